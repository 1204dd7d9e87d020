"""The Python in docs/recording.md does what it says."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_example_reads_the_reference_recording():
    text = (ROOT / "docs/recording.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    run = subprocess.run([sys.executable, "-c", example], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    found = re.fullmatch(r"(\d+) samples, largest \|α1\| ([0-9.]+) rad\n", run.stdout)
    assert found, run.stdout
    assert int(found[1]) == 1001
    assert 0.001 < float(found[2]) < 0.1
