"""Branches of periodic motions, their bifurcations, and the curves of these in two parameters."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from . import _extras, _resonarm
from ._dtypes import ORBIT, SINGULAR, Array, named, view
from ._load import Load
from .words import Parameter


@dataclass(frozen=True, repr=False, eq=False)
class Curve:
    """The curve of a fold or a period doubling in two parameters."""

    kind: str
    """`fold` or `period-doubling`."""
    parameters: tuple[str, str]
    """The parameter of the branch and the second one."""
    points: Array
    """Rows with `value` (of the first parameter), `value2` (of the second) and `harmonic1_rad`."""
    turns: Array
    """Points where it turns back in the second parameter; `kind` is `turn`, or `cusp` where two folds meet."""

    def __repr__(self) -> str:
        return f"<Curve of {self.kind}s in {self.parameters[0]} and {self.parameters[1]}: {len(self.points)} points>"

    def plot(self, ax: Any = None) -> Any:
        """Draws the second parameter over the first, turns and cusps as markers. `ax` are matplotlib's axes, by default
        those of a new figure; they are returned."""
        ax = _extras.axes(ax)
        ax.plot(self.points["value"], self.points["value2"], label=self.kind)
        for kind in np.unique(self.turns["kind"]):
            at = self.turns[self.turns["kind"] == kind]
            ax.plot(at["value"], at["value2"], "o", markersize=4, label=str(kind))
        ax.set_xlabel("{} ({})".format(*_label(self.parameters[0])))
        ax.set_ylabel("{} ({})".format(*_label(self.parameters[1])))
        ax.legend()
        return ax


@dataclass(frozen=True, repr=False, eq=False)
class Branch:
    """A branch of periodic motions."""

    parameter: str
    """The parameter in which it was followed."""
    points: Array
    """Rows with `value` (of the parameter), `frequency_hz`, `amplitude_rad` (the largest |α1|, |α2|), `harmonic1_rad`
    (of the component at the excitation's frequency), `stable`, `period` (in those of the excitation) and the four
    Floquet `multipliers`, the largest first."""
    bifurcations: Array
    """The same columns after `kind`: fold, period-doubling, neimark-sacker or branch-point."""
    doubled: tuple["Branch", ...] = ()
    """The branches of twice the period that leave at period doublings, if requested."""
    curves: tuple[Curve, ...] = ()
    """The curves of the folds and period doublings, if requested."""

    def __repr__(self) -> str:
        unstable = int(np.count_nonzero(~self.points["stable"]))
        kinds, counts = np.unique(self.bifurcations["kind"], return_counts=True)
        found = ", ".join(f"{count} × {kind}" for kind, count in zip(kinds, counts, strict=True))
        of = f"<Branch in {self.parameter}: {len(self.points)} motions, {unstable} of them unstable"
        return f"{of}; {found}>" if found else f"{of}>"

    def plot(self, ax: Any = None, *, joint: int = 1) -> Any:
        """Draws the largest |α| of a joint, 1 or 2, over the parameter: stable motions as lines, unstable ones dashed,
        bifurcations as markers. `ax` are matplotlib's axes, by default those of a new figure; they are returned."""
        ax, index = _extras.axes(ax), joint - 1
        x, y, stable = self.points["value"], self.points["amplitude_rad"][:, index], self.points["stable"]
        stretches(ax, x, y, stable)
        for kind in np.unique(self.bifurcations["kind"]):
            at = self.bifurcations[self.bifurcations["kind"] == kind]
            ax.plot(at["value"], at["amplitude_rad"][:, index], "o", markersize=4, label=str(kind))
        ax.set_xlabel("{} ({})".format(*_label(self.parameter)))
        ax.set_ylabel(f"largest |{'α₁' if joint == 1 else 'α₂'}| (rad)")
        ax.legend()
        return ax


def stretches(ax: Any, x: Array, y: Array, stable: Array) -> None:
    """Draws y over x: where motions are stable as lines, elsewhere dashed."""
    # A motion on either side of a change belongs to both stretches, so that the line has no gap.
    edges = [0, *(np.flatnonzero(np.diff(stable)) + 1), len(x)]
    for first, last in pairwise(edges):
        stretch = slice(max(first - 1, 0), last)
        color, style, label = ("C0", "-", "stable") if len(stable) and stable[first] else ("C3", "--", "unstable")
        # One entry of the legend for all stretches of a kind.
        is_known = any(line.get_label() == label for line in ax.lines)
        ax.plot(x[stretch], y[stretch], color=color, linestyle=style, label=None if is_known else label)


class BranchEndedEarly(_resonarm.ResonarmError):
    """A branch could not be followed to its end. `branch` is the branch up to there."""

    def __init__(self, reason: str, branch: Branch) -> None:
        super().__init__(reason)
        self.branch = branch

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.branch)


