"""`resonarm quickstart`: its controllers in Python, C and Rust shake the plant as its README says, and do the same."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from processes import RESONARM, run, wait_until
from recordings import Recording, bits

# A folder that the command has made, with the controllers in C and Rust built.
FOLDER = Path(os.environ.get("RESONARM_QUICKSTART", "target/tests/quickstart"))
PYTEST = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "--resonarm-bus"]
CONTROLLERS = {
    "python": [sys.executable, FOLDER / "python/controller.py"],
    "c": [FOLDER / "c/controller"],
    "rust": [FOLDER / "rust/target/debug/controller"],
}


def test_three_controllers_do_the_same(programs, tmp_path):
    said, states = {}, {}
    for language, words in CONTROLLERS.items():
        path = tmp_path / f"{language}.mcap"
        common = ["--bus", "vcan0", "--mode", "lockstep", "--scenario", FOLDER / "scenario.toml", "--json"]
        plant = programs.resonarm("run", *common, "--stop-on-disarm", "--record", path)
        wait_until(lambda plant=plant: "ready on" in plant.stderr, "the plant to be on the bus")
        program = programs.start(language, *words, "vcan0")
        assert program.wait() == 0, program.stderr
        said[language] = float(re.fullmatch(r".* along x: ([0-9.]+) m/s²\n", program.stdout).group(1))
        assert plant.result()["outcome"] == "disarmed"
        states[language] = bits(Recording.whole(path).states[:3000]).tolist()
    assert said["python"] == said["c"] == said["rust"] > 1.0, said
    # The sine of each language is its own, and the command's resolution of 0.02 N the same.
    assert states["python"] == states["c"] == states["rust"]


def test_its_test_passes_on_a_bus_in_memory():
    words = [*PYTEST, "memory", FOLDER / "python"]
    done = subprocess.run(words, capture_output=True, text=True, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})
    assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout


@pytest.mark.parametrize("bus", ["memory", "vcan0"])
def test_the_bench_of_a_build_server_is_green(bus, tmp_path):
    folder = shutil.copytree("examples/ci-bench", tmp_path / "ci-bench")
    done = subprocess.run([*PYTEST, bus], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0 and "4 passed" in done.stdout, done.stdout
    suite = ElementTree.parse(folder / "results/junit.xml").getroot().find("testsuite")
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("controller", "4", "0")
    assert len(list((folder / "results/runs").rglob("*.mcap"))) >= 4


def test_the_script_makes_the_bus():
    # As the tests' own interface is up already.
    assert run(FOLDER / "bus.sh", "vcan0") == "vcan0 is up\n"


def test_a_folder_that_is_not_empty_is_left_alone():
    done = subprocess.run([RESONARM, "quickstart", FOLDER], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.endswith("quickstart is not empty: choose a folder that does not exist\n"), done.stderr


def test_the_files_are_named(tmp_path):
    document = json.loads(run(RESONARM, "quickstart", tmp_path / "bench", "--json"))
    there = {str(path.relative_to(tmp_path / "bench")) for path in (tmp_path / "bench").rglob("*") if path.is_file()}
    assert set(document["files"]) == there and {"README.md", "bus.sh", "c/Makefile", "rust/src/main.rs"} < there
