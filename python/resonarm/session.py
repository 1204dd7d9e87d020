"""Runs: both nodes of a scenario in this process, or one of them on a bus."""

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from . import _checks, _extras, _resonarm
from ._dtypes import RESPONSE, Array, unit, view
from .own_structure import Stepped, parts
from .recording import Recording
from .scenario import Scenario
from .words import BusMode, LoadKind, Mode, NodeRole, Overrun, Reading, RealTime, Spin

READINGS = ("head_force_n", "acceleration_b_m_s2", "acceleration_c_m_s2")
Controller = Callable[[_resonarm.Measurement], tuple[float, float] | None]
"""A controller answers each sample: called with a `Measurement`, it returns the load to hold until the next sample, two
components, or None when its work is done. If it has a method `restart`, this is called when the exciter restarts after
a fault."""


@dataclass(frozen=True, repr=False)
class Report:
    """The report of a run."""

    plant: dict[str, Any]
    """The plant's report: the document of `resonarm run --json`; empty for an exciter alone."""
    exciter: dict[str, Any]
    """The exciter's report: `outcome`, `reason`, `samples_played` and counts; empty for a plant alone."""
    responses: Array
    """The responses that the exciter read, a row for each frequency: `frequency_hz`, `load` (N or N·m), `phase_deg`
    (NaN in open loop), complex `head_force_n`, `acceleration_b_m_s2`, `acceleration_c_m_s2` against the drive's
    phase, `drift`, `settled`, `clipped`, `tries`."""

    @property
    def outcome(self) -> str:
        """Outcome of the plant's run, or of the exciter's without a plant: completed, disarmed, …, finished, …"""
        return str((self.plant or self.exciter)["outcome"])

    @property
    def recording(self) -> Recording | None:
        """The recording of the run, if there is one."""
        path = self.plant.get("recording")
        return None if path is None else Recording(path)

    def plot(self, ax: Any = None, *, quantity: Reading = "acceleration_c_m_s2") -> Any:
        """Draws the amplitudes of the responses along x and y over the frequency: of `head_force_n`,
        `acceleration_b_m_s2` or `acceleration_c_m_s2`; those that had not settled are crosses. `ax` are matplotlib's
        axes, by default those of a new figure; they are returned."""
        if quantity not in READINGS:
            raise ValueError(f"there is no reading {quantity!r}: expected one of {', '.join(READINGS)}")
        ax = _extras.axes(ax)
        for axis, color in (("x", "C0"), ("y", "C1")):
            for settled, marker in ((True, "o"), (False, "x")):
                rows = self.responses[self.responses["settled"] == settled]
                if len(rows):
                    amplitude = np.abs(rows[quantity][:, "xy".index(axis)])
                    label = f"along {axis}" if settled else f"along {axis}, not settled"
                    ax.plot(rows["frequency_hz"], amplitude, marker, color=color, markerfacecolor="none", label=label)
        name = quantity.removesuffix("_m_s2").removesuffix("_n").replace("_", " ")
        return _extras.labelled(ax, "frequency (Hz)", f"amplitude of the {name} ({unit(quantity)})")

    def __repr__(self) -> str:
        parts = [
            f"{name} {part['outcome']}" for name, part in (("plant", self.plant), ("exciter", self.exciter)) if part
        ]
        samples = f", {self.plant['samples']} samples" if self.plant else ""
        return f"<Report: {', '.join(parts)}{samples}, {len(self.responses)} responses>"


