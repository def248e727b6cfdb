"""Script: MAVSDK's Python binding of before, over gRPC, flies a vehicle. Words: the UDP port and the autopilot."""

import asyncio
import sys

from client_flight import HEIGHT, KEEP_ALIVE, RATE_HZ, client, first, fly, say
from in_flight import free_port
from mavsdk_grpc import System
from mavsdk_grpc.offboard import VelocityNedYaw


async def main(port, autopilot):
    system = System(port=free_port())
    await system.connect(f"udpin://127.0.0.1:{port}")
    await first(system.core.connection_state(), lambda state: state.is_connected)
    drone = client(
        action=system.action,
        offboard=system.offboard,
        stream=lambda name: getattr(system.telemetry, name)(),
        truth=lambda: system.mavlink_direct.message("SIM_STATE"),
        velocity=VelocityNedYaw,
        mode=lambda value: value.name,
        landed=lambda value: value.name,
        why=lambda error: error._result.result.name,
    )
    await system.param.set_param_float(KEEP_ALIVE[autopilot], 3.0)
    await drone.action.set_takeoff_altitude(HEIGHT)
    for name in ("position", "position_velocity_ned", "landed_state"):
        await getattr(system.telemetry, f"set_rate_{name}")(RATE_HZ)
    facts = {}
    if autopilot == "px4":  # this binding asks for it once, and then waits for a stream that ArduCopter does not have
        home = await first(drone.stream("home"))
        facts["home"] = [home.latitude_deg, home.longitude_deg]
    say(facts | await fly(drone))


asyncio.run(main(*sys.argv[1:]))
