"""The arm: modes, frequency responses, motions under a sine, branches of periodic motions, basins of attraction."""

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _resonarm
from ._dtypes import COMPLEX, MOTION, Array, view
from ._load import Load
from .basins import basins
from .continuation import continuation
from .words import Drive, Quantity, Response, Scheme

MOST_PERIODS = 2**32 - 1


class Arm(_resonarm.Arm):
    """The arm in a pose: two rigid links with compliant joints (P. Gierlak, J. Warmiński, "Analysis of Bifurcation
    Vibrations of an Industrial Robot Arm System with Joints Compliance", Appl. Sci. 2023, 13, 11941).

    `preset` is one of `resonarm.presets()`; `beta1_deg` is the angle of link 1 against the x axis, `beta2_deg` that
    of link 2 against link 1, degrees, −360 to 360; `parameters` has those that differ from the preset's, by their names
    in the attribute `parameters`, in SI units. Arms are equal if all parameters and both angles are.

    Raises ValueError for impossible parameters or angles.
    """

    continuation = continuation
    basins = basins

    def _value(self) -> tuple[Any, ...]:
        """The values that equal arms share."""
        return (self.beta1_deg, self.beta2_deg, json.dumps(self.parameters, sort_keys=True))

    def __eq__(self, other: object) -> bool:
        return self._value() == other._value() if isinstance(other, Arm) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._value())

    def __repr__(self) -> str:
        own = f", parameters={self.own_parameters}" if self.own_parameters else ""
        return f"Arm({self.preset!r}, beta1_deg={self.beta1_deg:g}, beta2_deg={self.beta2_deg:g}{own})"

    def frf(
        self,
        frequency_hz: ArrayLike,
        *,
        drive: Drive = "torque1",
        response: Response = "c-x",
        quantity: Quantity = "receptance",
    ) -> NDArray[np.complex128]:
        """Frequency response of the linearised arm: response over drive, complex, as an array of the frequencies'
        shape.

        `drive` is torque1, torque2 (N·m), force-x or force-y (at the tip C, N); `response` alpha1, alpha2 (rad), b-x,
        b-y, c-x or c-y (m); `quantity` receptance, mobility or accelerance: the displacement, its first or second
        derivative in time, over the drive (ISO 7626-1).

        Raises ValueError for an unknown term or a negative frequency, TypeError for one that is no real number,
        ResonarmError where the response is infinite.
        """
        hz = _checks.real("frequency_hz", frequency_hz)
        return view(self.frf_at(hz.tobytes(), (drive, response, quantity)), COMPLEX).reshape(hz.shape)

    def simulate(
        self,
        duration_s: float,
        *,
        torque1_nm: float = 0.0,
        torque2_nm: float = 0.0,
        force_x_n: float = 0.0,
        force_y_n: float = 0.0,
        frequency_hz: float = 0.0,
        initial: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
        rate_hz: float | None = None,
        scheme: Scheme | None = None,
        every: int = 1,
    ) -> Array:
        """The motion under A·sin(2πft), exact inside the step: rows with `t_s`, `alpha_rad` and `alpha_dot_rad_s`.

        The amplitude A has torques at the joints, N·m, and a force at the tip, N; f is `frequency_hz`. `initial` is
        α1, α2 in rad, α̇1, α̇2 in rad/s; `rate_hz` the integration steps a second, by default those of a scenario
        with the `scheme` (rk4, dop853, gl4, gl6, exponential, exponential8; by default the last). There is a row for
        the start, for every `every`th step and for the end. Ctrl-C ends it.

        Raises ValueError if the duration is no whole number of steps, an excitation has no frequency, or the scheme
        can't carry the arm at the rate.
        """
        load = Load(torque1_nm, torque2_nm, force_x_n, force_y_n)
        if frequency_hz <= 0 and any(load.components):
            raise ValueError(f"frequency_hz is {frequency_hz:g}: an excitation A·sin(2πft) needs a positive frequency")
        state = _checks.four("initial", initial)
        if every < 1:
            raise ValueError(f"every is {every}: it must be 1 or more")
        rate = _resonarm.step_rate_hz(scheme) if rate_hz is None else rate_hz
        length = (_checks.steps(_checks.number("duration_s", duration_s), rate), every)
        return view(self.motion(state, load.sine(frequency_hz), (scheme, rate), length), MOTION)

    def ensemble(
        self,
        initial: ArrayLike,
        periods: int,
        *,
        frequency_hz: float,
        torque1_nm: float = 0.0,
        torque2_nm: float = 0.0,
        force_x_n: float = 0.0,
        force_y_n: float = 0.0,
        every: int | None = None,
    ) -> Array:
        """Many motions under one A·sin(2πft), side by side in the lanes of the processor and over all cores.

        `initial` has a row α1, α2 (rad), α̇1, α̇2 (rad/s) for each motion, at phase 0 of the excitation. The array
        has a row for the start, for every `every`th period (by default the last alone) and for the end, and a column
        for each motion, with `t_s`, `alpha_rad` and `alpha_dot_rad_s`. A motion that grows beyond all bounds is NaN.
        Steps (`dop853`, so many a period that the frequency is right to 1e-8 of the damping ratio) are the same for
        all, and each motion has the bits that it has alone. Ctrl-C ends it.

        Raises ValueError for a frequency that is not positive, an arm without damping, or states that are not finite.
        """
        states = _checks.real("initial", initial)
        if states.ndim != 2 or states.shape[1] != 4 or not len(states):
            raise ValueError(f"initial has the shape {states.shape}: it must be (motions, 4): α1, α2, α̇1, α̇2")
        step = periods if every is None else every
        for name, count in (("periods", periods), ("every", step)):
            if not 1 <= count <= MOST_PERIODS:
                raise ValueError(f"{name} is {count}: it must be from 1 to {MOST_PERIODS}")
        sine = Load(torque1_nm, torque2_nm, force_x_n, force_y_n).sine(frequency_hz)
        rows = view(_resonarm.ensemble(self, sine, states.tobytes(), (periods, step)), MOTION)
        return rows.reshape(-1, len(states))
