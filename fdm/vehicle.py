"""One JSBSim instance in SI and NED; the only file that knows feet and property names.

The aircraft carries its own velocity controller (`aircraft/quad/Systems`), so a vehicle is steered by a
velocity and a yaw and needs no Python between physics steps. Step it in bursts of 10 to 25: caches stay warm.
"""

from dataclasses import dataclass
from math import cos, degrees, isfinite, pi, radians, sin, tau
from typing import Final, NamedTuple

import jsbsim

import aircraft as models

FOOT: Final = 0.3048  # m
EARTH_RATE: Final = 7.292115e-5  # rad/s, WGS-84
ROTORS: Final = 4
CLEARANCE: Final = 0.5  # m, more than any contact point lies below the centre of mass
STEEPEST: Final = 40.0  # m/s², gravity and full thrust of an overturned vehicle, 3.3 g together, and some more

_INTEGRATORS: Final = (
    "north-correction",
    "east-correction",
    "down-demand",
    "roll-torque",
    "pitch-torque",
    "yaw-torque",
)
_CONTROLLER_OUTPUTS: Final = ("control/thrust", "mixer/roll-plus-pitch", "control/yaw-torque")

Vector = tuple[float, float, float]


class FlightModelDiverged(RuntimeError):
    """The flight model's state is no longer finite; the vehicle cannot be flown on and must be rebuilt."""


