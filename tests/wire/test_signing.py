"""Signing: ours and pymavlink's are the same, and what pymavlink is deceived by does not deceive us."""

import hashlib
import itertools
import random
import shutil
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.frames import Framer, Sender, decode
from wire.signing import (
    EPOCH_S,
    LAST_TICK,
    MARGIN,
    STREAMS_AT_MOST,
    TICKS_PER_S,
    Signer,
    SigningKeyError,
    read_key,
)

KEY = hashlib.sha256(b"a key").digest()
OTHER_KEY = hashlib.sha256(b"another key").digest()
DAY_S = 86_400
START_S = EPOCH_S + 3_000 * DAY_S


class Wall:
    """A wall clock that people set."""

    def __init__(self, seconds=START_S):
        self.now = seconds

    def __call__(self):
        return self.now

    @property
    def ticks(self):
        return int((self.now - EPOCH_S) * TICKS_PER_S)


@pytest.fixture
def wall():
    return Wall()


def cut(data):
    (frame,) = Framer().frames(0, data)
    return frame


def heartbeat(sender, mode=7):
    return sender.pack(dialect.MAVLink_heartbeat_message(2, 12, 0x81, mode, 4, 3))


def timestamp(signed):
    return int.from_bytes(signed[-12:-6], "little")


def stamped(signed, ticks, key=KEY):
    """The same frame at another time; without the key only its digest is wrong."""
    body = signed[:-12] + ticks.to_bytes(6, "little")
    return body + hashlib.sha256(key + body).digest()[:6]


def theirs(key=KEY, *, system=9, component=1, link=0, ticks=None):
    """pymavlink with a key: it signs, and it judges."""
    mavlink = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
    mavlink.signing.secret_key, mavlink.signing.sign_outgoing, mavlink.signing.link_id = key, True, link
    mavlink.signing.timestamp = Wall().ticks if ticks is None else ticks
    return mavlink


def admits(mavlink, data):
    """Whether pymavlink takes a frame."""
    mavlink.robust_parsing = True
    (message,) = mavlink.parse_buffer(data)
    return message.get_type() != "BAD_DATA"


# --- ours and theirs


@given(st.sampled_from(sorted(dialect.mavlink_map)), st.randoms(use_true_random=False))
def test_what_we_sign_is_what_pymavlink_signs_to_the_byte(number, rng):
    kind = dialect.mavlink_map[number]
    wall, mavlink, sender = Wall(), theirs(link=3), Sender(9, 1)
    payload = rng.randbytes(kind.unpacker.size - 1) + b"\1"
    plain = sender.frame(number, payload)
    signed = Signer(KEY, link=3, wall=wall).sign(plain)
    assert timestamp(signed) == wall.ticks
    message = cut(signed)
    assert (message.system, message.component, message.message, message.payload) == (9, 1, number, payload)
    assert len(signed) == len(plain) + 13
    assert hashlib.sha256(KEY + signed[:-6]).digest()[:6] == signed[-6:]
    assert admits(mavlink, signed)


def test_pymavlinks_frames_to_the_byte():
    mavlink = theirs(link=5)
    message = dialect.MAVLink_heartbeat_message(2, 12, 0x81, 7, 4, 3)
    assert Signer(KEY, link=5, wall=Wall()).sign(heartbeat(Sender(9, 1))) == bytes(message.pack(mavlink))


def test_pymavlink_admits_all_of_ours_and_we_admit_all_of_its(wall):
    mavlink, signer, sender = theirs(), Signer(KEY, wall=wall), Sender(255, 190)
    for number in range(300):
        wall.now += 0.01
        assert admits(mavlink, signer.sign(heartbeat(sender, number)))
        answer = bytes(dialect.MAVLink_heartbeat_message(2, 12, 0x81, number, 4, 3).pack(mavlink))
        assert signer.refusal(cut(answer)) is None


