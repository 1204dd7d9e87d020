"""Recordings, read by the packages `mcap` and `mcap-protobuf-support` alone."""

from collections import defaultdict
from functools import cached_property
from pathlib import Path

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

STATE = ("alpha1_rad", "alpha2_rad", "alpha1_dot_rad_s", "alpha2_dot_rad_s")
LOAD = ("torque1_nm", "torque2_nm", "force_x_n", "force_y_n")
SENSORS = tuple(f"acceleration_{point}_{axis}_m_s2" for point in "bc" for axis in "xy") + ("head_force_x_n", "head_force_y_n")
RECEIVED, SENT = 1, 2


class Recording:
    """A whole recording, every checksum checked and every message decoded by the schema in the file."""

    def __init__(self, path):
        self.topics = defaultdict(list)
        with Path(path).open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages():
                self.topics[channel.topic].append(message)
            self.messages = reader.get_summary().statistics.message_count
            self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}

    def column(self, topic, names):
        """Quantities at full rate, a row a step; the steps must follow each other from 0 without a gap."""
        rows = []
        for batch in self.topics[topic]:
            assert batch.first_step == sum(len(row) for row in rows)
            rows.append(np.stack([np.array(getattr(batch, name)) for name in names], axis=1))
        return np.concatenate(rows)

    @cached_property
    def steps(self):
        """States and loads."""
        return self.column("/plant/steps", STATE + LOAD)

    @cached_property
    def samples(self):
        return self.column("/plant/samples", SENSORS)

    @property
    def frames(self):
        return self.topics["/can/frames"]

    def frames_of(self, direction, identifier):
        return [frame for frame in self.frames if (frame.direction, frame.id) == (direction, identifier)]

    @property
    def events(self):
        return [event.name for event in self.topics["/events"]]


def bits(values):
    """Floating-point numbers as the whole numbers that their bits are."""
    return np.ascontiguousarray(values).view(np.uint64)


def last_step_in_chunks(path):
    """The last step in the whole chunks of a recording that ends in the middle of something."""
    factory, last = DecoderFactory(), None
    schemas, channels = {}, {}
    with Path(path).open("rb") as stream:
        records = StreamReader(stream, validate_crcs=True).records
        try:
            for record in records:
                match type(record).__name__:
                    case "Schema":
                        schemas[record.id] = record
                    case "Channel":
                        channels[record.id] = record
                    case "Message" if channels[record.channel_id].topic == "/plant/steps":
                        schema = schemas[channels[record.channel_id].schema_id]
                        batch = factory.decoder_for("protobuf", schema)(record.data)
                        last = batch.first_step + len(batch.alpha1_rad) - 1
        except McapError:
            pass  # where the kill cut it off
    return last
