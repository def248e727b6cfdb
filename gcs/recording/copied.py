"""A recording copied into another file, record by record; decoded messages are left for others to write."""

from __future__ import annotations

from typing import Any

from mcap import records

from gcs.recording.channels import RAW, Channel, Channels
from gcs.recording.decoded import SCHEMA
from gcs.recording.mcap_file import McapFile


class Copy:
    """Takes the records of a recording as they come; schemas and channels are told twice, in the data and behind it."""

    def __init__(self, file: McapFile, channels: Channels) -> None:
        """channels: of the file."""
        self._file, self._defined = file, channels
        self._schemas: dict[int, tuple[str, str, bytes]] = {0: ("", "", b"")}
        self._channels: dict[int, Channel] = {}
        self.written = 0
        """Messages."""

    def take(self, record: Any) -> records.Message | None:
        """Copy this record; a raw frame is handed back."""
        match record:
            case records.Message():
                channel = self._channels[record.channel_id]
                if channel.schema_name.startswith(SCHEMA):
                    return None
                self._defined.add(channel, record.log_time, record.data)
                self.written += 1
                return record if channel.encoding == RAW else None
            case records.Schema():
                self._schemas[record.id] = record.name, record.encoding, record.data
            case records.Channel():
                schema = self._schemas[record.schema_id]
                self._channels[record.id] = Channel(record.topic, record.message_encoding, *schema)
            case records.Attachment():
                self._file.attach(record.log_time, record.name, record.media_type, record.data)
            case records.Metadata():
                self._file.metadata(record.name, record.metadata)
        return None
