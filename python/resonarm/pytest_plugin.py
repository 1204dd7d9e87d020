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

import argparse
import fcntl
import hashlib
import json
import math
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from .scenario import Scenario
from .session import Node
from .testing import MEMORY, TIME_LIMIT_S, Bench, NeedsInterface, Program

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
    group.addoption(
        "--resonarm-time-limit",
        type=_time_limit,
        default=TIME_LIMIT_S,
        metavar="SECONDS",
        help="simulated time after which a run fails if neither the scenario nor the controller ends it, 0 for no "
        "limit (default: %(default)g)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Registers the marks."""
    config.addinivalue_line(
        "markers", "scenario(*files, **sections): the bench's scenario, or one after the other, with other values"
    )
    config.addinivalue_line("markers", "requirement(*ids): the requirements that the test shows, for reports")


def _time_limit(word: str) -> float:
    """The value of --resonarm-time-limit."""
    seconds = float(word)
    if not (math.isfinite(seconds) and seconds >= 0):
        raise argparse.ArgumentTypeError(f"{word} is not a time: give seconds, or 0 for no limit")
    return seconds


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the requirements of a test among its properties, which reports such as JUnit XML have."""
    for item in items:
        for mark in item.iter_markers("requirement"):
            item.user_properties += [("requirement", str(name)) for name in mark.args]


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
        folder = Path(kept) / _folder_name(request.node.nodeid)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            pytest.fail(
                f"the folder of --resonarm-recordings can't be made: {error}. Give one that this user may write",
                pytrace=False,
            )
    limit_s = request.config.getoption("--resonarm-time-limit")
    with _bus(request.config.getoption("--resonarm-bus")) as bus:
        bench = Bench(scenario, folder, bus, time_limit_s=limit_s or None)
        request.node.stash[_BENCH] = bench
        yield bench
    if kept is None and not request.node.stash.get(_FAILED, False):
        shutil.rmtree(folder, ignore_errors=True)


def _folder_name(nodeid: str) -> str:
    """A name of one folder for each test: equal ones would mix the recordings of tests that run at the same time."""
    plain = nodeid.replace("::", "-")
    name = re.sub(r"[^\w.\[\]-]+", "-", plain)
    return name if name == plain else f"{name}-{hashlib.sha256(nodeid.encode()).hexdigest()[:8]}"


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


# Before the wrappers of other report plug-ins, which read what this one adds.
@pytest.hookimpl(hookwrapper=True, trylast=True)
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
        return
    written = [path for path in bench.recordings if path.exists()]
    is_kept = report.failed or item.config.getoption("--resonarm-recordings") is not None
    if is_kept:
        # JUnit XML takes those of the last phase, which follows.
        item.user_properties += [("resonarm_recording", str(path)) for path in written]
        _attach(item.config, report, bench, written)
    if report.failed:
        item.stash[_FAILED] = True
        for program in bench.programs:
            report.sections.append(("resonarm controller", program.output))
        names = [str(path) for path in written]
        report.sections.append(("resonarm recordings", "\n".join([*names, f"on {bench.bus}, {bench.scenario!r}"])))


def _attach(config: pytest.Config, report: Any, bench: Bench, written: list[Path]) -> None:
    """Attaches recordings, outputs of programs and the scenario to the reports of pytest-html and Allure, if they are
    asked for. pytest-html links the recordings, Allure copies them."""
    scenario = json.dumps(bench.scenario.values(), indent=2, default=str)
    outputs = [(f"controller {number}", program.output) for number, program in enumerate(bench.programs, 1)]
    if config.getoption("htmlpath", None) is not None:
        extras = import_module("pytest_html").extras
        links = [extras.url(path.resolve().as_uri(), name=path.name) for path in written]
        texts = [extras.text(text, name=name) for name, text in [*outputs, ("scenario", scenario)]]
        report.extras = [*getattr(report, "extras", []), *links, *texts]
    if config.pluginmanager.hasplugin("allure_listener"):
        allure = import_module("allure")
        for path in written:
            allure.attach.file(str(path), name=path.name, extension="mcap")
        for name, text in outputs:
            allure.attach(text, name=name, attachment_type=allure.attachment_type.TEXT)
        allure.attach(scenario, name="scenario", attachment_type=allure.attachment_type.JSON)


@contextmanager
def _bus(wanted: str) -> Iterator[str]:
    """A bus that no other test uses at the same time, in any process."""
    if wanted == MEMORY:
        yield MEMORY
        return
    names = _virtual_interfaces() if wanted == "auto" else wanted.split(",")
    for name in names:
        with _lock_of(name).open("w") as lock:
            try:
                # The kernel gives the lock back with the file, so that a test that was killed keeps no interface.
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield name
            return
    if wanted == "auto":
        yield MEMORY
        return
    with _lock_of(names[0]).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield names[0]


def _lock_of(interface: str) -> Path:
    """The file by whose lock a process claims an interface."""
    return Path(tempfile.gettempdir()) / f"resonarm-{os.getuid()}-{interface}.lock"


def _virtual_interfaces() -> list[str]:
    """The vcan interfaces that are up."""
    found = []
    for device in sorted(Path("/sys/class/net").glob("vcan*")):
        is_can = (device / "type").read_text().strip() == _CAN
        if is_can and int((device / "flags").read_text(), 16) & 1:
            found.append(device.name)
    return found
