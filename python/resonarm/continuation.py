"""Branches of periodic responses, their bifurcations, and the curves of these in two parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import _checks, _drive, _extras, _resonarm
from ._drive import Drive, Harmonics
from ._dtypes import NUMBER, Array, orbit, prefixed, singular, texts, view


@dataclass(frozen=True, repr=False, eq=False)
class Curve:
    """The curve of a fold or a period doubling in two parameters."""

    kind: str
    """`fold` or `period-doubling`."""
    parameters: tuple[str, str]
    """The parameter of the branch and the second one."""
    labels: tuple[str, str]
    """Names of both in pictures, with their units."""
    points: Array
    """Rows with `value` (of the first parameter), `value2` (of the second) and the readings of a branch's `points`."""
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
        return _extras.labelled(ax, *self.labels)


class Origin(NamedTuple):
    """The place where a branch begins."""

    kind: str
    """`branch-point` or `period-doubling` for a branch that leaves another one there; `detached`, or with another
    period `sub-harmonic`, for one to which no other leads."""
    value: float
    """The parameter there, or where the branch was found."""
    branch: int | None
    """The branch that it leaves: 0 for the first, k for `(isolas + branches)[k - 1]`; None if it leaves none."""
    period: int
    """The period of the branch, in those of the excitation."""
    mirrored: bool
    """Whether the branch has a mirror image, by a symmetry that it breaks. The image is not in the results."""


class Searched(NamedTuple):
    """What was searched for responses that a branch does not reach. Others may exist."""

    not_searched: str | None
    """The reason for which responses with the period of the excitation were not searched: `coordinate` (the frequency
    does not vary), `early` (the branch ended early), `linear` (the structure is), `no-load`; None if they were."""
    frequencies_hz: tuple[float, ...]
    """Frequencies at which Newton's method was started from random responses."""
    starts: int
    """The number of starts at each."""
    largest: dict[str, float]
    """For each degree of freedom that is read, the largest displacement from which it was started, m or rad."""
    loads: tuple[float, float] | None
    """The least and the largest amplitude to which folds were followed; None if none was."""
    attached: int
    """The number of branches that were found, leave a known one at a bifurcation and are not in the results."""
    sub_harmonics: tuple[float, ...] | None
    """The values of the parameter at which responses of 2 and 3 periods of the excitation were sought; None if not."""