@dataclass(frozen=True, slots=True)
class Geodetic:
    """A place on or above WGS-84. The geoid is taken to be the ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class VehicleState(NamedTuple):
    """The truth after one physics step."""

    time_s: float  # steps × dt since the vehicle was built
    position_ned: Vector  # m from the vehicle's home, in the tangent plane there
    velocity_ned: Vector  # m/s over the ground
    acceleration_body: Vector  # m/s² specific force, what an accelerometer reads: (0, 0, −g) at rest
    attitude_rpy: Vector  # rad; yaw in [−π, π]
    attitude_wxyz: tuple[float, float, float, float]  # body → NED
    rate_body: Vector  # rad/s
    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class Battery:
    """What a power module would measure."""

    volts: float
    amps: float
    remaining: float  # 0 to 1


class _Silent(jsbsim.FGLogger):
    """Says nothing. What goes wrong while loading is raised."""

    def set_level(self, level: jsbsim.LogLevel) -> None: ...
    def file_location(self, filename: str, line: int) -> None: ...
    def message(self, message: str) -> None: ...
    def format(self, format: jsbsim.LogFormat) -> None: ...  # noqa: A002  the name is JSBSim's
    def flush(self) -> None: ...


_LOGGER: Final = _Silent()


class Vehicle:
    """A quadrotor standing at `home`, or `height_m` above it, disarmed.

    home:       where the centre of mass is when the vehicle stands on the ground there
    yaw:        rad, heading at the start and the first yaw set-point
    physics_hz: steps a second; 100 to 1000 fly alike
    seed:       of JSBSim's turbulence, the only thing random in here
    charge:     of the battery, 0 to 1
    """

    def __init__(
        self,
        *,
        home: Geodetic,
        yaw: float = 0.0,
        physics_hz: int = 250,
        aircraft: str = "quad",
        seed: int = 0,
        height_m: float = 0.0,
        charge: float = 1.0,
    ) -> None:
        self.steps = 0
        self.armed = False
        self._home = home
        self._physics_hz = physics_hz
        self._fdm = fdm = _load(aircraft, physics_hz)
        self._properties = fdm.get_property_manager()
        standing = self._node("params/standing-height-m").get_double_value()

        self._write("simulation/randomseed", seed)
        self._write("ic/terrain-elevation-ft", (home.altitude_m - standing) / FOOT)
        self._write("ic/lat-geod-deg", home.latitude_deg)
        self._write("ic/long-gc-deg", home.longitude_deg)
        self._write("ic/h-agl-ft", (standing + height_m) / FOOT)
        self._write("ic/psi-true-deg", degrees(yaw))
        self._write("control/yaw-sp", yaw)
        self._write("battery/initial-charge", charge)
        self._bind()
        self._hold(height_m <= 0)
        self._ground_enabled = True
        if not fdm.run_ic():
            raise FlightModelDiverged(f"the {aircraft} could not be put at {home}")
        self._weight = self._apparent_gravity()

    def _bind(self) -> None:
        """Look up once every property that is read or written in flight."""
        node = self._node
        self._position = [node(f"position/from-start-neu-{axis}-ft") for axis in "neu"]
        self._velocity = [node(f"velocities/v-{axis}-fps") for axis in ("north", "east", "down")]
        self._force = [node(f"accelerations/a-pilot-{axis}-ft_sec2") for axis in "xyz"]
        self._attitude = [node(f"attitude/{angle}-rad") for angle in ("phi", "theta", "psi")]
        self._rate = [node(f"velocities/{axis}-rad_sec") for axis in "pqr"]
        self._place = [node(f"position/{name}") for name in ("lat-geod-deg", "long-gc-deg", "geod-alt-ft")]
        self._height = node("position/h-agl-ft")
        # The controller's outputs too: the mixer takes NaN for 0, so a poisoned one only stops the motors.
        self._health = [self._height, self._rate[0], *map(node, _CONTROLLER_OUTPUTS)]
        self._ground = node("simulation/models/FGGroundReactions/enabled")
        self._ground_force = node("forces/fbz-gear-lbs")
        self._hold_down = node("forces/hold-down")
        self._armed = node("control/armed")
        self._set_points = [node(f"control/{axis}-sp") for axis in ("north", "east", "down", "yaw")]
        self._integrators = [node(f"control/{name}/initial-integrator-value") for name in _INTEGRATORS]
        self._limited = [node(f"mixer/{name}-limited") for name in ("tilt", "thrust", "yaw")]
        self._gust = [node(f"atmosphere/gust-{axis}-fps") for axis in ("north", "east", "down")]
        self._battery = [node(f"battery/{name}") for name in ("volts", "amps", "charge")]
        self._rotor_speeds = [node(f"rotor/speed-{rotor}") for rotor in range(ROTORS)]
        self._efficiency = [node(f"fault/m{rotor}-efficiency") for rotor in range(ROTORS)]
        self._speed_limit = [node(f"fault/m{rotor}-speed-limit") for rotor in range(ROTORS)]

    def _apparent_gravity(self) -> float:
        """m/s² that the ground carries: gravitation less the centrifugal part of the Earth's turn."""
        gravitation = self._node("accelerations/gravity-ft_sec2").get_double_value() * FOOT
        radius = self._node("position/radius-to-vehicle-ft").get_double_value() * FOOT
        return gravitation - radius * (EARTH_RATE * cos(radians(self._home.latitude_deg))) ** 2

    def _node(self, name: str) -> jsbsim.FGPropertyNode:
        """The property's node. JSBSim would invent an unknown one and read 0, so that is an error here."""
        node = self._properties.get_node(name)
        if node is None:
            raise KeyError(f"the flight model has no property {name!r}")
        return node

    def _write(self, name: str, value: float) -> None:
        self._node(name).set_double_value(value)

    def step(self, n: int) -> None:
        """Fly `n` physics steps. Raises FlightModelDiverged if the state is not finite afterwards."""
        self._watch_ground(n)
        if self.armed or self._held:
            self._run(n)
        else:
            self._settle(n)
        if not isfinite(sum([node.get_double_value() for node in self._health])):
            raise FlightModelDiverged(f"the flight model diverged before step {self.steps}: its state is not finite")

    def _run(self, n: int) -> None:
        run = self._fdm.run
        for _ in range(n):
            run()
        self.steps += n

    def _settle(self, n: int) -> None:
        """Fly on without motors, and hold the vehicle down once it lies still: contacts creep in wind.

        It looks at every tenth step of the flight, so that the length of bursts changes nothing.
        """
        for _ in range(n):
            self._run(1)
            if self.steps % 10 == 0 and not self._held and self._at_rest():
                self._hold(True)

    def _hold(self, held: bool) -> None:
        self._held = held
        self._hold_down.set_double_value(held)

    def _watch_ground(self, n: int) -> None:
        """Switch contacts off where `n` steps cannot reach the ground: they cost a fifth of a step."""
        seconds = n / self._physics_hz
        sinking = max(0.0, self._velocity[2].get_double_value() * FOOT)
        reach = CLEARANCE + (sinking + 0.5 * STEEPEST * seconds) * seconds
        enabled = self._height.get_double_value() * FOOT < reach
        if enabled != self._ground_enabled:
            self._ground_enabled = enabled
            self._ground.set_double_value(enabled)

    def _at_rest(self) -> bool:
        """Landed and slower than 5 cm/s."""
        still = 0.05 / FOOT
        return self.landed and all(abs(node.get_double_value()) < still for node in self._velocity)

    @property
    def landed(self) -> bool:
        """Whether some part of the vehicle presses on the ground."""
        return self._ground_force.get_double_value() != 0.0

    def state(self) -> VehicleState:
        """The whole truth, for records and sensors."""
        north, east, down, vn, ve, vd = self.position_velocity()
        roll, pitch, yaw = _vector(self._attitude, 1.0)
        latitude, longitude, altitude_ft = _vector(self._place, 1.0)
        return VehicleState(
            self.steps / self._physics_hz,
            (north, east, down),
            (vn, ve, vd),
            self._specific_force(roll, pitch),
            (roll, pitch, yaw if yaw <= pi else yaw - tau),
            _quaternion(roll, pitch, yaw),
            _vector(self._rate, 1.0),
            latitude,
            longitude,
            altitude_ft * FOOT,
        )

    def _specific_force(self, roll: float, pitch: float) -> Vector:
        """What an accelerometer reads. Held down, JSBSim reports no force, though the ground carries it."""
        if not self._held:
            return _vector(self._force, FOOT)
        g = self._weight
        return g * sin(pitch), -g * sin(roll) * cos(pitch), -g * cos(roll) * cos(pitch)

    def position_velocity(self) -> tuple[float, float, float, float, float, float]:
        """(north, east, down) m from home and (north, east, down) m/s, the cheap way."""
        north, east, up = self._position
        vn, ve, vd = self._velocity
        return (
            north.get_double_value() * FOOT,
            east.get_double_value() * FOOT,
            self._home.altitude_m - up.get_double_value() * FOOT,
            vn.get_double_value() * FOOT,
            ve.get_double_value() * FOOT,
            vd.get_double_value() * FOOT,
        )

    @property
    def yaw(self) -> float:
        """Heading, rad in [0, 2π)."""
        return self._attitude[2].get_double_value()

    def arm(self) -> None:
        """Let the rotors turn. The controller's integrators start from nothing."""
        for integrator in self._integrators:
            integrator.set_double_value(0.0)
        self._hold(False)
        self._armed.set_double_value(1.0)
        self.armed = True

    def disarm(self) -> None:
        """Stop the rotors, wherever the vehicle is."""
        self._armed.set_double_value(0.0)
        self.armed = False

    def set_velocity(self, velocity_ned: Vector, yaw: float) -> None:
        """Ask for a velocity over the ground, m/s, and a heading, rad. The aircraft slews towards both."""
        values = (*velocity_ned, yaw)
        _check_finite("velocity and yaw set-point", values)
        for node, value in zip(self._set_points, values, strict=True):
            node.set_double_value(value)

    def set_wind(self, wind_ned: Vector) -> None:
        """The velocity of the air here and now, m/s towards NED: steady wind and gust together."""
        _check_finite("wind", wind_ned)
        north, east, down = self._gust
        north.set_double_value(wind_ned[0] / FOOT)
        east.set_double_value(wind_ned[1] / FOOT)
        down.set_double_value(wind_ned[2] / FOOT)

    def set_turbulence(self, wind_at_6m: float) -> None:
        """Fly in Dryden turbulence (MIL-F-8785C, JSBSim type 4) as a wind of so many m/s at 6 m makes it.

        Below 300 m its strength is a tenth of that wind: 7.7 m/s is light, 15 moderate, 23 severe. 0 is off.
        It adds to `set_wind` and drifts past with the airspeed, so it stands still in still air.
        """
        _check_finite("turbulence", (wind_at_6m,))
        severity = 3 if wind_at_6m < 11.5 else 4 if wind_at_6m < 19.0 else 6
        self._write("atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps", wind_at_6m / FOOT)
        self._write("atmosphere/turbulence/milspec/severity", severity)
        self._write("atmosphere/turb-type", 4 if wind_at_6m > 0 else 0)

    def set_rotor(self, rotor: int, *, efficiency: float = 1.0, speed_limit: float = 1.0) -> None:
        """Damage rotor 0 to 3: the share of its thrust left, and of its greatest speed; 1 is healthy."""
        for name, value in (("efficiency", efficiency), ("speed_limit", speed_limit)):
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"{name} of rotor {rotor} must lie in [0, 1], not {value!r}")
        if not 0 <= rotor < ROTORS:
            raise ValueError(f"there is no rotor {rotor!r}: they are 0 to {ROTORS - 1}")
        self._efficiency[rotor].set_double_value(efficiency)
        self._speed_limit[rotor].set_double_value(speed_limit)

    @property
    def battery(self) -> Battery:
        """The battery's terminals and charge."""
        volts, amps, charge = (node.get_double_value() for node in self._battery)
        return Battery(volts, amps, charge)

    @property
    def rotor_speeds(self) -> tuple[float, ...]:
        """rad/s, rotors 0 to 3."""
        return tuple(node.get_double_value() for node in self._rotor_speeds)

    @property
    def saturated(self) -> bool:
        """Whether the mixer could not give all that the controller asked for."""
        return any(node.get_double_value() for node in self._limited)


