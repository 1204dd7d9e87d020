"""Holds both profiles to hilspy, a client that knows the protocol by its DBC files alone.

It reads the golden frames from a candump log, decodes them, and checks CRC and counter by its own E2E.
"""

import json
from pathlib import Path

import cantools
import hilspy
import pytest

PROTOCOL = Path(__file__).parents[2] / "firmware-protocol"
FILES = {"classic": "resonarm.dbc", "fd": "resonarm-fd.dbc"}
DEFAULT = (0x200, [1, 2])
BOOT_UP = ("701#00", "702#00")
# Form and content, which the others are about, are no affair of hilspy's.
VERDICTS = {
    "crc": "CrcError",
    "repeated": "Repeated",
    "wrong sequence": "WrongSequence",
    "invalid counter": "WrongSequence",
}


def protection(profile):
    """The E2E protection of each message, from the attributes of the DBC."""
    found, dbc = {}, cantools.database.load_file(PROTOCOL / FILES[profile])
    max_delta_counter = dbc.dbc.attributes["E2EMaxDeltaCounter"].value
    for message in dbc.messages:
        data_id = message.dbc.attributes.get("E2EDataId")
        if data_id is not None:
            form = {"profile": 5, "offset": 0} if message.is_fd else {"profile": 11, "mode": "both"}
            form |= {"data_id": data_id.value, "signals": ["crc", "counter"], "max_delta_counter": max_delta_counter}
            found[message.name] = form
    return found


def cases():
    """The cases at the default identifiers. After a node's boot-up the protocol takes any counter; hilspy doesn't."""
    for profile in FILES:
        for case in json.loads((PROTOCOL / "vectors" / f"{profile}.json").read_text())["cases"]:
            booted = any(step["frame"] in BOOT_UP for step in case["steps"][:-1])
            if (case["base"], case["node_ids"]) == DEFAULT and (not booted or "Heartbeat" in case["name"]):
                yield pytest.param(profile, case["steps"], id=f"{profile}-{case['name']}")


def read(path, profile):
    """hilspy's result for each line of a log: a message, or the error with which it refuses the line."""
    codec = {"e2e": protection(profile), "decode_choices": False}
    with hilspy.open(f"file://{path}?format=candump", f"dbc:{PROTOCOL / FILES[profile]}", **codec) as channel:
        for _ in path.read_text().splitlines():
            try:
                yield channel.recv(timeout=10)
            except hilspy.Error as error:
                yield error


@pytest.mark.parametrize(("profile", "steps"), list(cases()))
def test_a_client_by_the_dbc_sees_the_same(tmp_path, profile, steps):
    path = tmp_path / "golden.log"
    # hilspy takes no remote frames.
    steps = [step for step in steps if "#R" not in step["frame"]]
    arriving = [step for step in steps if step["result"] != "lost"]
    path.write_text("".join(f"({n}.000000) vcan0 {step['frame']}\n" for n, step in enumerate(arriving)))
    before = [None, *steps]
    after_loss = [step for step, last in zip(steps, before) if last and last["result"] == "lost"]
    for step, message in zip(arriving, read(path, profile), strict=True):
        if step["result"] == "ignored":
            assert message.name is None, message
        elif step["result"] == "accepted":
            assert message.name == step["accepted"]["message"]
            read_signals = {name: message[name] for name in step["accepted"]["signals"]}
            assert read_signals == pytest.approx(step["accepted"]["signals"], rel=1e-12, abs=0)
            if "Heartbeat" not in message.name:
                assert message["e2e"] == ("OkSomeLost" if step in after_loss else "Ok"), step
        elif step["reason"] in VERDICTS:
            assert message["e2e"] == VERDICTS[step["reason"]], step
