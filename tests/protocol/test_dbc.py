"""Holds the protocol to tools that know nothing of its code: cantools reads the DBC files, autosar-e2e computes the
CRCs.

A receiver and a sender are built from the two, and must do what the golden frames say.
"""

import json
import math
import re
import struct
import zlib
from pathlib import Path

import cantools
import pytest
from e2e.p05 import e2e_p05_check, e2e_p05_protect
from e2e.p11 import e2e_p11_check, e2e_p11_protect

PROTOCOL = Path(__file__).parents[2] / "firmware-protocol"
FILES = {"classic": "resonarm.dbc", "fd": "resonarm-fd.dbc"}
DBC = {profile: cantools.database.load_file(PROTOCOL / name, strict=True) for profile, name in FILES.items()}
VECTORS = {profile: json.loads((PROTOCOL / "vectors" / f"{profile}.json").read_text()) for profile in FILES}
PROTECTION = {"crc", "counter"}
SINGLE_MAX = struct.unpack("<f", bytes.fromhex("ffff7f7f"))[0]


def single(value):
    """The single nearest to a number, infinite beyond the range."""
    try:
        return struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)


def parse(text):
    """A frame as cansend writes it: identifier, is it 11 bits, format, data."""
    number, rest = text.split("#", 1)
    standard = len(number) == 3
    if rest.startswith("#"):
        return int(number, 16), standard, "fd", bytes.fromhex(rest[2:])
    if rest.startswith("R"):
        return int(number, 16), standard, "remote", b""
    return int(number, 16), standard, "classic", bytes.fromhex(rest)


class Network:
    """A profile's messages at a base and with node ids: identifiers and data ids by the rules of SPEC.md, section 1."""

    def __init__(self, profile, base, node_ids):
        self.profile, self.base = profile, base
        self.node_ids = dict(zip(["Plant", "Exciter"], node_ids))
        self.messages = DBC[profile].messages

    def identifier(self, message):
        for start in (0x080, 0x700):
            if start < message.frame_id < start + 0x80:
                return start + self.node_ids[message.senders[0]]
        return message.frame_id - 0x200 + self.base

    def message(self, identifier):
        return next((message for message in self.messages if self.identifier(message) == identifier), None)

    def is_of_other_profile(self, identifier):
        ids = {self.identifier(message) for message in DBC["fd" if self.profile == "classic" else "classic"].messages}
        return identifier in ids and self.message(identifier) is None

    def data_id(self, message):
        """The E2E data id, or None for a message without protection."""
        attribute = message.dbc.attributes.get("E2EDataId")
        return None if attribute is None else attribute.value & 0xFF | 0x51 + self.node_ids["Plant"] << 8

    def protect(self, message, data):
        if message.is_fd:
            e2e_p05_protect(data, self.data_id(message), increment_counter=False)
        else:
            e2e_p11_protect(data, self.data_id(message), increment_counter=False)

    def is_protected_well(self, message, data):
        """Whether the CRC is right, by protecting the content again and by the library's own check."""
        again = bytearray(data)
        self.protect(message, again)
        start = 2 if message.is_fd else 1
        assert again[start:] == data[start:]
        right = bytes(again) == data
        if message.is_fd:
            assert e2e_p05_check(bytearray(data), self.data_id(message)) == right
        elif data[1] & 0xF != 15:
            assert e2e_p11_check(bytearray(data), self.data_id(message)) == right
        return right


def content_fault(message, data):
    """Why the content is refused, if it is."""
    word = int.from_bytes(data, "little")
    for signal in message.signals:
        word &= ~(((1 << signal.length) - 1) << signal.start)
    if word:
        return "reserved"
    raw = message.decode(data, decode_choices=False, scaling=False)
    for signal in message.signals:
        value = raw[signal.name]
        if signal.is_float:
            if not math.isfinite(value):
                return "not finite"
            if value < signal.minimum:
                return "negative"
            continue
        if signal.is_signed and value == -32768:
            return "not available"
        named = signal.choices and not signal.is_signed
        low, high = round(signal.minimum / signal.scale), round(signal.maximum / signal.scale)
        if (named and value not in signal.choices) or not low <= value <= high:
            return "unknown value"
    return None


class Receiver:
    """The checks of SPEC.md, in their order."""

    def __init__(self, network):
        self.network, self.last, self.lost = network, {}, 0

    def sequence_fault(self, message, counter):
        counters = 256 if message.is_fd else 15
        if counter >= counters:
            return "invalid counter"
        last, self.last[message.name] = self.last.get(message.name), counter
        step = 1 if last is None else (counter - last) % counters
        if step == 0:
            return "repeated"
        if step > DBC[self.network.profile].dbc.attributes["E2EMaxDeltaCounter"].value:
            return "wrong sequence"
        self.lost += step - 1
        return None

    def fault(self, message, form, data):
        if form != ("fd" if message.is_fd else "classic"):
            return "format"
        if len(data) != message.length:
            return "length"
        if self.network.data_id(message) is not None:
            if not self.network.is_protected_well(message, data):
                return "crc"
            if fault := self.sequence_fault(message, data[2] if message.is_fd else data[1] & 0xF):
                return fault
        return content_fault(message, data)

    def accept(self, text):
        """The outcome of a frame, as the vectors write it."""
        identifier, standard, form, data = parse(text)
        if standard and self.network.is_of_other_profile(identifier):
            return {"result": "refused", "reason": "other profile"}
        message = self.network.message(identifier) if standard else None
        if message is None:
            return {"result": "ignored"}
        if fault := self.fault(message, form, data):
            return {"result": "refused", "reason": fault}
        signals = message.decode(data, decode_choices=False)
        if signals.get("state") == 0:
            senders = {other.name for other in self.network.messages if other.senders == message.senders}
            self.last = {name: counter for name, counter in self.last.items() if name not in senders}
        signals = {name: pytest.approx(value, rel=1e-12) for name, value in signals.items() if name not in PROTECTION}
        return {"result": "accepted", "accepted": {"message": message.name, "signals": signals}}


