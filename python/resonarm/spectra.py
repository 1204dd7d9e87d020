"""Spectra of the channels of a recording."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _extras, _resonarm
from ._dtypes import COMPLEX, NUMBER, view

IN_OCTAVE = 12
"""Natural frequencies in an octave, of a shock response spectrum."""
Wanted = tuple[list[str], list[float | None]]
Cut = tuple[float | None, float, str, str]


@dataclass(frozen=True)
class Averages:
    """What averaged spectra have in common."""

    frequency_hz: NDArray[np.float64]
    """The lines, from 0 Hz to half the sample rate."""
    units: dict[str, str]
    """The unit of each channel."""
    clipped: dict[str, int]
    """How many values of each channel are beyond the range of its sensor: its spectra are then wrong."""
    averages: int
    """The number of segments."""
    degrees_of_freedom: float
    """Degrees of freedom of a density; 2 of a single segment."""
    noise_bandwidth_hz: float
    """Equivalent noise bandwidth of the window: the mean square of a sine is its density times this, Hz."""
    within: tuple[float, float]
    """With 95 % probability the true density is between the stated one times these factors (Bendat, Piersol 2010)."""


@dataclass(frozen=True)
class Spectra(Averages):
    """Power spectral densities, of readings without the droop of the converters."""

    psd: dict[str, NDArray[np.float64]]
    """The one-sided density of each channel, unit²/Hz."""

    @property
    def rms(self) -> dict[str, float]:
        """The root of each density's integral: the effective value of the channel in all segments."""
        spacing_hz = self.frequency_hz[1]
        return {name: float(np.sqrt(np.sum(density) * spacing_hz)) for name, density in self.psd.items()}

    def plot(self, ax: Any = None) -> Any:
        """Draws the densities on matplotlib's axes, by default those of a new figure; they are returned."""
        ax = _extras.axes(ax)
        for name, density in self.psd.items():
            ax.semilogy(self.frequency_hz, density, label=f"{name} (({self.units[name]})²/Hz)")
        return _extras.labelled(ax, "frequency (Hz)", "power spectral density")


@dataclass(frozen=True)
class FrequencyResponses(Averages):
    """Frequency responses H1 to one channel."""

    reference: str
    """The channel of the excitation."""
    frf: dict[str, NDArray[np.complex128]]
    """The response of each channel over the reference."""
    coherence: dict[str, NDArray[np.float64]]
    """Its coherence with the reference, 0 to 1."""
    standard_deviation: dict[str, NDArray[np.float64]]
    """Standard deviation of the response's modulus at each line; NaN of a single segment."""

    def plot(self, ax: Any = None) -> Any:
        """Draws the moduli on matplotlib's axes, by default those of a new figure; they are returned."""
        ax = _extras.axes(ax)
        for name, response in self.frf.items():
            ax.semilogy(self.frequency_hz, np.abs(response), label=f"{name} ({self.units[name]})")
        unit = self.units[self.reference]
        return _extras.labelled(ax, "frequency (Hz)", f"response over {self.reference} ({unit})")


@dataclass(frozen=True)
class ShockSpectra:
    """Shock response spectra."""

    frequency_hz: NDArray[np.float64]
    """Natural frequencies of the oscillators."""
    quality: float
    """Their quality Q = 1/2ζ."""
    units: dict[str, str]
    """The unit of each channel."""
    clipped: dict[str, int]
    """How many values of each channel are beyond the range of its sensor: its spectrum is then wrong."""
    positive: dict[str, NDArray[np.float64]]
    """The largest response to the positive side, of each channel."""
    negative: dict[str, NDArray[np.float64]]
    """The largest response to the negative side, as a positive number."""

    @property
    def maximax(self) -> dict[str, NDArray[np.float64]]:
        """The larger of both sides."""
        return {name: np.maximum(side, self.negative[name]) for name, side in self.positive.items()}

    def plot(self, ax: Any = None) -> Any:
        """Draws the larger of both sides on matplotlib's axes, by default those of a new figure; they are returned."""
        ax = _extras.axes(ax)
        for name, response in self.maximax.items():
            ax.loglog(self.frequency_hz, response, label=f"{name} ({self.units[name]})")
        return _extras.labelled(ax, "natural frequency (Hz)", f"largest response, Q = {self.quality:g}")


