"""What a scenario is: frozen models, checked as they are built.

Keys carry their unit where it is not SI-and-NED inside; angles are degrees here, because people type them.
Time 0 is mission start: every vehicle at altitude, cruising begins.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from scenarios.faults import AnyFault, MotorDegradation
from scenarios.fence import Fence, all_bounds, check_it_holds
from scenarios.section import Fraction, Heading, Likert, NotNegative, Positive, Section


class Time(Section):
    """How finely time is cut."""

    physics_hz: Annotated[int, Field(ge=100, le=1000)] = 250
    """JSBSim steps a second."""
    period_s: Annotated[float, Field(gt=0, le=0.4)] = 0.1
    """One tick of the ground station: a whole number of physics steps. Vehicles lose patience after 0.5 s."""
    positions_per_tick: Annotated[int, Field(ge=1, le=20)] | None = None
    """How often in a tick each vehicle is asked to tell where it is. If absent, once in lockstep, where nothing is
    late, and five times in `gcs fly`, so that nothing is older than a fifth of a tick."""
    timeout_s: Positive = 180.0
    """A flight that takes longer, take-off to disarm, is given up (exit code 3)."""

    @model_validator(mode="after")
    def _whole_steps(self) -> Time:
        steps = self.period_s * self.physics_hz
        if abs(steps - round(steps)) > 1e-9 or round(steps) < 1:
            raise ValueError(
                f"period_s = {self.period_s} is {steps:g} physics steps at physics_hz = {self.physics_hz}: "
                "it must be a whole number of them"
            )
        return self

    @property
    def steps_per_tick(self) -> int:
        """Physics steps in one tick of the ground station."""
        return round(self.period_s * self.physics_hz)

    @property
    def period_ns(self) -> int:
        """One tick of the ground station."""
        return round(self.period_s * 1e9)

    def ticks(self, seconds: float) -> int:
        """The tick at or next after this many seconds."""
        return math.ceil(seconds / self.period_s - 1e-9)


class Swarm(Section):
    """Who flies, and in which formation. System ids count row by row from 1; row 1 is the front."""

    rows: Annotated[int, Field(ge=1)] = 2
    columns: Annotated[int, Field(ge=1)] = 3
    spacing_m: Positive = 3.0
    leaders: tuple[int, ...] = (1, 3)
    """System ids of the robots that know where the mission goes."""
    altitude_m: Annotated[float, Field(ge=2, le=500)] = 10.0
    """Height above the take-off place."""

    @model_validator(mode="after")
    def _ids(self) -> Swarm:
        if not 1 <= self.count <= 250:
            raise ValueError(f"rows × columns = {self.count}: allowed are 1 to 250 vehicles (MAVLink system ids)")
        if not self.leaders:
            raise ValueError("leaders = []: at least one robot must know where the mission goes")
        if len(set(self.leaders)) != len(self.leaders):
            raise ValueError(f"leaders = {list(self.leaders)}: a vehicle is named twice")
        for leader in self.leaders:
            if not 1 <= leader <= self.count:
                raise ValueError(f"leaders names vehicle {leader}: allowed are 1 to {self.count}")
        return self

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return self.rows * self.columns


class Leg(Section):
    """A straight line of the virtual leader. It starts where the virtual leader is, not where the swarm is."""

    task: str
    heading_deg: Heading
    length_m: Positive


class Mission(Section):
    """What the swarm was sent to do."""

    cruise_m_s: Positive = 1.5
    run_up_s: NotNegative = 4.0
    """Time before mission start in which the formation is brought to cruise; 0 begins at rest."""
    leg: tuple[Leg, ...]

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Mission:
        if not self.leg:
            raise ValueError("leg = []: a mission needs at least one [[mission.leg]]")
        return self


class Redirect(Section):
    """An emergency: the current leg is interrupted and a new one begins where the virtual leader is."""

    kind: Literal["redirect"]
    at_length_m: Positive
    """Length of path flown since mission start when the call comes."""
    task: str
    heading_deg: Heading
    length_m: Positive


RULES = {
    "average": False,
    "trust-r": True,
    "median": False,
    "wmsr-1": False,
    "wmsr-2": False,
    "confidence-decay": True,
}
"""Update rules that ship (`trustr/consensus.py`), and whether they ask for trust."""


class Control(Section):
    """The update rule and its parameters (reference values: `docs/reproduction.md`)."""

    rule: str = "trust-r"
    """A name of RULES, or package.module:function for a rule of your own (`docs/your-own-rule.md`)."""
    c1: NotNegative = 0.10
    """1/s: navigational feedback of position, eq. 11."""
    c2: NotNegative = 0.60
    """Navigational feedback of velocity, eq. 11."""
    feedback_cap: NotNegative = 0.25
    """Of cruise: the most that navigational feedback may ask for."""
    weights: Literal["sender", "literal"] = "sender"
    """η of eq. 13: lowered for distrusted senders, or one constant as printed."""
    eta: Fraction = 0.05
    """η of a sender whose trust is below the threshold."""
    threshold: Fraction = 0.5
    confidence: Fraction = 0.9
    """c of `confidence-decay`: the part of its first velocity in what a robot is commanded at mission start."""
    confidence_decay: Positive = 0.5
    """1/s: γ of `confidence-decay`, how fast that part falls."""
    profile: Literal["paper", "recommended"] = "paper"
    separation_radius_m: NotNegative = 2.0
    separation_gain: NotNegative = 0.3
    """1/s: metres inside the radius to speed apart."""
    berth_m: NotNegative | None = None
    """Separation radius from robots that are not trusted; if absent, none of its own in the paper's profile, and 3 m in
    the recommended one."""
    berth_gain: NotNegative = 0.6
    """1/s: metres inside that radius to speed away."""
    response_time_s: Positive = 0.47
    """Mean lag of the vehicles' answer to a velocity step, ∫ (1 − v/v_step) dt; `recommended` scales with it."""

    @field_validator("rule")
    @classmethod
    def _known(cls, rule: str) -> str:
        if rule not in RULES and not re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*", rule):
            raise ValueError(f"rule = {rule!r}: allowed are {', '.join(RULES)}, or package.module:function")
        return rule

    @model_validator(mode="after")
    def _somebody_counts(self) -> Control:
        if self.weights == "literal" and self.eta == 0.0:
            raise ValueError('eta = 0 with weights = "literal": nobody would be heard; it must be above 0')
        return self