def counted(signal, value):
    """The count of a value, and whether it is beyond the range."""
    count = round(value * round(1 / signal.scale))
    return (int(math.copysign(32767, count)), True) if abs(count) > 32767 else (int(count), False)


def rounded(signal, value):
    """The single of a value, and whether it is beyond the range."""
    near = single(value)
    return (math.copysign(SINGLE_MAX, value), True) if math.isinf(near) else (near, False)


def encode(network, name, signals, counter):
    """The identifier and the bytes of a message; None if it can't be sent."""
    message = next((message for message in network.messages if message.name == name), None)
    if message is None:
        return None
    raw = dict(signals)
    for signal in message.signals:
        if not (signal.is_signed or signal.is_float):
            continue
        value = float(signals[signal.name])
        if not math.isfinite(value) or value < 0 == signal.minimum:
            return None
        raw[signal.name], beyond = (rounded if signal.is_float else counted)(signal, value)
        if beyond:
            flags = [f"{signal.name.rsplit(unit, 1)[0]}_saturated" for unit in ("_n", "_m_s2")]
            flags.append(signal.name.split("_")[1] + "_saturated")
            flag = next((flag for flag in flags if flag in raw), None)
            if flag is None:
                return None
            raw[flag] = 1
    protected = network.data_id(message) is not None
    if protected:
        raw.update(crc=0, counter=counter)
    try:
        data = bytearray(message.encode(raw, scaling=False, strict=True))
    except cantools.database.errors.EncodeError:
        return None
    if protected:
        network.protect(message, data)
    return network.identifier(message), bytes(data)


def cases(key, name):
    return [
        pytest.param(profile, case, id=f"{profile}: {name(case)}")
        for profile, vectors in VECTORS.items()
        for case in vectors[key]
    ]


@pytest.mark.parametrize("profile, case", cases("cases", lambda case: case["name"]))
def test_a_case(profile, case):
    network = Network(profile, case["base"], case["node_ids"])
    receiver, counters = Receiver(network), {}
    for step in case["steps"]:
        if "send" in step:
            name = step["send"]["message"]
            identifier, data = encode(network, name, step["send"]["signals"], counters.get(name, 0))
            is_fd = network.message(identifier).is_fd
            counters[name] = (counters.get(name, 0) + 1) % (256 if is_fd else 15)
            assert parse(step["frame"])[0] == identifier
            assert parse(step["frame"])[3] == data, step["frame"]
        if step["result"] != "lost":
            expected = {key: step[key] for key in ("result", "reason", "accepted") if key in step}
            assert receiver.accept(step["frame"]) == expected, step["frame"]
    assert receiver.lost == case["lost"]


@pytest.mark.parametrize("profile, case", cases("unsendable", lambda case: f"{case['message']} {case['reason']}"))
def test_what_cannot_be_sent(profile, case):
    assert encode(Network(profile, 0x200, [1, 2]), case["message"], case["signals"], 0) is None


@pytest.mark.parametrize("profile", FILES)
def test_every_message_says_its_format_and_its_cycle_time(profile):
    for message in DBC[profile].messages:
        assert not message.is_extended_frame
        assert message.is_fd == (message.length > 8)
        assert message.dbc.attributes["VFrameFormat"].value == (14 if message.is_fd else 0)
        assert "GenMsgCycleTime" in message.dbc.attributes
        assert message.comment and all(signal.comment for signal in message.signals)


def test_the_hellos_of_the_specification_carry_the_hash_of_their_profile_s_dbc():
    dbcs = (PROTOCOL / "resonarm.dbc", PROTOCOL / "resonarm-fd.dbc")
    expected = [f"{zlib.crc32(dbc.read_bytes()) & 0xFFFFFF:06X}" for dbc in dbcs]
    stated = re.findall(r"dbc_hash=0x([0-9A-F]{6}) profile=(\d)", (PROTOCOL / "SPEC.md").read_text())
    assert set(stated) == {(expected[0], "0"), (expected[1], "1")}


def test_the_protections_are_those_of_the_golden_values():
    """Profile 11: both data id modes, eight zero bytes, data id 0x123, as AUTOSAR implementations agree on them.
    Profile 5: the example of its document."""
    data = bytearray(8)
    e2e_p11_protect(data, 0x123, increment_counter=False)
    assert data[:2] == bytes([0xCC, 0x00])
    data = bytearray(8)
    e2e_p05_protect(data, 0x1234, increment_counter=False)
    assert data[:3] == bytes([0x1C, 0xCA, 0x00])