def test_another_key_is_refused_by_both(wall):
    assert not admits(theirs(OTHER_KEY), Signer(KEY, wall=wall).sign(heartbeat(Sender(255, 190))))
    data = bytes(dialect.MAVLink_heartbeat_message(2, 12, 0x81, 7, 4, 3).pack(theirs(OTHER_KEY)))
    assert Signer(KEY, wall=wall).refusal(cut(data)) == "bad signature"


def test_a_signed_frame_decodes_as_the_plain_one(wall):
    plain = heartbeat(Sender(9, 1))
    signed = Signer(KEY, wall=wall).sign(plain)
    assert decode(cut(signed)).to_dict() == decode(cut(plain)).to_dict()
    assert decode(cut(signed)).get_seq() == decode(cut(plain)).get_seq()


# --- attacks


def genuine(wall, count, *, system=9):
    """Signed frames of one vehicle, 10 ms apart, as they come off the air."""
    signer, sender = Signer(KEY, wall=wall), Sender(system, 1)
    for number in range(count):
        wall.now += 0.01
        yield signer.sign(heartbeat(sender, number))


def admitted(signer, frames):
    return sum(signer.refusal(cut(frame)) is None for frame in frames)


def test_after_a_forged_timestamp_from_the_future_1000_of_1000_genuine_frames_pass(wall):
    signer = Signer(KEY, wall=wall)
    first = next(genuine(wall, 1))
    assert signer.refusal(cut(stamped(first, LAST_TICK, OTHER_KEY))) == "bad signature"
    assert admitted(signer, genuine(wall, 1000)) == 1000
    assert signer.refusal(cut(stamped(first, LAST_TICK, OTHER_KEY))) == "bad signature"
    assert admitted(signer, genuine(wall, 1000)) == 1000


def test_pymavlink_loses_them_all_so_the_attack_is_one(wall):
    mavlink = theirs(system=1)
    assert admits(mavlink, next(genuine(wall, 1)))
    assert not admits(mavlink, stamped(next(genuine(wall, 1)), LAST_TICK, OTHER_KEY))
    assert sum(admits(mavlink, frame) for frame in genuine(wall, 1000)) == 0


def test_a_replayed_frame_is_never_admitted_again(wall):
    signer = Signer(KEY, wall=wall)
    recorded = list(genuine(wall, 1000))
    assert admitted(signer, recorded) == 1000
    assert admitted(signer, recorded) == 0
    assert admitted(signer, reversed(recorded)) == 0
    assert signer.refusal(cut(recorded[-1])) == "replayed"


def test_frames_that_are_overtaken_on_the_way_are_refused_like_replayed_ones(wall):
    signer = Signer(KEY, wall=wall)
    first, second = genuine(wall, 2)
    assert signer.refusal(cut(second)) is None
    assert signer.refusal(cut(first)) == "replayed"


def test_unsigned_and_version_1_frames_are_never_admitted(wall):
    signer, sender = Signer(KEY, wall=wall), Sender(9, 1)
    packer = dialect.MAVLink(None, srcSystem=9, srcComponent=1)
    old = bytes(dialect.MAVLink_heartbeat_message(2, 3, 0x51, 5, 4, 3).pack(packer, force_mavlink1=True))
    assert admitted(signer, [heartbeat(sender) for _ in range(500)]) == 0
    assert admitted(signer, [old] * 500) == 0
    assert signer.refusal(cut(heartbeat(sender))) == "unsigned"
    assert signer.refusal(cut(old)) == "version 1"


def test_a_flipped_bit_anywhere_is_refused_even_where_the_checksum_was_made_right(wall):
    signer, frame = Signer(KEY, wall=wall), next(genuine(wall, 1))
    plain = len(frame) - 13
    for place in (*range(10, plain - 2), *range(plain, len(frame))):
        for bit in range(8):
            spoilt = bytearray(frame)
            spoilt[place] ^= 1 << bit
            spoilt = bytes(spoilt)
            if place < plain:
                spoilt = with_right_checksum(spoilt, plain)
            assert signer.refusal(cut(spoilt)) == "bad signature"
    assert signer.refusal(cut(frame)) is None


