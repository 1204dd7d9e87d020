"""The excitation A·sin(2πft) of calls that take its amplitudes by degree of freedom."""

import math
from collections.abc import Mapping

Drive = Mapping[str, float]
"""Amplitudes by degree of freedom, `{"joint1": 60}`: N·m at a joint, m/s² of a base, else N. All act in phase."""
Parts = tuple[list[tuple[str, float]], float, float]
"""Degrees of freedom with their shares of the amplitude, the amplitude, the frequency, Hz."""


def checked(given: Drive) -> dict[str, float]:
    """The amplitudes, if there are some and all can be. Raises TypeError for what is no mapping, else ValueError."""
    if not isinstance(given, Mapping):
        raise TypeError(f"drive is {given!r}: give the amplitude at each degree of freedom, as {{'joint1': 60}}")
    if not given:
        raise ValueError("drive is empty: give the amplitude at a degree of freedom, as {'joint1': 60}")
    amplitudes = {}
    for name, amplitude in given.items():
        try:
            amplitudes[name] = float(amplitude)
        except (TypeError, ValueError) as error:
            raise TypeError(f"drive[{name!r}] is {amplitude!r}: it must be a number") from error
        if not math.isfinite(amplitudes[name]) or amplitudes[name] == 0:
            raise ValueError(f"drive[{name!r}] is {amplitude:g}: it must be a finite number other than 0")
    return amplitudes


def parts(given: Drive, frequency_hz: float) -> Parts:
    """The form that the extension takes. The amplitude is that of the first load."""
    amplitudes = checked(given)
    first = next(iter(amplitudes.values()))
    return [(name, amplitude / first) for name, amplitude in amplitudes.items()], first, frequency_hz


def direction(given: Drive | str, frequency_hz: float) -> Parts:
    """The same of loads whose amplitude varies: the name of one, or several in a ratio."""
    if isinstance(given, str):
        return [(given, 1.0)], 1.0, frequency_hz
    amplitudes = checked(given)
    if len(amplitudes) == 1 and next(iter(amplitudes.values())) != 1:
        raise ValueError(
            f"the amplitude is the quantity that varies: give drive={next(iter(amplitudes))!r} without one"
        )
    return parts(amplitudes, frequency_hz)


def frequency(frequency_hz: float | None) -> float:
    """The frequency of an excitation. Raises ValueError if it is not positive."""
    if frequency_hz is None or not (math.isfinite(frequency_hz) and frequency_hz > 0):
        got = "missing" if frequency_hz is None else f"{frequency_hz:g}"
        raise ValueError(f"frequency_hz is {got}: it must be a positive number")
    return float(frequency_hz)
