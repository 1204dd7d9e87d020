"""Basins of attraction of chains and modal structures: which initial states reach which stable motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _checks, _resonarm
from ._dtypes import NUMBER, OUTCOME, view
from .basins import TIME_CONSTANTS, Cells, Grid, pair
from .structure_branch import needed_amplitude


@dataclass(frozen=True, repr=False, eq=False)
class StructureMotion:
    """A stable periodic motion of a structure under a sine."""

    period: int
    """Periods of the excitation after which it repeats."""
    largest_multiplier: float
    """Largest magnitude of its Floquet multipliers, over its own period."""
    largest: NDArray[np.float64]
    """The largest magnitude of each coordinate, rad or m·√kg."""
    section: NDArray[np.float64]
    """The states at phase 0 of the excitation, one a row: coordinates, rates, states of elements."""

    def __repr__(self) -> str:
        return f"<StructureMotion of period {self.period}, largest multiplier {self.largest_multiplier:.6}>"


@dataclass(frozen=True, repr=False, eq=False)
class StructureBasins(Cells):
    """Which initial states of a structure reach which stable motion."""

    motions: tuple[StructureMotion, ...]
    """The stable motions, by their largest displacement where the structure is driven."""
    known: tuple[str, ...]
    """The names of all coordinates and rates, in the order of a state."""

    def __repr__(self) -> str:
        return self._counted(len(self.motions))

    def plot(self, ax: Any = None) -> Any:
        """Draws the grid, a colour a motion, grey where undecided, and the motions at phase 0 as diamonds. `ax` are
        matplotlib's axes, by default those of a new figure; they are returned."""
        index = [self.known.index(name) for name in self.coordinates]
        return self._drawn(ax, [motion.section[:, index] for motion in self.motions], self.coordinates)


def basins(
    structure: _resonarm.Assembly,
    /,
    frequency_hz: float,
    *,
    drive: str,
    amplitude: float,
    coordinates: Sequence[str] | None = None,
    start: Sequence[float] | None = None,
    stop: Sequence[float] | None = None,
    points: Sequence[int] = (41, 41),
    initial: Sequence[float] | None = None,
    time_constants: float = TIME_CONSTANTS,
) -> StructureBasins:
    """Which initial states reach which stable motion under A·sin(2πft), over a grid of two coordinates of the state at
    phase 0, computed on all cores as by `resonarm basins`.

    - `drive`: what is driven, point and axis as `tip.x`, or a joint as `joint2`; `amplitude`: A, N, or N·m at a joint.
    - `coordinates`: the names of two coordinates or rates, as `alpha1_rad` or `q1_dot_m_sqrt_kg_s`, by default the
      first coordinate and its rate.
    - `start`, `stop`: the first and the last value of each; by default 1.5 times as far as the largest stable motion
      reaches, to both sides.
    - `points`: the number of values of each, from 2 to 1000, by default (41, 41).
    - `initial`: the state that gives the other coordinates and rates, by default at rest. States of elements are zero.
    - `time_constants`: the longest wait, in time constants of the structure's slowest mode, by default 40.

    Raises ValueError for invalid arguments, ResonarmError where no stable motion is known: none is with friction that
    sticks. Ctrl-C ends it.
    """
    (_, places), (_, rates), *_elements = structure.channels()
    known = (*places, *rates)
    if not (np.isfinite(frequency_hz) and frequency_hz > 0):
        raise ValueError(f"frequency_hz is {frequency_hz:g}: it must be a positive number")
    attractors = _resonarm.StructureAttractors(structure, (drive, needed_amplitude(amplitude), frequency_hz))
    motions = tuple(StructureMotion(*of[:2], np.array(of[2]), np.array(of[3])) for of in attractors.motions)
    if not motions:
        raise _resonarm.ResonarmError(
            f"no stable motion is known at {frequency_hz:g} Hz: no state can be said to reach one"
        )
    names = pair("coordinates", (places[0], rates[0]) if coordinates is None else coordinates)
    reach = tuple(attractors.reach(known.index(name)) if name in known else 1.0 for name in names)
    last = pair("stop", reach if stop is None else stop)
    first = (-last[0], -last[1]) if start is None else pair("start", start)
    state = np.zeros(len(known)) if initial is None else _checks.real("initial", initial).ravel()
    if len(state) != len(known):
        raise ValueError(f"initial has {len(state)} numbers: give {len(known)}, the coordinates and their rates")
    grid = Grid(names, first, last, pair("points", points), state.tolist(), known)
    size = motions[0].section.shape[1]
    states = np.zeros((grid.points[0] * grid.points[1], size), NUMBER)
    states[:, : len(known)] = grid.states()
    rows = view(attractors.outcomes(states.tobytes(), time_constants), OUTCOME)
    shape = (grid.points[1], grid.points[0])
    motion, periods = (np.ascontiguousarray(rows[name]).reshape(shape) for name in ("motion", "periods"))
    axes = (grid.axis(0), grid.axis(1))
    return StructureBasins(names, *axes, motion, periods, attractors.ended_early, motions, known)
