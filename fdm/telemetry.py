"""What a simulated vehicle says: MAVLink frames of its autopilot (component 1) and of the truth (component 200)."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm import position_reports, status_reports
from fdm.craft import Craft, Moment, Report
from fdm.modes import Pilot, Severity, Situation
from fdm.personality import Personality
from fdm.position_reports import MEASUREMENTS
from fdm.vehicle import Geodetic, Vehicle
from scenarios.models import Noise
from wire.frames import Sender
from wire.ids import AUTOPILOT, TRUTH
from wire.payloads import LOCAL_POSITION_NED, SIM_STATE, SimState, pack_sim_state

__all__ = ["MEASUREMENTS", "Reporter"]

TEXT_BYTES = 50
"""Of one STATUSTEXT."""


class Reporter:
    """Packs every message that the vehicle knows.

    origin:    the pad, from which `measured` counts
    origin_ne: m from there to the estimator's own origin, from which LOCAL_POSITION_NED counts
    noise:     of the vehicle's measurements; it goes into the accuracy it claims
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        system: int,
        origin: Geodetic,
        personality: Personality,
        origin_ne: tuple[float, float] = (0.0, 0.0),
        noise: Noise | None = None,
    ) -> None:
        self._vehicle = vehicle
        self._craft = Craft(vehicle, system, origin, personality, origin_ne, noise or Noise())
        self.sender = Sender(system, AUTOPILOT)
        """Numbers and packs whatever the autopilot says."""
        self._truth = Sender(system, TRUTH)
        own = status_reports.OWN_REPORTS.get(personality.autopilot, {})
        self._reports: dict[int, Report] = {**status_reports.REPORTS, **position_reports.REPORTS, **own}
        self._texts = 0

    def knows(self, message: float) -> bool:
        """Whether `report` can pack this message id."""
        return message == LOCAL_POSITION_NED or message in self._reports

    def report(self, message: int, pilot: Pilot, now: Situation, measured: tuple[float, ...]) -> bytes:
        """A frame with the vehicle's state; measured: (n, e, d, vn, ve, vd), SI, from the pad."""
        if message == LOCAL_POSITION_NED:
            return self.sender.frame(message, position_reports.pack_local(self._craft, now.time_s, measured))
        return self.sender.pack(self._reports[message](self._craft, Moment(pilot, now, measured)))

    def truth(self) -> bytes:
        """SIM_STATE: the state without noise."""
        state = self._vehicle.state()
        payload = SimState(
            *state.attitude_wxyz,
            *state.attitude_rpy,
            *state.acceleration_body,
            *state.rate_body,
            state.latitude_deg,
            state.longitude_deg,
            state.altitude_m,
            0.0,
            0.0,
            *state.velocity_ned,
            round(state.latitude_deg * 1e7),
            round(state.longitude_deg * 1e7),
        )
        return self._truth.frame(SIM_STATE, pack_sim_state(payload))

    def acknowledge(self, command: int, result: int, *, to_system: int, to_component: int) -> bytes:
        """COMMAND_ACK to whoever asked."""
        return self.sender.pack(
            dialect.MAVLink_command_ack_message(command, result, target_system=to_system, target_component=to_component)
        )

    def words(self, severity: Severity, text: str) -> list[bytes]:
        """STATUSTEXT for a person: one frame, or as many with one id as a long text fills."""
        told = text.encode()
        pieces = [told[at : at + TEXT_BYTES] for at in range(0, len(told), TEXT_BYTES)] or [b""]
        if len(pieces) == 1:
            return [self.sender.pack(dialect.MAVLink_statustext_message(severity.value, told))]
        if len(pieces[-1]) == TEXT_BYTES:
            pieces.append(b"")  # only a byte of zero ends a text
        self._texts = self._texts % 0xFFFF + 1
        return [
            self.sender.pack(dialect.MAVLink_statustext_message(severity.value, piece, self._texts, number))
            for number, piece in enumerate(pieces)
        ]

    def message_interval(self, message: int, interval_s: float) -> bytes:
        """MESSAGE_INTERVAL: what a stream's rate is; 0 s is off."""
        interval_us = min(round(interval_s * 1e6), 2**31 - 1) if interval_s else -1
        return self.sender.pack(dialect.MAVLink_message_interval_message(message, interval_us))
