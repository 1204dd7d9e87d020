"""An FMU as the structure, in plants and runs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import resonarm

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/fmu"


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")
    subprocess.run([sys.executable, EXAMPLE / "make.py", folder / "mass.fmu"], check=True)
    (folder / "mass.toml").write_text((EXAMPLE / "mass.toml").read_text())
    return resonarm.Scenario.load(folder / "mass.toml", simulation={"duration_s": 0.3})


def test_a_run_of_an_fmu_is_that_of_its_plant(scenario, command, tmp_path):
    resonarm.run(scenario, "free", record=tmp_path / "run.mcap")
    recording = resonarm.Recording(tmp_path / "run.mcap")
    fmu = scenario.values()["structure"]["file"]
    assert command("resim", tmp_path / "run.mcap", "--fmu", fmu)["identical"]
    assert recording.resim(fmu=fmu)["identical"]
    with pytest.raises(resonarm.ResonarmError, match="it is not loaded from the path in the recording"):
        recording.resim()
    assert "file" not in recording.scenario.values()["structure"]
    rows = resonarm.Plant(scenario).play(force_n=recording.states["force_n"][:-1])
    assert abs(rows["x_m"]).max() > 1e-5
    assert np.array_equal(rows["x_m"], recording.states["x_m"][:-1])
    assert np.array_equal(rows["acceleration_c_m_s2"], recording.samples["acceleration_c_m_s2"][: len(rows)])


def test_what_an_fmu_does_not_have_is_refused_in_words(scenario):
    assert repr(scenario) == "<Scenario of an FMU: excitation, 1000 Hz, 0.3 s>"
    with pytest.raises(ValueError, match="an FMU does not show its equations"):
        _ = scenario.structure
    with pytest.raises(ValueError, match="whose steps can take any time"):
        resonarm.run(scenario, "real-time")
