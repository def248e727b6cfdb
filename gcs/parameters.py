"""Which of an autopilot's parameters a flight depends on: they are read back before anybody is armed.

Firmware renames parameters; one of each group is enough, the older name first.
https://docs.px4.io/main/en/advanced_config/parameter_reference.html
https://ardupilot.org/copter/docs/parameters.html (SYSID_MYGCS became MAV_GCS_SYSID, WPNAV_SPEED became WP_SPD)
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from wire.modes import ARDUPILOT, PX4

Group = tuple[str, ...]

_WANTED: Mapping[int, tuple[Group, ...]] = MappingProxyType(
    {
        PX4: (("COM_OF_LOSS_T",), ("COM_OBL_RC_ACT",), ("NAV_DLL_ACT",), ("COM_DL_LOSS_T",), ("MPC_XY_VEL_MAX",)),
        ARDUPILOT: (
            ("GUID_TIMEOUT",),
            ("FS_GCS_ENABLE",),
            ("FS_GCS_TIMEOUT",),
            ("SYSID_MYGCS", "MAV_GCS_SYSID"),
            ("WPNAV_SPEED", "WP_SPD"),
        ),
    }
)
_NAMES = {autopilot: frozenset(name for group in groups for name in group) for autopilot, groups in _WANTED.items()}


def depends_on(autopilot: int, name: str) -> bool:
    """Whether a flight with this MAV_AUTOPILOT depends on this parameter: of others nothing is kept."""
    return name in _NAMES.get(autopilot, ())


def untold(autopilot: int, told: Mapping[str, float]) -> tuple[Group, ...]:
    """The groups of which no name has been told."""
    return tuple(group for group in _WANTED.get(autopilot, ()) if not any(name in told for name in group))
