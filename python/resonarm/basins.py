"""Basins of attraction: which initial states reach which stable motion."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _checks, _extras, _resonarm
from ._dtypes import NUMBER, OUTCOME, Array, view
from ._load import Load
from .words import Coordinate

COORDINATES = ("alpha1_rad", "alpha2_rad", "alpha1_dot_rad_s", "alpha2_dot_rad_s")
"""The coordinates of a state, in its order."""
LABELS = ("α₁ (rad)", "α₂ (rad)", "α̇₁ (rad/s)", "α̇₂ (rad/s)")
UNDECIDED, DIVERGES = 0, -1
REACH = 1.5
MOST_POINTS = 1000
TIME_CONSTANTS = 40.0
State = tuple[float, float, float, float]
AT_REST: State = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, repr=False, eq=False)
class Cells:
    """Which motion the states of a grid reach."""

    coordinates: tuple[str, str]
    """The coordinates that vary, of the columns and of the rows."""
    x: NDArray[np.float64]
    """The values of the first, one a column."""
    y: NDArray[np.float64]
    """The values of the second, one a row."""
    motion: NDArray[np.int64]
    """Which motion each state reaches, from 1; 0 where this is undecided, −1 where it grows beyond all bounds."""
    periods: NDArray[np.uint64]
    """Periods of the excitation until that was certain."""
    ended_early: str | None
    """Why some stable motions may not be known; None if all are."""

    def _counted(self, motions: int) -> str:
        counts = [f"{np.count_nonzero(self.motion == k + 1)} reach motion {k + 1}" for k in range(motions)]
        for outcome, name in ((UNDECIDED, "undecided"), (DIVERGES, "diverge")):
            if count := np.count_nonzero(self.motion == outcome):
                counts.append(f"{count} {name}")
        of = f"<{type(self).__name__} in {self.coordinates[0]} and {self.coordinates[1]}"
        return f"{of}: of {self.motion.size} states {', '.join(counts)}>"

    def _drawn(self, ax: Any, sections: Sequence[NDArray[np.float64]], labels: Sequence[str]) -> Any:
        """Draws the grid, and the two coordinates of each motion at phase 0."""
        ax = _extras.axes(ax)
        for k in sorted({int(k) for k in np.unique(self.motion)}):
            color = {UNDECIDED: "0.7", DIVERGES: "black"}.get(k, f"C{k - 1}")
            name = {UNDECIDED: "undecided", DIVERGES: "beyond all bounds"}.get(k, f"reaches motion {k}")
            cells = np.ma.masked_where(self.motion != k, np.ones(self.motion.shape))
            colors = _extras.require("matplotlib.colors", "plot").ListedColormap([color])
            # Cells that touch, whatever the size of the figure.
            ax.pcolormesh(self.x, self.y, cells, cmap=colors, shading="nearest")
            ax.plot([], [], "s", color=color, label=name)
        for number, section in enumerate(sections):
            label = None if number else "stable motions"
            ax.plot(section[:, 0], section[:, 1], "D", color="black", markerfacecolor="white", label=label)
        ax.set_xlabel(labels[0])
        ax.set_ylabel(labels[1])
        ax.legend()
        return ax


@dataclass(frozen=True, repr=False, eq=False)
class Basins(Cells):
    """Which initial states reach which stable motion."""

    motions: tuple[_resonarm.StableMotion, ...]
    """The stable motions, by their largest |α1|."""

    def __repr__(self) -> str:
        return self._counted(len(self.motions))

    def plot(self, ax: Any = None) -> Any:
        """Draws the grid, a colour a motion, grey where undecided, and the motions at phase 0 as diamonds. `ax` are
        matplotlib's axes, by default those of a new figure; they are returned."""
        index = [COORDINATES.index(name) for name in self.coordinates]
        sections = [np.array(motion.section)[:, index] for motion in self.motions]
        return self._drawn(ax, sections, [LABELS[k] for k in index])


