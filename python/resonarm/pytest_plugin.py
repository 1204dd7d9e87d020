"""The pytest plugin: a bench for every test, whose recordings are kept if the test fails.

    @pytest.mark.scenario("scenarios/bench.toml", simulation={"duration_s": 2.0})
    def test_the_controller_survives_a_lossy_bus(bench):
        with bench.loss(probability=0.01):
            result = bench.run(my_controller)
        result.assert_completed()

A test may start its parts itself: the fixture `plant` is a plant that runs on the bench's bus, `bus` a `can.Bus` on it,
`controller_process` starts a program on it; assertions are those of `bench.result(plant)`.

A scenario is parametrised by a separate fixture named `scenario`, or by several files in the mark:
`@pytest.mark.scenario("a.toml", "b.toml")` runs the test with each.
"""

import fcntl
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from .scenario import Scenario
from .session import Node
from .testing import MEMORY, Bench, NeedsInterface, Program

_CAN = "280"  # ARPHRD_CAN of Linux's if_arp.h


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds options for the bus and for the folder of recordings."""
    group = parser.getgroup("resonarm")
    group.addoption(
        "--resonarm-bus",
        default="auto",
        metavar="BUS",
        help="memory, CAN interfaces with commas between them, or auto: a vcan that is up and free, else memory",
    )
    group.addoption(
        "--resonarm-recordings",
        metavar="FOLDER",
        help="keep the recordings of all tests here, one folder a test; else only those of failed tests are kept",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Registers the mark."""
    config.addinivalue_line(
        "markers", "scenario(*files, **sections): the bench's scenario, or one after the other, with other values"
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test with several scenarios in its mark runs with each."""
    mark = metafunc.definition.get_closest_marker("scenario")
    if mark is not None and len(mark.args) > 1 and "scenario" in metafunc.fixturenames:
        names = [Path(file).stem for file in mark.args]
        metafunc.parametrize("scenario", mark.args, ids=names, indirect=True)


@pytest.fixture
def scenario(request: pytest.FixtureRequest) -> Scenario:
    """The scenario of the test's mark, or the default one."""
    mark = request.node.get_closest_marker("scenario")
    if mark is None:
        return Scenario()
    file = getattr(request, "param", mark.args[0] if mark.args else None)
    return Scenario().replace(**mark.kwargs) if file is None else Scenario.load(file, **mark.kwargs)


@pytest.fixture
def bench(request: pytest.FixtureRequest, scenario: Scenario) -> Iterator[Bench]:
    """A `resonarm.testing.Bench`. Recordings are kept if the test fails, and the report names them; with
    `--resonarm-recordings` those of all tests."""
    kept = request.config.getoption("--resonarm-recordings")
    if kept is None:
        folder = Path(tempfile.mkdtemp(prefix="resonarm-"))
    else:
        folder = Path(kept) / re.sub(r"[^\w.\[\]-]+", "-", request.node.nodeid)
    with _bus(request.config.getoption("--resonarm-bus")) as bus:
        bench = Bench(scenario, folder, bus)
        request.node.stash[_BENCH] = bench
        yield bench
    if kept is None and not request.node.stash.get(_FAILED, False):
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def plant(bench: Bench) -> Iterator[Node]:
    """A plant that runs, recorded, on the bench's bus until the test ends."""
    with bench.plant() as plant:
        yield plant


@pytest.fixture
def bus(bench: Bench, plant: Node) -> Iterator[Any]:
    """A `can.Bus` on the bus of the fixture `plant`; needs the extra `can`."""
    with bench.can_bus(plant) as bus:
        yield bus


@pytest.fixture
def controller_process(bench: Bench) -> Iterator[Callable[..., Program]]:
    """Starts a controller program by the words of a command, in which `{bus}` is replaced by the interface; it is
    stopped after the test. The report of a test that fails shows its output."""
    started: list[Program] = []

    def start(*words: str) -> Program:
        started.append(bench.program(words))
        return started[-1]

    yield start
    for program in started:
        program.end()


_BENCH = pytest.StashKey[Bench]()
_FAILED = pytest.StashKey[bool]()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[Any]) -> Iterator[None]:
    """Adds the recordings of a failed test to its report; skips a test whose controller has no bus."""
    outcome: Any = yield
    report = outcome.get_result()
    bench = item.stash.get(_BENCH, None)
    if bench is None or report.when != "call":
        return
    if call.excinfo is not None and call.excinfo.errisinstance(NeedsInterface):
        report.outcome = "skipped"
        report.longrepr = (str(item.path), item.location[1] or 0, f"Skipped: {call.excinfo.value}")
    elif report.failed:
        item.stash[_FAILED] = True
        written = [str(path) for path in bench.recordings if path.exists()]
        for program in bench.programs:
            report.sections.append(("resonarm controller", program.output))
        report.sections.append(("resonarm recordings", "\n".join([*written, f"on {bench.bus}, {bench.scenario!r}"])))


@contextmanager
def _bus(wanted: str) -> Iterator[str]:
    """A bus that no other test uses at the same time, in any process."""
    if wanted == MEMORY:
        yield MEMORY
        return
    names = _virtual_interfaces() if wanted == "auto" else wanted.split(",")
    for name in names:
        with (Path(tempfile.gettempdir()) / f"resonarm-{os.getuid()}-{name}.lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield name
            return
    if wanted == "auto":
        yield MEMORY
        return
    with (Path(tempfile.gettempdir()) / f"resonarm-{os.getuid()}-{names[0]}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield names[0]


def _virtual_interfaces() -> list[str]:
    """The vcan interfaces that are up."""
    found = []
    for device in sorted(Path("/sys/class/net").glob("vcan*")):
        is_can = (device / "type").read_text().strip() == _CAN
        if is_can and int((device / "flags").read_text(), 16) & 1:
            found.append(device.name)
    return found
