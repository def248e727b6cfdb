"""A recording copied into another file, record by record; decoded messages are left for others to write."""

from __future__ import annotations

from typing import Any

from mcap.records import Attachment, Channel, Message, Metadata, Schema

from gcs.recording.contents import RAW
from gcs.recording.decoded import SCHEMA
from gcs.recording.mcap_file import McapFile


class Copy:
    """Takes the records of a recording as they come; schemas and channels are told twice, in the data and behind it."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._schemas: dict[int, int] = {0: 0}
        self._decoded: set[int] = set()
        """Schemas of decoded messages."""
        self._channels: dict[int, tuple[int, bool]] = {}
        """Channel of the recording → that of the copy, and whether it is of raw frames."""
        self.written = 0
        """Messages."""

    def take(self, record: Any) -> Message | None:
        """Copy this record; a raw frame is handed back."""
        match record:
            case Message(channel_id=source) if source in self._channels:
                channel, raw = self._channels[source]
                self._file.add(channel, record.log_time, record.data)
                self.written += 1
                return record if raw else None
            case Schema(id=source, name=name):
                if name.startswith(SCHEMA):
                    self._decoded.add(source)
                elif source not in self._schemas:
                    self._schemas[source] = self._file.schema(name, record.encoding, record.data)
            case Channel(id=source, message_encoding=encoding, schema_id=schema):
                if schema not in self._decoded and source not in self._channels:
                    channel = self._file.channel(record.topic, encoding, self._schemas[schema])
                    self._channels[source] = channel, encoding == RAW
            case Attachment():
                self._file.attach(record.log_time, record.name, record.media_type, record.data)
            case Metadata():
                self._file.metadata(record.name, record.metadata)
        return None
