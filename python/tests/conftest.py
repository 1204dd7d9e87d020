"""Fixtures that the tests share."""

import json
import os
import subprocess
from pathlib import Path

import pytest

import resonarm

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("RESONARM_BIN", ROOT / "target/release/resonarm")


@pytest.fixture(scope="session")
def command():
    """Runs the program with `--json` and returns its document; or its messages, where another exit code than 0 is
    expected."""

    def run(*words, code=0):
        done = subprocess.run(
            [PROGRAM, *map(str, words), "--json"], capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == code, done.stderr
        return json.loads(done.stdout) if code == 0 else done.stderr

    return run


@pytest.fixture(scope="session")
def bench_scenario():
    """The bench of `scenarios/bench.toml`, for a second."""
    return resonarm.Scenario.load(ROOT / "scenarios/bench.toml", simulation={"duration_s": 1.0})
