"""What a recording told viewers, each recording read once a process."""

from collections import defaultdict
from functools import cache

import orjson
from flights import messages
from mcap.reader import SeekingReader
from mcap_protobuf.decoder import DecoderFactory


@cache
def viewed(path):
    """Topic → [(log time, message)] of all protobuf topics, decoded by what the file says of them."""
    decoded = defaultdict(list)
    with path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        protobuf = [c.topic for c in reader.get_summary().channels.values() if c.message_encoding == "protobuf"]
        for _, channel, raw, message in reader.iter_decoded_messages(topics=protobuf):
            decoded[channel.topic].append((raw.log_time, message))
    return dict(decoded)


@cache
def by_time(path, topic):
    """Log time → content of a topic of our own."""
    return {time_ns: orjson.loads(data) for name, time_ns, data in messages(path) if name == topic}


def scenes(flight):
    """[(log time, {id: entity})]"""
    return [(t, {entity.id: entity for entity in m.entities}) for t, m in viewed(flight.path)["/swarm/scene"]]


def transforms(flight):
    """Log time → {frame: transform into the swarm's}."""
    return {t: {one.child_frame_id: one for one in m.transforms} for t, m in viewed(flight.path)["/tf"]}


def sayings(flight):
    """[(name, level, sentence)] of /log."""
    return [(m.name, m.level, m.message) for _, m in viewed(flight.path)["/log"]]


def rgb(colour):
    return colour.r, colour.g, colour.b


def xyz(point):
    return point.x, point.y, point.z