def _load(aircraft: str, physics_hz: int) -> jsbsim.FGFDMExec:
    """A silent JSBSim with the model loaded and the step set."""
    jsbsim.set_logger(_LOGGER)  # holds for this thread only, so every load sets it
    jsbsim.FGJSBBase().debug_lvl = 0  # type: ignore[no-untyped-call]
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_dt(1.0 / physics_hz)  # before load_model: filter coefficients are computed there
    folder = str(models.folder())
    for set_path in (fdm.set_aircraft_path, fdm.set_engine_path, fdm.set_systems_path):
        set_path(folder)
    if not fdm.load_model(aircraft):
        raise FileNotFoundError(f"there is no aircraft {aircraft!r} in {folder}")
    return fdm


def _check_finite(what: str, values: tuple[float, ...]) -> None:
    """Refuse NaN and infinity: one would stay in the controller's integrators for good."""
    if not all(map(isfinite, values)):
        raise ValueError(f"{what} must be finite, not {values}")


def _vector(nodes: list[jsbsim.FGPropertyNode], unit: float) -> Vector:
    x, y, z = nodes
    return x.get_double_value() * unit, y.get_double_value() * unit, z.get_double_value() * unit


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Body → NED for the yaw, pitch, roll sequence."""
    cr, sr = cos(roll / 2), sin(roll / 2)
    cp, sp = cos(pitch / 2), sin(pitch / 2)
    cy, sy = cos(yaw / 2), sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
