"""The example suite, in memory; `tests/vcan/test_python.py` runs it on vcan with the controller in C."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_example_suite_passes_in_memory():
    words = [sys.executable, "-m", "pytest", "-q", "-rs", "--resonarm-bus", "memory", ROOT / "python/examples"]
    said = subprocess.run(words, capture_output=True, text=True, timeout=600, cwd=ROOT, check=False)
    assert said.returncode == 0, said.stdout
    assert "6 passed, 3 skipped" in said.stdout
