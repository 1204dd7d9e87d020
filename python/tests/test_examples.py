"""The examples: the suite, which `tests/vcan/test_python.py` runs on vcan with the controller in C; the notebook."""

import subprocess
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[2]


def test_the_example_suite_passes_in_memory():
    words = [sys.executable, "-m", "pytest", "-q", "-rs", "--resonarm-bus", "memory", ROOT / "python/examples"]
    said = subprocess.run(words, capture_output=True, text=True, timeout=600, cwd=ROOT, check=False)
    assert said.returncode == 0, said.stdout
    assert "6 passed, 3 skipped" in said.stdout


def test_the_notebook_runs_and_its_benches_agree_with_their_branches():
    notebook = nbformat.read(ROOT / "python/examples/paper.ipynb", as_version=4)
    where = {"metadata": {"path": ROOT / "python/examples"}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=where).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 3
