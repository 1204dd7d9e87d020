"""An invalid input has the message of the command line, and the exception that fits."""

import os
import re
import subprocess
from pathlib import Path

import pytest
from conftest import PROGRAM

import resonarm

ROOT = Path(__file__).resolve().parents[2]
TEXT = ROOT / "Cargo.toml"
NONE = ROOT / "none.mcap"
CHAIN = ROOT / "examples/structures/chain.toml"


def in_pythons_words(said):
    """The message without the program's name and clap's introduction, flags as keywords."""
    said = re.sub(r"^(resonarm: |error: invalid value '[^']*' for '[^']*': )", "", said.strip())
    said = said.partition("\n\nFor more information")[0]
    said = re.sub(r"--([a-z0-9-]+) A\b", lambda flag: flag[1].replace("-", "_") + "=A", said)
    return re.sub(r"--([a-z0-9-]+)", lambda flag: flag[1].replace("-", "_"), said)


def chain():
    return resonarm.Chain.from_scenario(CHAIN)


def run(mode="free", **options):
    sections = options.pop("sections", {})
    return resonarm.run(resonarm.Scenario.load(ROOT / "scenarios/bench.toml").replace(**sections), mode, **options)


CASES = [
    ("modes --preset irb", lambda: resonarm.Chain.preset("irb"), ValueError),
    (f"simulate --scenario {CHAIN} --duration-s 0.00033", lambda: chain().simulate(0.00033), ValueError),
    (f"simulate --scenario {CHAIN} --duration-s=-1", lambda: chain().simulate(-1), ValueError),
    (
        f"simulate --scenario {CHAIN} --duration-s 1 --scheme euler",
        lambda: chain().simulate(1, scheme="euler"),
        ValueError,
    ),
    (f"frf --scenario {CHAIN} --drive tip.z", lambda: chain().frf(1.0, drive="tip.z"), ValueError),
    ("run --mode free --rate-hz 0", lambda: run(sections={"simulation": {"rate_hz": 0.0}}), ValueError),
    ("run --mode free --speed=-1", lambda: run(speed=-1.0), ValueError),
    ("run --mode free --patience-s=-1", lambda: run(patience_s=-1.0), ValueError),
    ("run --mode real-time --bus memory --priority 100", lambda: run("real-time", priority=100), ValueError),
    ("run --mode real-time --bus memory --overrun panic", lambda: run("real-time", overrun="panic"), ValueError),
    ("run --bus memory --rt off --core 1", lambda: run("real-time", rt="off", core=1), ValueError),
    ("run --bus memory --rt off --cores-awake", lambda: run("real-time", rt="off", cores_awake=True), ValueError),
    ("run --mode free --bus vcan0", lambda: resonarm.Node("plant", resonarm.Scenario(), "vcan0", "free"), ValueError),
    ("run --bus foo:bar", lambda: resonarm.Node("plant", resonarm.Scenario(), "foo:bar"), ValueError),
    (f"resim {NONE}", lambda: resonarm.Recording(NONE), FileNotFoundError),
    (f"resim {TEXT}", lambda: resonarm.Recording(TEXT), ValueError),
    (f"resim {ROOT}", lambda: resonarm.Recording(ROOT), (ValueError, OSError)),
    (f"modes --scenario {NONE}", lambda: resonarm.Scenario.load(NONE), FileNotFoundError),
    (f"modes --scenario {TEXT}", lambda: resonarm.Scenario.load(TEXT), ValueError),
    (f"run --mode free --scenario scenarios/bench.toml --record {TEXT}", lambda: run(record=TEXT), FileExistsError),
    ("protocol dbc --base 0x205", lambda: resonarm.Network(base=0x205), ValueError),
    ("protocol dbc --plant-id 0", lambda: resonarm.Network(plant_id=0), ValueError),
]


@pytest.mark.parametrize(("words", "call", "kind"), CASES, ids=[re.sub(r"/\S+/", "", words) for words, _, _ in CASES])
def test_messages_are_those_of_the_program(words, call, kind):
    environment = {**os.environ, "NO_COLOR": "1"}
    program = subprocess.run(
        [PROGRAM, *words.split()], capture_output=True, text=True, timeout=60, check=False, cwd=ROOT, env=environment
    )
    assert program.returncode in (2, 3), program.stderr
    said = in_pythons_words(program.stderr)
    with pytest.raises(kind) as raised:
        call()
    own = in_pythons_words(str(raised.value))
    # Either may say more: the program the place along a walk, the package the other known names.
    assert own in said or said in own, (own, said)
