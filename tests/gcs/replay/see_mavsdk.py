"""Script: whom MAVSDK meets on a UDP port, and where it sees them. Words: the port, and how many to wait for."""

import asyncio
import json
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

LIMIT_S = 20.0


async def place(system):
    """North, east, down [m] of the first position that it tells."""
    async for told in TelemetryAsync(system).subscribe_position_velocity_ned():
        return told.position.north_m, told.position.east_m, told.position.down_m
    raise EOFError("the stream ended")


async def main(port, count):
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        sys.stdout.write("listening\n")
        sys.stdout.flush()
        async with asyncio.timeout(LIMIT_S):
            while len(systems := await mavsdk.get_systems()) < int(count):
                await asyncio.sleep(0.05)
            places = await asyncio.gather(*(place(system) for system in systems))
            ids = [await system.get_system_id() for system in systems]
    sys.stdout.write("seen: " + json.dumps(dict(zip(ids, places, strict=True))) + "\n")


asyncio.run(main(*sys.argv[1:]))
