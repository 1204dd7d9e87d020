"""A bench for tests of controllers: runs with faults, and assertions about them.

The pytest plugin (`resonarm.pytest_plugin`) provides it as the fixture `bench`; it does not depend on pytest.
"""

import atexit
import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from . import _checks, _extras, _resonarm
from ._result import Result
from ._result import assert_in_specification as assert_in_specification
from .own_structure import Stepped
from .scenario import Scenario
from .session import Controller, Node, run
from .words import BusMode, Mode, NetworkFault, NodeRole, SensorFault

__all__ = ["FAULTS", "MEMORY", "Bench", "BenchFault", "NeedsInterface", "Program", "Result", "TimeLimit"]

MEMORY = "memory"
TIME_LIMIT_S = 60.0
"""The simulated time after which a run ends if nothing else says when."""


class TimeLimit(AssertionError):
    """A run has reached the time limit of its bench."""


@dataclass(frozen=True)
class BenchFault:
    """A fault for runs of a bench, by a name that suits a test: `with bench.inject(fault)`."""

    name: str
    kind: NetworkFault | SensorFault
    values: dict[str, Any] = field(default_factory=dict, hash=False)
    instrument: str | None = None
    """The instrument of a sensor's fault; None for a fault of the network, at the plant's end."""
    ends_run: bool = False
    """Whether the plant must end the run by a fault, since no fresh command reaches it: `assert_faulted` is then the
    test. Otherwise a controller can carry on."""

    def __str__(self) -> str:
        return self.name


_COMMANDS = {"direction": "receive"}
_READINGS = {"direction": "send"}
FAULTS: tuple[BenchFault, ...] = (
    BenchFault("commands-lost", "loss", {"probability": 0.01, **_COMMANDS}),
    BenchFault("readings-lost", "loss", {"probability": 0.01, **_READINGS}),
    BenchFault("frames-late", "delay", {"delay_s": 0.002}),
    BenchFault("frames-jitter", "jitter", {"delay_s": 0.002}),
    BenchFault("frames-reordered", "reordering", {"delay_s": 0.002, "probability": 0.01}),
    BenchFault("frames-duplicated", "duplication", {"probability": 0.05}),
    BenchFault("commands-damaged", "bit_error", {"probability": 0.01, **_COMMANDS}),
    BenchFault("readings-damaged", "bit_error", {"probability": 0.01, **_READINGS}),
    BenchFault("bus-busy", "babble", {"rate_hz": 1000.0, "ids": [0x700]}),
    BenchFault("tip-sensor-stuck", "stuck", {"axis": "x", "from_s": 0.3}, "c"),
    BenchFault("tip-sensor-silent", "dropout", {"axis": "x", "from_s": 0.3}, "c"),
    BenchFault("tip-sensor-noisy", "noise", {"axis": "x", "rms_m_s2": 1.0, "from_s": 0.3}, "c"),
    BenchFault("head-stuck", "stuck", {"axis": "x", "from_s": 0.3}, "head"),
    BenchFault("head-silent", "dropout", {"axis": "x", "from_s": 0.3}, "head"),
    BenchFault("cable-unplugged", "link_down", {"from_s": 0.3}, ends_run=True),
    BenchFault("commands-end", "loss", {"from_s": 0.3, **_COMMANDS}, ends_run=True),
)
"""Faults to parametrise a test with: of the network, the first ones, and of instruments. Those of `ends_run` come last.

    @pytest.mark.parametrize("fault", FAULTS, ids=str)
    def test_it(bench, fault):
        with bench.inject(fault):
            result = bench.run(controller)
        result.assert_faulted() if fault.ends_run else result.assert_controlled()
"""


class NeedsInterface(Exception):
    """A controller program needs a CAN interface of the kernel, and the bench has a bus in memory."""


