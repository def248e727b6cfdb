"""What fits a serial link, with numbers worked out by hand.

A vehicle at 10 Hz, in bytes a second: 10 set-points of 65, 10 × p positions of 40, three heartbeats of 21, two of
them ours, and once ATTITUDE 40, SYS_STATUS 55, EXTENDED_SYS_STATE 14: 822 + 400 p. Signed, each 13 more: 1030 + 530 p.
57 600 bits/s carry 5760 bytes/s, of which 5184 are planned with; 115 200 twice that, 10 368.
"""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.commands import Beat, SetVelocity
from gcs.messages import Encoder
from gcs.rates import LinkTooSlow, positions_per_tick
from scenarios import load
from wire.connection import parse
from wire.frames import Framer, Sender
from wire.payloads import LOCAL_POSITION_NED, LocalPosition, pack_local_position
from wire.signing import Signer

UDP = parse("udpin:0.0.0.0:14550")


def serial(bits_per_s, count=1):
    return [parse(f"serial:/dev/ttyUSB{number}:{bits_per_s}")[0] for number in range(count)]


def transit(*, vehicles=6, period_s=0.1, positions=None):
    changes = [
        f"swarm.columns={vehicles}",
        "swarm.rows=1",
        "swarm.leaders=[1]",
        f"time.period_s={period_s}",
        "fault=[]",
    ]
    if positions is not None:
        changes.append(f"time.positions_per_tick={positions}")
    return load("transit", overrides=changes)


def refused(links, scenario, *, signed=False):
    with pytest.raises(LinkTooSlow) as sentence:
        positions_per_tick(links, scenario, signed=signed)
    assert "\n" not in str(sentence.value)
    return str(sentence.value)


@pytest.mark.parametrize(
    ("bits_per_s", "vehicles", "positions"),
    [
        (57_600, 1, 5),  # 2822 of 5184
        (57_600, 2, 4),  # 5644, 4844
        (57_600, 3, 2),  # 6066, 4866
        (57_600, 4, 1),  # 6488, 4888
        (115_200, 3, 5),  # 8466 of 10 368
        (115_200, 6, 2),  # 12 132, 9732
        (115_200, 8, 1),  # 9776
        (230_400, 6, 5),  # 16 932 of 20 736
        (921_600, 29, 5),  # 81 838 of 82 944
        (921_600, 30, 4),  # 84 660, 72 660
    ],
)
def test_as_many_positions_as_fit_are_asked_for(bits_per_s, vehicles, positions):
    assert positions_per_tick(serial(bits_per_s), transit(vehicles=vehicles), signed=False) == positions


@pytest.mark.parametrize(
    ("bits_per_s", "vehicles", "positions"),
    [
        (57_600, 1, 5),  # 3680 of 5184
        (57_600, 2, 2),  # 5240, 4180
        (57_600, 3, 1),  # 6270, 4680
        (115_200, 6, 1),  # 12 540, 9360
    ],
)
def test_signatures_take_their_share(bits_per_s, vehicles, positions):
    assert positions_per_tick(serial(bits_per_s), transit(vehicles=vehicles), signed=True) == positions


def test_a_network_is_fast_enough_for_everything():
    assert positions_per_tick(UDP, transit(), signed=True) == 5
    assert positions_per_tick([], transit(), signed=True) == 5
    assert positions_per_tick(UDP, transit(positions=20), signed=True) == 20


def test_six_vehicles_do_not_fit_57600_baud_at_10_hz_both_ways_and_the_arithmetic_says_so():
    assert refused(serial(57_600), transit()) == (
        "serial:/dev/ttyUSB0:57600: 6 vehicles at 10 Hz need 6 × 1222 = 7332 bytes/s both ways (each 10 set-points of "
        "65, 10 positions of 40 and 172 of heartbeats and slow streams), and 57600 / 10 = 5760 less 10% in reserve is "
        "5184; what would fit: 4 vehicles, or time.period_s = 0.152, or 115200 bits/s"
    )


def test_what_the_refusal_says_would_fit_does_fit_and_no_more():
    assert positions_per_tick(serial(57_600), transit(vehicles=4), signed=False) == 1
    assert "4 vehicles, or" in refused(serial(57_600), transit(vehicles=5))
    assert positions_per_tick(serial(57_600), transit(period_s=0.152), signed=False) == 1
    refused(serial(57_600), transit(period_s=0.148))
    assert positions_per_tick(serial(115_200), transit(), signed=False) >= 1


