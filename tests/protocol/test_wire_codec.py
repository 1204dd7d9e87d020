"""Holds DBC files, signals and checksums to tools that know nothing of our code: cantools and hilspy decode and encode
the same frames, autosar-e2e computes the same checksums.

The example `dbc_frames` answers all lines of a file in one process. `RESONARM_DBC_FILES` names a folder with more DBC
files; those that cantools refuses are left out.
"""

import functools
import importlib.metadata
import itertools
import json
import math
import operator
import os
import random
import re
import subprocess
from pathlib import Path

import cantools
import hilspy
import pytest
from e2e import crc, p01, p02, p04, p05, p06, p07, p11

ROOT = Path(__file__).parents[2]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
PROGRAM = Path(os.environ.get("RESONARM_DBC_FRAMES", TARGET / "debug/examples/dbc_frames"))
OWN = sorted((Path(__file__).parent / "dbc").glob("*.dbc")) + sorted((ROOT / "firmware-protocol").glob("*.dbc"))
DECODED, ENCODED, HILSPY = 65_000, 44_000, 100_000
F64_BITS = 53
LENGTHS_OF_FD = (*range(9), 12, 16, 20, 24, 32, 48, 64)


def odrive_files():
    """The DBC files of the package odrive-can."""
    try:
        installed = importlib.metadata.files("odrive-can") or []
    except importlib.metadata.PackageNotFoundError:
        installed = []
    return [Path(file.locate()) for file in installed if file.suffix == ".dbc"]


def users_files():
    folder = os.environ.get("RESONARM_DBC_FILES")
    return sorted(Path(folder).rglob("*.dbc")) if folder else []


# hilspy takes all of these.
BUNDLED = [*OWN, *odrive_files()]
FILES = [*BUNDLED, *users_files()]
EACH = 1 / min(len(FILES), 10)


def answers(path, lines):
    """What the program says to each line."""
    said = subprocess.run([PROGRAM, path], input="\n".join(lines), capture_output=True, text=True, check=True)
    found = [json.loads(line) for line in said.stdout.splitlines()]
    assert len(found) == len(lines)
    return found


def load(path):
    try:
        database = cantools.database.load_file(path, strict=path in OWN)
    except Exception as error:  # cantools raises many kinds at files that break rules
        if path in OWN:
            raise
        pytest.skip(f"cantools refuses it: {error}")
    identifiers = [message.frame_id for message in database.messages]
    unique = [message for message in database.messages if identifiers.count(message.frame_id) == 1]
    return [message for message in unique if message.length in LENGTHS_OF_FD]


def text(message, data):
    """Messages of more than 8 bytes are of CAN FD, also without `VFrameFormat`."""
    identifier = f"{message.frame_id:0{8 if message.is_extended_frame else 3}X}"
    return f"{identifier}#{'#1' if message.is_fd or message.length > 8 else ''}{data.hex().upper()}"


def problems(path):
    """The signals and messages that the program takes for wrong: `a of Message`, `Message`."""
    (answer,) = answers(path, ["problems"])
    return {line.split(", ", 1)[1].split(":")[0] for line in answer["problems"]}


def is_usable(message, signal, wrong):
    return f"{signal} of {message.name}" not in wrong


def number(value):
    """Of a value as either writes it; NaN is equal to NaN."""
    value = float(value)
    return "nan" if math.isnan(value) else value


def random_data(rng, message):
    """Random bytes; of a few the payload ends early."""
    length = message.length
    if length and rng.random() < 0.05:
        shorter = [size for size in (*range(9), 12, 16, 20, 24, 32, 48) if size < length]
        length = rng.choice(shorter)
    return rng.randbytes(length)


def decoded(message, data):
    """cantools' values; None where it takes a payload for wrong: one whose switch has no such value."""
    try:
        return message.decode(data, decode_choices=False, allow_truncated=True)
    except cantools.database.DecodeError:
        return None


def cases(rng, messages, count):
    """Messages in turn, with random payloads and their values."""
    for k in range(count):
        message = messages[k % len(messages)]
        data = random_data(rng, message)
        if (values := decoded(message, data)) is not None:
            yield message, data, values


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_frames_decode_as_by_cantools(path):
    messages, wrong, rng = load(path), problems(path), random.Random(1)
    messages = [message for message in messages if message.name not in wrong]
    if not messages:
        pytest.skip("no message without problems")
    compared = list(cases(rng, messages, round(DECODED * EACH)))
    if not compared and path not in OWN:
        pytest.skip("cantools decodes no frame")
    answered = answers(path, ["decode " + text(message, data) for message, data, _ in compared])
    for (message, data, values), ours in zip(compared, answered, strict=True):
        assert ours["message"] == message.name
        names = [signal.name for signal in message.signals]
        values = {name: number(value) for name, value in values.items() if names.count(name) == 1}
        # What is wrong may be readable all the same: signals that share bits, integers of more than 53 bits.
        expected = {
            name: value for name, value in values.items() if name in ours["signals"] or is_usable(message, name, wrong)
        }
        found = {name: number(value) for name, value in ours["signals"].items() if names.count(name) == 1}
        assert found == expected, text(message, data)
    assert path not in OWN or len(compared) > 0.5 * DECODED * EACH


