"""Prints what the reference controllers reach, computed from recordings by SciPy and pyYeti.

Each test runs in free mode and is recorded; the recording is exported as CSV. All figures come from the readings of C
and the force in that CSV, by code that shares nothing with Resonarm: densities by scipy.signal.welch, the fundamental
of a sine by demodulation with the specified phase, shock response spectra by pyyeti.srs. The table is the one of
docs/specifications.md, section "Controlling a test".

    pip install numpy scipy pyyeti
    python accuracies.py [RESONARM] [TEXT ...]

RESONARM is the program, `resonarm` by default. With TEXT, only rows whose name contains it are measured.
"""

import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import pyyeti.srs
import scipy.signal

RATE_HZ = 1000

# ---- structures ----

PLATE_SHAKER = """
[rig.shaker]
direction_deg = 0.0
amplifier = "voltage"
moving_mass_kg = 0.2
stiffness_n_m = 2000.0
damping_n_s_m = 8.0
force_factor_n_a = 15.0
resistance_ohm = 2.0
inductance_h = 5e-4
stroke_m = 0.0127
current_limit_a = 15.0
voltage_limit_v = 60.0
"""


def modal(modes, rig="", elements=""):
    """A scenario of modes (frequency in Hz, damping ratio, shape at the tip and at the middle, 1/√kg)."""
    text = '[structure]\nkind = "modal"\nname = "modes"\n'
    for frequency_hz, damping_ratio, tip, mid in modes:
        text += (
            f"[[structure.modes]]\nfrequency_hz = {frequency_hz}\ndamping_ratio = {damping_ratio}\n"
            f'shape = {{ "tip.x" = {tip}, "mid.x" = {mid} }}\n'
        )
    return text + elements + '[rig.exciter]\nat = "tip.x"\nforce_limit_n = 655\n[rig.sensors.b]\nat = "mid.x"\n' + rig


def two_modes(damping_ratio):
    """Two modes, driven by an ideal force at the tip."""
    return modal([(31.3, damping_ratio, 0.40, 0.22), (87.7, damping_ratio, 0.35, -0.30)])


HARDENING = modal(
    [(31.3, 0.01, 0.40, 0.22), (87.7, 0.01, 0.35, -0.30)],
    elements='[[structure.elements]]\nkind = "cubic"\nat = "tip.x"\nstiffness3_n_m3 = 3e9\n',
)
# The plate of scenarios/shaken-plate.toml on its shaker.
PLATE = modal([(36.4, 0.01, 0.6, 0.32), (125.2, 0.012, -0.45, 0.3), (181.9, 0.015, 0.5, -0.4)], PLATE_SHAKER)
ARM = '[structure.set]\n"link1.damping_nm_s_rad" = 60.0\n"link2.damping_nm_s_rad" = 60.0\n'

# ---- specifications ----

HEADER = '[spec]\nkind = "{kind}"\nsources = ["own"]\n'
CHANNEL = '[control]\nchannels = ["c.x"]\n'


def random_test(breakpoints):
    """A random test of 120 s at full level."""
    return (
        HEADER.format(kind="random")
        + f'[random]\nunit = "(m/s2)2/Hz"\nbreakpoints = {breakpoints}\ntolerance_db = [-3, 3]\nabort_db = [-6, 6]\n'
        + "abort_share = 0.1\n[schedule]\nlevels_db = [-12, -6, -3, 0]\nseconds = [10, 10, 10, 120]\n"
        + CHANNEL
    )


def sine_test(from_hz, to_hz, rate_oct_min):
    """One sweep up at 3 m/s²."""
    return (
        HEADER.format(kind="sine")
        + f"[sine]\nfrom_hz = {from_hz}\nrate_oct_min = {rate_oct_min}\n"
        + f"segments = [{{ to_hz = {to_hz}, acceleration_m_s2 = 3 }}]\ntolerance = 0.1\nabort = 0.5\n"
        + CHANNEL
    )


def shock_test(duration_s):
    """Half-sines of 10 m/s², three at full level."""
    return (
        HEADER.format(kind="shock")
        + f'[shock]\npulse = "half-sine"\npeak_m_s2 = 10\nduration_s = {duration_s}\npre_s = 0.1\npost_s = 0.1\n'
        + "band = 0.2\nvelocity_tolerance = 0.15\nend_velocity_tolerance = 0.1\n"
        + "shots = [{ level_db = -12, count = 2 }, { level_db = -6, count = 2 }, { level_db = 0, count = 3 }]\n"
        + CHANNEL
    )


