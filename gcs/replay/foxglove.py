"""A replay as a live source for Foxglove: its WebSocket server, to this machine only.

Foxglove connects to ws://127.0.0.1:PORT ("Open connection"). Protocol: https://github.com/foxglove/ws-protocol
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from gcs.choices import BadUsageError
from gcs.console import say
from gcs.recording.channels import RAW
from gcs.replay.outputs import Played

try:
    from foxglove import Channel, Context, Schema, start_server
    from foxglove.websocket import Capability
except ImportError:
    raise BadUsageError("--foxglove needs foxglove-sdk: pip install 'trustr[foxglove]'") from None

HOST = "127.0.0.1"


class FoxgloveOutput:
    """Topics as they were recorded, with their schemas and log times. Nobody has to be connected."""

    def __init__(self, port: int) -> None:
        """port: 0 takes a free one. Raises BadUsageError where it cannot be had."""
        if not 0 <= port <= 65535:
            raise BadUsageError(f"--foxglove-port {port}: must be 0 to 65535")
        self._context = Context()
        self._channels: dict[str, Channel] = {}
        self._sessions = count(1)
        try:
            self._server = start_server(
                name="trustr",
                host=HOST,
                port=port,
                capabilities=[Capability.Time],
                context=self._context,
            )
        except RuntimeError as error:
            why = str(error).removeprefix("FoxgloveError: ")
            raise BadUsageError(f"--foxglove-port {port}: {why}") from None
        self.port: int = self._server.port
        """Where it listens."""
        say(f"Foxglove connects to ws://{HOST}:{self.port}; raw MAVLink frames, which it cannot read, are left out")

    def put(self, messages: Sequence[Played]) -> None:
        """To whoever has subscribed to their topics; and what time it is."""
        for message in messages:
            if message.encoding != RAW:  # Foxglove has no decoder for them; what an export decodes, it reads
                self._channel(message).log(message.data, log_time=message.time_ns)
        if messages:
            self._server.broadcast_time(messages[-1].time_ns)

    def jumped(self, time_ns: int) -> None:
        """Viewers forget what they have drawn: trails would lead across the jump."""
        self._server.clear_session(f"jump {next(self._sessions)}")
        self._server.broadcast_time(time_ns)

    def close(self) -> None:
        """Viewers are told that the server goes."""
        self._server.stop()

    def _channel(self, message: Played) -> Channel:
        """Of its topic; made, and so told to viewers, when its first message is due."""
        channel = self._channels.get(message.topic)
        if channel is None:
            schema = Schema(name=message.schema_name, encoding=message.schema_encoding, data=message.schema_data)
            channel = self._channels[message.topic] = Channel(
                message.topic, message_encoding=message.encoding, schema=schema, context=self._context
            )
        return channel
