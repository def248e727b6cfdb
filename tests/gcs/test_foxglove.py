"""A replay served to Foxglove, heard by a WebSocket client that nobody here wrote."""

import asyncio
import socket
import struct
import sys

import orjson
import pytest
from flights import SHORT, recorded
from tornado.websocket import websocket_connect

from gcs.choices import BadUsageError
from gcs.recording.history import load
from gcs.replay.foxglove import FoxgloveOutput
from gcs.replay.player import Span
from gcs.replay.reel import Reel

pytestmark = pytest.mark.wall_clock
BRIEF = ("demo", *SHORT)
MESSAGE, TIME = 1, 2
"""Opcodes of what comes in binary: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md"""
WANTED = ("/tf", "/swarm/scene", "/uav/3/fix", "/mission")


def played(from_s, to_s):
    """What a recording has between these times of its mission."""
    flight = load(recorded(*BRIEF).path)
    start_ns = flight.time_ns[flight.mission_s == 0.0][0]
    with Reel(flight.path) as reel:
        return reel.play(Span(int(start_ns + from_s * 1e9), int(start_ns + to_s * 1e9)))


class Viewer:
    """Reads what comes, as Foxglove would."""

    def __init__(self, connection):
        self._connection = connection
        self.subprotocol = connection.selected_subprotocol
        self.channels, self.sessions, self.messages, self.times = {}, [], [], []
        self._topics = []

    async def until(self, enough):
        while not enough():
            word = await asyncio.wait_for(self._connection.read_message(), timeout=10)
            assert word is not None, "the server has gone"
            self._take(orjson.loads(word) if isinstance(word, str) else word)

    async def subscribe(self, topics):
        self._topics = topics
        wanted = [{"id": at, "channelId": self.channels[topic]["id"]} for at, topic in enumerate(topics)]
        await self._connection.write_message(
            orjson.dumps({"op": "subscribe", "subscriptions": wanted, "channelIds": [w["channelId"] for w in wanted]})
        )

    def _take(self, word):
        if isinstance(word, bytes) and word[0] == MESSAGE:
            at, time_ns = struct.unpack_from("<IQ", word, 1)
            self.messages.append((self._topics[at], time_ns, word[13:]))
        elif isinstance(word, bytes):
            assert word[0] == TIME
            self.times.append(struct.unpack_from("<Q", word, 1)[0])
        elif word["op"] == "serverInfo":
            assert "time" in word["capabilities"]
            self.sessions.append(word["sessionId"])
        elif word["op"] == "advertise":
            self.channels |= {channel["topic"]: channel for channel in word["channels"]}


def watched(output, watch):
    """Run `watch` with a viewer that is connected."""

    async def connected():
        connection = await websocket_connect(f"ws://127.0.0.1:{output.port}", subprotocols=["foxglove.sdk.v1"])
        viewer = Viewer(connection)
        await viewer.until(lambda: viewer.sessions)
        await watch(viewer)
        connection.close()

    asyncio.run(connected())


@pytest.fixture
def output():
    served = FoxgloveOutput(0)
    yield served
    served.close()


def test_a_viewer_is_offered_every_topic_as_it_was_recorded_but_raw_frames(output):
    messages = played(0, 1)

    async def watch(viewer):
        topics = {message.topic: message for message in messages if message.encoding != "mavlink"}
        assert viewer.subprotocol == "foxglove.sdk.v1"
        output.put(messages)
        await viewer.until(lambda: len(viewer.channels) == len(topics))
        assert viewer.channels.keys() == topics.keys() >= set(WANTED)
        for topic, channel in viewer.channels.items():
            assert channel["encoding"] == topics[topic].encoding
            assert channel["schemaName"] == topics[topic].schema_name
        assert viewer.channels["/tf"]["schemaName"] == "foxglove.FrameTransforms"
        assert viewer.channels["/swarm/scene"]["schemaName"] == "foxglove.SceneUpdate"

    watched(output, watch)


def test_whoever_subscribes_receives_what_was_recorded_at_its_recorded_time(output):
    first, then = played(0, 1), played(1, 3)

    async def watch(viewer):
        output.put(first)
        await viewer.until(lambda: set(WANTED) <= viewer.channels.keys())
        await viewer.subscribe(WANTED)
        await asyncio.sleep(0.2)  # a subscription is not answered
        output.put(then)
        due = [(message.topic, message.time_ns, message.data) for message in then if message.topic in WANTED]
        await viewer.until(lambda: len(viewer.messages) == len(due) and viewer.times[-1:] == [then[-1].time_ns])
        assert viewer.messages == due
        assert {topic for topic, _, _ in due} == set(WANTED)

    watched(output, watch)


def test_a_jump_makes_viewers_forget_what_they_have_drawn(output):
    async def watch(viewer):
        output.jumped(1_000_000_007)
        await viewer.until(lambda: len(viewer.sessions) == 2 and viewer.times)
        assert viewer.sessions[0] != viewer.sessions[1]
        assert viewer.times == [1_000_000_007]

    watched(output, watch)


def test_it_is_served_to_this_machine_only(output):
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", output.port), timeout=1)


def test_a_port_that_cannot_be_had_is_refused_in_a_sentence(output):
    with pytest.raises(BadUsageError, match=rf"--foxglove-port {output.port}: .*in use"):
        FoxgloveOutput(output.port)
    with pytest.raises(BadUsageError, match="--foxglove-port 70000: must be 0 to 65535"):
        FoxgloveOutput(70_000)


def test_without_the_extra_it_is_said_how_to_get_it(gcs, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    monkeypatch.delitem(sys.modules, "gcs.replay.foxglove")
    code, out, err = gcs("replay", recorded(*BRIEF).path, "--foxglove")
    assert (code, out) == (2, "")
    assert err == "gcs: --foxglove needs foxglove-sdk: pip install 'trustr[foxglove]'\n"
