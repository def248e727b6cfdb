"""A live link with a key: what was forged, replayed, unsigned or of version 1 is not heard; what is genuine is."""

import random
import socket
import struct
from contextlib import closing

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from test_live import HOST, after, free_port

from gcs.live import Live
from wire.connection import Connection
from wire.frames import Framer, Sender, decode
from wire.ids import AUTOPILOT
from wire.signing import Signer

pytestmark = pytest.mark.wall_clock

KEY, WRONG_KEY = bytes(range(32)), bytes(32)
COUNT = 400
"""Genuine frames, each among attacks of every kind."""


class Vehicle:
    """Vehicle 1 with a key, and whoever sits behind its address and has none."""

    def __init__(self, port):
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.connect((HOST, port))
        self.udp.settimeout(1.0)
        self._sender, self._signer = Sender(1, AUTOPILOT), Signer(KEY)
        self._old_sender = dialect.MAVLink(None, srcSystem=1, srcComponent=AUTOPILOT)
        self._wrong = Signer(WRONG_KEY, wall=lambda: 4e9)
        self._said = []

    def genuine(self, place):
        """Tells `place` in the field custom_mode."""
        self._said.append(self._signer.sign(self._sender.pack(beat(place))))
        return self._said[-1]

    def attacks(self, rng):
        """One of each kind: with another key and a time far ahead, changed under way, as old, said before, unsigned."""
        plain = Sender(1, AUTOPILOT).pack(beat(10**6))
        changed = bytearray(self._said[-1])
        changed[-20] ^= 1
        unsigned_copy = self._said[-1][:-13]
        return {
            "bad signature": self._wrong.sign(plain),
            "bad checksum": bytes(changed),
            "bad time": self._said[-1][:-12] + struct.pack("<Q", 2**47)[:6] + self._said[-1][-6:],
            "version 1": bytes(beat(10**6).pack(self._old_sender, force_mavlink1=True)),
            "replayed": rng.choice(self._said),
            "unsigned": plain,
            "cut short": unsigned_copy,
        }


def beat(number):
    return dialect.MAVLink_heartbeat_message(2, 12, 0, number, 4, 3)


@pytest.fixture
def signed():
    """(a live link with a key, its vehicle)."""
    port = free_port()
    with closing(Live([Connection("udpin", HOST, port)], (1,), signer=Signer(KEY))) as live:
        vehicle = Vehicle(port)
        with closing(vehicle.udp):
            yield live, vehicle


def test_all_that_is_genuine_is_heard_and_nothing_else(signed):
    live, vehicle = signed
    rng, heard = random.Random(1), []
    for place in range(COUNT):
        vehicle.udp.send(vehicle.genuine(place))
        attacks = list(vehicle.attacks(rng).values())
        rng.shuffle(attacks)
        for attack in attacks:
            vehicle.udp.send(attack)
        if place % 20 == 19:
            heard += after(live, 0.02)
    heard += after(live, 0.1)
    assert [decode(frame).custom_mode for frame in heard] == list(range(COUNT))
    refused = live.rejections
    assert refused["unsigned"] == refused["version 1"] == refused["replayed"] == COUNT
    assert refused["bad signature"] == 2 * COUNT
    assert live.rejected >= 7 * COUNT
    assert live.duplicates == frozenset()


def test_who_has_no_key_cannot_introduce_itself_nor_be_taken_for_a_second_one(signed):
    live, vehicle = signed
    for attack in (Sender(1, AUTOPILOT).pack(beat(0)), Signer(WRONG_KEY).sign(Sender(1, AUTOPILOT).pack(beat(0)))):
        vehicle.udp.send(attack)
    assert after(live, 0.05) == []
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        vehicle.udp.send(vehicle.genuine(1))
        stranger.sendto(Sender(1, AUTOPILOT).pack(beat(2)), vehicle.udp.getpeername())
        assert [decode(frame).custom_mode for frame in after(live, 0.05)] == [1]
        assert live.duplicates == frozenset()


def test_what_leaves_is_signed_and_what_is_handed_in_is_not_changed_by_it(signed):
    live, vehicle = signed
    vehicle.udp.send(vehicle.genuine(0))
    after(live, 0.05)
    said = Sender(255, 190).pack(beat(5))
    live.send(1, said)
    live.send(1, said)
    signer, framer = Signer(KEY), Framer()
    for _ in range(2):
        [frame] = framer.frames(0, vehicle.udp.recv(2048))
        assert signer.refusal(frame) is None
        assert signer.refusal(frame) == "replayed"
        [plain] = framer.frames(0, said)
        assert frame.payload == plain.payload
