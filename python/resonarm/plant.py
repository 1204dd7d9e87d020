"""The plant: the arm or another structure with its instruments, sample by sample."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _resonarm
from ._dtypes import Array, played, unit, view
from .own_structure import Stepped, parts
from .scenario import Scenario

_OF_THE_STATE = ("sample", "time_s", "alpha_rad", "alpha_dot_rad_s", "states")
_MOVES = ("seek", "reset", "rewind")


class Plant(_resonarm.Plant):
    """The arm or structure of a scenario with its exciter, its instruments and an integrator, at a sample.

    One sample is `measure()`, then `advance(force_n=…)` with the load held up to the next. The same scenario and the
    same loads give the same states and readings, bit for bit. A reading is earlier than its sample by the delay of the
    converters: 2.5 samples by default.

        plant = resonarm.Plant(resonarm.Scenario())
        for _ in range(1000):
            ax, _ = plant.measure().acceleration_c_m_s2
            plant.advance((10 - 0.5 * ax, 0.0))
    """

    def __new__(cls, scenario: Scenario | None = None, *, structure: Stepped | None = None) -> "Plant":
        """Starts at sample 0 of the scenario, with a `structure` whose step is written in Python in place of the arm if
        one is given. Raises ValueError if the scenario can't make a plant."""
        scenario = Scenario() if scenario is None else scenario
        _checks.scenario(scenario)
        return super().__new__(cls, scenario, parts(structure))

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _OF_THE_STATE:
            raise AttributeError(f"{name} can't be set: {self._way()}")
        super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        if name in ("alpha_rad", "alpha_dot_rad_s"):
            raise AttributeError(
                f"the structure under test has no {name}: its states are {', '.join(self.states)}", name=name, obj=self
            )
        way = f": {self._way()}" if name in _MOVES else ""
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{way}", name=name, obj=self)

    def _way(self) -> str:
        return (
            f"a plant is at sample {self.sample} and continues from there by advance() or play(); "
            "a new Plant(scenario) begins at sample 0"
        )

    def play(self, force_n: ArrayLike | None = None, torque_nm: ArrayLike | None = None) -> Array:
        """Measures and advances once for each row of loads: forces (Fx, Fy) of the exciter, or (Fx, Fy, Fz), N, and
        torques (u1, u2) at the joints, or of up to eight joints, N·m. A row has, before its load acts, `sample`, the
        states by the names of `states`, such as `alpha_rad`, the readings `acceleration_b_m_s2`, `acceleration_c_m_s2`
        and `head_force_n`, those of other sensors by the names of their channels, such as `acceleration_m3_z_m_s2`, and
        `clipped` (as `Measurement.clipped`).

        Raises ValueError, and plays nothing, if the loads have other columns, or not the same number of rows, or one is
        not finite; TypeError if they are not real numbers; ResonarmError if the structure does not take a load, the
        integrator can't continue or the shaker trips: the plant is then at the sample before.
        """
        force, torque = _rows("force_n", force_n, 3, self.sample), _rows("torque_nm", torque_nm, 8, self.sample)
        if force is None and torque is None:
            raise ValueError("no loads are given: give force_n, torque_nm, or both, with a row for each sample")
        force = np.zeros((len(torque), 3)) if force is None and torque is not None else force
        torque = np.zeros((len(force), 8)) if torque is None and force is not None else torque
        assert force is not None and torque is not None
        if len(force) != len(torque):
            raise ValueError(
                f"force_n has {len(force)} rows and torque_nm {len(torque)}: both must have a row for each sample"
            )
        return view(self.play_rows(force.tobytes(), torque.tobytes()), played(self.channels(), self.reading_channels()))

    def __repr__(self) -> str:
        name, coordinates = next(iter(self.states.items()))
        symbol = {"alpha_rad": "α", "q_m_sqrt_kg": "q"}.get(name, "x")
        numbers = ", ".join(f"{number:+.3e}" for number in coordinates)
        return f"<Plant at sample {self.sample} ({self.time_s:g} s): {symbol} = ({numbers}) {unit(name)}>"


def _rows(name: str, loads: ArrayLike | None, most: int, first: int) -> NDArray[np.float64] | None:
    """Loads from the sample `first` on, all finite, in `most` columns: zeros are added to the two or more given."""
    if loads is None:
        return None
    array = _checks.real(name, loads)
    if array.ndim != 2 or not 2 <= array.shape[1] <= most:
        raise ValueError(f"{name} has the shape {array.shape}: it must be (samples, 2), or up to (samples, {most})")
    if len(bad := np.argwhere(~np.isfinite(array))):
        row, column = bad[0]
        got = "NaN" if np.isnan(array[row, column]) else f"{array[row, column]:g}"
        raise ValueError(f"{name} is {got} at sample {first + row}, in column {column}: it must be a finite number")
    return np.hstack([array, np.zeros((len(array), most - array.shape[1]))])