RANDOM = [[10, 0.02], [20, 0.2], [100, 0.2], [200, 0.05]]
RANDOM_ARM = [[15, 0.02], [60, 0.02]]
SPECTRUM = [[20, 20], [60, 100], [100, 100]]
SPECTRUM_TEST = (
    HEADER.format(kind="shock")
    + f'[srs]\nunit = "m/s2"\nq = 10\nbreakpoints = {SPECTRUM}\ntolerance_db = [-1.5, 3]\nlines_per_octave = 6\n'
    + CHANNEL
)

# ---- runs ----


def run(resonarm, structure, law, test, amplitude_n):
    """Runs a test and returns the reading of C, m/s², and the force, N, of each sample."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "spec.toml").write_text(test)
        # At most what the exciter can: the blocked force of the plate's shaker, or a limit that is raised.
        amplitude_n = min(amplitude_n, 225) if structure is PLATE else amplitude_n
        control = f'[control]\nlaw = "{law}"\nspecification = "spec.toml"\n'
        amplitude = f"amplitude = {{ exciter_x = {amplitude_n} }}\n"
        (folder / "scenario.toml").write_text(structure + control + amplitude)
        for command in (
            ["run", "--mode", "free", "--scenario", "scenario.toml", "--record", "test.mcap"],
            ["export", "test.mcap", "--to", "csv", "--parts", "states,samples", "--out", "test"],
        ):
            done = subprocess.run([resonarm, *command], cwd=folder, capture_output=True, text=True)
            if done.returncode != 0:
                sys.exit(f"{' '.join(command)} ends with {done.returncode}: {done.stderr}")
        reading = column(folder / "test-samples.csv", "acceleration_c_x_m_s2")
        return reading, column(folder / "test-states.csv", "force_x_n")


def column(path, name):
    """A column of a CSV file."""
    with open(path) as file:
        index = file.readline().strip().split(",").index(name)
    return np.loadtxt(path, delimiter=",", skiprows=1, usecols=index)


def log_log(breakpoints, frequencies_hz):
    """Values between breakpoints, on straight lines of the logarithms."""
    at, values = np.log(np.transpose(breakpoints))
    return np.exp(np.interp(np.log(frequencies_hz), at, values))


def played(drive):
    """The last sample of the drive before the final ramp of 100 samples, exclusive."""
    return np.flatnonzero(drive)[-1] + 1 - 100


# ---- figures ----


def random(reading, drive, breakpoints):
    """Deviations of the lines at full level, without two lines at each edge, and the largest drive."""
    end = played(drive)
    full = slice(end - 120 * RATE_HZ, end)
    frequencies_hz, density = scipy.signal.welch(reading[full], RATE_HZ, "hann", RATE_HZ, detrend=False)
    lines = slice(int(breakpoints[0][0]) + 2, int(breakpoints[-1][0]) - 1)
    deviation_db = 10 * np.log10(density[lines] / log_log(breakpoints, frequencies_hz[lines]))
    beyond = f"{np.count_nonzero(np.abs(deviation_db) > 3)} of {len(deviation_db)} lines beyond 3 dB"
    peak_n = np.abs(drive[full]).max()
    return f"{deviation_db.min():+.2f} to {deviation_db.max():+.2f} dB, {beyond}, {peak_n:.0f} N"


def sine(reading, drive, from_hz, to_hz, rate_oct_min):
    """Deviations of the tracked fundamental from 3 m/s², through the sweep but its first and last second."""
    end = played(drive)
    begin = end - round(60 * np.log2(to_hz / from_hz) / rate_oct_min * RATE_HZ)
    octaves = rate_oct_min / 60 * np.arange(end - begin) / RATE_HZ
    phase = 2 * np.pi * from_hz * 60 / (rate_oct_min * np.log(2)) * (2**octaves - 1)
    low_pass = scipy.signal.butter(2, 4, fs=RATE_HZ, output="sos")
    fundamental = 2 * np.abs(scipy.signal.sosfiltfilt(low_pass, reading[begin:end] * np.exp(-1j * phase)))
    deviation = fundamental[RATE_HZ:-RATE_HZ] / 3 - 1
    within = f"{100 * np.mean(np.abs(deviation) <= 0.1):.1f} % of the time within 10 %"
    return f"{100 * deviation.min():+.1f} to {100 * deviation.max():+.1f} %, {within}"


def shock(reading, drive, duration_s):
    """Error in each pulse at full level over its peak, and the largest drive."""
    samples = round(duration_s * RATE_HZ)
    # Where the pulse begins between two samples is not known: of all shifts the one that agrees best.
    shifts = np.linspace(0, 1, 21)[:-1]
    pulses = np.array([10 * np.sin(np.pi * (np.arange(samples) + shift) / samples) for shift in shifts])
    match = scipy.signal.correlate(reading, pulses[0], "valid")
    peaks, _ = scipy.signal.find_peaks(match, height=0.8 * np.sum(pulses[0] ** 2), distance=RATE_HZ // 2)
    errors = []
    for peak in peaks[-3:]:
        windows = [reading[at : at + samples] - pulse for at in range(peak - 2, peak + 3) for pulse in pulses]
        errors.append(min(np.abs(window).max() for window in windows) / 10)
    return ", ".join(f"{100 * error:.1f}" for error in errors) + f" % of the peak, {np.abs(drive).max():.0f} N"


def spectrum(reading, drive, breakpoints):
    """Deviation of the shock response spectrum of the largest shot, which is at full level, and the largest drive."""
    largest = np.abs(reading).argmax()
    shot = reading[largest - 2 * RATE_HZ : largest + 4 * RATE_HZ]
    octaves = np.arange(0, np.log2(breakpoints[-1][0] / breakpoints[0][0]) + 1e-9, 1 / 6)
    lines_hz = breakpoints[0][0] * 2**octaves
    reached = pyyeti.srs.srs(shot, RATE_HZ, lines_hz, 10, ic="zero", ppc=0)
    deviation_db = 20 * np.log10(reached / log_log(breakpoints, lines_hz))
    return f"{deviation_db.min():+.3f} to {deviation_db.max():+.3f} dB, {np.abs(drive).max():.0f} N"


def tests():
    """Name, structure, law, specification, largest drive in N, figure and its parameters of each row."""
    for name, structure in [
        ("two modes, 2 %", two_modes(0.02)),
        ("two modes, 0.5 %", two_modes(0.005)),
        ("two modes, 0.1 %", two_modes(0.001)),
        ("hardening, 1 %", HARDENING),
        ("plate", PLATE),
    ]:
        yield f"random, {name}", structure, "random", random_test(RANDOM), 300, random, (RANDOM,)
    yield "random, 15 to 60 Hz, arm", ARM, "random", random_test(RANDOM_ARM), 300, random, (RANDOM_ARM,)
    for sweep, name, structure in [
        ((24, 42, 1), "two modes, 2 %", two_modes(0.02)),
        ((24, 42, 1), "two modes, 1 %", two_modes(0.01)),
        ((24, 42, 1), "two modes, 0.5 %", two_modes(0.005)),
        ((24, 42, 1), "two modes, 0.1 %", two_modes(0.001)),
        ((10, 150, 1), "plate, 1 octave a minute", PLATE),
        ((10, 150, 4), "plate, 4 octaves a minute", PLATE),
    ]:
        yield f"sine, {name}", structure, "swept-sine", sine_test(*sweep), 300, sine, sweep
    for duration_s, name, structure in [
        (0.02, "two modes, 2 %", two_modes(0.02)),
        (0.02, "two modes, 0.5 %", two_modes(0.005)),
        (0.02, "hardening, 1 %", HARDENING),
        (0.01, "plate", PLATE),
    ]:
        yield f"half-sine, {name}", structure, "shock", shock_test(duration_s), 650, shock, (duration_s,)
    for name, structure in [("two modes, 2 %", two_modes(0.02)), ("two modes, 0.5 %", two_modes(0.005))]:
        yield f"spectrum, {name}", structure, "shock", SPECTRUM_TEST, 650, spectrum, (SPECTRUM,)


def main():
    """Measures the rows that were asked for."""
    resonarm, *texts = sys.argv[1:] or ["resonarm"]
    for name, structure, law, test, amplitude_n, figure, parameters in tests():
        if not texts or any(text in name for text in texts):
            reading, drive = run(resonarm, structure, law, test, amplitude_n)
            print(f"{name}: {figure(reading, drive, *parameters)}", flush=True)


main()