def with_right_checksum(frame, plain):
    extra = dialect.mavlink_map[int.from_bytes(frame[7:10], "little")].crc_extra
    crc = dialect.x25crc(bytearray(frame[1 : plain - 2]) + bytes([extra])).crc
    return frame[: plain - 2] + crc.to_bytes(2, "little") + frame[plain:]


def test_guessed_digests_are_refused_and_leave_no_trace(wall):
    signer, rng = Signer(KEY, wall=wall), random.Random(1)
    template = next(genuine(wall, 1))
    for _ in range(2000):
        forged = with_right_checksum(template[:5] + rng.randbytes(2) + template[7:], len(template) - 13)
        forged = forged[:-13] + rng.randbytes(13)
        assert signer.refusal(cut(forged)) == "bad signature"
    assert repr(signer) == "Signer(link=0, 0 streams)"
    assert signer.refusal(cut(template)) is None


def test_our_own_frames_thrown_back_at_us_are_refused(wall):
    signer = Signer(KEY, wall=wall)
    own = [signer.sign(heartbeat(Sender(255, 190))) for _ in range(10)]
    assert admitted(signer, own) == 0


# --- streams and their clocks


def test_streams_are_told_apart_by_system_component_and_link(wall):
    judge = Signer(KEY, wall=wall)
    for system, component, link in ((1, 1, 0), (2, 1, 0), (1, 2, 0), (1, 1, 1)):
        signed = Signer(KEY, link=link, wall=wall).sign(heartbeat(Sender(system, component)))
        assert timestamp(signed) == wall.ticks
        assert judge.refusal(cut(signed)) is None
        assert judge.refusal(cut(signed)) == "replayed"


def test_every_port_of_every_program_has_a_link_id_of_its_own(wall):
    programs = [Signer(KEY, link=link, wall=wall) for link in range(4)]
    signed = [program.sign(heartbeat(Sender(255, 190)), place=place) for program in programs for place in range(64)]
    assert sorted(frame[-13] for frame in signed) == list(range(256))


@pytest.mark.parametrize(("late_s", "verdict"), [(0.0, None), (59.9, None), (60.1, "replayed"), (-59.0, None)])
def test_a_new_stream_may_be_a_minute_old_by_our_clock(wall, late_s, verdict):
    signed = Signer(KEY, wall=Wall(wall.now - late_s)).sign(heartbeat(Sender(9, 1)))
    assert Signer(KEY, wall=wall).refusal(cut(signed)) == verdict


def test_a_new_stream_may_be_a_minute_old_by_the_newest_time_we_know(wall):
    signer = Signer(KEY, wall=wall)
    assert signer.refusal(cut(next(genuine(Wall(wall.now + 3600), 1, system=1)))) is None
    for late_s, verdict in ((61.0, "replayed"), (59.0, None)):
        assert signer.refusal(cut(next(genuine(Wall(wall.now + 3600 - late_s), 1, system=2)))) == verdict


def test_a_genuine_clock_that_is_ahead_is_followed_so_that_its_owner_hears_us(wall):
    signer, mavlink = Signer(KEY, wall=wall), theirs(ticks=wall.ticks + DAY_S * TICKS_PER_S)
    assert not admits(mavlink, signer.sign(heartbeat(Sender(255, 190)))), "a day behind"
    ahead = bytes(dialect.MAVLink_heartbeat_message(2, 12, 0x81, 7, 4, 3).pack(mavlink))
    assert signer.refusal(cut(ahead)) is None
    assert admits(mavlink, signer.sign(heartbeat(Sender(255, 190))))


def test_the_last_timestamp_there_is_raises_nothing(wall):
    signer, frame = Signer(KEY, wall=wall), next(genuine(wall, 1))
    assert signer.refusal(cut(stamped(frame, LAST_TICK))) is None
    assert timestamp(signer.sign(heartbeat(Sender(255, 190)))) == LAST_TICK


