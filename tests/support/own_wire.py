"""The frames of SPEC.md, sections 1 to 4, written from its text alone: no code of this project is used, nor its DBC but
for the hash of its bytes."""

import math
import socket
import struct
import zlib
from collections import defaultdict
from pathlib import Path

BASE, PLANT_ID, EXCITER_ID = 0x200, 1, 2
PLANT, EXCITER = "plant", "exciter"
# Offset from the base, the low byte of the data id, the sender.
BLOCK = {
    "OperatorCommand": (0, 0x01, EXCITER),
    "ForceCommand": (1, 0x02, EXCITER),
    "TorqueCommand": (2, 0x03, EXCITER),
    "ImpedanceHead": (3, 0x04, PLANT),
    "AccelerometerB": (4, 0x05, PLANT),
    "AccelerometerC": (5, 0x06, PLANT),
    "PlantHello": (6, 0x07, PLANT),
    "ExciterHello": (7, 0x08, EXCITER),
    "Sensors": (8, 0x0B, PLANT),
    "PlantCapabilities": (10, 0x0D, PLANT),
    "ExciterCapabilities": (11, 0x0E, EXCITER),
}
EMERGENCIES = {"PlantEmergency": (PLANT_ID, 0x09, PLANT), "ExciterEmergency": (EXCITER_ID, 0x0A, EXCITER)}
HEARTBEATS = {"PlantHeartbeat": (PLANT_ID, None, PLANT), "ExciterHeartbeat": (EXCITER_ID, None, EXCITER)}
IDS = {
    **{name: BASE + row[0] for name, row in BLOCK.items()},
    **{name: 0x080 + row[0] for name, row in EMERGENCIES.items()},
    **{name: 0x700 + row[0] for name, row in HEARTBEATS.items()},
}
ROWS = {**BLOCK, **EMERGENCIES, **HEARTBEATS}
NAMES = {identifier: name for name, identifier in IDS.items()}
# What follows the protection in a CAN FD frame, whose lengths are these; the other messages are classical frames.
FD = {
    "ForceCommand": ("<xHxxff", 16),
    "TorqueCommand": ("<xHxxff", 16),
    "Sensors": ("<BHxx6f", 32),
    "PlantCapabilities": ("<Bxxxxff", 16),
    "ExciterCapabilities": ("<Bxxxxff", 16),
}
ONLY_CLASSIC = ("ImpedanceHead", "AccelerometerB", "AccelerometerC")
ONLY_FD = ("Sensors", "PlantCapabilities", "ExciterCapabilities")
# Flags that a message has in the high nibble of byte 1.
FLAGS = {"PlantHello": 0x1, "ExciterHello": 0x1, "ImpedanceHead": 0x3, "AccelerometerB": 0x3, "AccelerometerC": 0x3}

# `linux/can/raw.h` and `linux/can/error.h`, of which Python's socket module has only a few.
CAN_RAW_ERR_FILTER, BUS_OFF = 2, 0x040
CLASSIC_FRAME, FD_FRAME = "=IB3x8s", "=IBBxx64s"


def crc8(data_id, data, polynomial=0x1D, start=0x00):
    crc = start
    for byte in [data_id & 0xFF, data_id >> 8, *data[1:8]]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ polynomial if crc & 0x80 else crc << 1) & 0xFF
    return crc


def crc16(data_id, data):
    crc = 0xFFFF
    for byte in [*data[2:], data_id & 0xFF, data_id >> 8]:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


# The check values of section 2.
assert crc8(0x0123, bytes(8)) == 0xCC and crc16(0x1234, bytes(8)) == 0xCA1C


def dbc_hash(fd):
    name = "resonarm-fd.dbc" if fd else "resonarm.dbc"
    return zlib.crc32((Path(__file__).parents[2] / "firmware-protocol" / name).read_bytes()) & 0xFFFFFF


