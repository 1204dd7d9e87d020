"""The FMUs of the tests: one a scenario, made once."""

import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

from fmus import Fmu, export, stripped
from processes import RESONARM
from recordings import Recording

# The force is the same for ten samples at a time, so that steps of 10 ms can set it.
STEPS = """
[structure]
preset = "irb1600-fitted"
angles_deg = [30.0, 60.0]
[simulation]
rate_hz = 1000.0
seed = 7
[rig]
converter = "sinc5"
[rig.sensors.b]
lowpass_hz = 400.0
delay_samples = 2
[excitation]
amplitude = { exciter_x = 60.0 }
profile = { waveform = "file", path = "steps.csv" }
"""
SAMPLES = 600


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    return stripped(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="session")
def make(library, tmp_path_factory):
    """Exports a scenario file, and unpacks the FMU."""

    def make(scenario, *flags, name="plant"):
        folder = tmp_path_factory.mktemp(name)
        done = export(library, scenario, folder / f"{name}.fmu", *flags)
        assert done.returncode == 0, done.stderr
        return Fmu(folder / f"{name}.fmu", folder / "unpacked")

    return make


@pytest.fixture(scope="session")
def arm(make, tmp_path_factory):
    """The arm's FMU, and the native run of its scenario."""
    folder = tmp_path_factory.mktemp("native")
    blocks = [[(7 * block) % 13 - 6] * 10 for block in range(SAMPLES // 10)]
    (folder / "steps.csv").write_text("\n".join(str(load) for block in blocks for load in block))
    (folder / "steps.toml").write_text(STEPS)
    fmu = make(folder / "steps.toml")
    return SimpleNamespace(fmu=fmu, native=free_run(folder / "steps.toml", folder / "native.mcap"))


def free_run(scenario, path):
    words = [RESONARM, "run", "--mode", "free", "--scenario", scenario, "--record", path]
    subprocess.run([str(word) for word in words], check=True, capture_output=True)
    return Recording.whole(path)


@pytest.fixture(scope="session")
def structures():
    return Path("examples/structures")