class Network(Section):
    """Who hears whom, eq. 13."""

    range_m: Positive = 28.0
    """R: nothing is heard from here on."""
    best_range_m: Positive = 6.0
    """ρ: best quality up to here."""
    decay: NotNegative = 2.0
    """γ: how fast quality falls between ρ and R."""

    @model_validator(mode="after")
    def _ordered(self) -> Network:
        if self.best_range_m >= self.range_m:
            raise ValueError(
                f"best_range_m = {self.best_range_m} must be below range_m = {self.range_m} (eq. 13 needs 0 < ρ < R)"
            )
        return self


class Trust(Section):
    """Where trust comes from."""

    source: Literal["truth", "ratings", "auto", "fused"] = "truth"
    """The simulation's own knowledge of the fault; what people say (without anyone to say it, the study's mean
    ratings); what the swarm's own behaviour shows; or both together."""
    faulty_rating: Likert = 1.94
    """Mean rating of the failed robot in the user study, 1 to 5."""
    others_rating: Likert = 3.83
    """Mean rating of the repaired swarm in the user study, 1 to 5."""

    response_delay_s: Annotated[float, Field(ge=0, le=3)] = 0.147
    """How healthy vehicles answer a velocity set-point: not at all for so long …"""
    response_lag_s: Annotated[float, Field(ge=0, le=3)] = 0.298
    """… then as a first-order lag. `gcs identify` finds these four, and the two tolerances, from fault-free flights."""
    response_acceleration_m_s2: Positive | None = None
    """Where vehicles bound their acceleration; with the next key."""
    response_jerk_m_s3: Positive | None = None
    """Where vehicles bound its change."""
    tolerance_m_s: Positive = 0.05
    """σ_h: how far a healthy vehicle's velocity strays from that answer, an axis."""
    place_tolerance_m: Positive = 0.1
    """How far a healthy vehicle's position strays, in a second, from where its reported velocity takes it, an axis."""
    age_out_s: Positive = 20.0
    """Time in which a rating's say falls to 1/e."""
    hand_over: bool = True
    """A distrusted leader passes its role to the most trusted follower."""
    beyond_repair: Literal["keep", "hold", "land"] = "keep"
    """What becomes of a robot whose trust stays below 0.05 for 5 s: it is kept, or left behind, holding below the
    others or landing."""

    @model_validator(mode="after")
    def _both_bounds(self) -> Trust:
        if (self.response_acceleration_m_s2 is None) != (self.response_jerk_m_s3 is None):
            raise ValueError("response_acceleration_m_s2 and response_jerk_m_s3: it takes both bounds, or neither")
        return self


class Noise(Section):
    """What blurs telemetry and air, seeded, counted from mission start."""

    velocity_m_s: Annotated[float, Field(ge=0, le=10)] = 0.0
    """Standard deviation a horizontal axis, white: drawn anew for each telemetry message of a 10 Hz stream."""
    position_m: Annotated[float, Field(ge=0, le=100)] = 0.0
    """As the velocity's."""
    gust_m_s: Annotated[float, Field(ge=0, le=30)] = 0.0
    """Standard deviation an axis of each vehicle's own first-order Gauss–Markov wind."""
    gust_time_s: Positive = 2.0
    """Its correlation time."""


class Wind(Section):
    """Air that moves as a whole."""

    speed_m_s: Annotated[float, Field(ge=0, le=50)] = 0.0
    from_deg: Heading = 0.0
    """Where it blows from, as a weather report says it."""
    turbulence: Annotated[float, Field(ge=0, le=30)] = 0.0
    """Mean wind at 20 ft [m/s] that drives JSBSim's MIL-F-8785C turbulence; 0 is none."""
    vehicles: tuple[int, ...] | None = None
    """System ids it acts on; all, if absent."""


