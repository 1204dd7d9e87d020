"""A structure under test whose step is written in Python."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks
from ._dtypes import NUMBER

Numbers = NDArray[np.float64]
Step = Callable[[float, float, Numbers, Numbers], ArrayLike]
"""Called with t, s, the step, s, the state at t and the loads held over the step, it returns the state at its end."""
Points = Callable[[float, Numbers, Numbers], tuple[ArrayLike, ArrayLike, ArrayLike]]
"""Called with t, s, the state and the loads, it returns displacements, velocities, accelerations of the points."""
OwnParts = tuple[Any, Any, str, list[float], str | None, list[str], list[str], Any]
Coordinates = Literal["angles", "displacements", "modal"]
"""Kind of the coordinates."""


@dataclass(frozen=True, eq=False)
class Stepped:
    """A structure whose step is written in Python or NumPy. It stands in place of a scenario's in a `Plant`, and in
    runs and nodes in the modes free and lockstep; in real time it is refused.

    A state is an array of n coordinates and their n rates; loads are an array of what `loads` names, torques at joints,
    N·m, and forces of the exciter, N, held over a sample. All arrays that the functions take are read-only.
    Both functions must depend on their arguments alone, so that the same run gives the same bits.

        frequency = 2 * math.pi * 20

        def step(t_s, dt_s, state, loads):
            x, v = state
            v = v + dt_s * (loads[2] / 5 - frequency**2 * x)  # Euler's method, symplectic
            return [x + dt_s * v, v]

        def points(t_s, state, loads):
            x, v = state
            a = loads[2] / 5 - frequency**2 * x
            return [[0, 0], [x, 0]], [[0, 0], [v, 0]], [[0, 0], [a, 0]]

        resonarm.run(scenario, structure=resonarm.Stepped(step, points, initial=[0, 0]))
    """

    step: Step
    """`step(t_s, dt_s, state, loads)` is the state a step later, as many times a sample as the scenario's `simulation`
    says: twice by default."""
    points: Points
    """`points(t_s, state, loads)` has displacements (m), velocities (m/s) and accelerations (m/s²), each with a row
    x, y for the point of accelerometer B and for that of C, where the exciter is."""
    initial: ArrayLike
    """The state at sample 0: coordinates and their rates, at most 32 each, 8 angles."""
    coordinates: Coordinates = "displacements"
    """Kind of the coordinates in recordings: displacements (`x_m`), angles of joints (`alpha_rad`) or modal ones
    (`q_m_sqrt_kg`)."""
    name: str | None = None
    """Name of the structure in recordings."""
    loads: Sequence[str] = ("joint1", "joint2", "exciter_x", "exciter_y")
    """Loads that can act on it, in the order in which its functions get the values: `joint1` to `joint8`, `exciter_x`,
    `exciter_y`, `exciter_z`. A command of another load is rejected."""

    sensed: Sequence[str] = ()
    """Degrees of freedom that the sensors of `[rig.sensors]` beside B and C may read: points along an axis (`mid.z`)
    and joints (`joint1`, whose displacement is an angle, rad)."""
    sensors: Points | None = None
    """`sensors(t_s, state, loads)` has displacements (m or rad), velocities and accelerations, each with a number for
    each of `sensed`."""

    def _parts(self) -> OwnParts:
        """The form that the extension takes."""
        for name, call in (("step", self.step), ("points", self.points)):
            if not callable(call):
                raise TypeError(f"{name} is {call!r}: it must be a function")
        initial = _checks.real("initial", self.initial).ravel().tolist()
        loads = [self.loads] if isinstance(self.loads, str) else list(self.loads)
        sensed = [self.sensed] if isinstance(self.sensed, str) else list(self.sensed)
        if (self.sensors is None) == bool(sensed):
            raise ValueError(
                "only one of sensed and sensors is given: give both, the names of what the sensors read and its "
                "motion, or neither"
            )
        if self.sensors is not None and not callable(self.sensors):
            raise TypeError(f"sensors is {self.sensors!r}: it must be a function")
        sensors = None if self.sensors is None else self._sensors
        return self._step, self._points, self.coordinates, initial, self.name, loads, sensed, sensors

    def _step(self, t_s: float, dt_s: float, state: bytes, loads: bytes) -> bytes:
        """The step on the bytes of arrays."""
        before = np.frombuffer(state, NUMBER)
        after = self.step(t_s, dt_s, before, np.frombuffer(loads, NUMBER))
        what = f"the state that step returned for t = {t_s + dt_s:g} s"
        return _numbers(what, after, before.shape)

    def _points(self, t_s: float, state: bytes, loads: bytes) -> bytes:
        """The motion of the points on the bytes of arrays."""
        given = self.points(t_s, np.frombuffer(state, NUMBER), np.frombuffer(loads, NUMBER))
        what = f"what points returned for t = {t_s:g} s, displacements, velocities and accelerations of B and C,"
        return _numbers(what, given, (3, 2, 2))

    def _sensors(self, t_s: float, state: bytes, loads: bytes) -> bytes:
        """The motion of what sensors read on the bytes of arrays."""
        given = self.sensors(t_s, np.frombuffer(state, NUMBER), np.frombuffer(loads, NUMBER))  # type: ignore[misc]
        what = f"what sensors returned for t = {t_s:g} s, displacements, velocities and accelerations of sensed,"
        sensed = 1 if isinstance(self.sensed, str) else len(self.sensed)
        return _numbers(what, given, (3, sensed))


def _numbers(what: str, given: Any, shape: tuple[int, ...]) -> bytes:
    """Finite numbers of a shape. Raises ValueError, or TypeError for anything else."""
    numbers = _checks.real(what, given)
    if numbers.shape != shape:
        raise ValueError(f"{what} has the shape {numbers.shape}: it must be {shape}")
    if not np.isfinite(numbers).all():
        raise ValueError(f"{what} is {numbers.tolist()}: all must be finite numbers")
    return np.ascontiguousarray(numbers).tobytes()


def parts(structure: Stepped | None) -> OwnParts | None:
    """A structure as the extension takes it. Raises TypeError for anything else."""
    if structure is None or isinstance(structure, Stepped):
        return None if structure is None else structure._parts()
    raise TypeError(
        f"structure is {structure!r}: it must be a resonarm.Stepped, a structure with a step in Python; put a Chain "
        "or a Modal into the scenario, scenario.replace(structure=chain.section)"
    )