@dataclass(frozen=True, repr=False, eq=False)
class Branch:
    """A branch of periodic responses. The excitation is A·sin(2πft)."""

    parameter: str
    """The quantity in which it was followed: frequency (Hz), amplitude (of the first load, N, or N·m at a joint) or a
    parameter of the structure, as `link2.angle_deg`, in its unit."""
    label: str
    """Name in pictures, with the unit."""
    drive: dict[str, float]
    """The loads: the amplitude at each degree of freedom that is driven, or their ratio if the amplitude varies."""
    at: tuple[str, ...]
    """The degrees of freedom that are read."""
    points: Array
    """Rows with `stability` (stable, unstable, undecided within the accuracy of the multipliers, or conservative, where
    disturbances neither die out nor grow; empty where it is not computed), `value` (of the parameter), `frequency_hz`,
    `drive` (the amplitude of the first load, N, or N·m at a joint), `stable` (whether `stability` is stable),
    `harmonics`, `period` (in those of the excitation), `truncation_error` (of the harmonics left out, over the
    response's size), `state` (at phase 0 of the excitation: coordinates, rates, states of elements, from which
    `from_state` starts), for each degree of freedom that is read, as `tip.x`, the columns `tip_x_largest_m` (the
    largest displacement from rest), `tip_x_mean_m` and complex `tip_x_harmonic1_m` (the component at f: its argument is
    the phase by which it leads the drive), of a joint in rad (`joint2_largest_rad`), and the Floquet `multipliers`, the
    largest first, followed by NaN where others have more."""
    bifurcations: Array
    """The same columns after `kind`: fold, period-doubling, neimark-sacker or branch-point. At a Neimark–Sacker point
    `rotation_number` and `beat_hz` are the second frequency of the vibration that begins there, as a fraction of that
    of the response, from 0 to 1/2, and in Hz; elsewhere they are NaN."""
    peaks: Array
    """The same columns: for each degree of freedom that is read the response with its largest displacement, located
    between the points."""
    unlocated: tuple[tuple[str, float, float], ...] = ()
    """Bifurcations that were detected between two points and could not be located: kind, and the parameter at both
    points."""
    stability: bool = True
    """Whether the stability was computed. If not, `stable` is False in all rows, and bifurcations are folds alone."""
    origin: Origin | None = None
    """Where the branch begins; None for the first."""
    isolas: tuple["Branch", ...] = ()
    """Branches that a search found and to which no other leads: closed ones, and those that leave the range."""
    branches: tuple["Branch", ...] = ()
    """If requested, the branches that leave this one or an isola at bifurcations, and those that leave these."""
    left_out: tuple[tuple[Origin, str], ...] = ()
    """Places where branches begin that were not followed, with the reasons."""
    searched: Searched | None = None
    """What was searched; None for the other branches."""
    curves: tuple[Curve, ...] = ()
    """The curves of the folds and period doublings, if requested."""

    def __repr__(self) -> str:
        unstable = f"{np.count_nonzero(~self.points['stable'])} of them not stable"
        kinds, counts = np.unique(self.bifurcations["kind"], return_counts=True)
        found = ", ".join(f"{count} × {kind}" for kind, count in zip(kinds, counts, strict=True))
        of = f"<Branch in {self.parameter}, driven at {', '.join(self.drive)}: {len(self.points)} periodic responses"
        of += f", {unstable if self.stability else 'stability not computed'}"
        return f"{of}; {found}>" if found else f"{of}>"

    def plot(self, ax: Any = None, *, at: str | None = None) -> Any:
        """Draws the largest displacement of a degree of freedom, by default the first that is read, over the parameter:
        stable responses as lines, unstable ones dashed, undecided and conservative ones as black lines, all as lines
        if the stability was not computed, bifurcations as markers, with the other branches. `ax` are matplotlib's
        axes, by default those of a new figure; they are returned."""
        at = self.at[0] if at is None else at
        ax, column = _extras.axes(ax), self.column(at)
        for branch in (self, *self.isolas, *self.branches):
            points = branch.points
            _stretches(ax, points["value"], points[column], points["stability"])
        for kind in np.unique(self.bifurcations["kind"]):
            found = self.bifurcations[self.bifurcations["kind"] == kind]
            ax.plot(found["value"], found[column], "o", markersize=4, label=str(kind))
        return _extras.labelled(ax, self.label, f"largest displacement of {at} ({column.rpartition('_')[2]})")

    def column(self, at: str, reading: str = "largest") -> str:
        """The name of a column of a degree of freedom that is read: its `largest`, `mean` or `harmonic1`."""
        if at not in self.at:
            raise ValueError(f"at is {at!r}: the branch is read at {', '.join(self.at)}")
        prefix = f"{at.replace('.', '_')}_{reading}_"
        return next(name for name in self.points.dtype.names or () if name.startswith(prefix))


_STYLES = {
    "stable": ("C0", "-", "stable"),
    "unstable": ("C3", "--", "unstable"),
    "undecided": ("black", "-", "stability undecided"),
    "conservative": ("black", "-", "neither stable nor unstable"),
    "": ("black", "-", "stability not computed"),
}
"""Colour, dashes and label of a stretch by the stability of its responses, as in the figures of `resonarm continue`."""


def _stretches(ax: Any, x: Array, y: Array, stability: Array) -> None:
    """Draws y over x, each stretch of one stability in its style."""
    # A response on either side of a change belongs to both stretches, so that the line has no gap.
    edges = [0, *(np.flatnonzero(stability[1:] != stability[:-1]) + 1), len(x)]
    for first, last in pairwise(edges):
        stretch = slice(max(first - 1, 0), last)
        color, style, label = _STYLES[str(stability[first]) if len(stability) else "stable"]
        # One entry of the legend for all stretches of a kind.
        is_known = any(line.get_label() == label for line in ax.lines)
        ax.plot(x[stretch], y[stretch], color=color, linestyle=style, label=None if is_known else label)