class Vehicle(Section):
    """How a slower autopilot takes up horizontal set-points in OFFBOARD, on top of the flight model's own response.

    None of it acts unless a key is set; the quad alone answers a step of 2 m/s with a 10–90 % rise in 0.58 s and a mean
    lag, ∫ (1 − v/v_step) dt, of 0.47 s. Measured in flight with these keys:

    * as ArduCopter, its default acceleration and jerk: lag_s = 0.2, acceleration_m_s2 = 2.5, jerk_m_s3 = 5
      rises in 1.01 s, mean lag 1.13 s (of small steps, which the bounds touch less, shorter: 0.73 s of 0.2 m/s)
    * as a first-order lag of 0.9 s: lag_s = 0.8
      rises in 2.00 s, mean lag 1.27 s
    """

    lag_s: Annotated[float, Field(ge=0, le=10)] = 0.0
    """Time constant with which it approaches a set-point, as far as the two bounds allow."""
    acceleration_m_s2: Positive | None = None
    """The most it speeds up or brakes; no bound of its own, if absent."""
    jerk_m_s3: Positive | None = None
    """The most that its acceleration changes a second; no bound of its own, if absent."""


class Limits(Section):
    """What a set-point may ask for at most."""

    speed_m_s: Positive = 5.0
    acceleration_m_s2: Positive = 10.0
    fence: Fence = Fence()
    """Where it may take a vehicle."""


class Expect(Section):
    """What makes a flight pass (the paper's repaired condition: 4° and 3.2 m)."""

    heading_error_deg: Positive = 4.0
    distance_to_target_m: Positive = 3.2
    min_separation_m: NotNegative = 1.0


LOWEST_TO_LEAVE = 6.0
"""m: altitude from which there is room below the swarm."""


class Scenario(Section):
    """One flight, from formation to what counts as success."""

    title: str
    time: Time = Time()
    swarm: Swarm = Swarm()
    mission: Mission
    event: tuple[Redirect, ...] = ()
    fault: tuple[AnyFault, ...] = ()
    control: Control = Control()
    network: Network = Network()
    trust: Trust = Trust()
    noise: Noise = Noise()
    wind: Wind = Wind()
    vehicle: Vehicle = Vehicle()
    limits: Limits = Limits()
    expect: Expect = Expect()

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        known = f"allowed are 1 to {self.swarm.count}"
        for index, fault in enumerate(self.fault):
            if fault.vehicle > self.swarm.count:
                raise ValueError(f"fault.{index}.vehicle = {fault.vehicle}: there is no such vehicle; {known}")
        for vehicle in self.wind.vehicles or ():
            if not 1 <= vehicle <= self.swarm.count:
                raise ValueError(f"wind.vehicles names vehicle {vehicle}: there is no such vehicle; {known}")
        flown, planned = 0.0, sum(leg.length_m for leg in self.mission.leg)
        for index, event in enumerate(self.event):
            if not flown < event.at_length_m < planned:
                raise ValueError(
                    f"event.{index}.at_length_m = {event.at_length_m}: must lie on the path that is then being flown, "
                    f"between {flown:g} m and {planned:g} m"
                )
            flown, planned = event.at_length_m, event.at_length_m + event.length_m
        if self.trust.beyond_repair != "keep" and self.swarm.altitude_m < LOWEST_TO_LEAVE:
            raise ValueError(
                f"trust.beyond_repair = {self.trust.beyond_repair!r} at swarm.altitude_m = {self.swarm.altitude_m}: "
                f"robots that are left behind go 3 m below the others; it must be {LOWEST_TO_LEAVE:g} m or more"
            )
        if self.mission.cruise_m_s > self.limits.speed_m_s:
            raise ValueError(
                f"mission.cruise_m_s = {self.mission.cruise_m_s} is above limits.speed_m_s = {self.limits.speed_m_s}"
            )
        check_it_holds(self)
        return self

    def with_severity(self, max_speed_fraction: float) -> Scenario:
        """The same scenario with every degraded motor at this fraction of cruise."""
        return self._revised(
            fault=[
                fault.model_dump() | {"max_speed_fraction": max_speed_fraction}
                if isinstance(fault, MotorDegradation)
                else fault.model_dump()
                for fault in self.fault
            ]
        )

    def asking(self, positions_per_tick: int) -> Scenario:
        """The same scenario; vehicles are asked for positions this often where it does not say."""
        if self.time.positions_per_tick is not None:
            return self
        return self._revised(time=self.time.model_dump() | {"positions_per_tick": positions_per_tick})

    def fenced(self) -> Scenario:
        """The same scenario; where it names no bound of its fence, one that holds its mission and a margin."""
        return self._revised(limits=self.limits.model_dump() | {"fence": all_bounds(self)})

    def without_faults(self) -> Scenario:
        """The same scenario, everything healthy."""
        return self._revised(fault=[])

    def _revised(self, **changes: Any) -> Scenario:
        return Scenario.model_validate(self.model_dump() | changes)


def direction(heading_deg: float) -> tuple[float, float]:
    """Unit vector (north, east) of a heading, clockwise from north."""
    return math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))