class Program:
    """A controller program, running from its creation on."""

    def __init__(self, words: Sequence[str], log: Path) -> None:
        self._log = log
        with log.open("wb") as file:
            self._process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=file, stderr=file)

    @property
    def is_running(self) -> bool:
        """Whether it is still running."""
        return self._process.poll() is None

    @property
    def output(self) -> str:
        """Output of the program so far."""
        return self._log.read_text(errors="replace")

    def wait(self, within_s: float = 60.0) -> int:
        """Waits for its end and returns the exit code. Raises AssertionError with its output after this time, s."""
        __tracebackhide__ = True
        try:
            return self._process.wait(within_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"the controller has not ended within {within_s:g} s:\n{self.output}") from None

    def end(self) -> None:
        """Asks the program to end, and kills it after ten seconds."""
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class Bench:
    """A scenario, a bus and a folder for recordings: runs a controller against the simulated plant.

    `scenario` is one or the path of one, by default the default one. `folder` is created if missing, and existing
    recordings in it are kept; without one there is a temporary folder, removed after a `with` block, or with the
    process. `bus` is memory or a CAN interface of the kernel, for controller programs. Chains and modes are in the
    scenario; a `structure` whose step is written in Python is under test in every run if the scenario states none.

    A run whose scenario has no `simulation.duration_s` and whose controller does not end it fails with TimeLimit after
    `time_limit_s` of its samples' time; the emulated controller ends by itself. None is no limit.

    Runs are in simulated time, so they are exact on a busy machine. A controller in this process runs in the `mode`
    free: the times and delays of network faults are simulated, and deadlines hold as in real time. A program runs in
    lockstep, in which time waits for its answer: there the times of network faults follow the clock. Another `mode`,
    lockstep or real-time, applies to both.

        with Bench("scenarios/bench.toml") as bench, bench.delay(0.002):
            bench.run().assert_completed()
    """

    def __init__(
        self,
        scenario: Scenario | str | PathLike[str] | None = None,
        folder: str | PathLike[str] | None = None,
        bus: str = MEMORY,
        mode: Mode | None = None,
        *,
        structure: Stepped | None = None,
        time_limit_s: float | None = TIME_LIMIT_S,
    ) -> None:
        if time_limit_s is not None and not (math.isfinite(time_limit_s) and time_limit_s > 0):
            raise ValueError(f"time_limit_s is {time_limit_s:g}: it must be a positive number, or None for no limit")
        if scenario is None:
            scenario = Scenario()
        self.scenario = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
        self.bus, self.mode, self.structure, self.time_limit_s = bus, mode, structure, time_limit_s
        self._is_temporary = folder is None
        self.folder = Path(tempfile.mkdtemp(prefix="resonarm-") if folder is None else folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        if self._is_temporary:
            atexit.register(shutil.rmtree, self.folder, ignore_errors=True)
        self.recordings: list[Path] = []
        self.programs: list[Program] = []
        self._hub: _resonarm.Hub | None = None

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *_: object) -> None:
        """Ends the programs that still run, and removes a temporary folder."""
        for program in self.programs:
            program.end()
        if self._is_temporary:
            shutil.rmtree(self.folder, ignore_errors=True)

    def __repr__(self) -> str:
        count = len(self.recordings)
        runs = "1 run" if count == 1 else f"{count} runs"
        return f"<Bench of {self.scenario!r} on {self.bus}: {runs} in {str(self.folder)!r}>"

    def run(
        self, controller: Controller | list[str] | tuple[str, ...] | None = None, *, patience_s: float = 60.0
    ) -> Result:
        """Runs until the controller has disarmed the plant, the scenario's duration has passed, or an error ends it.

        `controller` is the emulated one of the scenario (None), one written in Python, or the words of a command, in
        which `{bus}` stands for the interface: then NeedsInterface is raised on a bus in memory. `patience_s` is how
        long a plant waits to be armed, by the clock; in the mode free it waits for 5 s of simulated time.
        """
        if controller is not None and not isinstance(controller, list | tuple):
            _checks.controller(controller)
        before, limit_s = self.scenario, self._limit_s(controller is None)
        if limit_s is not None:
            self.scenario = before.replace(simulation={"duration_s": limit_s})
        try:
            result = self._run(controller, patience_s)
        finally:
            self.scenario = before
        if limit_s is not None and result.plant["outcome"] == "completed":
            raise TimeLimit(
                f"the controller has not ended its run within {limit_s:g} s of simulated time, the bench's time limit: "
                "expected it to return None or to disarm the plant when it is done. If it has no end, set "
                'simulation.duration_s, as in @pytest.mark.scenario("bench.toml", simulation={"duration_s": 2.0}); if '
                "it takes longer, raise --resonarm-time-limit, in Python Bench(time_limit_s=...)\n"
                f"recording: {result.recording.path}"
            )
        return result

    def _limit_s(self, is_emulated: bool) -> float | None:
        """The time limit of a run, None if something else ends it."""
        has_end = is_emulated or self.scenario.values()["simulation"].get("duration_s") is not None
        return None if has_end else self.time_limit_s

    def _run(self, controller: Controller | list[str] | tuple[str, ...] | None, patience_s: float) -> Result:
        if isinstance(controller, list | tuple):
            return self._with_program(controller, patience_s)
        path, mode = self._next(), self.mode or "free"
        if mode == "free":
            words: dict[str, Any] = {"structure": self.structure, "record": path, "patience_s": patience_s}
            report = run(self.scenario, mode, controller=controller, **words)
            return Result(report, report, "", path)
        hub = _resonarm.Hub(2) if self.bus == MEMORY else None
        near, far = (hub.end(), hub.end()) if hub else (self.bus, self.bus)
        with self._plant(near, mode, path, patience_s) as plant:
            words = {"controller": controller, "patience_s": patience_s}
            exciter = Node("exciter", self._of_simulated_plant(), far, mode, **words).wait()
            return Result(plant.wait(), exciter, "", path)

    def _of_simulated_plant(self) -> Scenario:
        """The scenario of an exciter that knows how the plant at the other end of its bus reads."""
        values = self.scenario.values()
        if "plant_converter" in values["network"]:
            return self.scenario
        return self.scenario.replace(network={"plant_converter": values["rig"]["converter"]})

    def _with_program(self, words: Sequence[str], patience_s: float) -> Result:
        if self.bus == MEMORY:
            self.program(words)  # raises an error that says what is missing
        path = self._next()
        with self._plant(self.bus, self._bus_mode, path, patience_s) as plant:
            program = self.program(words)
            while program.is_running and plant.is_running:
                time.sleep(0.01)
            # It learns that the plant leaves.
            ending = time.monotonic() + 10
            while program.is_running and time.monotonic() < ending:
                time.sleep(0.01)
            program.end()
            plant.stop()
            return Result(plant.wait(), None, program.output, path)

    @property
    def _bus_mode(self) -> BusMode:
        """The mode of a node on a bus. The mode free has no bus; the node reports this."""
        return self.mode or "lockstep"  # type: ignore[return-value]

    def _plant(self, end: _resonarm.BusEnd | str, mode: BusMode, path: Path, patience_s: float) -> Node:
        words: dict[str, Any] = {"structure": self.structure, "record": path, "patience_s": patience_s}
        return Node("plant", self.scenario, end, mode, end_on_disarm=True, **words)

    def _next(self) -> Path:
        """The file of the next recording, which does not exist yet."""
        count = len(self.recordings) + 1
        while (path := self.folder / f"run-{count}.mcap").exists():
            count += 1
        self.recordings.append(path)
        return path

    @contextmanager
    def plant(self, **options: Any) -> Iterator[Node]:
        """A plant that runs, recorded, on the bench's bus within the block, for a `can_bus` or a `program`. `options`
        are those of `Node`. `result` has its report."""
        self._hub = _resonarm.Hub(8) if self.bus == MEMORY else None
        near = self.bus if self._hub is None else self._hub.end()
        words = {"structure": self.structure, "record": self._next(), **options}
        plant = Node("plant", self.scenario, near, self._bus_mode, **words)
        try:
            yield plant
        finally:
            self._hub = None
            plant.stop()
            # A stop takes effect between two samples, also while a plant waits in lockstep.
            ending = time.monotonic() + 60
            while plant.is_running and time.monotonic() < ending:
                time.sleep(0.005)

    def result(self, plant: Node) -> Result:
        """The result of a `plant`'s run, which is stopped if it has not ended."""
        return Result(plant.end(), None, "".join(program.output for program in self.programs), self.recordings[-1])

    @contextmanager
    def can_bus(self, plant: Node) -> Iterator[Any]:
        """A `can.Bus` on the bus of a running plant; in memory, `can.Bus(interface="resonarm", channel=bus.channel)`
        opens another."""
        can = _extras.require("can", "can")
        if self._hub is None:
            is_fd = self.scenario.values()["network"]["profile"] == "fd"
            with can.Bus(interface="socketcan", channel=self.bus, fd=is_fd) as bus:
                yield bus
            return
        served = _extras.require("resonarm.can_bus", "can").served
        channel = self.folder.name
        with served(channel, plant, self._hub, self.scenario), can.Bus(interface="resonarm", channel=channel) as bus:
            yield bus

    def program(self, words: Sequence[str]) -> Program:
        """Starts a controller program by the words of a command, in which `{bus}` is replaced by the interface.
        Raises NeedsInterface on a bus in memory."""
        if self.bus == MEMORY:
            raise NeedsInterface("a controller that is a program needs a CAN interface, as by --resonarm-bus vcan0")
        log = self.folder / f"controller-{len(self.programs) + 1}.txt"
        self.programs.append(Program([word.format(bus=self.bus) for word in words], log))
        return self.programs[-1]

    def fault(self, kind: NetworkFault, *, node: NodeRole = "plant", **values: Any) -> AbstractContextManager[None]:
        """Runs within the block have a fault of the network at a node's end: loss, delay, jitter, reordering,
        duplication, bit_error, babble, bus_off or link_down, with the keys of `[[network.faults]]`. Faults at a
        program's end are not applied: give them to the plant's end."""
        return self._section("network", {"node": node, "kind": kind, **values})

    def loss(self, **values: Any) -> AbstractContextManager[None]:
        """Frames are lost: `probability` or `count`, `ids`, `direction`, `from_s`, `to_s`."""
        return self.fault("loss", **values)

    def delay(self, delay_s: float, **values: Any) -> AbstractContextManager[None]:
        """Frames are delayed by a time, s, and so are those behind them: simulated time in the mode free, otherwise by
        the clock."""
        return self.fault("delay", delay_s=delay_s, **values)

    def wrong_crc(self, **values: Any) -> AbstractContextManager[None]:
        """One bit of a frame is inverted, so that its E2E check fails."""
        return self.fault("bit_error", **values)

    def link_down(self, **values: Any) -> AbstractContextManager[None]:
        """No frame is received, and no frame sent arrives."""
        return self.fault("link_down", **values)

    def sensor_fault(self, instrument: str, kind: SensorFault, **values: Any) -> AbstractContextManager[None]:
        """An instrument (head, or a sensor by its name) has a fault: stuck, dropout, drift, noise,
        spike or gain, with the keys of `[[rig.faults]]`."""
        return self._section("rig", {"instrument": instrument, "kind": kind, **values})

    def inject(self, fault: BenchFault) -> AbstractContextManager[None]:
        """Runs within the block have a fault of the list `FAULTS`, or one like them."""
        if fault.instrument is None:
            return self.fault(fault.kind, **fault.values)  # type: ignore[arg-type]
        return self.sensor_fault(fault.instrument, fault.kind, **fault.values)  # type: ignore[arg-type]

    @contextmanager
    def _section(self, section: str, fault: dict[str, Any]) -> Iterator[None]:
        before = self.scenario
        faults = [*before.values()[section].get("faults", []), {"from_s": 0.0, **fault}]
        self.scenario = before.replace(**{section: {"faults": [_plain(fault) for fault in faults]}})
        try:
            yield
        finally:
            self.scenario = before


def _plain(fault: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in fault.items() if value is not None}
