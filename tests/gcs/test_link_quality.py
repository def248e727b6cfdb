"""Loss, counted from sequence numbers, whatever a network does to their order."""

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.link_quality import WINDOW, LinkQuality, Meter
from gcs.routes import ALIVE_NS
from wire.frames import Framer, Sender

MS = 1_000_000


def sent(count, *, boot_ms=0, step_ms=20):
    """So many positions of one vehicle, as they would arrive: frame k at k · step."""
    sender, framer = Sender(1, 1), Framer()
    messages = (
        dialect.MAVLink_local_position_ned_message(boot_ms + k * step_ms, 1, 2, 3, 4, 5, 6) for k in range(count)
    )
    return [framer.frames(k * step_ms * MS, sender.pack(message))[0] for k, message in enumerate(messages)]


def measured(frames, meter=None):
    meter = meter or Meter()
    for frame in frames:
        meter.count(frame)
    return meter.quality


def test_a_perfect_link_loses_nothing_over_any_number_of_rounds():
    assert measured(sent(1000)) == LinkQuality(received=1000)


@given(st.sets(st.integers(1, 899)))
def test_every_frame_left_out_is_lost_once_as_many_as_the_window_have_followed(missing):
    runs = [False] * 901
    for place in missing:
        runs[place] = True
    longest = max(map(len, "".join("x" if gone else " " for gone in runs).split()), default=0)
    if longest > 255 - WINDOW:  # more than eight bits can tell from frames that come late
        return
    frames = [frame for place, frame in enumerate(sent(1000)) if place not in missing]
    assert measured(frames) == LinkQuality(received=1000 - len(missing), lost=len(missing))


@given(st.lists(st.integers(0, 20), min_size=300, max_size=300), st.sets(st.integers(0, 299), max_size=40))
def test_frames_out_of_order_and_frames_that_come_twice_are_not_lost(delays, twice):
    frames = sent(300)
    arriving = [(place + delay, place, frame) for place, (delay, frame) in enumerate(zip(delays, frames, strict=True))]
    arriving[0] = (-1, 0, frames[0])
    arriving += [(at + 1, place, frame) for at, place, frame in arriving if place in twice]
    order = [place for _, place, _ in sorted(arriving, key=lambda one: one[:2])]
    first = list(dict.fromkeys(order))
    late = sum(place < max(first[: k + 1]) for k, place in enumerate(first))
    quality = measured([frames[place] for place in order])
    assert quality == LinkQuality(received=300, lost=0, reordered=late, duplicated=len(twice))


def test_what_a_long_silence_swallowed_is_not_counted():
    before, after = sent(1000)[:100], sent(1000)[100 + ALIVE_NS // (20 * MS) + 1 :]
    assert measured(before + after).lost == 0
    just = sent(1000)[100 + ALIVE_NS // (20 * MS) - 1 :]
    assert measured(before + just).lost > 0


def test_a_vehicle_that_boots_again_is_counted_from_the_beginning():
    meter = Meter()
    assert measured(sent(200, boot_ms=50_000), meter) == LinkQuality(received=200)
    again = [frame._replace(time_ns=frame.time_ns + 4000 * MS) for frame in sent(30)]
    assert measured(again, meter) == LinkQuality(received=30)


def test_frames_of_mavlink_1_have_their_number_elsewhere():
    framer = Framer()
    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    frames = []
    for _ in range(300):
        packed = dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(mav, force_mavlink1=True)
        mav.seq = mav.seq + 1 & 0xFF
        frames += framer.frames(0, bytes(packed))
    assert frames[0].raw[0] == 0xFE
    assert measured(frames) == LinkQuality(received=300)
