"""Recordings, read by the packages `mcap` and `mcap-protobuf-support` alone."""

import struct
from collections import defaultdict
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

STATE = ("alpha1_rad", "alpha2_rad", "alpha1_dot_rad_s", "alpha2_dot_rad_s")
LOAD = ("torque1_nm", "torque2_nm", "force_x_n", "force_y_n")
ACCELERATIONS = tuple(f"acceleration_{point}_{axis}_m_s2" for point in "bc" for axis in "xy")
SENSORS = (*ACCELERATIONS, "head_force_x_n", "head_force_y_n")
RECEIVED, SENT = 1, 2
# Bits of `flags` in a `FrameBatch`.
EXTENDED, REMOTE, FD, BRS, ESI, TIMED = (1 << bit for bit in range(6))


class Recording:
    """A recording, every checksum checked and every message decoded by the schema in the file."""

    def __init__(self):
        self.topics = defaultdict(list)
        self.metadata, self.messages = {}, None

    @classmethod
    def whole(cls, path):
        self = cls()
        with Path(path).open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages():
                self.topics[channel.topic].append(message)
            self.messages = reader.get_summary().statistics.message_count
            self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        return self

    @classmethod
    def cut_off(cls, path):
        """The readable content of a truncated recording."""
        self, factory, schemas, channels = cls(), DecoderFactory(), {}, {}
        with Path(path).open("rb") as stream:
            try:
                for record in StreamReader(stream, validate_crcs=True).records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        channels[record.id] = record
                    elif isinstance(record, Message):
                        channel = channels[record.channel_id]
                        decode = factory.decoder_for(channel.message_encoding, schemas[channel.schema_id])
                        self.topics[channel.topic].append(decode(record.data))
            # Between two fields of a record the package finds no end of the file, but too few bytes.
            except (EndOfFile, struct.error):
                return self
        raise AssertionError(f"{path} is whole")

    def column(self, topic, names):
        """Quantities at full rate, a row a sample; the samples must follow each other from 0 without a gap."""
        rows = self.batches(topic, names)
        counts = [len(row) for row in rows]
        assert [batch.first_step for batch in self.topics[topic]] == [0, *accumulate(counts)][:-1]
        return np.concatenate(rows)

    def batches(self, topic, names):
        """Quantities at full rate, an array with a row a sample for each batch: between two batches samples may be
        missing where a run in real time recorded less than it computed, which its report counts."""
        return [np.stack([np.array(getattr(batch, name)) for name in names], axis=1) for batch in self.topics[topic]]

    @cached_property
    def states(self):
        """States and loads, a row a sample."""
        return self.column("/plant/steps", STATE + LOAD)

    @cached_property
    def samples(self):
        return self.column("/plant/samples", SENSORS)

    @cached_property
    def frames(self):
        return [frame for batch in self.topics["/can/frames"] for frame in unpacked(batch)]

    def frames_of(self, direction, identifier):
        return [frame for frame in self.frames if (frame.direction, frame.id) == (direction, identifier)]

    def event(self, name, after=-1):
        """The first event of this name after a sample."""
        return next(event for event in self.topics["/events"] if event.name == name and event.step > after)


def sums(differences):
    """The values of which these are the differences, modulo 2^64."""
    return [value % 2**64 for value in accumulate(differences)]


def unpacked(batch):
    """The frames of a `FrameBatch`."""
    payloads, data = [bytearray() for _ in batch.id], iter(batch.data)
    for identifier in sorted(set(batch.id)):
        rows = [row for row, found in enumerate(batch.id) if found == identifier]
        for place in range(64):
            for row in rows:
                if place < batch.length[row] and not batch.flags[row] & REMOTE:
                    payloads[row].append(next(data))
    timestamps = iter(sums(batch.bus_timestamp_difference_ns))
    columns = (sums(batch.step_difference), sums(batch.time_difference_ns), batch.direction, batch.id, batch.flags)
    for step, time_ns, direction, identifier, flags, payload in zip(*columns, payloads, strict=True):
        timestamp_ns = next(timestamps) if flags & TIMED else None
        yield SimpleNamespace(
            step=step, time_ns=time_ns, bus_timestamp_ns=timestamp_ns, direction=direction, id=identifier, flags=flags,
            extended=bool(flags & EXTENDED), remote=bool(flags & REMOTE), fd=bool(flags & FD), brs=bool(flags & BRS),
            esi=bool(flags & ESI), data=bytes(payload),
        )
    assert not list(data) and not list(timestamps)


def bits(values):
    """Floating-point numbers as the whole numbers that their bits are."""
    return np.ascontiguousarray(values).view(np.uint64)


def with_column(source, target, topic, column, sample, value):
    """A recording rewritten by the package `mcap`, with another value in a column at a sample; returns its path."""
    with Path(source).open("rb") as read, Path(target).open("wb") as written:
        reader, writer = make_reader(read, decoder_factories=[DecoderFactory()]), Writer(written)
        writer.start()
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        ids = {}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            if channel.topic not in ids:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.topic] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_id, channel.metadata
                )
            data = message.data
            if channel.topic == topic and 0 <= sample - decoded.first_step < len(getattr(decoded, column)):
                getattr(decoded, column)[sample - decoded.first_step] = value
                data = decoded.SerializeToString()
            writer.add_message(ids[channel.topic], message.log_time, data, message.publish_time)
        writer.finish()
    return target