def _label(parameter: str) -> tuple[str, str]:
    name, unit = _resonarm.parameter_label(parameter)
    return name, unit or "N or N·m"


def continuation(
    arm: _resonarm.Arm,
    /,
    parameter: Parameter,
    start: float,
    stop: float,
    *,
    torque1_nm: float | None = None,
    torque2_nm: float | None = None,
    force_x_n: float | None = None,
    force_y_n: float | None = None,
    frequency_hz: float | None = None,
    doubled: bool = False,
    curves_in: Parameter | None = None,
    curves_to: float | None = None,
    most_harmonics: int = 64,
    most_points: int = 20_000,
    largest_step: float = 0.25,
) -> Branch:
    """Follows the periodic motions under A·sin(2πft) from `start` to `stop` of a parameter, around folds.

    `parameter` is frequency (Hz), amplitude (of the load, N or N·m), beta1_deg, beta2_deg or a parameter of the arm by
    its name, in its SI unit.

    - `torque1_nm` and `torque2_nm`, or `force_x_n` and `force_y_n`: the amplitude A of torques at the joints or of a
      force at the tip. If the amplitude varies, a force gives only the direction; without one the load is a torque
      at joint 1.
    - `frequency_hz`: of the excitation, if another parameter varies.
    - `doubled`: follow the motions of twice the period that leave at period doublings, too.
    - `curves_in`, `curves_to`: follow each fold and period doubling in a second parameter as well, up to a value.
    - `most_harmonics` (64), `most_points` (20 000), `largest_step` (0.25, relative to the motion's size).

    Raises ValueError for invalid arguments, BranchEndedEarly if the continuation ends before `stop`, with the branch
    up to there.
    """
    _resonarm.parameter_label(parameter)  # an unknown one raises an error with the known names
    load = _direction(parameter, Load(torque1_nm, torque2_nm, force_x_n, force_y_n))
    amplitude = math.hypot(*load)
    if parameter == "frequency":
        if frequency_hz is not None:
            raise ValueError("frequency_hz is for runs in another parameter: leave it out")
        frequency_hz = start
    elif frequency_hz is None or not (math.isfinite(frequency_hz) and frequency_hz > 0):
        raise ValueError(f"frequency_hz is {frequency_hz}: it must be a positive number")
    if not 1e-6 <= largest_step <= 1:
        raise ValueError(f"largest_step is {largest_step:g}: it must be from 0.000001 to 1")
    if not 3 <= most_harmonics <= 1000:
        raise ValueError(f"most_harmonics is {most_harmonics}: it must be from 3 to 1000")
    if (curves_in is None) != (curves_to is None):
        raise ValueError("curves_in and curves_to belong together: give both or neither")
    if curves_in == parameter:
        raise ValueError(f"curves_in is {parameter}, in which the branch is followed already: name another parameter")
    u1, u2, fx, fy = load
    direction = (u1 / amplitude, u2 / amplitude, fx / amplitude, fy / amplitude)
    traced = _resonarm.trace_branch(
        arm,
        (direction, amplitude, frequency_hz),
        (parameter, start, stop),
        (most_harmonics, most_points, largest_step),
        doubled,
        (curves_in, curves_to) if curves_in is not None and curves_to is not None else None,
    )
    branch = _branch(traced, parameter, curves_in or "")
    if traced.ended_early is not None:
        raise BranchEndedEarly(traced.ended_early, branch)
    return branch


def _direction(parameter: str, load: Load) -> tuple[float, float, float, float]:
    """u1, u2, Fx, Fy. If the amplitude varies: the direction of the force, or 1 N·m at joint 1 without one."""
    if parameter != "amplitude":
        return load.checked().components
    if load.is_torque:
        raise ValueError("the amplitude is what varies: leave torque1_nm out")
    return load.checked().components if load.is_force else (1.0, 0.0, 0.0, 0.0)


def _branch(traced: _resonarm.Traced, parameter: str, second: str) -> Branch:
    found = [(view(points, ORBIT), named(kinds, view(events, ORBIT))) for points, kinds, events in traced.branches]
    curves = tuple(
        Curve(
            kind,
            (parameter, second),
            view(points, SINGULAR),
            named(["cusp" if cusp else "turn" for cusp in cusps], view(turns, SINGULAR)),
        )
        for kind, points, turns, cusps in traced.curves
    )
    doubled = tuple(Branch(parameter, *of) for of in found[1:])
    return Branch(parameter, *found[0], doubled, curves)
