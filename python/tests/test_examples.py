"""The examples: the suite, which `tests/vcan/test_python.py` runs on vcan with the controller in C; the notebooks."""

import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[2]


def test_the_example_suite_passes_in_memory():
    words = [sys.executable, "-m", "pytest", "-q", "-rs", "--resonarm-bus", "memory", ROOT / "python/examples"]
    said = subprocess.run(words, capture_output=True, text=True, timeout=600, cwd=ROOT, check=False)
    assert said.returncode == 0, said.stdout
    assert "6 passed, 3 skipped" in said.stdout


@pytest.mark.parametrize(("name", "pictures"), [("paper", 3), ("structures", 4)])
def test_the_notebooks_run_and_their_benches_agree_with_their_branches(name, pictures):
    notebook = nbformat.read(ROOT / f"python/examples/{name}.ipynb", as_version=4)
    # A picture of so many states would take most of the time of these tests.
    shrunk = 0
    for cell in notebook.cells:
        shrunk += cell.source.count("points=(25, 25)")
        cell.source = cell.source.replace("points=(25, 25)", "points=(9, 9)")
    assert shrunk == (name == "structures")
    where = {"metadata": {"path": ROOT / "python/examples"}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=where).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == pictures
