"""Branches of periodic motions of chains and modal structures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from . import _extras, _resonarm
from ._dtypes import Array, named, structure_orbit, view
from .continuation import stretches

StructureParameter = Literal["frequency", "amplitude"]
"""The quantity in which a branch of a structure is followed."""


@dataclass(frozen=True, repr=False, eq=False)
class StructureBranch:
    """A branch of periodic motions of a structure. The drive is A·sin(2πft)."""

    parameter: StructureParameter
    """The quantity in which it was followed: frequency (Hz) or amplitude (N, or N·m at a joint)."""
    drive: str
    """The degree of freedom that is driven."""
    drive_unit: str
    """The unit of the load there: N, or N·m at a joint."""
    at: tuple[str, ...]
    """The degrees of freedom that are read."""
    points: Array
    """Rows with `value` (of the parameter), `frequency_hz`, `drive` (the amplitude, N, or N·m at a joint), `stable`
    (False where it is not known, too: all multipliers are NaN there), `harmonics`, for each degree of freedom that is
    read, as `tip.x`, the columns `tip_x_largest_m` (the largest displacement from rest), `tip_x_mean_m` and complex
    `tip_x_harmonic1_m` (the component at f: its argument is the phase by which it leads the drive), of a joint in rad
    (`joint2_largest_rad`), and the Floquet `multipliers`, the largest first, followed by NaN where others have more."""
    bifurcations: Array
    """The same columns after `kind`: fold, period-doubling, neimark-sacker or branch-point."""
    peaks: Array
    """The same columns: for each degree of freedom that is read the motion with its largest displacement, located
    between the points."""
    unlocated: tuple[tuple[str, float, float], ...] = ()
    """Bifurcations that were detected between two points and could not be located: kind, and the parameter at both
    points."""
    stability: bool = True
    """Whether the stability was computed. If not, `stable` is False in all rows, and bifurcations are folds alone."""

    def __repr__(self) -> str:
        unstable = f"{np.count_nonzero(~self.points['stable'])} of them not stable"
        kinds, counts = np.unique(self.bifurcations["kind"], return_counts=True)
        found = ", ".join(f"{count} × {kind}" for kind, count in zip(kinds, counts, strict=True))
        of = f"<StructureBranch in {self.parameter}, driven at {self.drive}: {len(self.points)} motions"
        of += f", {unstable if self.stability else 'stability not computed'}"
        return f"{of}; {found}>" if found else f"{of}>"

    def plot(self, ax: Any = None, *, at: str | None = None) -> Any:
        """Draws the largest displacement of a degree of freedom, by default the first that is read, over the parameter:
        stable motions as lines, others dashed, all as lines if the stability was not computed, bifurcations as markers.
        `ax` are matplotlib's axes, by default those of a new figure; they are returned."""
        at = self.at[0] if at is None else at
        if at not in self.at:
            raise ValueError(f"at is {at!r}: the branch is read at {', '.join(self.at)}")
        ax, prefix = _extras.axes(ax), f"{at.replace('.', '_')}_largest_"
        column = next(name for name in self.points.dtype.names or () if name.startswith(prefix))
        solid = self.points["stable"] if self.stability else np.ones(len(self.points), bool)
        stretches(ax, self.points["value"], self.points[column], solid)
        for kind in np.unique(self.bifurcations["kind"]):
            found = self.bifurcations[self.bifurcations["kind"] == kind]
            ax.plot(found["value"], found[column], "o", markersize=4, label=str(kind))
        of_frequency = self.parameter == "frequency"
        ax.set_xlabel("excitation frequency (Hz)" if of_frequency else f"load at {self.drive} ({self.drive_unit})")
        ax.set_ylabel(f"largest displacement of {at} ({column.removeprefix(prefix)})")
        ax.legend()
        return ax


class StructureBranchEndedEarly(_resonarm.ResonarmError):
    """A branch of a structure could not be followed to its end. `branch` is the branch up to there."""

    def __init__(self, reason: str, branch: StructureBranch) -> None:
        super().__init__(reason)
        self.branch = branch

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.branch)


