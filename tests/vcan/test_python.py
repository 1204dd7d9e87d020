"""The example suite of the Python package on vcan: the emulated controller, one in Python, the one in C."""

import os
import subprocess
import sys
from pathlib import Path

from test_c_controller import CONTROLLER

ROOT = Path(__file__).resolve().parents[2]


def test_the_example_suite_passes_with_all_three_controllers():
    words = [sys.executable, "-m", "pytest", "-q", "--resonarm-bus", "vcan0", ROOT / "python/examples"]
    environment = os.environ | {"RESONARM_C_CONTROLLER": str(Path(CONTROLLER).resolve())}
    said = subprocess.run(words, capture_output=True, text=True, timeout=600, env=environment, check=False)
    assert said.returncode == 0, said.stdout
    assert "9 passed" in said.stdout


SUITE = """
import pytest
import resonarm

@pytest.mark.scenario(network={{"lockstep_timeout_s": 30.0}})
def test_a_test_brings_its_parts_itself(bench, plant, bus, controller_process):
    assert bench.bus == bus.channel == "vcan0"
    process = controller_process(*{words}.split())
    decoder, verdicts = resonarm.Decoder(), set()
    while process.is_running:
        if message := bus.recv(0.1):
            verdicts.add(decoder.decode(message).verdict)
    # Simulated time goes faster than this loop may: the kernel then drops frames, and the counters have gaps.
    assert "taken" in verdicts and "foreign" not in verdicts, verdicts
    assert process.wait() == 0, process.output
    result = bench.result(plant)
    result.assert_no_refused_command()
    result.assert_force_below(3.0)

def test_a_failure_shows_what_the_program_wrote(plant, controller_process):
    assert controller_process("sh", "-c", "echo on {{bus}}; exit 3").wait() == 0
"""


def test_a_process_on_the_bus_of_a_test(tmp_path):
    held = "--frequencies-hz 14 --amplitude-n 2 --ramp-s 0.3 --settle-s 0.3 --window-s 0.5"
    words = f"{Path(CONTROLLER).resolve()} {{bus}} --lockstep {held}"
    (tmp_path / "test_suite.py").write_text(SUITE.format(words=repr(words)))
    options = ["-q", "-p", "no:cacheprovider", "--resonarm-bus", "vcan0"]
    command = [sys.executable, "-m", "pytest", *options, "test_suite.py"]
    said = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=tmp_path, check=False)
    assert "1 failed, 1 passed" in said.stdout, said.stdout
    assert "on vcan0" in said.stdout[said.stdout.index("resonarm controller") :]
