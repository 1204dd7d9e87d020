"""The Python in docs/recording.md does what it says."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF
from processes import RESONARM, run
from pyarrow import parquet
from recordings import SENSORS, Recording

ROOT = Path(__file__).resolve().parents[2]


def examples():
    """The export's example, and that of reading a recording."""
    text = (ROOT / "docs/recording.md").read_text(encoding="utf-8")
    convert, read = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    return convert, read


def test_the_example_makes_parquet_and_mf4_of_the_csv(tmp_path):
    run(RESONARM, "export", ROOT / "recordings/free-sweep.mcap", "--to", "csv", "--out", tmp_path / "free")
    example, _ = examples()
    ended = subprocess.run([sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr
    recording = Recording.whole(ROOT / "recordings/free-sweep.mcap")
    table, measured = parquet.read_table(tmp_path / "free-samples.parquet"), MDF(tmp_path / "free-samples.mf4")
    for name, values in zip(SENSORS, recording.samples.T, strict=True):
        assert (table[name].to_numpy() == values).all()
        signal = measured.get(name)
        assert (signal.samples == values).all()
        assert signal.timestamps == pytest.approx((np.arange(len(values)) - 0.5) * 1e-3, abs=1e-12)


def test_the_example_reads_the_reference_recording():
    _, example = examples()
    ended = subprocess.run([sys.executable, "-c", example], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    found = re.fullmatch(r"(\d+) samples, largest \|α1\| ([0-9.]+) rad\n", ended.stdout)
    assert found, ended.stdout
    assert int(found[1]) == 1001
    assert 0.001 < float(found[2]) < 0.1