def to_encode(rng, message, values):
    """The values, off by up to 0.4 counts where the range allows; floats finite."""
    changed = {}
    for name, value in values.items():
        signal = message.get_signal_by_name(name)
        if signal.is_float:
            value = value if math.isfinite(value) and abs(value) < 1e30 else rng.uniform(-1e6, 1e6)
        elif not (signal.is_multiplexer or signal.length > F64_BITS - 8):
            raw = round((value - signal.offset) / signal.scale)
            ends = (
                (-(1 << signal.length - 1), (1 << signal.length - 1) - 1)
                if signal.is_signed
                else (0, (1 << signal.length) - 1)
            )
            value += 0.4 * rng.uniform(-1, 1) * signal.scale if raw not in ends else 0
        changed[name] = float(value)
    return changed


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_values_encode_as_by_cantools(path):
    messages, wrong, rng = load(path), problems(path), random.Random(2)
    messages = [
        message
        for message in messages
        if message.name not in wrong and all(is_usable(message, signal.name, wrong) for signal in message.signals)
    ]
    if not messages:
        pytest.skip("no message without problems")
    compared = [
        (message, to_encode(rng, message, values))
        for message, data, values in cases(rng, messages, round(ENCODED * EACH))
        if len(data) == message.length
    ]
    found = answers(path, [f"encode {message.name} {json.dumps(values)}" for message, values in compared])
    for (message, values), ours in zip(compared, found, strict=True):
        expected = text(message, message.encode(values, strict=False))
        assert ours.get("frame") == expected, (message.name, values, ours)


def hilspy_name(ours):
    """hilspy knows no long names of a DBC, of which `SG_` has the first 32 characters or a name of its own."""
    return None if len(ours) > 32 else ours


@pytest.mark.parametrize("path", BUNDLED, ids=lambda path: path.name)
def test_frames_decode_as_by_hilspy(path, tmp_path):
    """hilspy takes no payload that ends early."""
    messages, rng = load(path), random.Random(3)
    count = math.ceil(HILSPY / len(BUNDLED))
    turns = itertools.islice(itertools.cycle(messages), count)
    frames = [text(message, rng.randbytes(message.length)) for message in turns]
    log = tmp_path / "frames.log"
    log.write_text("".join(f"({k}.000000) vcan0 {frame}\n" for k, frame in enumerate(frames)))
    found, seen = answers(path, ["decode " + frame for frame in frames]), 0
    with hilspy.open(f"file://{log}?format=candump", f"dbc:{path}", decode_choices=False) as channel:
        for ours, frame in zip(found, frames, strict=True):
            theirs = channel.recv(timeout=10)
            assert theirs.name == ours["message"]
            names = [name for name in ours["signals"] if hilspy_name(name)]
            assert len(theirs.fields) == len(ours["signals"])
            for name in names:
                value, expected = number(ours["signals"][name]), number(theirs[name])
                # One product's rounding: `1e-12` of the value.
                assert value == expected or abs(value - expected) <= 1e-12 * abs(expected), (frame, name)
            seen += bool(names)
    assert seen > 0.6 * count


def within(signal, value):
    """The value in the range that the DBC states, which hilspy holds values to, and cantools with `strict`."""
    least = -math.inf if signal.minimum is None else signal.minimum
    most = math.inf if signal.maximum is None else signal.maximum
    return min(max(value, least), most)


@pytest.mark.parametrize("path", BUNDLED, ids=lambda path: path.name)
def test_values_encode_as_by_hilspy(path, tmp_path):
    """Values off by up to 0.4 counts, where the range allows."""
    messages, rng = load(path), random.Random(5)
    messages = [message for message in messages if all(hilspy_name(signal.name) for signal in message.signals)]
    count = math.ceil(HILSPY / len(BUNDLED))
    turns = list(itertools.islice(itertools.cycle(messages), count))
    payloads = [text(message, rng.randbytes(message.length)) for message in turns]
    values = []
    for message, answer in zip(turns, answers(path, ["decode " + frame for frame in payloads]), strict=True):
        numbers = {name: number(value) for name, value in answer["signals"].items()}
        numbers = {name: 0.0 if value == "nan" else value for name, value in numbers.items()}
        changed = to_encode(rng, message, numbers)
        signals = {signal.name: signal for signal in message.signals}
        values.append({name: within(signals[name], value) for name, value in changed.items()})
    log = tmp_path / "frames.log"
    with hilspy.open(f"file://{log}?write&format=candump", f"dbc:{path}") as channel:
        for message, given in zip(turns, values, strict=True):
            channel.send(message.name, given)
    # Of CAN FD the digit after `##` has flags of the bit rate, which are not the codec's.
    def payload(frame):
        return re.sub("##.", "##", frame)

    expected = [payload(line.split()[2]) for line in log.read_text().splitlines()]
    lines = [f"encode {message.name} {json.dumps(given)}" for message, given in zip(turns, values, strict=True)]
    ours = [payload(answer["frame"]) for answer in answers(path, lines)]
    assert len(ours) == count
    different = [(line, *pair) for line, *pair in zip(lines, ours, expected, strict=True) if pair[0] != pair[1]]
    assert not different, (len(different), different[:3])


