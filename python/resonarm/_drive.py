"""The excitation A·sin(2πft) of calls that take its amplitudes by degree of freedom."""

import math
from collections.abc import Mapping

Drive = Mapping[str, float]
"""Amplitudes by degree of freedom, `{"joint1": 60}`: N·m at a joint, m/s² of a base, else N. All act in phase."""
Harmonics = Mapping[int, float | tuple[float, float]]
"""Harmonics of the loads by their order: the amplitude in the unit of the first load, `{3: 2.0}`, or the amplitude and
the phase in degrees, `{3: (2.0, 90)}`. The other loads have them in proportion."""
Parts = tuple[list[tuple[str, float]], float, float, list[tuple[int, float, float]]]
"""Degrees of freedom with their shares of the amplitude, the amplitude, the frequency, Hz, and the harmonics: order,
amplitude over the amplitude, phase, rad."""

MOST_HARMONICS = 8
MOST_ORDER = 50


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


def parts(given: Drive, frequency_hz: float, harmonics: Harmonics | None = None) -> Parts:
    """The form that the extension takes. The amplitude is that of the first load."""
    amplitudes = checked(given)
    first = next(iter(amplitudes.values()))
    shares = [(name, amplitude / first) for name, amplitude in amplitudes.items()]
    return shares, first, frequency_hz, _harmonics(harmonics or {}, first)


def _harmonics(given: Harmonics, first: float) -> list[tuple[int, float, float]]:
    """The harmonics in the form that the extension takes. Raises ValueError for those that no load can have."""
    if len(given) > MOST_HARMONICS:
        raise ValueError(f"drive_harmonics has {len(given)} harmonics: a load can have at most {MOST_HARMONICS}")
    found = []
    for order, value in given.items():
        if not isinstance(order, int) or not 2 <= order <= MOST_ORDER:
            raise ValueError(f"drive_harmonics has the order {order!r}: it must be an integer from 2 to {MOST_ORDER}")
        amplitude, phase_deg = value if isinstance(value, tuple) else (value, 0.0)
        if not (math.isfinite(amplitude) and math.isfinite(phase_deg)) or amplitude == 0:
            raise ValueError(f"drive_harmonics[{order}] is {value!r}: expected an amplitude other than 0")
        found.append((order, amplitude / first, math.radians(phase_deg)))
    return found


def direction(given: Drive | str, frequency_hz: float, harmonics: Harmonics | None = None) -> Parts:
    """The same of loads whose amplitude varies: the name of one, or several in a ratio."""
    if isinstance(given, str):
        return [(given, 1.0)], 1.0, frequency_hz, _harmonics(harmonics or {}, 1.0)
    amplitudes = checked(given)
    if len(amplitudes) == 1 and next(iter(amplitudes.values())) != 1:
        raise ValueError(
            f"the amplitude is the quantity that varies: give drive={next(iter(amplitudes))!r} without one"
        )
    return parts(amplitudes, frequency_hz, harmonics)


def frequency(frequency_hz: float | None) -> float:
    """The frequency of an excitation. Raises ValueError if it is not positive."""
    if frequency_hz is None or not (math.isfinite(frequency_hz) and frequency_hz > 0):
        got = "missing" if frequency_hz is None else f"{frequency_hz:g}"
        raise ValueError(f"frequency_hz is {got}: it must be a positive number")
    return float(frequency_hz)
