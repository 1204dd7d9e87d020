"""A bench for tests of controllers: runs with faults, and what must hold of them, in the trade's words.

The pytest plugin (`resonarm.pytest_plugin`) hands one out as the fixture `bench`; it needs nothing of pytest itself.
"""

import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from . import _extras, _resonarm
from ._dtypes import Array
from .recording import Recording
from .scenario import Scenario
from .session import Controller, Node, Report

MEMORY = "memory"
SIGNALS = tuple(
    f"{quantity}_{axis}" for quantity in ("acceleration_b_m_s2", "acceleration_c_m_s2", "head_force_n") for axis in "xy"
)


class NeedsInterface(Exception):
    """A controller that is a program needs a CAN interface of the kernel, and the bench has a bus in memory."""


class Result:
    """What a run came to, and what must hold of it. An assertion that fails shows the signal about the failure and
    names the recording."""

    def __init__(self, plant: Report, exciter: Report | None, output: str, path: Path) -> None:
        self.plant = plant.plant
        """The plant's report: the document of `resonarm run --json`."""
        self.exciter = exciter.exciter if exciter else {}
        """The exciter's report; empty if the controller was a program."""
        self.responses = exciter.responses if exciter else plant.responses
        """What an emulated exciter has read, as `Report.responses`."""
        self.output = output
        """What a program wrote."""
        self.recording = Recording(path)
        """The recording of the plant."""

    def signal(self, name: str) -> tuple[Array, Array]:
        """Times, s, and values of a reading by its name, such as `acceleration_c_m_s2_x`, or of the held load
        `force_n_x`."""
        column, _, axis = name.rpartition("_")
        loads = ("force_n", "torque_nm")
        if axis not in ("x", "y") or (name not in SIGNALS and column not in loads):
            known = [*SIGNALS, *(f"{load}_{axis}" for load in loads for axis in "xy")]
            raise ValueError(f"there is no signal {name!r}, only {', '.join(known)}")
        rows = self.recording.states if column in loads else self.recording.samples
        return rows["time_s"], rows[column][:, "xy".index(axis)]

    def fail(self, message: str, name: str, at: int, rows: int = 8) -> None:
        """Raises AssertionError with a signal from some samples before the `at`th to some after."""
        __tracebackhide__ = True
        times, values = self.signal(name)
        first = max(0, at - rows)
        lines = [
            f"{'>' if k == at else ' '} sample {k:6}  {times[k]:10.4f} s  {values[k]:+12.5g}"
            for k in range(first, min(len(times), at + rows + 1))
        ]
        table = "\n".join([f"  {name}:", *lines, f"recording: {self.recording.path}"])
        raise AssertionError(f"{message}\n{table}")

    def assert_completed(self) -> None:
        """Neither the plant nor an emulated exciter ended by a fault or an error."""
        __tracebackhide__ = True
        good = ("completed", "disarmed", "stopped")
        if self.plant["outcome"] not in good or self.plant["error"]:
            why = self.plant["error"] or self.plant["fault"]
            self.fail(f"the plant ended {self.plant['outcome']}: {why}", "force_n_x", self.plant["samples"] - 1)
        if self.exciter and self.exciter["outcome"] not in ("finished", "plant-left"):
            why = self.exciter["reason"]
            self.fail(f"the exciter ended {self.exciter['outcome']}: {why}", "force_n_x", self.plant["samples"] - 1)

    def assert_no_overrun(self) -> None:
        """No deadline was missed, in real time."""
        __tracebackhide__ = True
        if self.plant["overruns"]:
            late = self.recording.read("ticks")
            at = int(late["sample"][np.flatnonzero(late["overruns"])[0]])
            self.fail(f"{self.plant['overruns']} deadlines were missed", "force_n_x", at)

    def assert_no_refused_command(self) -> None:
        """Every command that came in whole acted on the arm, and every frame was valid. The answer to the last sample
        of a run whose duration has passed comes when the plant has left, and doesn't count."""
        __tracebackhide__ = True
        refused = {reason: count for reason, count in self.plant["refused"].items() if count}
        if self.plant["outcome"] == "completed":
            refused.pop("not_armed", None)
        invalid = self.plant["bus"]["e2e_errors"]
        if refused or invalid:
            events = self.recording.events
            named = np.flatnonzero(np.char.find(events["name"], "refused") >= 0)
            at = int(events["sample"][named[0]]) if len(named) else 0
            self.fail(f"commands were refused: {refused}, and {invalid} frames were invalid", "force_n_x", at)

    def assert_force_below(self, limit_n: float) -> None:
        """The force that acted on the tip stayed below a limit, N, in each axis."""
        __tracebackhide__ = True
        for axis in "xy":
            values = np.abs(self.signal(f"force_n_{axis}")[1])
            if (values >= limit_n).any():
                at = int(np.argmax(values >= limit_n))
                self.fail(
                    f"the force along {axis} reaches {values.max():g} N: limit {limit_n:g} N", f"force_n_{axis}", at
                )

    def assert_state_reached(self, state: str, within_s: float) -> None:
        """The plant reached a state, such as operational or fault, within a time of its samples, s."""
        __tracebackhide__ = True
        events = self.recording.events
        named = events[np.char.endswith(events["name"], f"state.{state}")]
        within = round(within_s / self.recording.dt_s)
        if not len(named) or named["sample"][0] > within:
            when = f"at {named['sample'][0] * self.recording.dt_s:g} s" if len(named) else "never"
            at = min(within, self.plant["samples"] - 1)
            self.fail(f"the state {state} was to be reached within {within_s:g} s, and was {when}", "force_n_x", at)

    def amplitude(self, name: str, frequency_hz: float, from_s: float = 0.0, to_s: float = np.inf) -> float:
        """Amplitude of the sine of a frequency in a signal, by least squares beside an offset."""
        times, values = self.signal(name)
        chosen = (times >= from_s) & (times <= to_s)
        phase = 2 * np.pi * frequency_hz * times[chosen]
        columns = np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=1)
        fit = np.linalg.lstsq(columns, values[chosen], rcond=None)[0]
        return float(np.hypot(fit[0], fit[1]))

    def assert_settled(
        self,
        name: str,
        frequency_hz: float,
        *,
        from_s: float,
        to_s: float,
        amplitude: float | None = None,
        within: float = 0.02,
    ) -> None:
        """A signal vibrates evenly at a frequency, Hz: its amplitude in the second half of a time is that of the
        first, and an expected one if it is given, `within` a part of it."""
        __tracebackhide__ = True
        middle = (from_s + to_s) / 2
        halves = [self.amplitude(name, frequency_hz, *ends) for ends in ((from_s, middle), (middle, to_s))]
        at = int(np.searchsorted(self.signal(name)[0], middle))
        if abs(halves[1] - halves[0]) > within * halves[1]:
            self.fail(f"{name} has not settled: its amplitude goes from {halves[0]:g} to {halves[1]:g}", name, at)
        if amplitude is not None and abs(halves[1] - amplitude) > within * amplitude:
            self.fail(f"{name} has an amplitude of {halves[1]:g}: expected {amplitude:g} within {within:.1%}", name, at)