class Wire:
    """One node's end of the bus: frames out with counters and CRC, messages in that passed the checks of section 2."""

    def __init__(self, interface, role, fd, flaw):
        self.role, self.fd, self.flaw = role, fd, flaw
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self.socket.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, BUS_OFF)
        self.socket.bind((interface,))
        self.boot()

    def boot(self):
        """Counters from 0, and none known of the partner's."""
        self.counters, self.last = defaultdict(int), {}

    def data_id(self, name):
        data_id = (0x51 + PLANT_ID) << 8 | ROWS[name][1]
        return data_id ^ 0x0100 if self.flaw == "wrong-data-id" else data_id

    def counter(self, name, n):
        """The counter of the next frame."""
        key = "all" if self.flaw == "one-counter" else name
        counter = self.counters[key]
        self.counters[key] += {"counter-by-2": 2, "counter-by-4": 4}.get(self.flaw, 1)
        return counter % n

    def send(self, name, *values, flags=0):
        """Sends a message: of the values of its signals, or of its bytes."""
        form = FD.get(name) if self.fd else None
        if form:
            body = struct.pack(form[0], *values)
            data = bytearray(2) + bytes([self.counter(name, 256)]) + body
            data[:2] = crc16(self.data_id(name), data).to_bytes(2, "little")
            # With bit rate switch.
            self.socket.send(struct.pack(FD_FRAME, IDS[name], len(data), 1, bytes(data)))
            return
        data = bytearray(values[0])
        if ROWS[name][1] is not None:
            data = bytearray([0, flags << 4 | self.counter(name, 15)]) + data
            polynomial = 0x07 if self.flaw == "wrong-polynomial" else 0x1D
            data[0] = crc8(self.data_id(name), data, polynomial, 0xFF if self.flaw == "wrong-start" else 0x00)
        self.socket.send(struct.pack(CLASSIC_FRAME, IDS[name], len(data), bytes(data)))

    def receive(self, within_s):
        """The next message, as its name, its flags and the bytes after the protection; None if none came."""
        self.socket.settimeout(max(within_s, 1e-6))
        try:
            raw = self.socket.recv(72)
        except (TimeoutError, BlockingIOError):
            return None
        is_fd = len(raw) == 72
        identifier, length = struct.unpack("=IB", raw[:5])
        data = raw[8 : 8 + length]
        if identifier & socket.CAN_ERR_FLAG:
            return ("bus-off", 0, b"")
        if identifier & socket.CAN_RTR_FLAG:
            return ("remote", 0, b"")
        if self.flaw == "any-base" and 0x180 <= identifier < 0x580:
            identifier = BASE | identifier & 0xF
        name = NAMES.get(identifier)
        return ("", 0, b"") if name is None else self.checked(name, data, is_fd) or ("", 0, b"")

    def checked(self, name, data, is_fd):
        """The message in a frame, or None if it is refused."""
        if name in (ONLY_CLASSIC if self.fd else ONLY_FD):
            return None
        form = FD.get(name) if self.fd else None
        length = form[1] if form else 1 if name in HEARTBEATS else 8
        if is_fd != bool(form) or len(data) != length:
            return None
        if name in HEARTBEATS:
            return self.heartbeat(name, data)
        data_id = (0x51 + PLANT_ID) << 8 | ROWS[name][1]
        if form:
            if int.from_bytes(data[:2], "little") != crc16(data_id, data) or not self.in_sequence(name, data[2], 256):
                return None
            values = struct.unpack(form[0], data[3:])
            is_zero = struct.pack(form[0], *values) == data[3:]
            return (name, 0, values) if is_zero and all(math.isfinite(value) for value in values) else None
        counter, flags = data[1] & 0xF, data[1] >> 4
        if data[0] != crc8(data_id, data) or counter == 15 or not self.in_sequence(name, counter, 15):
            return None
        is_known = not flags & ~FLAGS.get(name, 0) and has_meaning(name, data[2:])
        return (name, flags, data[2:]) if is_known else None

    def heartbeat(self, name, data):
        if data[0] not in (0, 4, 5, 127):
            return None
        if data[0] == 0:
            sender = ROWS[name][2]
            self.last = {known: last for known, last in self.last.items() if ROWS[known][2] != sender}
        return (name, 0, data)

    def in_sequence(self, name, counter, n):
        last = self.last.get(name)
        self.last[name] = counter
        return last is None or 1 <= (counter - last) % n <= 4


def has_meaning(name, content):
    """Whether the signals of a classical frame have values of the tables, and the other bits are zero."""
    if name == "OperatorCommand":
        return content[0] in (1, 2, 3) and content[1] in (1, 2) and not any(content[2:])
    if name in ("ForceCommand", "TorqueCommand", *ONLY_CLASSIC):
        return -32768 not in struct.unpack("<hhH", content)[:2]
    if name in EMERGENCIES:
        return 1 <= content[0] | content[1] << 8 <= 14
    return content[4] | content[5] << 8 > 0
