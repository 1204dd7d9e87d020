"""A shaker for the tests of the controllers in C, and the force that it makes in the impedance head."""

import numpy as np

# Its armature reduces the force, so that a loop has something to do. With a stroke of a micrometre it trips.
SHAKER = """
[rig.shaker]
amplifier = "voltage"
moving_mass_kg = 0.5
stiffness_n_m = 2000.0
damping_n_s_m = 10.0
force_factor_n_a = 20.0
resistance_ohm = 2.0
inductance_h = 3e-4
stroke_m = {stroke_m}
current_limit_a = 15.0
voltage_limit_v = 60.0
"""


def fundamental(samples, rate_hz, frequency_hz):
    """Amplitude of a sine in samples, beside an offset, by least squares. The arm rings at another frequency, with the
    shaker on it at none that is known: a window that is zero at both ends leaves it out."""
    t, weight = np.arange(len(samples)) / rate_hz, np.hanning(len(samples))
    phase = 2 * np.pi * frequency_hz * t
    columns = np.stack([np.ones_like(t), np.cos(phase), np.sin(phase)], axis=1)
    fit, *_ = np.linalg.lstsq(columns * np.sqrt(weight)[:, None], samples * np.sqrt(weight), rcond=None)
    return np.hypot(fit[1], fit[2])
