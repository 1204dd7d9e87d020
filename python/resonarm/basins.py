"""Basins of attraction: the initial states that reach each stable periodic response."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _drive, _extras, _resonarm
from ._drive import Drive, Harmonics
from ._dtypes import NUMBER, OUTCOME, Array, view

UNDECIDED, DIVERGES = 0, -1
MOST_POINTS = 1000
TIME_CONSTANTS = 40.0
_TRIALS = 8
"""Undecided states from which responses are looked for, as by the command line."""


@dataclass(frozen=True, repr=False, eq=False)
class StableMotion:
    """A stable periodic response under a sine."""

    period: int
    """Periods of the excitation after which it repeats."""
    largest_multiplier: float
    """Largest magnitude of its Floquet multipliers, over its own period."""
    largest: NDArray[np.float64]
    """The largest magnitude of each coordinate, rad or m·√kg."""
    section: NDArray[np.float64]
    """The states at phase 0 of the excitation, one a row: coordinates, rates, states of elements."""

    def __repr__(self) -> str:
        return f"<StableMotion of period {self.period}, largest multiplier {self.largest_multiplier:.6}>"


@dataclass(frozen=True, repr=False, eq=False)
class Basins:
    """Basins of attraction: the stable periodic response that each initial state reaches."""

    coordinates: tuple[str, str]
    """The coordinates that vary, of the columns and of the rows."""
    x: NDArray[np.float64]
    """The values of the first, one a column."""
    y: NDArray[np.float64]
    """The values of the second, one a row."""
    motion: NDArray[np.int64]
    """Number of the periodic response that each state reaches, from 1; 0 where this is undecided, −1 where it grows
    beyond all bounds."""
    periods: NDArray[np.uint64]
    """Periods of the excitation until that was certain."""
    ended_early: str | None
    """Reason why the branch ended early, so that stable responses are missing; others may exist if it is None, too."""
    motions: tuple[StableMotion, ...]
    """The stable periodic responses, by their largest displacement where the structure is driven first. Those on which
    only states of the grid were found to settle, of up to 12 periods, come last."""
    known: tuple[str, ...]
    """The names of all coordinates and rates, in the order of a state."""

    def __repr__(self) -> str:
        counts = [f"{np.count_nonzero(self.motion == k + 1)} reach response {k + 1}" for k in range(len(self.motions))]
        for outcome, name in ((UNDECIDED, "undecided"), (DIVERGES, "diverge")):
            if count := np.count_nonzero(self.motion == outcome):
                counts.append(f"{count} {name}")
        axes = zip(self.coordinates, (self.x, self.y), strict=True)
        spans = [f"{name} from {values[0]:.4g} to {values[-1]:.4g}" for name, values in axes]
        return f"<Basins of {self.motion.size} states, {', '.join(spans)}: {', '.join(counts)}>"

    def plot(self, ax: Any = None) -> Any:
        """Draws the grid, with one colour for each periodic response and grey where undecided, and the responses at
        phase 0 as diamonds. `ax` are matplotlib's axes, by default those of a new figure; they are returned."""
        ax = _extras.axes(ax)
        for k in sorted({int(k) for k in np.unique(self.motion)}):
            color = {UNDECIDED: "0.7", DIVERGES: "black"}.get(k, f"C{k - 1}")
            name = {UNDECIDED: "undecided", DIVERGES: "beyond all bounds"}.get(k, f"reaches response {k}")
            cells = np.ma.masked_where(self.motion != k, np.ones(self.motion.shape))
            colors = _extras.require("matplotlib.colors", "plot").ListedColormap([color])
            # Cells that touch, whatever the size of the figure.
            ax.pcolormesh(self.x, self.y, cells, cmap=colors, shading="nearest")
            ax.plot([], [], "s", color=color, label=name)
        index = [self.known.index(name) for name in self.coordinates]
        for number, motion in enumerate(self.motions):
            at = motion.section[:, index]
            label = None if number else "stable responses"
            ax.plot(at[:, 0], at[:, 1], "D", color="black", markerfacecolor="white", label=label)
        return _extras.labelled(ax, *self.coordinates)


@dataclass(frozen=True)
class Grid:
    """Initial states over two coordinates."""

    coordinates: tuple[str, str]
    start: tuple[float, float]
    stop: tuple[float, float]
    points: tuple[int, int]
    initial: Sequence[float]
    """A state that gives the others: coordinates, rates, states of elements."""
    known: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.coordinates:
            if name not in self.known:
                known = ", ".join(self.known)
                raise ValueError(f"unknown coordinate `{name}`: the coordinates are {known}")
        if self.coordinates[0] == self.coordinates[1]:
            raise ValueError(f"coordinates has {self.coordinates[0]} twice: it must have two different ones")
        for count in self.points:
            if not 2 <= count <= MOST_POINTS:
                raise ValueError(f"points has {count}: each must be from 2 to {MOST_POINTS}")
        for start, stop in zip(self.start, self.stop, strict=True):
            if not (math.isfinite(start) and math.isfinite(stop) and start != stop):
                raise ValueError(f"invalid grid from {start:g} to {stop:g}: the ends must be two different numbers")

    def axis(self, index: int) -> NDArray[np.float64]:
        """The values of a coordinate, equal to those of the command line to the last bit."""
        last = self.points[index] - 1
        places = np.arange(self.points[index])
        # As the command line has it: `np.linspace` rounds in another way.
        return np.asarray((self.start[index] * (last - places) + self.stop[index] * places) / last)

    def states(self) -> NDArray[np.float64]:
        """Returns all states, row by row."""
        states = np.tile(np.array(self.initial, NUMBER), (self.points[0] * self.points[1], 1))
        y, x = np.meshgrid(self.axis(1), self.axis(0), indexing="ij")
        for name, values in zip(self.coordinates, (x, y), strict=True):
            states[:, self.known.index(name)] = values.ravel()
        return states


