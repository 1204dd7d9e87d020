"""The codec compared with hilspy, cantools and the AUTOSAR E2E library, which know the protocol by its DBC."""

import json
import subprocess

import can
import cantools
import hilspy
import pytest
from conftest import PROGRAM
from e2e.p05 import e2e_p05_check
from e2e.p11 import e2e_p11_check

import resonarm

NETWORK = {"base": 0x340, "plant_id": 5, "exciter_id": 9}
PROFILES = ["classic", "fd"]
DBC = {
    profile: cantools.database.load_string(resonarm.Network(**NETWORK, profile=profile).dbc()) for profile in PROFILES
}
MESSAGES = [(profile, message.name) for profile in PROFILES for message in DBC[profile].messages]
PROTECTED = [
    (profile, message.name)
    for profile in PROFILES
    for message in DBC[profile].messages
    if "E2EDataId" in message.dbc.attributes
]
OF_THE_PROTECTION = {"crc", "counter"}
MOST_LOST = 4
IDENTIFIERS = [*sorted({message.frame_id for profile in PROFILES for message in DBC[profile].messages}), 0x123]
"""Those of every message of both profiles, and one of nobody."""


def network(profile):
    return resonarm.Network(**NETWORK, profile=profile)


def signals(profile, name, k):
    """Values that the wire carries exactly, different for each k."""
    found = {}
    for index, signal in enumerate(DBC[profile].get_message_by_name(name).signals):
        if signal.name in OF_THE_PROTECTION:
            continue
        if signal.choices and len(signal.choices) > 1:
            choices = sorted(signal.choices)
            found[signal.name] = choices[k % len(choices)]
        elif signal.is_float:
            found[signal.name] = 12.5 + 0.25 * index + k
        else:
            steps = (signal.maximum - signal.minimum) / signal.scale
            found[signal.name] = signal.minimum + round((0.2 + 0.03 * index + 0.01 * k) * steps) * signal.scale
    return found


def protection(profile):
    """The E2E protection of each message, from the attributes of the DBC."""
    found = {}
    for message in DBC[profile].messages:
        if data_id := message.dbc.attributes.get("E2EDataId"):
            form = {"profile": 5, "offset": 0} if message.is_fd else {"profile": 11, "mode": "both"}
            more = {"signals": ["crc", "counter"], "max_delta_counter": MOST_LOST}
            found[message.name] = form | {"data_id": data_id.value} | more
    return found


@pytest.fixture
def channel(tmp_path):
    """Opens a candump log in hilspy with the DBC that the package writes."""

    def opened(profile, log, how=""):
        path = tmp_path / "network.dbc"
        path.write_text(network(profile).dbc())
        options = {"e2e": protection(profile), "decode_choices": False}
        return hilspy.open(f"file://{log}?format=candump{how}", f"dbc:{path}", **options)

    return opened


def candump(frames):
    def line(k, frame):
        flags = f"##{4 + frame.bitrate_switch:X}" if frame.fd else "#"
        return f"({k}.000000) vcan0 {frame.identifier:03X}{flags}{frame.data.hex().upper()}\n"

    return "".join(line(k, frame) for k, frame in enumerate(frames))


@pytest.mark.parametrize("profile", PROFILES)
def test_the_dbc_says_how_many_may_be_lost(profile):
    assert DBC[profile].dbc.attributes["E2EMaxDeltaCounter"].value == MOST_LOST


@pytest.mark.parametrize(("profile", "name"), MESSAGES)
def test_every_message_is_read_by_all(profile, name, channel, tmp_path):
    encoder, decoder = resonarm.Encoder(network(profile)), resonarm.Decoder(network(profile))
    message = DBC[profile].get_message_by_name(name)
    expected = [signals(profile, name, k) for k in range(20)]
    frames = [encoder.encode(name, **values) for values in expected]
    log = tmp_path / "frames.log"
    log.write_text(candump(frames))
    data_id = message.dbc.attributes.get("E2EDataId")
    with channel(profile, log) as client:
        for frame, values in zip(frames, expected, strict=True):
            ours, theirs = decoder.decode(frame), client.recv(timeout=10)
            assert (ours.verdict, ours.message, theirs.name) == ("taken", name, name)
            read = message.decode(frame.data, decode_choices=False)
            assert {signal: read[signal] for signal in values} == pytest.approx(values, rel=1e-12)
            assert {signal: theirs[signal] for signal in values} == pytest.approx(values, rel=1e-12)
            assert ours.signals == pytest.approx(values, rel=1e-12)
            assert (frame.identifier, frame.fd) == (message.frame_id, message.is_fd)
            if data_id is not None:
                assert theirs["e2e"] == "Ok"
                check = e2e_p05_check if message.is_fd else e2e_p11_check
                assert check(bytearray(frame.data), data_id.value)


