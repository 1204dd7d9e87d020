"""MCAP files taken apart into records and put together again, as other writers or damage leave them."""

import struct
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)


def records(data):
    """The records of a file: opcode and body."""
    found, place = [], len(MAGIC)
    while place < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, place)
        found.append((opcode, data[place + 9 : place + 9 + length]))
        place += 9 + length
    return found


def file_of(found):
    """The file of these records, with every checksum right; its footer states the summary as it is."""
    data = bytearray(MAGIC)
    summary = offsets = None
    for opcode, body in found:
        if opcode == DATA_END:
            body = struct.pack("<I", zlib.crc32(data))
        if opcode == FOOTER:
            start = len(data)
            body = struct.pack("<QQ", summary or 0, offsets or 0)
            checksum = zlib.crc32(data[summary or start :] + struct.pack("<BQ", FOOTER, 20) + body)
            body += struct.pack("<I", checksum)
        if opcode == SUMMARY_OFFSET and offsets is None:
            offsets = len(data)
        data += struct.pack("<BQ", opcode, len(body)) + body
        if opcode == DATA_END:
            summary = len(data)
    return bytes(data + MAGIC)


def without_index(found):
    """The records without those that name others by their place, which are wrong once a record has moved."""
    index = (MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT_INDEX, METADATA_INDEX, SUMMARY_OFFSET, STATISTICS)
    return [record for record in found if record[0] not in index]


def chunks(found):
    """The places of the chunks among the records."""
    return [place for place, (opcode, _) in enumerate(found) if opcode == CHUNK]
