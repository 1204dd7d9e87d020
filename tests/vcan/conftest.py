"""Fixtures of the tests on vcan. Run them by `tests/vcan/with-vcan`, one after another: they use the same interface."""

import os
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import pytest
import wire
from processes import Programs, run, wait_until
from recordings import Recording

SCENARIOS = Path(__file__).parents[2] / "scenarios"
LEAN = Path(__file__).parent / "lean"

if os.environ.get("RESONARM_TEST_VCAN") is None:
    raise pytest.UsageError("these tests need two CAN interfaces: run them by tests/vcan/with-vcan")

# Of the programs that tests start.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(LEAN), os.environ.get("PYTHONPATH")]))


@pytest.fixture
def programs():
    with Programs() as programs:
        yield programs


class Run(SimpleNamespace):
    """A run that is over: what its processes said, and its recording, read when it is asked for."""

    @cached_property
    def recording(self):
        return Recording.whole(self.path)


def session(folder, plant_bus, exciter_bus, scenario, *, candump=None):
    """A whole run in lockstep, plant and exciter as separate processes; the output of both and of candump."""
    recording = folder / "run.mcap"
    common = ["--mode", "lockstep", "--scenario", scenario, "--json"]
    with Programs() as programs:
        dump = programs.candump(candump) if candump else None
        plant = programs.resonarm("run", "--bus", plant_bus, *common, "--stop-on-disarm", "--record", recording)
        if dump:
            # So that it misses no frame of the exciter's.
            wait_until(lambda: dump.stdout, "the plant to be on the bus")
        exciter = programs.resonarm("exciter", "--bus", exciter_bus, *common)
        result = Run(path=recording, exciter=exciter.result(), plant=plant.result())
        if dump:
            result.frames = wire.log(dump)
    return result


def free(folder, scenario):
    """The same scenario as one process without a bus."""
    path = folder / "free.mcap"
    with Programs() as programs:
        run_free = programs.resonarm("run", "--mode", "free", "--scenario", scenario, "--record", path, "--json")
        return Run(path=path, plant=run_free.result())


@pytest.fixture(scope="session")
def three_frequencies():
    return SCENARIOS / "three-frequencies.toml"


@pytest.fixture(scope="session")
def lockstep(tmp_path_factory, three_frequencies):
    """The scenario with three frequencies in lockstep on vcan0, with candump listening."""
    return session(tmp_path_factory.mktemp("lockstep"), "vcan0", "vcan0", three_frequencies, candump="vcan0")


@pytest.fixture(scope="session")
def free_run(tmp_path_factory, three_frequencies):
    return free(tmp_path_factory.mktemp("free"), three_frequencies)


@pytest.fixture
def interface():
    """A virtual interface for one test, which may take it down."""
    run("ip", "link", "add", "vcan7", "type", "vcan")
    run("ip", "link", "set", "vcan7", "mtu", "72", "up")
    yield "vcan7"
    run("ip", "link", "del", "vcan7")