class Program:
    """A controller that is a program of its own, from the moment it is made."""

    def __init__(self, words: Sequence[str], log: Path) -> None:
        self._log = log
        with log.open("wb") as file:
            self._process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=file, stderr=file)

    @property
    def is_running(self) -> bool:
        """Whether it runs still."""
        return self._process.poll() is None

    @property
    def output(self) -> str:
        """What it has written up to now."""
        return self._log.read_text(errors="replace")

    def wait(self, within_s: float = 60.0) -> int:
        """Its exit code. AssertionError with its output if it has not ended within a time, s."""
        __tracebackhide__ = True
        try:
            return self._process.wait(within_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"the controller has not ended within {within_s:g} s:\n{self.output}") from None

    def end(self) -> None:
        """Asks it to end, and ends it where it does not within ten seconds."""
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class Bench:
    """A scenario, a bus and a folder for recordings: runs a controller against the simulated plant.

    `bus` is memory or a CAN interface of the kernel. Runs are in lockstep, so that they are exact on a busy machine.
    """

    def __init__(self, scenario: Scenario, folder: Path, bus: str = MEMORY, mode: str = "lockstep") -> None:
        self.scenario, self.folder, self.bus, self.mode = scenario, folder, bus, mode
        self.recordings: list[Path] = []
        self.programs: list[Program] = []
        self._hub: _resonarm.Hub | None = None

    def run(self, controller: Controller | Sequence[str] | None = None, *, patience_s: float = 60.0) -> Result:
        """Runs until the controller has disarmed the plant, the scenario's duration has passed, or an error ends it.

        `controller` is the emulated one of the scenario (None), one written in Python, or the words of a command, in
        which `{bus}` stands for the interface: then NeedsInterface is raised on a bus in memory. `patience_s` is how
        long a plant waits to be armed.
        """
        if controller is not None and not callable(controller) and self.bus == MEMORY:
            self.program(controller)  # which says what is missing
        path = self._next()
        hub = _resonarm.Hub(2) if self.bus == MEMORY else None
        near, far = (hub.end(), hub.end()) if hub else (self.bus, self.bus)
        options: dict[str, Any] = {"record": path, "patience_s": patience_s, "end_on_disarm": True}
        with Node("plant", self.scenario, near, self.mode, **options) as plant:
            exciter, output = None, ""
            if controller is None or callable(controller):
                own = controller if callable(controller) else None
                exciter = Node("exciter", self.scenario, far, self.mode, controller=own, patience_s=patience_s).wait()
            else:
                program = self.program(controller)
                while program.is_running and plant.is_running:
                    time.sleep(0.01)
                # It hears that the plant leaves.
                ending = time.monotonic() + 10
                while program.is_running and time.monotonic() < ending:
                    time.sleep(0.01)
                program.end()
                plant.stop()
                output = program.output
            return Result(plant.wait(), exciter, output, path)

    def _next(self) -> Path:
        """The file of the next recording."""
        path = self.folder / f"run-{len(self.recordings) + 1}.mcap"
        self.recordings.append(path)
        return path

    @contextmanager
    def plant(self, **options: Any) -> Iterator[Node]:
        """A plant that runs, recorded, on the bench's bus within the block, for whatever is to meet it there: a
        `can_bus`, a `program`. `options` are those of `Node`. `result` has its report."""
        self._hub = _resonarm.Hub(8) if self.bus == MEMORY else None
        near = self.bus if self._hub is None else self._hub.end()
        plant = Node("plant", self.scenario, near, self.mode, record=self._next(), **options)
        try:
            yield plant
        finally:
            self._hub = None
            plant.stop()
            # A stop is heard between two samples; a plant that waits in lockstep hears it, too.
            ending = time.monotonic() + 60
            while plant.is_running and time.monotonic() < ending:
                time.sleep(0.005)

    def result(self, plant: Node) -> Result:
        """What the run of a `plant` came to: it is asked to end, if it has not."""
        return Result(plant.end(), None, "".join(program.output for program in self.programs), self.recordings[-1])

    @contextmanager
    def can_bus(self, plant: Node) -> Iterator[Any]:
        """A `can.Bus` on the bus of a running plant; in memory `can.Bus(interface="resonarm", channel=bus.channel)` is
        another."""
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
        """Starts a controller that is a program: the words of a command, in which `{bus}` stands for the interface.
        Raises NeedsInterface on a bus in memory."""
        if self.bus == MEMORY:
            raise NeedsInterface("a controller that is a program needs a CAN interface: --resonarm-bus vcan0")
        log = self.folder / f"controller-{len(self.programs) + 1}.txt"
        self.programs.append(Program([word.format(bus=self.bus) for word in words], log))
        return self.programs[-1]

    @contextmanager
    def fault(self, kind: str, *, node: str = "plant", **values: Any) -> Iterator[None]:
        """Runs within the block have a fault of the network at a node's end: loss, delay, jitter, reordering,
        duplication, bit_error, babble, bus_off or link_down, with the keys of `[[network.faults]]`. The faults of a
        program's own end are not applied: give them to the plant's."""
        with self._section("network", {"node": node, "kind": kind, **values}):
            yield

    @contextmanager
    def loss(self, **values: Any) -> Iterator[None]:
        """Frames are lost: `probability` or `count`, `ids`, `direction`, `from_s`, `to_s`."""
        with self.fault("loss", **values):
            yield

    @contextmanager
    def delay(self, delay_s: float, **values: Any) -> Iterator[None]:
        """Frames come later, s, and those behind them wait."""
        with self.fault("delay", delay_s=delay_s, **values):
            yield

    @contextmanager
    def wrong_crc(self, **values: Any) -> Iterator[None]:
        """One bit of a frame is inverted, so that its E2E check fails."""
        with self.fault("bit_error", **values):
            yield

    @contextmanager
    def link_down(self, **values: Any) -> Iterator[None]:
        """Nothing comes in, and nothing that is sent arrives."""
        with self.fault("link_down", **values):
            yield

    @contextmanager
    def sensor_fault(self, instrument: str, kind: str, **values: Any) -> Iterator[None]:
        """An instrument (accelerometer_b, accelerometer_c, impedance_head) has a fault: stuck, dropout, drift, noise
        or spike, with the keys of `[[rig.faults]]`."""
        with self._section("rig", {"instrument": instrument, "kind": kind, **values}):
            yield

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
