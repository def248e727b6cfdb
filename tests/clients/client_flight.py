"""One flight as both of MAVSDK's Python bindings fly it, whose plug-ins use the same words. Imported by scripts."""

import asyncio
import contextlib
import json
import sys
import time
from types import SimpleNamespace

CRUISE = 3.0  # m/s
HEIGHT = 3.0  # m above home
RATE_HZ = 20.0  # of position and velocity
SAMPLES = 20
LIMIT_S = 20.0  # real seconds for anything to happen

KEEP_ALIVE = {"px4": "COM_OF_LOSS_T", "ardupilot": "GUID_TIMEOUT"}
"""s until set-points that fell silent end. Clients send 20 a second by their own clock, rarer in simulated time."""


def say(facts):
    """To the test."""
    sys.stdout.write(f"facts: {json.dumps(facts)}\n")
    sys.stdout.flush()


async def first(stream, wanted=lambda _: True, *, limit_s=LIMIT_S):
    """The first value of a stream that is wanted."""
    async with asyncio.timeout(limit_s):
        async with contextlib.aclosing(stream) as values:
            async for value in values:
                if wanted(value):
                    return value
    raise EOFError("the stream ended")


async def some(stream, count=SAMPLES):
    """This many values of a stream."""
    values = []
    await first(stream, lambda value: values.append(value) or len(values) == count)
    return values


async def refused(asked, *, why):
    """Why a request was refused, in the client's word; None where it was not."""
    try:
        await asked
    except Exception as error:  # each plug-in has its own, and `why` reads them all
        return why(error)
    return None


@contextlib.asynccontextmanager
async def noted(stream, name):
    """The different values that a stream has while the block runs, by name, in order."""
    seen = []

    async def watch():
        async for value in stream:
            if not seen or seen[-1] != name(value):
                seen.append(name(value))

    task = asyncio.create_task(watch())
    try:
        yield seen
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def armed(client):
    """Arm as soon as the vehicle lets us; the refusals until then."""
    refusals = []
    begun = time.monotonic()
    while (refusal := await refused(client.action.arm(), why=client.why)) is not None:
        refusals.append(refusal)
        assert time.monotonic() - begun < LIMIT_S, refusals
        await asyncio.sleep(0.2)
    return refusals


async def velocities(client, settled):
    """Some velocities NED [m/s], from half a second after the first that had `settled`."""
    await first(client.stream("position_velocity_ned"), lambda value: settled(velocity_of(value)))
    await asyncio.sleep(0.5)
    return [velocity_of(value) for value in await some(client.stream("position_velocity_ned"))]


def velocity_of(value):
    """(north, east, down) m/s."""
    return value.velocity.north_m_s, value.velocity.east_m_s, value.velocity.down_m_s


def velocity_in_truth(message):
    """The same, of SIM_STATE."""
    state = json.loads(message.fields_json)
    return state["vn"], state["ve"], state["vd"]


async def fly(client):
    """Arm, disarm, arm, take off, fly north, stop, land, and arm once more; what the client saw of it."""
    facts = {"refusals": await armed(client)}
    await client.action.disarm()
    await first(client.stream("armed"), lambda is_armed: not is_armed)
    await client.action.arm()
    async with (
        noted(client.stream("flight_mode"), client.mode) as modes,
        noted(client.stream("landed_state"), client.landed) as landed,
    ):
        await client.action.takeoff()
        await first(client.stream("position"), lambda place: place.relative_altitude_m > HEIGHT - 0.3)
        await first(client.stream("landed_state"), lambda state: client.landed(state) == "IN_AIR")
        await client.offboard.set_velocity_ned(client.velocity(0.0, 0.0, 0.0, 0.0))
        await client.offboard.start()
        await client.offboard.set_velocity_ned(client.velocity(CRUISE, 0.0, 0.0, 0.0))
        facts["cruise"] = await velocities(client, lambda velocity: abs(velocity[0] - CRUISE) < 0.1)
        facts["truth"] = velocity_in_truth(await first(client.truth()))
        facts["disarming_in_the_air"] = await refused(client.action.disarm(), why=client.why)
        await client.offboard.set_velocity_ned(client.velocity(0.0, 0.0, 0.0, 0.0))
        facts["stopped"] = await velocities(client, lambda velocity: abs(velocity[0]) < 0.1)
        await client.offboard.stop()
        await client.action.land()
        await first(client.stream("armed"), lambda is_armed: not is_armed)
        await first(client.stream("landed_state"), lambda state: client.landed(state) == "ON_GROUND")
        facts["modes"], facts["landed"] = list(modes), list(landed)
    await client.action.disarm()
    facts["arming_after_landing"] = await refused(client.action.arm(), why=client.why)
    return facts


def client(**parts):
    """A client's plug-ins, and how to read what they give."""
    return SimpleNamespace(**parts)