@pytest.mark.parametrize(("profile", "name"), PROTECTED)
def test_faults_have_the_same_verdict(profile, name, channel, tmp_path):
    encoder, decoder = resonarm.Encoder(network(profile)), resonarm.Decoder(network(profile))
    made = [encoder.encode(name, **signals(profile, name, 1)) for _ in range(40)]
    broken = made[3]._replace(data=made[3].data[:-1] + bytes([made[3].data[-1] ^ 0x10]))
    # The frames that arrive, and the verdicts: good, the same again, corrupt, one lost, as many as allowed, too many.
    arriving = [
        (made[0], "taken", "Ok"),
        (made[1], "taken", "Ok"),
        (made[1], "repeated", "Repeated"),
        (made[2], "taken", "Ok"),
        (broken, "CRC", "CrcError"),
        (made[4], "taken", "OkSomeLost"),
        (made[5], "taken", "Ok"),
        (made[5 + MOST_LOST], "taken", "OkSomeLost"),
        (made[5 + 2 * MOST_LOST + 1], "counter", "WrongSequence"),
    ]
    log = tmp_path / "frames.log"
    log.write_text(candump(frame for frame, _ours, _theirs in arriving))
    lost = 0
    with channel(profile, log) as client:
        for place, (frame, ours, theirs) in enumerate(arriving):
            decoded = decoder.decode(frame)
            assert client.recv(timeout=10)["e2e"] == theirs, place
            if ours == "taken":
                assert (decoded.verdict, decoded.message) == ("taken", name), place
                assert (decoder.lost > lost) == (theirs == "OkSomeLost"), place
                lost = decoder.lost
            else:
                assert decoded.verdict == "refused", place
                assert ours in decoded.reason, decoded.reason


@pytest.mark.parametrize(("profile", "name"), PROTECTED)
def test_frames_of_another_encoder_are_taken(profile, name, channel, tmp_path):
    log = tmp_path / "theirs.log"
    expected = [signals(profile, name, k) for k in range(20)]
    with channel(profile, log, "&write") as client:
        for values in expected:
            client.send(name, values)
    decoder = resonarm.Decoder(network(profile))
    for line, values in zip(log.read_text().splitlines(), expected, strict=True):
        identifier, _, data = line.split()[2].partition("#")
        is_fd = data.startswith("#")
        payload = bytes.fromhex(data[2:] if is_fd else data)
        frame = resonarm.Frame(int(identifier, 16), False, payload, is_fd, is_fd)
        decoded = decoder.decode(frame)
        assert (decoded.verdict, decoded.message) == ("taken", name), decoded
        assert decoded.signals == pytest.approx(values, rel=1e-12)
    assert decoder.lost == 0


@pytest.mark.parametrize("profile", PROFILES)
def test_a_remote_frame_has_the_verdict_of_the_program(profile):
    """At any moment, and the frames of data about it are judged as without it."""
    encoder, decoder = resonarm.Encoder(network(profile)), resonarm.Decoder(network(profile))
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in (NETWORK | {"profile": profile}).items()]
    asked = [(identifier, False) for identifier in IDENTIFIERS] + [(0x344, True)]
    words = [f"{identifier:0{8 if extended else 3}X}#R8" for identifier, extended in asked]
    program = [PROGRAM, "protocol", "decode", "--json", *flags, *words]
    said = json.loads(subprocess.run(program, capture_output=True, timeout=60, check=False).stdout)["frames"]
    for (identifier, extended), theirs in zip(asked, said, strict=True):
        assert decoder.decode(encoder.encode("PlantHello", **signals(profile, "PlantHello", 1))).verdict == "taken"
        ours = decoder.decode(
            can.Message(arbitration_id=identifier, is_extended_id=extended, is_remote_frame=True, dlc=8)
        )
        expected = theirs["verdict"], theirs.get("message", ""), theirs.get("reason", "")
        assert (ours.verdict, ours.message, ours.reason) == expected
        assert (ours.sender != "") == (ours.message != "") and ours.signals == {}
    assert {frame["verdict"] for frame in said} == {"refused", "foreign"} and decoder.lost == 0
    assert {frame.get("reason", "").partition(" rejected: ")[2] for frame in said} == {
        "",
        "expected a data frame, got a remote frame",
        "the network's profile has no such message",
    }


@pytest.mark.parametrize("identifier", [0x701, 0x204, 0x020])
def test_an_error_frame_is_foreign(identifier):
    """Its identifier is the error classes of the controller, its data may look like a message."""
    decoder = resonarm.Decoder()
    message = can.Message(arbitration_id=identifier, is_error_frame=True, is_extended_id=False, data=bytes([5]))
    reason = "an error frame is a report of the local CAN controller, and was never on the bus"
    assert decoder.decode(message) == resonarm.Decoded("foreign", reason=reason)
    assert decoder.lost == 0


@pytest.mark.parametrize("kind", ["remote", "error"])
def test_a_frame_of_data_is_made_of_nothing_else(kind):
    message = can.Message(arbitration_id=0x701, is_extended_id=False, **{f"is_{kind}_frame": True})
    with pytest.raises(
        ValueError, match=f"the message is an? {kind} frame, of identifier 0x701: it must be a data frame"
    ):
        resonarm.Frame.of(message)
