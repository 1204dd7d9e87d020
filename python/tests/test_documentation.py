"""Every block of Python in the documents runs."""

import re
from pathlib import Path

import matplotlib
import pytest

ROOT = Path(__file__).resolve().parents[2]
BLOCKS = [
    (f"{path.name}-{number}", block)
    for path in (ROOT / "docs/python.md", ROOT / "python/README.md")
    for number, block in enumerate(re.findall(r"^```python\n(.*?)^```$", path.read_text(), re.S | re.M), 1)
]


@pytest.mark.parametrize("block", [block for _, block in BLOCKS], ids=[name for name, _ in BLOCKS])
def test_every_block_runs(block, tmp_path, monkeypatch):
    matplotlib.use("Agg")
    for folder in ("scenarios", "recordings", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    exec(block, {})


def test_there_are_blocks():
    assert len(BLOCKS) >= 8
