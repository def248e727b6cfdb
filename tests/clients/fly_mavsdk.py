"""Script: MAVSDK 4 and a vehicle. Words: the UDP port, the autopilot, and `meet` it on the ground or `fly` it."""

import asyncio
import contextlib
import sys

from client_flight import HEIGHT, KEEP_ALIVE, RATE_HZ, client, first, fly, refused, say
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.offboard import VelocityNedYaw
from mavsdk.plugins.telemetry import FlightMode, LandedState

INTEGERS = {"px4": "COM_DL_LOSS_T", "ardupilot": "DISARM_DELAY"}
RATES = ("position", "landed_state", "in_air", "attitude_euler", "attitude_quaternion", "velocity_ned", "gps_info")
RATES += ("raw_gps", "battery", "position_velocity_ned", "health", "home")


@contextlib.asynccontextmanager
async def connected(port):
    """The first vehicle that speaks to this port."""
    station = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(station) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = await mavsdk.first_autopilot(timeout_s=20.0)
        assert system is not None, "no vehicle was discovered"
        telemetry, direct = TelemetryAsync(system), MavlinkDirectAsync(system)
        yield client(
            system=system,
            action=ActionAsync(system),
            info=InfoAsync(system),
            offboard=OffboardAsync(system),
            param=ParamAsync(system),
            telemetry=telemetry,
            stream=lambda name: getattr(telemetry, f"subscribe_{name}")(),
            truth=lambda: direct.subscribe_message("SIM_STATE"),
            velocity=VelocityNedYaw,
            mode=lambda value: FlightMode(value).name,
            landed=lambda value: LandedState(value).name,
            why=lambda error: error.result.name,
        )


async def meet(drone, autopilot):
    """All that can be known and asked on the ground. A PX4 is ready as soon as it is heard, an ArduCopter is not."""
    facts = {}
    if autopilot == "ardupilot":
        facts["arming_too_early"] = await refused(drone.action.arm(), why=drone.why)
    facts["take_off_disarmed"] = await refused(drone.action.takeoff(), why=drone.why)
    facts["offboard_without_setpoint"] = await refused(drone.offboard.start(), why=drone.why)
    facts["system"] = await drone.system.get_system_id()
    facts["autopilot"] = (await drone.system.autopilot_type()).name
    facts["vehicle"] = (await drone.system.vehicle_type()).name
    version = await drone.info.get_version()
    facts["version"] = [version.flight_sw_major, version.flight_sw_minor]
    facts["unique_id"] = (await drone.info.get_identification()).legacy_uid
    for name in RATES:
        await getattr(drone.telemetry, f"set_rate_{name}")(RATE_HZ)
    facts |= await telemetry(drone)
    facts |= await parameters(drone, autopilot)
    return facts


async def telemetry(drone):
    """One value of each stream."""
    health = await first(drone.stream("health"), lambda health: health.is_armable)
    position, home = await first(drone.stream("position")), await first(drone.stream("home"))
    origin = await drone.telemetry.get_gps_global_origin()
    attitude = await first(drone.stream("attitude_euler"))
    quaternion = await first(drone.stream("attitude_quaternion"))
    battery, gps = await first(drone.stream("battery")), await first(drone.stream("gps_info"))
    await first(drone.stream("raw_gps"))
    return {
        "health": [health.is_local_position_ok, health.is_global_position_ok, health.is_home_position_ok],
        "all_ok": await first(drone.stream("health_all_ok")),
        "place": [position.latitude_deg, position.longitude_deg],
        "home": [home.latitude_deg, home.longitude_deg],
        "origin": [origin.latitude_deg, origin.longitude_deg],
        "height": position.relative_altitude_m,
        "attitude": [attitude.roll_deg, attitude.pitch_deg, attitude.yaw_deg],
        "quaternion": [quaternion.w, quaternion.x, quaternion.y, quaternion.z],
        "volts": battery.voltage_v,
        "charge": battery.remaining_percent,
        "satellites": gps.num_satellites,
        "fix": gps.fix_type,
        "landed": drone.landed(await first(drone.stream("landed_state"))),
        "in_air": await first(drone.stream("in_air")),
    }


async def parameters(drone, autopilot):
    """A whole number and a real one, read, set and read again; and all."""
    whole, real = INTEGERS[autopilot], KEEP_ALIVE[autopilot]
    before = [await drone.param.get_param_int(whole), await drone.param.get_param_float(real)]
    await drone.param.set_param_int(whole, 20)
    await drone.param.set_param_float(real, 1.25)
    every = await drone.param.get_all_params()
    listed = {parameter.name: parameter.value for parameter in every.int_params + every.float_params}
    return {
        "before": before,
        "after": [await drone.param.get_param_int(whole), await drone.param.get_param_float(real)],
        "listed": [listed[whole], listed[real]],
        "count": len(listed),
    }


async def flight(drone, autopilot):
    """At rates and with a patience that suit a fast simulation."""
    await drone.param.set_param_float(KEEP_ALIVE[autopilot], 3.0)
    await drone.action.set_takeoff_altitude(HEIGHT)
    for name in ("position", "position_velocity_ned", "landed_state"):
        await getattr(drone.telemetry, f"set_rate_{name}")(RATE_HZ)
    return await fly(drone)


async def main(port, autopilot, task):
    async with connected(port) as drone:
        say(await (meet if task == "meet" else flight)(drone, autopilot))


asyncio.run(main(*sys.argv[1:]))