def densities(recording: _resonarm.Recording, wanted: Wanted, cut: Cut) -> Spectra:
    """Power spectral densities; see `Recording.psd`."""
    channels, average, words = _resonarm.densities(recording, wanted, cut)
    rows = view(words, NUMBER).reshape(-1, 1 + len(channels))
    psd = {name: rows[:, 1 + place] for place, (name, _, _) in enumerate(channels)}
    return Spectra(frequency_hz=rows[:, 0], psd=psd, **_averaged(channels, average))


def frequency_responses(recording: _resonarm.Recording, wanted: Wanted, cut: Cut) -> FrequencyResponses:
    """Frequency responses; see `Recording.frf`."""
    channels, average, words = _resonarm.frequency_responses(recording, wanted, cut)
    (reference, _, _), *others = channels
    rows = view(words, NUMBER).reshape(-1, 1 + 4 * len(others))
    names = [name for name, _, _ in others]
    parts = {name: rows[:, 1 + 4 * place : 5 + 4 * place] for place, name in enumerate(names)}
    return FrequencyResponses(
        frequency_hz=rows[:, 0],
        reference=reference,
        frf={name: np.ascontiguousarray(part[:, :2]).view(COMPLEX)[:, 0] for name, part in parts.items()},
        coherence={name: part[:, 2] for name, part in parts.items()},
        standard_deviation={name: part[:, 3] for name, part in parts.items()},
        **_averaged(channels, average),
    )


def shock_responses(
    recording: _resonarm.Recording, wanted: Wanted, quality: float, frequency_hz: ArrayLike | None
) -> ShockSpectra:
    """Shock response spectra; see `Recording.srs`."""
    if frequency_hz is None:
        highest_hz = 0.1 / recording.dt_s
        # Down to the oscillator that turns twice in the record.
        octaves = max(0.0, np.log2(highest_hz * _duration_s(recording, wanted[1]) / 2.0))
        frequency_hz = highest_hz * 2.0 ** (-np.arange(int(IN_OCTAVE * octaves), -1, -1) / IN_OCTAVE)
    hz = _checks.real("frequency_hz", frequency_hz).reshape(-1)
    channels, words = _resonarm.shock_responses(recording, wanted, _checks.number("quality", quality), hz.tobytes())
    rows = view(words, NUMBER).reshape(-1, len(channels), 2)
    sides = [{name: rows[:, place, side] for place, (name, _, _) in enumerate(channels)} for side in (0, 1)]
    units, clipped = _common(channels)
    return ShockSpectra(hz, float(quality), units, clipped, *sides)


def _duration_s(recording: _resonarm.Recording, ends_s: list[float | None]) -> float:
    """The duration between two times, s."""
    last_s = recording.summary["duration_s"]
    from_s, to_s = ends_s
    return float(min(last_s if to_s is None else to_s, last_s) - (from_s or 0.0))


def _common(channels: list[tuple[str, str, int]]) -> tuple[dict[str, str], dict[str, int]]:
    """Units and clipped values by the names of the channels."""
    return {name: unit for name, unit, _ in channels}, {name: clipped for name, _, clipped in channels}


def _averaged(channels: list[tuple[str, str, int]], average: tuple[int, float, float, list[float]]) -> dict[str, Any]:
    """The fields that averaged spectra have in common, but the lines."""
    units, clipped = _common(channels)
    averages, freedom, bandwidth_hz, (low, high) = average
    return {
        "units": units,
        "clipped": clipped,
        "averages": averages,
        "degrees_of_freedom": freedom,
        "noise_bandwidth_hz": bandwidth_hz,
        "within": (low, high),
    }