def pair(name: str, values: Sequence[Any]) -> tuple[Any, Any]:
    """Checks the two values of an argument."""
    if len(values) != 2:
        raise ValueError(f"{name} has {len(values)} values, expected two: X,Y")
    return (values[0], values[1])


def names(structure: _resonarm.Assembly) -> tuple[str, ...]:
    """The names of the coordinates and their rates, in the order of a state."""
    (_, places), (_, rates), *_elements = structure.channels()
    return (*places, *rates)


def full_states(structure: _resonarm.Assembly, initial: ArrayLike) -> NDArray[np.float64]:
    """Rows of states, those of elements, which are 0 where they are not given, included."""
    given = _checks.real("initial", initial)
    channels = [len(components) for _vector, components in structure.channels()]
    moving, size = sum(channels[:2]), sum(channels)
    if given.ndim != 2 or given.shape[1] not in (moving, size) or not len(given):
        more = f", or {size} with the states of its elements" if size > moving else ""
        raise ValueError(
            f"initial has the shape {given.shape}: give rows of {moving} numbers, coordinates and their rates{more}"
        )
    states = np.zeros((len(given), size), NUMBER)
    states[:, : given.shape[1]] = given
    return states


def grid_of(
    structure: _resonarm.Assembly,
    coordinates: Sequence[str],
    start: Sequence[float],
    stop: Sequence[float],
    points: Sequence[int],
    initial: Sequence[float] | None,
) -> Grid:
    """The grid of a structure's initial states."""
    known = names(structure)
    given = np.zeros(len(known)) if initial is None else _checks.real("initial", initial).ravel()
    state = full_states(structure, given[np.newaxis])[0].tolist()
    two = pair("coordinates", coordinates)
    return Grid(two, pair("start", start), pair("stop", stop), pair("points", points), state, known)


def found(attractors: _resonarm.Attractors, states: NDArray[np.float64], wait: float, on_cores: bool) -> Array:
    """Returns rows with the number of the periodic response that each state reaches, and the number of periods it
    takes."""
    return view(attractors.outcomes(states.tobytes(), wait, on_cores), OUTCOME)


def basins(
    structure: _resonarm.Assembly,
    /,
    frequency_hz: float,
    *,
    drive: Drive,
    coordinates: Sequence[str] | None = None,
    start: Sequence[float] | None = None,
    stop: Sequence[float] | None = None,
    points: Sequence[int] = (41, 41),
    initial: Sequence[float] | None = None,
    time_constants: float = TIME_CONSTANTS,
    drive_harmonics: Harmonics | None = None,
) -> Basins:
    """Computes which initial states reach which stable periodic response under A·sin(2πft), over a grid of two
    coordinates of the state at phase 0, computed on all cores as by `resonarm basins`.

    - `drive`: the amplitude at each degree of freedom that is driven, `{"joint1": 60}`, N·m at a joint, else N.
    - `coordinates`: the names of two coordinates or rates, as `alpha1_rad` or `q1_dot_m_sqrt_kg_s`, by default the
      first coordinate and its rate.
    - `start`, `stop`: the first and the last value of each; by default 1.5 times as far as the largest stable response
      reaches, to both sides.
    - `points`: the number of values of each, from 2 to 1000, by default (41, 41).
    - `initial`: the state that gives the other coordinates and rates, by default at rest. States of elements are zero.
    - `time_constants`: the longest wait, in time constants of the structure's slowest mode, by default 40.
    - `drive_harmonics`: harmonics of the loads, as those of `continuation`.

    Raises ValueError for invalid arguments, ResonarmError where no stable periodic response is known: none is with
    friction that sticks. Ctrl-C ends it.
    """
    known = names(structure)
    two = pair("coordinates", (known[0], known[len(known) // 2]) if coordinates is None else coordinates)
    # The grid is checked before the stable responses are looked for, which takes long.
    ends = ((-1.0, -1.0), (1.0, 1.0)) if start is None or stop is None else (start, stop)
    grid_of(structure, two, *ends, points, initial)
    attractors = _resonarm.Attractors(structure, _drive.parts(drive, _drive.frequency(frequency_hz), drive_harmonics))
    if not attractors.motions:
        raise _resonarm.ResonarmError(
            f"no stable periodic response is known at {frequency_hz:g} Hz, so no state can be assigned to one"
        )
    reach = tuple(attractors.reach(known.index(name)) for name in two)
    last = reach if stop is None else pair("stop", stop)
    first = (-last[0], -last[1]) if start is None else pair("start", start)
    grid = grid_of(structure, two, first, last, points, initial)
    states = grid.states()
    rows = found(attractors, states, time_constants, True).copy()
    undecided = np.flatnonzero(rows["motion"] == UNDECIDED)
    if len(undecided):
        trials = states[undecided[:: max(1, -(-len(undecided) // _TRIALS))]]
        count, attractors = len(attractors.motions), attractors.with_those_of(trials.tobytes())
        if len(attractors.motions) > count:
            rows[undecided] = found(attractors, states[undecided], time_constants, True)
    motions = tuple(StableMotion(*of[:2], np.array(of[2]), np.array(of[3])) for of in attractors.motions)
    rows = rows.reshape(grid.points[1], grid.points[0])
    motion, periods = np.ascontiguousarray(rows["motion"]), np.ascontiguousarray(rows["periods"])
    axes = (grid.axis(0), grid.axis(1))
    return Basins(two, *axes, motion, periods, attractors.ended_early, motions, known)
