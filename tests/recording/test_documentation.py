"""The Python examples in docs/recording.md."""

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
    """The examples: of the export, of states, of frames."""
    text = (ROOT / "docs/recording.md").read_text(encoding="utf-8")
    convert, states, frames = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    return convert, states, frames


def printed(example):
    """The output of an example run in the project's folder."""
    ended = subprocess.run([sys.executable, "-c", example], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_the_example_makes_parquet_and_mf4_of_the_csv(tmp_path):
    run(RESONARM, "export", ROOT / "recordings/free-sweep.mcap", "--to", "csv", "--out", tmp_path / "free")
    example, _, _ = examples()
    ended = subprocess.run([sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr
    recording = Recording.whole(ROOT / "recordings/free-sweep.mcap")
    table, measured = parquet.read_table(tmp_path / "free-samples.parquet"), MDF(tmp_path / "free-samples.mf4")
    for name, values in zip(SENSORS, recording.samples.T, strict=True):
        assert (table[name].to_numpy() == values).all()
        signal = measured.get(name)
        assert (signal.samples == values).all()
        assert signal.timestamps == pytest.approx((np.arange(len(values)) - 2.5) * 1e-3, abs=1e-12)


def test_the_example_reads_the_states():
    _, example, _ = examples()
    found = re.fullmatch(r"(\d+) samples, largest \|α1\| ([0-9.]+) rad\n", printed(example))
    assert int(found[1]) == 1001
    assert 0.001 < float(found[2]) < 0.1


def test_the_example_reads_the_frames():
    _, _, example = examples()
    found = re.findall(r"(\d+) frames (0x[0-9a-f]+)", printed(example))
    counts = {identifier: int(count) for count, identifier in found}
    assert counts["0x203"] == counts["0x204"] == counts["0x205"] == 1001 and counts["0x201"] == 1000
