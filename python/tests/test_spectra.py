"""Spectra of recordings, beside Welch's sums written out with NumPy."""

from pathlib import Path

import numpy as np
import pytest

import resonarm

ROOT = Path(__file__).resolve().parents[2]
FORCE, READING = "head_force_x_n", "acceleration_c_x_m_s2"


@pytest.fixture(scope="module")
def recording():
    return resonarm.Recording(ROOT / "recordings/free-sweep.mcap")


def values(recording):
    """The force of the head along x and the acceleration of C along x."""
    samples = recording.samples
    return samples["head_force_n"][:, 0], samples["acceleration_c_m_s2"][:, 0]


def welch(first, second, rate_hz, length, overlap, window):
    """2/(fs Σw²) ⟨conj(X) Y⟩ over the segments, once at 0 Hz and at half the sample rate."""
    starts = range(0, len(first) - length + 1, length - overlap)
    of = [np.fft.rfft(np.stack([signal[s : s + length] for s in starts]) * window) for signal in (first, second)]
    density = 2.0 / (rate_hz * np.sum(window**2)) * np.mean(np.conj(of[0]) * of[1], axis=0)
    density[0] /= 2.0
    density[-1] /= 2.0 if length % 2 == 0 else 1.0
    return density


def power_gain(frequency_hz, rate_hz):
    """The square of the gain of sinc5, the converter of the recording: sin x / x to the fifth, x being pi f / rate."""
    return np.sinc(frequency_hz / rate_hz) ** 10


def hann(length):
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)


def test_densities_are_those_of_welch(recording):
    spectra = recording.psd(READING, segment_s=0.5, overlap=0.25, window="hamming")
    length, rate_hz = round(0.5 / recording.dt_s), 1 / recording.dt_s
    reading = values(recording)[1]
    window = 0.54 - 0.46 * np.cos(2 * np.pi * np.arange(length) / length)
    psd = welch(reading, reading, rate_hz, length, length // 4, window).real
    np.testing.assert_allclose(spectra.frequency_hz, np.fft.rfftfreq(length, 1 / rate_hz), rtol=1e-14)
    psd /= power_gain(spectra.frequency_hz, rate_hz)
    np.testing.assert_allclose(spectra.psd[READING], psd, rtol=1e-9, atol=1e-12 * psd.max())
    assert spectra.units == {READING: "m/s²"} and spectra.clipped == {READING: 0}


def test_a_vector_stands_for_its_components_and_the_area_is_the_mean_square(recording):
    spectra = recording.psd("acceleration_c_m_s2", window="rectangular", overlap=0.0)
    assert list(spectra.psd) == ["acceleration_c_x_m_s2", "acceleration_c_y_m_s2"]
    length = 2 * (len(spectra.frequency_hz) - 1)
    kept = values(recording)[1][: length * spectra.averages]
    readings = spectra.psd[READING] * power_gain(spectra.frequency_hz, 1 / recording.dt_s)
    assert np.sum(readings) * spectra.frequency_hz[1] == pytest.approx(np.mean(kept**2), rel=1e-12)
    assert spectra.rms[READING] ** 2 == pytest.approx(np.sum(spectra.psd[READING]) * spectra.frequency_hz[1], rel=1e-12)


def test_responses_and_coherence_are_those_of_welch(recording):
    found = recording.frf(READING, reference=FORCE, segment_s=1.0)
    length, rate_hz = round(1.0 / recording.dt_s), 1 / recording.dt_s
    force, reading = values(recording)
    cut = (rate_hz, length, length // 2, hann(length))
    of_force, of_reading = welch(force, force, *cut).real, welch(reading, reading, *cut).real
    crossed = welch(force, reading, *cut)
    h1 = crossed / of_force
    np.testing.assert_allclose(found.frf[READING], h1, rtol=1e-8)
    np.testing.assert_allclose(found.coherence[READING], np.abs(crossed) ** 2 / (of_force * of_reading), rtol=1e-8)
    assert found.reference == FORCE and found.standard_deviation[READING].shape == h1.shape


def test_a_shock_spectrum_follows_the_static_response(recording):
    # Far above the band of the vibration an oscillator moves as its base.
    spectra = recording.srs(READING, frequency_hz=[400.0])
    reading = values(recording)[1]
    assert spectra.maximax[READING][0] == pytest.approx(np.abs(reading).max(), rel=0.2)
    assert len(recording.srs(READING).frequency_hz) > 50


def test_figures(recording):
    for found in (recording.psd(READING), recording.frf(READING, reference=FORCE), recording.srs(READING)):
        assert found.plot().get_legend_handles_labels()[1]


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (["acceleration_d_m_s2"], {}, "has no channel `acceleration_d_m_s2`: it has "),
        ([READING], {"overlap": 1.0}, "overlap is 1: it must be from 0 to below 1"),
        ([READING], {"window": "hanning"}, 'window is "hanning": it must be one of hann, '),
        ([READING], {"segment_s": 1e9}, "it must have from 2 to as many as the shortest record"),
        ([READING, "alpha1_rad"], {}, "`alpha1_rad` is a state and `acceleration_c_x_m_s2` is a reading"),
    ],
)
def test_what_can_not_be_computed_is_said(recording, arguments, options, words):
    with pytest.raises(ValueError) as refused:
        recording.psd(*arguments, **options)
    assert words in str(refused.value)