def run(
    scenario: Scenario,
    mode: Mode = "free",
    *,
    controller: Controller | None = None,
    load: LoadKind = "force",
    structure: Stepped | None = None,
    record: str | PathLike[str] | None = None,
    overwrite: bool = False,
    speed: float | None = None,
    patience_s: float | None = None,
    rearm: int = 0,
    overrun: Overrun | None = None,
    rt: RealTime | None = None,
    priority: int | None = None,
    core: int | None = None,
    cores_awake: bool = False,
    spin_s: float | Spin | None = None,
) -> Report:
    """Runs plant and exciter of a scenario on a bus inside this process, until the exciter's work is done.

    `mode` is free (simulated time, one loop, as fast as possible), lockstep (simulated time, the plant waits for each
    answer; `speed` is the number of simulated seconds a second) or real-time. A `controller` replaces the scenario's;
    `load` says whether it commands a force at the tip (N) or torques at the joints (N·m). A `structure` whose step is
    written in Python is under test, in the modes free and lockstep (the scenario states no other); its recording can't
    be simulated again. `record` names an MCAP file. `patience_s` is how long a plant waits to be armed, `rearm` how
    often the exciter restarts after a fault. Ctrl-C ends the run in order.

    In real time `overrun` is the reaction to a missed deadline: slip (the default), continue, fault or stop
    (`docs/real-time.md`). With `rt` auto the thread of the run, the plant's, asks for what `resonarm run` asks for:
    SCHED_FIFO with the `priority` of 80, or another from 1 to 99, all memory of the process locked, and the `core` if
    one is given. With require the run does not begin without them. By default it asks only for the arguments given: a
    priority, with it the memory, or a core. `cores_awake` keeps all cores of the machine out of their idle states
    during the run. The settings granted to the thread are `thread` in the plant's report; those refused are also logged
    by the logger `resonarm`. The plant's loop sleeps until `spin_s` seconds before each deadline, at most a quarter of
    the period, and then polls the clock; auto measures how late sleeps are, off, the default, sleeps until the
    deadline. The result is `spin` in the plant's report.

    Raises ValueError and OSError if the run can't begin, exceptions of the controller and of the structure, ValueError
    or TypeError, with the sample, for a load that is not two finite numbers, and with the time for a state or a motion
    of points that is not. The report has the reason if a run ends early.
    """
    own = _controller(scenario, controller, load, rearm)
    real_time = (overrun, rt, priority, core, cores_awake, spin_s)
    how = (mode, record, overwrite, speed, patience_s, rearm, True, real_time)
    plant, exciter, responses = _resonarm.run_both(scenario, how, own, parts(structure))
    return Report(plant, exciter, view(responses, RESPONSE))


def _controller(
    scenario: Scenario, controller: Controller | None, load: LoadKind, rearm: int
) -> tuple[Controller, str] | None:
    """The controller given and the kind of its load, checked."""
    _checks.scenario(scenario)
    if rearm < 0:
        raise ValueError(f"rearm is {rearm}: it must be 0 or more")
    if controller is None:
        if load != "force":
            raise ValueError("load applies only to a controller in Python, and none is given: leave it out")
        return None
    _checks.controller(controller)
    return (controller, load)


class Node(_resonarm.NodeRun):
    """A plant or an exciter that runs on a bus, on a separate thread, from its creation on; as a context manager it is
    stopped at the end of the block.

    `bus` is the address of a bus as on the command line, such as vcan0. The other arguments are those of `run`;
    `end_on_disarm` ends a plant's run when it is disarmed or faults. `spin_s` and `structure` are for a plant.
    """

    def __new__(
        cls,
        role: NodeRole,
        scenario: Scenario,
        bus: "str | _resonarm.BusEnd",
        mode: BusMode = "real-time",
        *,
        controller: Controller | None = None,
        load: LoadKind = "force",
        structure: Stepped | None = None,
        record: str | PathLike[str] | None = None,
        overwrite: bool = False,
        speed: float | None = None,
        patience_s: float | None = None,
        rearm: int = 0,
        end_on_disarm: bool = False,
        overrun: Overrun | None = None,
        rt: RealTime | None = None,
        priority: int | None = None,
        core: int | None = None,
        cores_awake: bool = False,
        spin_s: float | Spin | None = None,
    ) -> "Node":
        own = _controller(scenario, controller, load, rearm)
        if not isinstance(bus, str | _resonarm.BusEnd):
            raise TypeError(f"bus is of the type {type(bus).__name__}: it must be an address such as 'vcan0'")
        real_time = (overrun, rt, priority, core, cores_awake, spin_s)
        how = (mode, record, overwrite, speed, patience_s, rearm, end_on_disarm, real_time)
        return super().__new__(cls, role, scenario, how, bus, own, parts(structure))

    def wait(self) -> Report:
        """The report, after the run has ended by itself. Raises the error if it could not begin."""
        report, responses = self.join()
        # A plant counts its samples, an exciter those that it has played.
        parts = (report, {}) if "samples" in report else ({}, report)
        return Report(*parts, view(responses, RESPONSE))

    def end(self) -> Report:
        """Ends the run in order, and returns the report."""
        self.stop()
        return self.wait()

    def __enter__(self) -> "Node":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