def test_only_a_key_holder_can_open_streams_and_only_so_many(wall):
    judge, signer = Signer(KEY, wall=wall), Signer(KEY, wall=wall)
    frames = [signer.sign(heartbeat(Sender(1 + n % 250, 1 + n // 250))) for n in range(STREAMS_AT_MOST + 10)]
    assert admitted(judge, frames) == STREAMS_AT_MOST
    assert judge.refusal(cut(frames[-1])) == "too many streams"
    assert judge.refusal(cut(signer.sign(heartbeat(Sender(1, 1))))) is None


# --- outgoing timestamps


@given(st.lists(st.floats(-7200, 7200), max_size=40))
def test_timestamps_strictly_increase_wherever_the_clock_is_set(jumps):
    wall = Wall()
    signer, sender = Signer(KEY, wall=wall), Sender(255, 190)
    stamps = []
    for jump in jumps:
        wall.now += jump
        stamps += [timestamp(signer.sign(heartbeat(sender))) for _ in range(3)]
    assert all(after > before for before, after in itertools.pairwise(stamps))
    assert all(stamp >= 0 for stamp in stamps)


def test_timestamps_follow_the_wall_clock(wall):
    signer, sender = Signer(KEY, wall=wall), Sender(255, 190)
    for _ in range(100):
        wall.now += 0.1
        assert timestamp(signer.sign(heartbeat(sender))) == wall.ticks


def killed(signer):
    """All that the system does for a program that ends: files are closed, and with them the lock."""
    signer._unlock()


@pytest.mark.parametrize("orderly", [True, False], ids=["saved", "killed"])
@pytest.mark.parametrize("set_back_s", [0.0, 3600.0])
def test_no_timestamp_repeats_after_a_restart(wall, tmp_path, orderly, set_back_s):
    sender, used = Sender(255, 190), -1
    for _ in range(5):
        signer = Signer(KEY, memory=tmp_path / "memory", wall=wall)
        for _ in range(50):
            wall.now += 0.03
            before, used = used, timestamp(signer.sign(heartbeat(sender)))
            assert used > before
        signer.save() if orderly else killed(signer)
        wall.now -= set_back_s


@pytest.mark.parametrize("orderly", [True, False], ids=["saved", "killed"])
def test_what_was_heard_before_a_restart_cannot_be_played_after_it(wall, tmp_path, orderly):
    signer = Signer(KEY, memory=tmp_path / "memory", wall=wall)
    recorded = [frame for system in (1, 2) for frame in genuine(wall, 300, system=system)]
    assert admitted(signer, recorded) == 600
    signer.save() if orderly else killed(signer)
    again = Signer(KEY, memory=tmp_path / "memory", wall=wall)
    assert admitted(again, recorded) == 0
    assert admitted(Signer(KEY, wall=wall), recorded) > 0, "without a memory they are"
    wall.now += MARGIN / TICKS_PER_S
    assert admitted(again, genuine(wall, 100)) == 100


def test_after_an_orderly_end_the_next_frame_is_admitted_at_once(wall, tmp_path):
    vehicle, sender = Signer(KEY, wall=wall), Sender(9, 1)
    for _ in range(5):
        signer = Signer(KEY, memory=tmp_path / "memory", wall=wall)
        wall.now += 0.001
        assert signer.refusal(cut(vehicle.sign(heartbeat(sender)))) is None
        signer.save()


def test_a_stream_that_fell_silent_is_not_pushed_further_ahead_at_each_restart(wall, tmp_path):
    vehicle, sender = Signer(KEY, wall=wall), Sender(9, 1)
    Signer(KEY, memory=tmp_path / "memory", wall=wall).refusal(cut(vehicle.sign(heartbeat(sender))))
    for _ in range(50):
        Signer(KEY, memory=tmp_path / "memory", wall=wall).sign(heartbeat(Sender(255, 190)))
    wall.now += MARGIN / TICKS_PER_S + 0.001
    again = Signer(KEY, memory=tmp_path / "memory", wall=wall)
    assert again.refusal(cut(vehicle.sign(heartbeat(sender)))) is None


def test_the_memory_is_written_about_once_a_second_however_much_is_said(wall, tmp_path):
    memory = tmp_path / "memory"
    signer, sender = Signer(KEY, memory=memory, wall=wall), Sender(255, 190)
    vehicles = [Signer(KEY, wall=wall) for _ in range(6)]
    written = set()
    for _ in range(1000):
        wall.now += 0.01
        signer.sign(heartbeat(sender))
        for system, vehicle in enumerate(vehicles, start=1):
            assert signer.refusal(cut(vehicle.sign(heartbeat(Sender(system, 1))))) is None
        written.add(memory.read_bytes())
    assert 5 <= len(written) <= 10


def test_a_memory_is_one_programs_alone_until_it_ends(wall, tmp_path):
    memory = tmp_path / "memory"
    first = Signer(KEY, memory=memory, wall=wall)
    first.sign(heartbeat(Sender(255, 190)))
    with pytest.raises(SigningKeyError, match=rf"^signing memory {memory}: is in use by another program$"):
        Signer(KEY, memory=memory, wall=wall)
    other = Signer(KEY, memory=tmp_path / "other", wall=wall)
    first.save()
    second = Signer(KEY, memory=memory, wall=wall)
    killed(second)
    third = Signer(KEY, memory=memory, wall=wall)
    assert (other.trouble, third.trouble) == (None, None)


def test_a_program_that_is_killed_gives_its_memory_back(tmp_path):
    code = (
        "import sys; from pathlib import Path; from wire.signing import Signer; "
        "signer = Signer(bytes(32), memory=Path(sys.argv[1])); print('ready', flush=True); sys.stdin.read()"
    )
    memory = tmp_path / "memory"
    command = [sys.executable, "-c", code, str(memory)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as program:
        assert program.stdout.readline() == b"ready\n"
        with pytest.raises(SigningKeyError, match="is in use by another program"):
            Signer(KEY, memory=memory)
        program.kill()
    Signer(KEY, memory=memory)


def test_the_disk_is_waited_for_at_the_start_and_at_an_orderly_end_and_never_in_between(wall, tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr("wire.signing.os.fsync", synced.append)
    signer = Signer(KEY, memory=tmp_path / "memory", wall=wall)
    assert len(synced) == 1
    written = set()
    for _ in range(100):
        wall.now += 0.1
        signer.sign(heartbeat(Sender(255, 190)))
        written.add((tmp_path / "memory").read_bytes())
    assert (len(synced), len(written) > 3) == (1, True)
    signer.save()
    assert len(synced) == 2


def test_a_disk_that_fills_up_in_flight_is_told_and_stops_nothing(wall, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    signer, sender = Signer(KEY, memory=folder / "memory", wall=wall), Sender(255, 190)
    assert signer.trouble is None
    shutil.rmtree(folder)
    signer.sign(heartbeat(sender))
    assert signer.trouble == f"signing memory {folder / 'memory'}: cannot be written: No such file or directory"
    folder.mkdir()
    wall.now += 3
    signer.sign(heartbeat(sender))
    assert signer.trouble is None
    assert (folder / "memory").exists()


# --- keys and files


def test_a_key_file_holds_64_hex_digits_or_a_passphrase(tmp_path):
    file = tmp_path / "key"
    for words, key in (
        (KEY.hex(), KEY),
        (KEY.hex().upper() + "\n", KEY),
        ("a key", KEY),
        ("a key\r\n", KEY),
        ("grüß Gott", hashlib.sha256("grüß Gott".encode()).digest()),
    ):
        file.write_bytes(words.encode())
        assert read_key(file) == key


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "must hold one line, 64 hex digits or a passphrase"),
        (b" \n", "must hold one line"),
        (b"one\ntwo\n", "must hold one line"),
        (b"x" * 5000, "must hold one line"),
        (b"\xff\xfe" * 16, "must be text"),
        (b"ab" * 31, "has 62 hex digits; a key has 64"),
        (b"ab" * 33, "has 66 hex digits; a key has 64"),
    ],
)
def test_a_key_file_that_cannot_be_used_is_refused_without_showing_it(tmp_path, content, words):
    file = tmp_path / "key"
    file.write_bytes(content)
    with pytest.raises(SigningKeyError) as refused:
        read_key(file)
    assert str(refused.value).startswith(f"signing key {file}: {words}")
    assert "abab" not in str(refused.value)
    assert refused.value.__cause__ is None


def test_a_key_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(SigningKeyError, match="No such file or directory"):
        read_key(tmp_path / "nowhere")
    with pytest.raises(SigningKeyError, match="Is a directory"):
        read_key(tmp_path)


def test_a_key_of_another_length_is_refused_without_showing_it():
    with pytest.raises(SigningKeyError, match=r"^a signing key has 32 bytes, this one 31$"):
        Signer(KEY[:31])


def test_nothing_that_is_shown_shows_the_key(wall, tmp_path):
    signer = Signer(KEY, memory=tmp_path / "memory", wall=wall)
    signer.sign(heartbeat(Sender(255, 190)))
    shown = repr(signer) + str(vars(signer)) + (tmp_path / "memory").read_text()
    assert KEY.hex() not in shown
    assert repr(KEY) not in shown


@pytest.mark.parametrize("content", ["", "[", "{}x", '[["a", 1, 0, 5]]', "[[1, 1, 0]]", "[[1, 1, 0, -1]]", "[5]", "7",
                                     "[[1, 1, 0, 1e999]]", f"[[1, 1, 0, {2**48}]]", "[" * 100_000, "[[256, 1, 0, 5]]",
                                     "[[1, -1, 0, 5]]", "[[1, 1, 0, true]]", "[[1, 1.5, 0, 5]]", '[["1", 1, 0, 5]]',
                                     "[[[1], 1, 0, 5]]", "null"])  # fmt: skip
def test_a_damaged_memory_is_refused_in_one_sentence(tmp_path, content):
    memory = tmp_path / "memory"
    memory.write_text(content)
    with pytest.raises(SigningKeyError, match=r"^signing memory .*: is damaged; [^\n]*$"):
        Signer(KEY, memory=memory)


@pytest.mark.parametrize(("days", "believed"), [(364, True), (366, False), (36_500, False), (None, False)])
def test_a_memory_that_is_far_ahead_of_the_clock_is_refused_in_one_sentence(wall, tmp_path, days, believed):
    newest = LAST_TICK if days is None else min(wall.ticks + days * DAY_S * TICKS_PER_S, LAST_TICK)
    memory = tmp_path / "memory"
    memory.write_text(f"[[1, 1, 0, {newest}]]")
    if believed:
        Signer(KEY, memory=memory, wall=wall)
    else:
        with pytest.raises(SigningKeyError, match=r"^signing memory .*: is more than a year ahead of this machine's "):
            Signer(KEY, memory=memory, wall=wall)
    assert str(newest) in memory.read_text()


def test_a_memory_that_cannot_be_kept_is_refused_before_the_flight(tmp_path):
    with pytest.raises(SigningKeyError, match=r"^signing memory .*: cannot be written: [^\n]*$"):
        Signer(KEY, memory=tmp_path / "no" / "such" / "folder")
    with pytest.raises(SigningKeyError, match=r"^signing memory .*: cannot be read: [^\n]*$"):
        Signer(KEY, memory=tmp_path)


def test_only_plain_version_2_frames_can_be_signed(wall):
    signer = Signer(KEY, wall=wall)
    packer = dialect.MAVLink(None, srcSystem=9, srcComponent=1)
    old = bytes(dialect.MAVLink_heartbeat_message(2, 3, 0x51, 5, 4, 3).pack(packer, force_mavlink1=True))
    for frame in (old, signer.sign(heartbeat(Sender(9, 1)))):
        with pytest.raises(ValueError, match="only a MAVLink 2 frame without flags can be signed"):
            signer.sign(frame)
