#!/usr/bin/env python3
"""Writes spectra.json: spectra, coherence and frequency responses by SciPy and NumPy, with NumPy and SciPy 1.17."""

import json
import pathlib

import numpy as np
from scipy import signal

RATE_HZ, SAMPLES = 500.0, 1000
MASK = 2**64 - 1


def uniform(seed, count):
    """Numbers in [−½, ½) of the generator SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014)."""
    numbers = []
    for _ in range(count):
        seed = (seed + 0x9E3779B97F4A7C15) & MASK
        z = ((seed ^ (seed >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        numbers.append(((z ^ (z >> 31)) >> 11) * 2.0**-53 - 0.5)
    return numbers


def resonator(inputs, noise, offset):
    """y(n) = 1.6 y(n − 1) − 0.9 y(n − 2) + inputs + noise, plus an offset and a trend."""
    y = [0.0, 0.0]
    for x, e in zip(inputs, noise):
        y.append(1.6 * y[-1] - 0.9 * y[-2] + x + 0.3 * e)
    return [value + offset + 0.001 * n for n, value in enumerate(y[2:])]


def signals():
    x, z, a, b = (uniform(seed, SAMPLES) for seed in (1, 2, 3, 4))
    z = [0.8 * q + 0.4 * p for p, q in zip(x, z)]
    y = resonator([p + 0.5 * q for p, q in zip(x, z)], a, 2.0)
    w = resonator([0.2 * p - q for p, q in zip(x, z)], b, -1.0)
    return [np.array(channel) for channel in (x, z, y, w)]


def pairs(values):
    return [[float(value.real), float(value.imag)] for value in values]


def main():
    x, z, y, w = signals()
    cases = []
    for window, length, overlap, detrend in [
        ("boxcar", 64, 0, False),
        ("hann", 64, 32, False),
        ("hann", 50, 37, "constant"),
        ("hamming", 51, 15, "linear"),
        ("blackman", 32, 24, "constant"),
        ("blackmanharris", 46, 30, False),
        ("flattop", 64, 48, "linear"),
    ]:
        options = {"fs": RATE_HZ, "window": window, "nperseg": length, "noverlap": overlap, "detrend": detrend}
        s = lambda p, q: signal.csd(p, q, **options)[1]
        frequency, psd = signal.welch(y, **options)
        case = {
            "window": window,
            "length": length,
            "overlap": overlap,
            "detrend": detrend or "none",
            "frequency_hz": frequency.tolist(),
            "psd_y": psd.tolist(),
            "csd_xy": pairs(s(x, y)),
            "coherence_xy": signal.coherence(x, y, **options)[1].tolist(),
            "power_y": signal.welch(y, scaling="spectrum", **options)[1].tolist(),
        }
        # Two inputs x and z, two outputs y and w; Hv of y over x alone with the ratio of noise powers 4.
        h1, coherence, hv, hv2 = [], [], [], []
        spectra = {p + q: s(signals_[p], signals_[q]) for signals_ in [dict(x=x, z=z, y=y, w=w)] for p in "xzyw" for q in "xzyw"}
        for k in range(len(frequency)):
            at = lambda p, q: spectra[p + q][k]
            xx = np.array([[at(p, q) for q in "xz"] for p in "xz"])
            for o in "yw":
                xy = np.array([at(p, o) for p in "xz"])
                h = np.linalg.solve(xx, xy)
                h1.append(h)
                coherence.append((h.conj() @ xx @ h).real / at(o, o).real)
            for names, found in (("x", hv), ("xz", hv2)):
                both = names + "y"
                scale = np.array([1.0] * len(names) + [0.5])
                m = np.array([[at(p, q) for q in both] for p in both]) * np.outer(scale, scale)
                vector = np.linalg.eigh(m)[1][:, 0]
                found += list(-vector[:-1] / vector[-1] * 2.0)
        case["h1"] = [pairs([row[i] for row in h1[o::2]]) for o in range(2) for i in range(2)]
        case["multiple_coherence"] = [coherence[0::2], coherence[1::2]]
        case["hv_xy"] = pairs(hv)
        case["hv_y"] = [pairs(hv2[0::2]), pairs(hv2[1::2])]
        cases.append(case)
    text = json.dumps({"rate_hz": RATE_HZ, "samples": SAMPLES, "sums": [float(np.sum(c)) for c in (x, z, y, w)], "cases": cases})
    (pathlib.Path(__file__).parent / "spectra.json").write_text(text.replace("}, {", "},\n{") + "\n")


main()
