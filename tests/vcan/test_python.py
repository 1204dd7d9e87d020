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
