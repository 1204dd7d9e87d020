"""The six structures of the gallery, the whole way: modes, responses, branch, picture, a run on vcan by two processes,
recording, resimulation, identification, comparison."""

import json
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import session

EXAMPLES = Path(__file__).parents[2] / "examples/structures"
WALK = """[control]
law = "phase-walk"
amplitude = {{ exciter_{axis} = {load} }}
from_lag_deg = 60
to_lag_deg = 120
points = 3
"""
STEPPED = """[excitation]
amplitude = {{ exciter_{axis} = {load} }}
profile = {{ waveform = "stepped-sine", {band}, steps = 2, dwell_s = 4.0, settle_s = 3.5 }}
"""
RANDOM = """[excitation]
amplitude = {{ exciter_{axis} = {load} }}
profile = {{ waveform = "random", {band}, duration_s = 8.0, seed = 3 }}
"""
# Of each its drive, a run whose responses lie on the computed branch, and a random force that leaves it linear, with
# the number of modes that are then found. A force that does not move the bolted joint leaves it a spring.
STRUCTURES = {
    "chain": ("tip.y", (WALK, 50, None), (RANDOM, 50, "from_hz = 5, to_hz = 40"), 2),
    "bracket": ("tip.y", (WALK, 2, None), (RANDOM, 2, "from_hz = 20, to_hz = 300"), 2),
    "contact": ("tip.y", (STEPPED, 4, "from_hz = 61.4, to_hz = 62.4"), (RANDOM, 0.5, "from_hz = 40, to_hz = 90"), 1),
    "friction": ("tip.y", (STEPPED, 10, "from_hz = 42, to_hz = 46"), (RANDOM, 0.5, "from_hz = 30, to_hz = 60"), 1),
    "hardening": ("tip.x", (WALK, 0.3, None), (RANDOM, 0.5, "from_hz = 10, to_hz = 60"), 2),
    "plate": ("tip.z", (WALK, 1, None), (RANDOM, 1, "from_hz = 20, to_hz = 200"), 4),
}


# In User-Mode Linux a page that a process gives back and takes again costs more than what is computed on it.
ENVIRONMENT = {**os.environ, "MALLOC_TOP_PAD_": "67108864"}


def resonarm(*arguments):
    program = [os.environ["RESONARM_BIN"], *map(str, arguments)]
    ended = subprocess.run(program, capture_output=True, text=True, timeout=300, env=ENVIRONMENT)
    assert ended.returncode == 0, (arguments, ended.stderr, ended.stdout)
    return json.loads(ended.stdout)


def scenario(folder, name, drive, excitation):
    """The example with another excitation, its files beside it."""
    text, load, band = excitation
    structure = (EXAMPLES / f"{name}.toml").read_text().split("[excitation]")[0]
    structure = re.sub(r'"([\w-]+\.(uff|npy|urdf))"', lambda file: f'"{EXAMPLES / file[1]}"', structure)
    path = folder / f"{name}.toml"
    # Of an exciter at a degree of freedom of its own the load is along x.
    axis = "x" if drive == "tip.z" else drive[-1]
    # The exciter of another process corrects readings for the converter that the scenario states.
    network = '[network]\nplant_converter = "sinc5"\n'
    path.write_text(structure + network + text.format(axis=axis, load=load, band=band))
    return path


def stuck_hz():
    """Natural frequencies of the bolted beam with the joint's spring, from its modal matrices."""
    phi = np.array([[0.9, 0.35], [-0.8, 0.7]])
    between = phi[:, 0] - phi[:, 1]
    stiffness = np.diag((2 * np.pi * np.array([41.0, 187.0])) ** 2) + 4e4 * np.outer(between, between)
    return np.sqrt(np.linalg.eigvalsh(stiffness)) / 2 / np.pi


@pytest.mark.parametrize("name", STRUCTURES)
def test_a_structure_the_whole_way(name, tmp_path):
    drive, loaded, linear, found = STRUCTURES[name]
    of = ["--scenario", scenario(tmp_path, name, drive, loaded), "--json"]
    modes_hz = [mode["frequency_hz"] for mode in resonarm("modes", *of)["modes"]]
    lowest_hz = stuck_hz()[0] if name == "friction" else modes_hz[0]

    band = ["--from-hz", 0.8 * modes_hz[0], "--to-hz", 1.2 * modes_hz[0]]
    response = resonarm("frf", *of, "--drive", drive, *band)
    assert response["configuration"]
    picture = tmp_path / name
    branch = resonarm("continue", *of, "--drive", f"{drive}={loaded[1]}", *band, "--plot", picture)
    assert len(branch["points"]) > 20
    assert picture.with_suffix(".svg").read_text().startswith("<svg")

    run = session(tmp_path, "vcan0", "vcan0", of[1])
    assert run.exciter["outcome"] == "finished", run.exciter
    resimulated = resonarm("resim", run.path, "--json")
    assert resimulated["identical"] is True, resimulated
    score = resonarm("compare", run.path, "--json")["score"]
    assert score["settled_points"] >= 1, score
    assert score["largest_frequency_deviation"] < 1e-5, score
    assert score["largest_amplitude_deviation"] < 1e-3, score

    run.path.unlink()
    random = session(tmp_path, "vcan0", "vcan0", scenario(tmp_path, name, drive, linear))
    identified = resonarm("identify", random.path, "--json")["modes"]
    assert [mode["mode"] for mode in identified] == list(range(1, found + 1)), identified
    assert identified[0]["pole_frequency_hz"] == pytest.approx(lowest_hz, rel=1e-3)
