"""Recordings made of a flown one: frames alone, as they are imported from another ground station's log."""

from flights import messages, scratch
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.recording.channels import raw_sender
from gcs.recording.mcap_file import McapFile

OTHER_STATION = 254, 230
"""System and component of a ground station that is not ours."""


def frames_alone(path, *, keep=lambda _sender, _seconds: True, more=()):
    """The frames of a recording without scenario, topics or metadata.

    keep: takes (system, component) and seconds since the first message;  more: frames of others, (seconds, bytes).
    """
    copy = scratch() / "imported.mcap"
    recorded = messages(path)
    start_ns = min(time_ns for _, time_ns, _ in recorded)
    frames = [
        (time_ns, topic, data)
        for topic, time_ns, data in recorded
        if (name := raw_sender(topic)) and keep(name, (time_ns - start_ns) / 1e9)
    ]
    frames += [(start_ns + round(at_s * 1e9), f"/mavlink/{data[5]}_{data[6]}/raw", data) for at_s, data in more]
    file, channels = McapFile(copy), {}
    for time_ns, topic, data in sorted(frames):
        if topic not in channels:
            channels[topic] = file.channel(topic, "mavlink")
        file.add(channels[topic], time_ns, data)
    file.finish()
    return copy


def said_by_another_station(at_s):
    """(seconds, frame): it says who it is, and commands vehicle 1 to land."""
    words = dialect.MAVLink(None, srcSystem=OTHER_STATION[0], srcComponent=OTHER_STATION[1])
    beat = words.heartbeat_encode(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 0)
    land = words.command_long_encode(1, 1, dialect.MAV_CMD_NAV_LAND, 0, *[0] * 7)
    return [(at_s, bytes(beat.pack(words))), (at_s + 0.1, bytes(land.pack(words)))]