@dataclass(frozen=True)
class Grid:
    """Initial states over two coordinates."""

    coordinates: tuple[str, str]
    start: tuple[float, float]
    stop: tuple[float, float]
    points: tuple[int, int]
    initial: Sequence[float]
    known: tuple[str, ...] = COORDINATES

    def __post_init__(self) -> None:
        for name in self.coordinates:
            if name not in self.known:
                known = ", ".join(self.known)
                raise ValueError(f"there is no coordinate `{name}`: the coordinates are {known}")
        if self.coordinates[0] == self.coordinates[1]:
            raise ValueError(f"coordinates has {self.coordinates[0]} twice: give two")
        for count in self.points:
            if not 2 <= count <= MOST_POINTS:
                raise ValueError(f"points has {count}: it must be from 2 to {MOST_POINTS}")
        for start, stop in zip(self.start, self.stop, strict=True):
            if not (math.isfinite(start) and math.isfinite(stop) and start != stop):
                raise ValueError(f"the grid goes from {start:g} to {stop:g}: both must be numbers, and different")

    def axis(self, index: int) -> NDArray[np.float64]:
        """The values of a coordinate, equal to those of the command line to the last bit."""
        last = self.points[index] - 1
        places = np.arange(self.points[index])
        return np.asarray((self.start[index] * (last - places) + self.stop[index] * places) / last)

    def states(self) -> NDArray[np.float64]:
        """All states, row by row."""
        states = np.tile(np.array(self.initial, NUMBER), (self.points[0] * self.points[1], 1))
        y, x = np.meshgrid(self.axis(1), self.axis(0), indexing="ij")
        for name, values in zip(self.coordinates, (x, y), strict=True):
            states[:, self.known.index(name)] = values.ravel()
        return states


def pair(name: str, values: Sequence[Any]) -> tuple[Any, Any]:
    """Two values of an argument."""
    if len(values) != 2:
        raise ValueError(f"{name} has {len(values)} values: it needs two, X,Y")
    return (values[0], values[1])


def found(attractors: _resonarm.Attractors, states: NDArray[np.float64], wait: float, on_cores: bool) -> Array:
    """Rows with the motion that each state reaches, and the number of periods it takes."""
    return view(attractors.outcomes(states.astype(NUMBER).tobytes(), wait, on_cores), OUTCOME)


def basins(
    arm: _resonarm.Arm,
    /,
    frequency_hz: float,
    *,
    torque1_nm: float | None = None,
    torque2_nm: float | None = None,
    force_x_n: float | None = None,
    force_y_n: float | None = None,
    coordinates: Sequence[Coordinate] = ("alpha1_rad", "alpha1_dot_rad_s"),
    start: Sequence[float] | None = None,
    stop: Sequence[float] | None = None,
    points: Sequence[int] = (41, 41),
    initial: Sequence[float] = AT_REST,
    time_constants: float = TIME_CONSTANTS,
) -> Basins:
    """Which initial states reach which stable motion under A·sin(2πft), over a grid of two coordinates of the state at
    phase 0, computed on all cores as by `resonarm basins`.

    - `torque1_nm`, `torque2_nm`, or `force_x_n` and `force_y_n`: the amplitude A.
    - `coordinates`: two of alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s, by default α1 and α̇1.
    - `start`, `stop`: the first and the last value of each; by default 1.5 times as far as the largest stable motion
      reaches, to both sides.
    - `points`: the number of values of each, from 2 to 1000, by default (41, 41).
    - `initial`: the state that gives the other two coordinates, by default at rest.
    - `time_constants`: the longest wait, in time constants of the arm's slowest mode, by default 40.

    Raises ValueError for invalid arguments, ResonarmError where no stable motion is known. Ctrl-C ends it.
    """
    load = Load(torque1_nm, torque2_nm, force_x_n, force_y_n).checked()
    attractors = _resonarm.Attractors(arm, load.sine(frequency_hz))
    motions = tuple(attractors.motions)
    if not motions:
        raise _resonarm.ResonarmError(
            f"no stable motion is known at {frequency_hz:g} Hz: no state can be said to reach one"
        )
    names = pair("coordinates", coordinates)
    last = _reach(motions, names, frequency_hz) if stop is None else pair("stop", stop)
    first = (-last[0], -last[1]) if start is None else pair("start", start)
    grid = Grid(names, first, last, pair("points", points), _checks.four("initial", initial))
    rows = found(attractors, grid.states(), time_constants, True).reshape(grid.points[1], grid.points[0])
    motion, periods = np.ascontiguousarray(rows["motion"]), np.ascontiguousarray(rows["periods"])
    return Basins(names, grid.axis(0), grid.axis(1), motion, periods, attractors.ended_early, motions)


def _reach(
    motions: Sequence[_resonarm.StableMotion], coordinates: tuple[str, str], frequency_hz: float
) -> tuple[float, float]:
    """The default extent of the grid: 1.5 times the largest motion; for a rate this times 2πf."""
    reaches = []
    for name in coordinates:
        joint = COORDINATES.index(name) % 2 if name in COORDINATES else 0
        largest = max(motion.amplitude_rad[joint] for motion in motions)
        reaches.append(REACH * largest * (2 * math.pi * frequency_hz if "_dot_" in name else 1.0))
    return (reaches[0], reaches[1])
