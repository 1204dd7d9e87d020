"""Maps: known answers, the same bits by threads and by Dask, and resumed after a kill."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from dask.distributed import Client, LocalCluster

import resonarm
from resonarm.maps import basin_map, response_map, seed_map

HZ = np.linspace(21.5, 22.5, 41)
ARM = resonarm.Chain.preset()
TURN = "link2.angle_deg"
GRID = {"frequency_hz": HZ, "drive": "joint1", "amplitude": [0.5, 60.0], "over": {TURN: [50.0, 60.0]}}


@pytest.fixture(scope="module")
def whole():
    return response_map(ARM, **GRID)


def test_the_map_agrees_with_the_branch_and_the_linear_arm(whole):
    folds = ARM.continuation("frequency", 21.5, 22.5, drive={"joint1": 60}).bifurcations
    low, high = sorted(folds["value"])
    here = whole.sel({TURN: 60.0, "amplitude": 60.0})
    # A stable response on either side of the folds, two and an unstable one between them.
    between = (low < HZ) & (high > HZ)
    assert here["stable"].values.tolist() == [2 if inside else 1 for inside in between]
    assert here["unstable"].values.tolist() == [1 if inside else 0 for inside in between]
    assert (here["largest"].values[between] > 1.5 * here["least"].values[between]).all()
    weak = whole.sel({TURN: 60.0, "amplitude": 0.5, "at": "joint1"})["largest"].values
    linear = 0.5 * abs(ARM.frf(HZ, drive="joint1"))
    away = abs(HZ - ARM.modes()[0].frequency_hz) > 0.2
    np.testing.assert_allclose(weak[away], linear[away], rtol=5e-3)


def test_the_map_has_units(whole):
    assert whole["unit"].values.tolist() == ["rad"] and whole["amplitude"].attrs["units"] == "N m"
    assert whole["frequency_hz"].attrs["units"] == "Hz" and whole[TURN].attrs["units"] == "degree"
    assert dict(whole.sizes) == {TURN: 2, "amplitude": 2, "frequency_hz": 41, "at": 1}
    assert not whole["ended_early"].any()


def test_a_cluster_gives_the_same_bits(whole, tmp_path):
    with LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        found = response_map(ARM, folder=tmp_path, client=client, **GRID)
    assert found.identical(whole)
    assert len(list(tmp_path.glob("chunk-*.npz"))) == 4


KILLED = """
import sys
import numpy as np, resonarm
from dask.distributed import Client, LocalCluster
from resonarm.maps import basin_map, response_map, seed_map
if __name__ == "__main__":
    with LocalCluster(1, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        torques = np.linspace(20, 80, 400)
        response_map(resonarm.Chain.preset(), frequency_hz=np.linspace(21.5, 22.5, 41), drive="joint1",
                     amplitude=torques, folder=sys.argv[1], client=client)
"""


def test_a_killed_map_resumes(whole, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(KILLED)
    folder = tmp_path / "chunks"
    words = [sys.executable, str(script), str(folder)]
    with subprocess.Popen(words, start_new_session=True, stderr=subprocess.DEVNULL) as run:
        while run.poll() is None and len(list(folder.glob("chunk-*.npz"))) < 3:
            time.sleep(0.01)
        os.killpg(run.pid, signal.SIGKILL)
    done = {path: path.stat().st_mtime_ns for path in folder.glob("chunk-*.npz")}
    assert 3 <= len(done) < 400
    torques = np.linspace(20, 80, 400)[: len(done) + 5]
    resumed = response_map(ARM, frequency_hz=HZ, drive="joint1", amplitude=torques, folder=folder)
    assert {path: path.stat().st_mtime_ns for path in done} == done, "what was there is not computed again"
    assert resumed.identical(response_map(ARM, frequency_hz=HZ, drive="joint1", amplitude=torques))


DAMPED = ARM.replace({"link1.damping_nm_s_rad": 4.5, "link2.damping_nm_s_rad": 4.5})
BASINS = {
    "frequency_hz": [21.9, 21.98],
    "drive": "joint1",
    "amplitude": [600.0],
    "start": (-0.6, -80),
    "stop": (0.6, 80),
    "points": (18, 15),
    "time_constants": 0.5,
}
BENCH = {"amplitude": {"exciter_x": 80.0}, "ramp_s": 0.1}
STEPS = {"waveform": "stepped-sine", "from_hz": 14.0, "to_hz": 15.0, "steps": 2, "dwell_s": 0.6, "settle_s": 0.2}


@pytest.fixture(scope="module")
def basins():
    return basin_map(DAMPED, **BASINS)


def test_a_map_of_basins_is_those_of_each_place(basins):
    assert dict(basins.sizes) == {
        "amplitude": 1,
        "frequency_hz": 2,
        "alpha1_dot_rad_s": 15,
        "alpha1_rad": 18,
        "stable_motion": 2,
        "coordinate": 2,
    }
    grid = {name: BASINS[name] for name in ("start", "stop", "points", "time_constants")}
    one = DAMPED.basins(21.98, drive={"joint1": 600.0}, **grid)
    here = basins.sel(amplitude=600.0, frequency_hz=21.98)
    np.testing.assert_array_equal(here["motion"], one.motion)
    np.testing.assert_array_equal(here["periods"], one.periods)
    np.testing.assert_array_equal(here["alpha1_rad"], one.x)
    np.testing.assert_array_equal(here["largest"], [motion.largest for motion in one.motions])
    assert here["coordinate"].values.tolist() == ["alpha1_rad", "alpha2_rad"]
    assert here["alpha1_dot_rad_s"].attrs["units"] == "rad s-1"
    assert not basins["ended_early"].any()


def test_a_cluster_gives_the_same_bits_of_basins_and_seeds(basins, tmp_path):
    scenario = resonarm.Scenario().replace(simulation={"duration_s": 2.0}, excitation={**BENCH, "profile": STEPS})
    seeds = seed_map(scenario, [3, 4, 5])
    with LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        assert basin_map(DAMPED, folder=tmp_path, client=client, **BASINS).identical(basins)
        assert seed_map(scenario, [3, 4, 5], client=client).identical(seeds)
    # Two places with their responses and the 270 states of each in two blocks.
    files = sorted(tmp_path.glob("chunk-*.npz"))
    assert len(files) == 6
    for path in files[::2]:
        path.unlink()
    left = {path: path.stat().st_mtime_ns for path in files[1::2]}
    assert basin_map(DAMPED, folder=tmp_path, **BASINS).identical(basins)
    assert {path: path.stat().st_mtime_ns for path in left} == left, "what was there is not computed again"
    files[0].write_bytes(b"not a chunk")
    with pytest.raises(ValueError, match=r"is not a whole chunk of a map .* remove it, so that it is computed again"):
        basin_map(DAMPED, folder=tmp_path, **BASINS)


def test_a_map_of_seeds_is_its_runs():
    scenario = resonarm.Scenario().replace(simulation={"duration_s": 2.0}, excitation={**BENCH, "profile": STEPS})
    found = seed_map(scenario, [3, 4])
    report = resonarm.run(scenario.replace(simulation={"seed": 4}))
    np.testing.assert_array_equal(found["head_force_n"].sel(seed=4), report.responses["head_force_n"])
    assert (found["head_force_n"].sel(seed=4) != found["head_force_n"].sel(seed=3)).all()
    assert found["outcome"].values.tolist() == ["finished", "finished"]
    assert dict(found.sizes) == {"seed": 2, "point": 2, "axis": 2}
    assert found["load"].attrs["units"] == "N"


def test_a_map_goes_over_any_load():
    found = response_map(ARM, frequency_hz=[14.0, 15.0, 16.0], drive="tip.y", amplitude=[0.5], at=["joint2", "tip.x"])
    assert found["amplitude"].attrs["units"] == "N" and found["unit"].values.tolist() == ["rad", "m"]
    for at in ("joint2", "tip.x"):
        linear = 0.5 * abs(ARM.frf([14.0, 15.0, 16.0], drive="tip.y", at=at))
        np.testing.assert_allclose(found["largest"].sel(at=at, amplitude=0.5), linear, rtol=5e-3)
    with pytest.raises(ValueError, match="drive joint3: there is no `joint3`"):
        response_map(ARM, frequency_hz=[1.0, 2.0], drive="joint3", amplitude=[0.5])
    with pytest.raises(ValueError, match=r"link3\.mass_kg"):
        response_map(ARM, frequency_hz=[1.0, 2.0], drive="joint1", amplitude=[0.5], over={"link3.mass_kg": [1.0]})


def test_invalid_arguments_are_value_errors():
    for hz in ([22.0], [22.0, 21.0], [-1.0, 1.0]):
        with pytest.raises(ValueError, match="two or more positive frequencies that increase"):
            response_map(ARM, frequency_hz=hz, drive="joint1", amplitude=[1.0])


ONCE = """
import sys
import numpy as np, resonarm
from resonarm.maps import response_map
assert resonarm.__file__.startswith(sys.argv[1]), resonarm.__file__
response_map(resonarm.Chain.preset(), frequency_hz=[10.0, 11.0], drive="joint1", amplitude=[1.0], folder=sys.argv[2])
"""


class CopiedPackage:
    """A copy of the package, and the chunks of the map that a process computes with it."""

    def __init__(self, folder):
        self.package, self.folder = folder / "package", folder / "chunks"
        shutil.copytree(Path(resonarm.__file__).parent, self.package / "resonarm")

    def chunks(self):
        words = [sys.executable, "-c", ONCE, str(self.package), str(self.folder)]
        environment = os.environ | {"PYTHONPATH": str(self.package), "PYTHONDONTWRITEBYTECODE": "1"}
        subprocess.run(words, check=True, env=environment, cwd=self.package)
        return {path: path.stat().st_mtime_ns for path in self.folder.iterdir()}


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    copied = CopiedPackage(tmp_path_factory.mktemp("copied"))
    first = copied.chunks()
    assert len(first) == 1 and copied.chunks() == first, "the same code resumes from its chunks"
    return copied


@pytest.mark.parametrize("changed", ["_resonarm.abi3.so", "maps.py", "continuation.py"])
def test_chunks_of_other_code_are_not_taken(copied, changed):
    """A byte after the end of the extension, or a line added to the package, changes only the identity of the code."""
    file = copied.package / "resonarm" / changed
    original, before = file.read_bytes(), {path: path.stat().st_mtime_ns for path in copied.folder.iterdir()}
    file.write_bytes(original + b"\n")
    after = copied.chunks()
    file.write_bytes(original)
    assert len(after) == len(before) + 1 and before.items() < after.items()
