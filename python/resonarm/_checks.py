"""Checks of arguments before they are passed to the extension."""

import math
import operator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _resonarm
from ._dtypes import NUMBER

LAST = 2**64 - 1
"""A sample after every other."""
MOST_STEPS = 10_000_000_000
"""The most integration steps of a motion."""


def real(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Real numbers as an array. Raises TypeError for arguments without numbers, and for complex ones."""
    if values is None:
        raise TypeError(f"{name} is None: it must be an array of numbers")
    try:
        given = np.asarray(values)
    except ValueError as error:
        raise TypeError(f"{name} must be an array of numbers: {error}") from error
    # `astype` would drop the imaginary parts with no more than a warning.
    if np.iscomplexobj(given):
        raise TypeError(f"{name} has complex numbers: it must have real ones, such as values.real or abs(values)")
    # `astype` would read texts as numbers, "1" as 1.0.
    if given.dtype.kind not in "biuf" and given.dtype != object:
        raise TypeError(f"{name} has values of the type {given.dtype.str}: it must have real numbers")
    try:
        return given.astype(NUMBER)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} must be an array of numbers: {error}") from error


def samples(from_sample: int, to_sample: int) -> tuple[int, int]:
    """The first and the last sample of a range. Raises ValueError for a negative one, and if the last is earlier."""
    first, last = operator.index(from_sample), operator.index(to_sample)
    for name, sample in (("from_sample", first), ("to_sample", last)):
        if sample < 0:
            raise ValueError(f"{name} is {sample}: it must be 0 or more")
    if first > last:
        raise ValueError(f"from_sample is {first} and to_sample {last}: give the earlier one first")
    return min(first, LAST), min(last, LAST)


def rows(count: int) -> int:
    """Returns the number of rows of a chunk, checked."""
    if operator.index(count) < 1:
        raise ValueError(f"rows is {count}: it must be 1 or more")
    return min(operator.index(count), LAST)


def number(name: str, given: float) -> float:
    """A real number of any type. Raises TypeError for anything else."""
    if isinstance(given, str) or not hasattr(given, "__float__"):
        raise TypeError(f"{name} is {given!r}: it must be a number")
    return float(given)


def steps(duration_s: float, rate_hz: float) -> int:
    """A duration as a whole number of steps."""
    exact = duration_s * rate_hz
    if not (math.isfinite(exact) and round(exact) >= 1):
        raise ValueError(f"duration_s is {duration_s:g}: it must be a positive number, of one step at least")
    steps = round(exact)
    if steps > MOST_STEPS:
        raise ValueError(f"duration_s {duration_s:g} is {steps} steps at {rate_hz:g} Hz: at most {MOST_STEPS} are made")
    if abs(exact - steps) > 1e-6:
        raise ValueError(
            f"duration_s {duration_s!r} is {exact!r} steps at {rate_hz:g} Hz, not a whole number: "
            f"choose {steps / rate_hz!r}, or another rate"
        )
    return steps


def controller(given: Any) -> None:
    """Raises TypeError unless this can be called with a measurement."""
    if not callable(given):
        raise TypeError(
            f"controller is {given!r}: it must be a function of a Measurement, or a list of the words of a command "
            "where a bench runs it"
        )


def scenario(given: Any) -> None:
    """Raises TypeError unless this is a scenario, and says how to get one."""
    if not isinstance(given, _resonarm.Scenario):
        what = "None" if given is None else type(given).__name__
        hint = (
            f"; Scenario.load({str(given)!r}) reads one"
            if hasattr(given, "__fspath__") or isinstance(given, str)
            else ""
        )
        raise TypeError(f"scenario is {what}: it must be a resonarm.Scenario{hint}")
