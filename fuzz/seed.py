"""Writes the first inputs of a run into `fuzz/corpus/`: golden frames, scenarios, beginnings of recordings, logs."""

import io
import json
import struct
import zipfile
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CORPUS = ROOT / "fuzz/corpus"
PROFILES = ("classic", "fd")
# The identifiers of the default network, in the order of MessageKind::ALL.
IDENTIFIERS = (*range(0x200, 0x208), 0x701, 0x702, 0x081, 0x082, *range(0x208, 0x20C))
REMOTE, FD, LENGTH_IN_DATA = 2 << 5, 3 << 5, 1 << 7
# The length of a recording that a run with `-max_len=70000` takes.
BEGINNING = 60_000


def entry(text, length):
    """A frame as `cansend` writes it, in the form that `protocol_receive` reads; None if it has no such form."""
    number, rest = text.split("#", 1)
    if len(number) != 3 or int(number, 16) not in IDENTIFIERS:
        return None
    head = IDENTIFIERS.index(int(number, 16))
    if rest.startswith("R"):
        return bytes([head | REMOTE]) + bytes(length)
    head, data = (head | FD, rest[2:]) if rest.startswith("#") else (head, rest)
    data = bytes.fromhex(data)
    if len(data) == length:
        return bytes([head]) + data
    return bytes([head | LENGTH_IN_DATA]) + data if data and data[0] & 63 == len(data) else None


def lengths(cases):
    """The length of each message's frames in a profile."""
    accepted = [step["frame"] for case in cases for step in case["steps"] if step["result"] == "accepted"]
    split = [frame.split("#", 1) for frame in accepted]
    return {number: len(rest[2:] if rest.startswith("#") else rest) // 2 for number, rest in split}


def streams():
    """A file for each case of golden frames: the profile, then the frames that arrive."""
    for first, profile in enumerate(PROFILES):
        cases = json.loads((ROOT / f"firmware-protocol/vectors/{profile}.json").read_text())["cases"]
        length = lengths(cases)
        for number, case in enumerate(cases):
            frames = [step["frame"] for step in case["steps"] if step["result"] != "lost"]
            entries = [entry(frame, length.get(frame.split("#", 1)[0], 8)) for frame in frames]
            yield f"{profile}-{number}", bytes([first]) + b"".join(filter(None, entries))


CANDUMP = b"(1436509052.249713) vcan0 044#2A366C2BBA R\n(1436509052.5) vcan0 202##1" + 24 * b"09" + b" T\n"
ASC = b"""date Sat Sep 30 15:06:13.191 2017
base hex  timestamps absolute
   0.001000 1  201             Rx   d 2 11 22
   0.002000 1  1FFFFFFFx       Tx   r 5
   0.003000 CANFD   1 Rx         202   1 0 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B 0 0 3000
"""


def blf(container):
    """A BLF log of a classical frame and a CAN FD frame, in a container that `container` makes of its objects."""
    classic = struct.pack("<HBBL8s", 1, 0, 8, 0x201, bytes(8))
    fd = struct.pack("<HBBLLBBB5x64s", 1, 1, 9, 0x202, 0, 0, 3, 12, bytes(12))
    objects = b"".join(
        struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 32 + len(body), kind, 2, 0, 0, 1000) + body
        for kind, body in ((1, classic), (100, fd))
    )
    method, content = container(objects)
    head = struct.pack("<4sL8xQQLL32x", b"LOGG", 72, 0, 0, 2, 0)
    base = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(content), 10, method, len(objects))
    return head + base + content


def logs():
    """A log of each format; the first byte is that of the format."""
    yield "candump", b"\0" + CANDUMP
    yield "asc", b"\1" + ASC
    yield "blf", b"\2" + blf(lambda objects: (0, objects))
    yield "blf-deflated", b"\2" + blf(lambda objects: (2, zlib.compress(objects)))


def databases():
    """A payload and a DBC each."""
    for folder in ("firmware-protocol", "examples/own-protocol", "tests/protocol/dbc"):
        for path in sorted(ROOT.glob(f"{folder}/*.dbc")):
            yield path.name, bytes(64) + path.read_bytes()


def wires():
    """Requests of ODrive (state, mode, torque) and of CANopen (start, mode of operation, states with a target)."""

    def frame(number, data):
        return struct.pack("<H8s", number | (8 - len(data)) << 12, data)

    arm = [(0x07, b"\x08\0\0\0"), (0x0B, b"\1\0\0\0\1\0\0\0"), (0x0E, struct.pack("<f", 1.0) + bytes(3) + b"\1")]
    drive = [(0, b"\1\0"), (0x601, bytes.fromhex("2f6060000a000000")), (0x201, b"\x06\0\0\0"), (0x201, b"\x0f\0\x0a\0")]
    for first, frames in ((1, arm), (2, drive)):
        yield str(first), bytes([first]) + b"".join(frame(*entry) for entry in frames)


def fmus():
    """The example's descriptions with an empty library and a resource."""
    for version, folder in ((2, "linux64"), (3, "x86_64-linux")):
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(ROOT / f"examples/fmu/fmi{version}.xml", "modelDescription.xml")
            archive.writestr(f"binaries/{folder}/mass.so", b"")
            archive.writestr("resources/table.txt", b"0 0\n1 1\n")
        yield f"mass{version}", content.getvalue()


def viewers():
    """What a browser and a client of Foxglove send; the first byte says as what."""
    yield "request", b"\0GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    yield "file", b"\0GET /page.js HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://127.0.0.1\r\n\r\n"
    for first in (1, 2):
        yield f"ping-{first}", bytes([first]) + b"\x89\x80\0\0\0\0\x88\x80\0\0\0\0"
        yield f"long-{first}", bytes([first]) + b"\x81\xff\0\0\0\0\0\xff\xff\xff\0\0\0\0"
    yield "order", b'\3{"token":"0","request":"arm"}'
    yield "subscribe", b'\4{"op":"subscribe","subscriptions":[{"id":1,"channelId":0}]}'


def write(target, files):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    written = [(folder / name).write_bytes(content) for name, content in files]
    print(f"{folder}: {len(written)} files")


if __name__ == "__main__":
    write("protocol_receive", streams())
    write("scenario", ((path.name, path.read_bytes()) for path in sorted(ROOT.glob("scenarios/*.toml"))))
    write("can_log", logs())
    write("dbc", databases())
    presets = sorted(ROOT.glob("crates/specification/src/presets/*.toml"))
    write("specification", ((path.name, path.read_bytes()) for path in presets))
    universal = sorted(ROOT.glob("tests/oracles/pyuff/*.uff"))
    write("universal_file", ((path.name, path.read_bytes()[:BEGINNING]) for path in universal))
    write("wire", wires())
    write("fmu", fmus())
    write("live", viewers())
    write("recording", ((path.stem, path.read_bytes()[:BEGINNING]) for path in sorted(ROOT.glob("recordings/*.mcap"))))