class EndedEarly(_resonarm.ResonarmError):
    """A branch, or one that it leads to, could not be followed to its end. `branch` is what was found."""

    def __init__(self, reason: str, branch: Branch) -> None:
        super().__init__(reason)
        self.branch = branch

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.branch)


def continuation(
    structure: _resonarm.Assembly,
    /,
    parameter: str,
    start: float,
    stop: float,
    *,
    drive: Drive | str,
    frequency_hz: float | None = None,
    at: Sequence[str] = (),
    branches: bool = False,
    search: bool = False,
    curves_in: str | None = None,
    curves_to: float | None = None,
    most_harmonics: int = 64,
    most_points: int = 20_000,
    largest_step: float = 0.25,
    stability: bool = True,
    tolerance: float | None = None,
    from_state: ArrayLike | None = None,
    drive_harmonics: Harmonics | None = None,
) -> Branch:
    """Follows the periodic responses under A·sin(2πft) from `start` to `stop` of a parameter, around folds.

    `parameter` is frequency (Hz), amplitude (N, or N·m at a joint) or a parameter of the structure, as
    `link2.angle_deg`, `mode1.damping_ratio` or `element1.gap_m`; `parameters` has all of them.

    - `drive`: the amplitude at each degree of freedom that is driven, `{"joint1": 60}`. If the amplitude varies, the
      name of one, `"joint1"`, or several in a ratio; then it is that of the first.
    - `frequency_hz`: f, if another parameter varies.
    - `at`: where the response is read, by default where the structure is driven.
    - `branches`: follow the branches that leave it at branch points and period doublings, and those that leave these,
      up to 8 periods of the excitation, and sub-harmonic ones of 2 and 3 periods that are found near free vibrations.
    - `search`: search further for responses that the branch does not reach. Without it, they are searched at 5
      frequencies, and along folds for half to twice the amplitude if all forces are smooth. With it, they are searched
      at 20 frequencies, along more folds for a quarter to 4 times the amplitude, and for 2 and 3 periods.
    - `curves_in`, `curves_to`: follow each fold and period doubling in a second parameter as well, up to a value.
    - `most_harmonics` (64), `most_points` (20 000), `largest_step` (0.25, relative to the response's size).
    - `stability`: False leaves it out, and with it all bifurcations but folds. Faster, with many modes most.
    - `tolerance`: the largest error from the harmonics left out, over the response's size, from 1e-14 to 0.1; by
      default it depends on the elements.
    - `from_state`: start on the response near this state at phase 0 of the excitation: coordinates, rates, and possibly
      states of elements, as a row's `state`, or a `section` of `basins`. The response may repeat after several periods
      of the excitation, up to 12.
    - `drive_harmonics`: harmonics of the loads by their order, with the amplitude in the unit of the first load, and
      possibly a phase in degrees: `{3: 2.0}` or `{3: (2.0, 90)}`.

    Raises ValueError for invalid arguments, EndedEarly if the continuation ends before `stop`, with the branch up to
    there.
    """
    if parameter == "frequency":
        if frequency_hz is not None:
            raise ValueError("frequency_hz applies only to a branch in another parameter: leave it out")
        hz = start
    else:
        hz = _drive.frequency(frequency_hz)
    if parameter == "amplitude":
        loads = _drive.direction(drive, hz, drive_harmonics)
    else:
        loads = _drive.parts(drive, hz, drive_harmonics)  # type: ignore[arg-type]
    _check_settings(most_harmonics, most_points, largest_step, tolerance)
    near = None if from_state is None else _checks.real("from_state", from_state).ravel().tolist()
    if (curves_in is None) != (curves_to is None):
        raise ValueError("only one of curves_in and curves_to is given: give both or neither")
    if curves_in == parameter:
        raise ValueError(f"curves_in is {parameter}, in which the branch is followed already: give another parameter")
    if isinstance(at, str):
        raise TypeError(f"at is {at!r}: it must be a list of degrees of freedom, as [{at!r}]")
    amplitudes = {name: loads[1] * share for name, share in loads[0]}
    for name in amplitudes:
        structure.units("drive", name)  # an unknown one raises an error with the known names
    read = tuple(dict.fromkeys(at)) or tuple(amplitudes)
    traced = _resonarm.trace_branch(
        structure,
        loads,
        (parameter, start, stop),
        list(read),
        (most_harmonics, most_points, largest_step, stability, tolerance, near),
        ((branches, search), None if curves_in is None or curves_to is None else (curves_in, curves_to)),
    )
    units = [(dof, structure.units("at", dof)[0]) for dof in read]
    label = _label(structure, parameter, amplitudes)

    def branch(rows: _resonarm.TracedBranch, **more: Any) -> Branch:
        form = orbit(units, rows.states, rows.multipliers)
        points, peaks, bifurcations = (
            prefixed(view(part, form), stability=texts(names))
            for names, part in zip(rows.stability, (rows.points, rows.peaks, rows.bifurcations), strict=True)
        )
        beats = np.array(rows.beats, NUMBER).reshape(-1, 2).T
        bifurcations = prefixed(bifurcations, kind=texts(rows.kinds), rotation_number=beats[0], beat_hz=beats[1])
        unlocated = tuple(rows.unlocated)
        of = (parameter, label, amplitudes, read, points, bifurcations, peaks, unlocated, stability)
        return Branch(*of, **more)

    curves = []
    if curves_in is not None:
        names, labels = (parameter, curves_in), (label, _label(structure, curves_in, amplitudes))
        form = singular(units)
        for kind, points, turns, cusps in traced.curves:
            kinds = texts(["cusp" if cusp else "turn" for cusp in cusps])
            curves.append(Curve(kind, names, labels, view(points, form), prefixed(view(turns, form), kind=kinds)))
    isolas, leaving = (
        tuple(branch(rows, origin=Origin(*origin)) for origin, rows in others)
        for others in (traced.isolas, traced.branches)
    )
    left_out = tuple((Origin(*origin), reason) for origin, reason in traced.left_out)
    reason, frequencies_hz, starts, largest, along, attached, sought = traced.searched
    searched = Searched(
        reason,
        tuple(frequencies_hz),
        starts,
        dict(zip(read, largest, strict=False)),
        along,
        attached,
        None if sought is None else tuple(sought),
    )
    more: dict[str, Any] = {"isolas": isolas, "branches": leaving, "left_out": left_out, "searched": searched}
    found = branch(traced.branch, curves=tuple(curves), **more)
    if traced.ended_early is not None:
        raise EndedEarly(traced.ended_early, found)
    return found


def _label(structure: _resonarm.Assembly, parameter: str, drive: dict[str, float]) -> str:
    """Returns the name of a parameter in pictures, with its unit."""
    if parameter == "frequency":
        return "excitation frequency (Hz)"
    if parameter == "amplitude":
        first = next(iter(drive))
        return f"load at {first} ({structure.units('drive', first)[1]})"
    _value, unit = structure.parameter(parameter)
    return f"{parameter} ({unit})" if unit else parameter


def _check_settings(most_harmonics: int, most_points: int, largest_step: float, tolerance: float | None) -> None:
    """Raises ValueError for limits that no continuation can have."""
    if tolerance is not None and not 1e-14 <= tolerance <= 0.1:
        raise ValueError(f"tolerance is {tolerance:g}: it must be from 1e-14 to 0.1")
    if not 1e-6 <= largest_step <= 1:
        raise ValueError(f"largest_step is {largest_step:g}: it must be from 0.000001 to 1")
    if not 3 <= most_harmonics <= 1000:
        raise ValueError(f"most_harmonics is {most_harmonics}: it must be from 3 to 1000")
    if most_points < 1:
        raise ValueError(f"most_points is {most_points}: it must be 1 or more")