# By preset: the library's function with its options, start bit and bits of the checksum, the least payload.
PROFILES = {
    "autosar-p1": (p01.e2e_p01_protect, {"data_id_mode": p01.E2E_P01_DATAID_BOTH}, 0, 8, 2, 0xFFFF),
    "autosar-p1-alternating": (p01.e2e_p01_protect, {"data_id_mode": p01.E2E_P01_DATAID_ALT}, 0, 8, 2, 0xFFFF),
    "autosar-p1-low": (p01.e2e_p01_protect, {"data_id_mode": p01.E2E_P01_DATAID_LOW}, 0, 8, 2, 0xFF),
    "autosar-p1-nibble": (p01.e2e_p01_protect, {"data_id_mode": p01.E2E_P01_DATAID_NIBBLE}, 0, 8, 2, 0xFFF),
    "autosar-p2": (p02.e2e_p02_protect, {}, 0, 8, 2, None),
    "autosar-p4": (p04.e2e_p04_protect, {}, 71, 32, 12, 0xFFFF_FFFF),
    "autosar-p5": (p05.e2e_p05_protect, {}, 0, 16, 3, 0xFFFF),
    "autosar-p6": (p06.e2e_p06_protect, {}, 7, 16, 5, 0xFFFF),
    "autosar-p7": (p07.e2e_p07_protect, {}, 7, 64, 20, 0xFFFF_FFFF),
    "autosar-p11": (p11.e2e_p11_protect, {"data_id_mode": p11.E2E_P11_DATAID_BOTH}, 0, 8, 2, 0xFFFF),
    "autosar-p11-nibble": (p11.e2e_p11_protect, {"data_id_mode": p11.E2E_P11_DATAID_NIBBLE}, 0, 8, 2, 0xFFF),
}
LENGTHS = (*range(2, 9), 12, 16, 20, 24, 32, 48, 64)


@pytest.mark.parametrize("preset", PROFILES)
def test_checksums_are_those_of_autosar_e2e(preset):
    protect, options, start, bits, least, most = PROFILES[preset]
    rng, lines, expected = random.Random(4), [], []
    for _ in range(1000):
        data = bytearray(rng.randbytes(rng.choice([length for length in LENGTHS if length >= least])))
        if bits == 8:
            # 15 is no counter of profiles 1 and 11.
            data[1] = data[1] & 0xF0 | rng.randrange(16 if preset == "autosar-p2" else 15)
        data_id = rng.randbytes(16) if most is None else rng.randint(0, most)
        offset = 0 if preset == "autosar-p2" or len(data) < least + 8 else rng.choice([0, 8])
        words = ",".join(map(str, data_id)) if most is None else str(data_id)
        lines.append(f"checksum {preset} {start + 8 * offset} {bits} {words} 123##1{data.hex()}")
        shift = {"offset": offset} if offset else {}
        protect(data, data_id, increment_counter=False, **options, **shift)
        expected.append({"frame": f"123##1{data.hex().upper()}"})
    assert answers(OWN[0], lines) == expected


SIMPLE = {
    "crc8-j1850": crc.calculate_crc8,
    "crc8-2f": crc.calculate_crc8_h2f,
    "sum": lambda data: sum(data) & 0xFF,
    "xor": lambda data: functools.reduce(operator.xor, data, 0),
}


@pytest.mark.parametrize("preset", SIMPLE)
def test_checksums_without_a_data_id(preset):
    rng, lines, expected = random.Random(5), [], []
    for _ in range(1000):
        data = bytearray(rng.randbytes(rng.choice(LENGTHS)))
        place = rng.randrange(len(data))
        lines.append(f"checksum {preset} {8 * place} 8 - 123##1{data.hex()}")
        data[place] = SIMPLE[preset](bytes(data[:place] + data[place + 1 :]))
        expected.append({"frame": f"123##1{data.hex().upper()}"})
    assert answers(OWN[0], lines) == expected