def continuation(
    structure: _resonarm.Assembly,
    /,
    parameter: StructureParameter,
    start: float,
    stop: float,
    *,
    drive: str,
    amplitude: float | None = None,
    frequency_hz: float | None = None,
    at: Sequence[str] = (),
    most_harmonics: int = 64,
    most_points: int = 20_000,
    largest_step: float = 0.25,
    stability: bool = True,
) -> StructureBranch:
    """Follows the periodic motions under A·sin(2πft) from `start` to `stop` of a parameter, around folds.

    `parameter` is frequency (Hz) or amplitude (N, or N·m at a joint).

    - `drive`: what is driven, point and axis as `tip.x`, or a joint as `joint2`; `dofs` has all of them.
    - `amplitude`: A, if the frequency varies; `frequency_hz`: f, if the amplitude varies.
    - `at`: where the motion is read, by default where it is driven.
    - `most_harmonics` (64), `most_points` (20 000), `largest_step` (0.25, relative to the motion's size).
    - `stability`: False leaves it out, and with it all bifurcations but folds. Faster, with many modes most.

    Raises ValueError for invalid arguments, StructureBranchEndedEarly if the continuation ends before `stop`, with the
    branch up to there.
    """
    amplitude, frequency_hz = _excitation(parameter, start, amplitude, frequency_hz)
    _check_walk(most_harmonics, most_points, largest_step)
    if isinstance(at, str):
        raise TypeError(f"at is {at!r}: it is a list of degrees of freedom, as [{at!r}]")
    read = list(dict.fromkeys(at)) or [drive]
    units = [(dof, structure.units("at", dof)[0]) for dof in read]
    traced = _resonarm.trace_structure(
        structure,
        (drive, amplitude, frequency_hz),
        (parameter == "amplitude", start, stop),
        read,
        (most_harmonics, most_points, largest_step),
        stability,
    )
    form = structure_orbit(units, traced.multipliers)
    points, peaks = view(traced.points, form), view(traced.peaks, form)
    bifurcations = named(traced.kinds, view(traced.bifurcations, form))
    _displacement, unit = structure.units("drive", drive)
    unlocated = tuple(traced.unlocated)
    branch = StructureBranch(parameter, drive, unit, tuple(read), points, bifurcations, peaks, unlocated, stability)
    if traced.ended_early is not None:
        raise StructureBranchEndedEarly(traced.ended_early, branch)
    return branch


def _check_walk(most_harmonics: int, most_points: int, largest_step: float) -> None:
    """Raises ValueError for limits that no continuation can have."""
    if not 1e-6 <= largest_step <= 1:
        raise ValueError(f"largest_step is {largest_step:g}: it must be from 0.000001 to 1")
    if not 3 <= most_harmonics <= 1000:
        raise ValueError(f"most_harmonics is {most_harmonics}: it must be from 3 to 1000")
    if most_points < 1:
        raise ValueError(f"most_points is {most_points}: it must be 1 or more")


def _excitation(
    parameter: str, start: float, amplitude: float | None, frequency_hz: float | None
) -> tuple[float, float]:
    """The amplitude and the frequency at the start."""
    if parameter == "frequency":
        if frequency_hz is not None:
            raise ValueError("frequency_hz is for runs in another parameter: leave it out")
        return needed_amplitude(amplitude), start
    if parameter == "amplitude":
        if amplitude is not None:
            raise ValueError("the amplitude is what varies: leave amplitude out")
        if frequency_hz is None or not (math.isfinite(frequency_hz) and frequency_hz > 0):
            got = "missing" if frequency_hz is None else f"{frequency_hz:g}"
            raise ValueError(f"frequency_hz is {got}: it must be a positive number")
        return 1.0, frequency_hz
    raise ValueError(f"parameter {parameter}: of a structure vary frequency or amplitude")


def needed_amplitude(amplitude: float | None) -> float:
    """The amplitude of an excitation, finite and not 0."""
    if amplitude is None:
        raise ValueError("give the amplitude of the excitation: amplitude=A")
    if not math.isfinite(amplitude) or amplitude == 0:
        raise ValueError(f"amplitude is {amplitude:g}: it must be a finite number other than 0")
    return float(amplitude)