def test_signed_frames_are_named_in_the_arithmetic():
    words = refused(serial(57_600), transit(), signed=True)
    assert "6 vehicles at 10 Hz, signed, need 6 × 1560 = 9360 bytes/s" in words
    assert "each 10 set-points of 78, 10 positions of 53 and 250 of" in words


def test_what_nothing_but_a_faster_link_helps_is_said_too():
    words = refused(serial(1_200), transit())
    assert words.endswith("is 108; what would fit: 115200 bits/s")
    assert refused(serial(1_200), transit(vehicles=250)).endswith("what would fit: a network instead of a serial link")


def test_where_the_scenario_says_how_often_it_is_that_or_nothing():
    assert positions_per_tick(serial(57_600), transit(vehicles=4, positions=1), signed=False) == 1
    words = refused(serial(57_600), transit(vehicles=4, positions=2))
    assert "20 positions of 40" in words
    assert ", or time.positions_per_tick = 1, or " in words
    assert positions_per_tick(serial(57_600), transit(vehicles=4, positions=1), signed=False) == 1


def test_what_would_not_fit_either_is_not_offered():
    assert "positions_per_tick" not in refused(serial(57_600), transit(vehicles=6, positions=2))
    assert "vehicle" not in refused(serial(1_200), transit()).split("what would fit")[1]
    words = refused([*serial(9_600), *serial(19_200)], transit())
    assert words.endswith("what would fit: 57600 bits/s on every serial link")
    raised = [parse(f"serial:/dev/ttyUSB{n}:57600")[0] for n in range(2)]
    assert positions_per_tick(raised, transit(), signed=False) == 2
    odd = load("transit", overrides=["time.physics_hz=300", "time.period_s=0.1"])
    longer_s = float(refused(serial(57_600), odd).split("time.period_s = ")[1].split(",")[0])
    assert positions_per_tick(serial(57_600), odd.model_validate(told_period(odd, longer_s)), signed=False) == 1


def told_period(scenario, period_s):
    told = scenario.model_dump()
    return told | {"time": told["time"] | {"period_s": period_s}}


def test_beside_a_network_that_may_be_unused_a_serial_link_must_carry_all():
    one = transit(vehicles=3)
    assert positions_per_tick([*serial(57_600), *UDP], one, signed=False) == 2
    assert "57600: 6 vehicles at" in refused([*serial(57_600), *UDP], transit())
    assert "57600: 6 vehicles at" in refused([*serial(57_600, count=5), *UDP], transit())


def test_vehicles_are_shared_among_links_and_the_slowest_serial_one_decides():
    assert positions_per_tick(serial(57_600, count=6), transit(), signed=False) == 5
    assert positions_per_tick(serial(57_600, count=2), transit(), signed=False) == 2
    assert positions_per_tick([*serial(57_600), *serial(921_600)], transit(), signed=False) == 2
    assert positions_per_tick([*serial(921_600), *serial(57_600)], transit(), signed=False) == 2


@pytest.mark.parametrize("signed", [False, True])
def test_our_frames_are_as_long_as_the_arithmetic_says(signed):
    more = 13 * signed
    signer = Signer(bytes(32))
    sizes = {
        "set-point": Encoder(1).encode(SetVelocity(1.0, 2.0, 3.0, 0.5), 123_456),
        "heartbeat": Encoder(1).encode(Beat(), 0),
        "position": Sender(1, 1).frame(LOCAL_POSITION_NED, pack_local_position(LocalPosition(1, *[math.pi] * 6))),
        "attitude": Sender(1, 1).pack(dialect.MAVLink_attitude_message(1, *[math.pi] * 6)),
        "status": Sender(1, 1).pack(dialect.MAVLink_sys_status_message(*[1] * 13, *[2**32 - 1] * 3)),
        "landed": Sender(1, 1).pack(dialect.MAVLink_extended_sys_state_message(1, 1)),
    }
    assert len(Framer().frames(0, b"".join(sizes.values()))) == 6
    measured = {name: len(signer.sign(frame) if signed else frame) for name, frame in sizes.items()}
    assert measured == {
        "set-point": 65 + more, "heartbeat": 21 + more, "position": 40 + more,
        "attitude": 40 + more, "status": 55 + more, "landed": 14 + more,
    }  # fmt: skip
