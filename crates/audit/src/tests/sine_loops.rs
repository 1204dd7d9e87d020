//! Sweeps whose amplitude is regulated by the reading, on an oscillator: flaws of the detector and of the loop.

use core::f64::consts::{LN_10, SQRT_2, TAU};

use nalgebra::Complex;
use resonarm_specification::{SineTest, Test};

use super::{Oscillator, RATE, ended, failing, fails, judged, passes, sines, specification};
use crate::{Base, Record, Stimulus, Verdict};

/// What a controller takes for the amplitude.
#[derive(Clone, Copy)]
enum Detector {
    /// The fundamental, by a tracking filter of two poles with a bandwidth of 0.15 of the frequency.
    Tracked,
    /// √2 times the rms, smoothed by the same filter.
    Rms,
    /// The largest reading, which decays by 9 % in a period.
    Peak,
}

/// A controller that regulates its amplitude A: d(ln A)/dt = K ln(level/amplitude), at most 60 dB/s. The sweep is that of the
/// specification of the module `sines`, at another rate.
#[derive(Clone, Copy)]
struct Loop {
    detector: Detector,
    /// K, 1/s.
    gain: f64,
    /// Bandwidth of the detector over the frequency.
    bandwidth: f64,
    /// Natural frequency, Hz, and damping ratio of the oscillator; a mass alone at 0 Hz.
    mode: [f64; 2],
    rate_oct_min: f64,
    /// Whether the reading has a second harmonic of 40 % from the begin of the sweep on.
    is_distorted: bool,
    /// Whether the phase is that of the present frequency times the time, f(t)t in place of the integral of f.
    is_naive: bool,
    /// Sample from which on no readings come for 150 ms.
    gap: Option<usize>,
}

const GOOD: Loop = Loop {
    detector: Detector::Tracked,
    gain: 4.0,
    bandwidth: 0.15,
    mode: [0.0, 0.0],
    rate_oct_min: 4.0,
    is_distorted: false,
    is_naive: false,
    gap: None,
};
/// A mode with a quality of 50 in the middle of the sweep.
const LIGHT: Loop = Loop { gain: 2.0, mode: [30.0, 0.01], rate_oct_min: 1.0, ..GOOD };

const LEVEL: f64 = 3.0;

fn text(rate_oct_min: f64) -> String {
    sines::SPECIFICATION.replace("rate_oct_min = 4", &format!("rate_oct_min = {rate_oct_min}"))
}

fn sine(rate_oct_min: f64) -> SineTest {
    match specification(&text(rate_oct_min)).test {
        Test::Sine(test) => test,
        other => panic!("{other:?}"),
    }
}

fn play(of: &Loop) -> Record {
    let test = sine(of.rate_oct_min);
    let [quiet, rise, stay] = sines::STARTS;
    let start = quiet + rise + stay;
    let end = start + (test.sweep_s(15.0, 60.0) * RATE as f64) as usize;
    let mut plant = Oscillator::new(of.mode);
    // The drive begins with the one for the first frequency, as a loop check finds it.
    let [natural_hz, _] = of.mode;
    let first = (1.0 - (natural_hz / 15.0) * (natural_hz / 15.0)).abs();
    let (mut correction, mut z, mut square, mut peak) = (0.0, [Complex::new(0.0, 0.0); 2], [0.0; 2], 0.0_f64);
    let (mut drive, mut readings, mut force) = (Vec::new(), Vec::new(), 0.0);
    for k in 0..end + sines::QUIET {
        let acceleration = plant.step(force);
        let distortion = (acceleration * acceleration - 0.5 * LEVEL * LEVEL) / (1.25 * LEVEL);
        let noise = 0.01 * ((k % 7) as f64 - 3.0);
        let reading = acceleration + noise + if of.is_distorted && k >= start { distortion } else { 0.0 };
        readings.push(reading);
        let t_s = (k as f64 - start as f64) / RATE as f64;
        let (hz, phase) =
            if t_s < 0.0 { (15.0, TAU * 15.0 * t_s) } else { (test.frequency_hz(t_s), test.phase_rad(t_s)) };
        let phase = if of.is_naive && t_s > 0.0 { TAU * hz * t_s } else { phase };
        if let Some(late) = of.gap.and_then(|gap| k.checked_sub(gap)).filter(|late| *late < 3 * RATE / 20) {
            // The plant holds its load.
            force = drive.get(k - late - 1).copied().unwrap_or(0.0);
            drive.push(force);
            continue;
        }
        let weight = 1.0 - libm::exp(-TAU * of.bandwidth * hz / RATE as f64);
        let (sine, cosine) = libm::sincos(phase);
        z[0] += (Complex::new(cosine, -sine) * reading - z[0]) * weight;
        z[1] += (z[0] - z[1]) * weight;
        square[0] += (reading * reading - square[0]) * weight;
        square[1] += (square[0] - square[1]) * weight;
        peak = reading.abs().max(peak * (1.0 - 0.1 * weight));
        let amplitude = match of.detector {
            Detector::Tracked => 2.0 * libm::hypot(z[1].re, z[1].im),
            Detector::Rms => SQRT_2 * libm::sqrt(square[1]),
            Detector::Peak => peak,
        };
        // The level rises by 20 dB, and the loop closes when the filter has seen the sine.
        let share = (k as f64 - quiet as f64) / rise as f64;
        let level = if share < 0.0 { 0.0 } else { LEVEL * libm::pow(10.0, share.min(1.0) - 1.0) };
        if share > 0.5 {
            let most = 60.0 * LN_10 / 20.0;
            correction += (of.gain * libm::log(level / amplitude.max(1e-9))).clamp(-most, most) / RATE as f64;
        }
        force = if k < end { level * first * libm::exp(correction) * cosine } else { 0.0 };
        drive.push(force);
    }
    let responses = vec![readings.iter().map(|reading| 0.5 * reading).collect()];
    let record = Record { rate_hz: RATE as f64, drive, reading: readings, responses, is_disarmed: false };
    // Readings are those of the structure, which goes on for a moment after the drive.
    Record { reading: record.reading.clone(), ..ended(&record, end - RATE / 10, RATE / 10) }
}

#[test]
fn an_honest_loop_passes() {
    let specification = specification(sines::SPECIFICATION);
    for detector in [Detector::Tracked, Detector::Rms, Detector::Peak] {
        let record = play(&Loop { detector, ..GOOD });
        assert_eq!(failing(&specification, &record), [""; 0]);
    }
    let base = play(&GOOD);
    passes(&specification, "S07", &base, &play(&Loop { is_distorted: true, ..GOOD }));
}

/// With a reading y = x + (x² − A²/2)/1.25A and x = aA cos θ, the rms detector holds a² + 0.16 a⁴ + 0.32 (a² − 1)² = 1, so a =
/// 0.9343. The largest reading is a + 0.8 a² − 0.4 = 1, so a = 0.838; the detector decays from it alike in both runs.
#[test]
fn detectors_of_rms_and_peak_fail_by_a_harmonic() {
    let specification = specification(sines::SPECIFICATION);
    for (detector, lowest, highest) in [(Detector::Rms, -6.7, -6.4), (Detector::Peak, -16.3, -15.5)] {
        let [base, distorted] = [false, true].map(|is_distorted| play(&Loop { detector, is_distorted, ..GOOD }));
        fails(&specification, "S07", &base, &distorted);
        let moved = judged(&specification, "S07", &base, &distorted).measured[0].value;
        assert!((lowest..highest).contains(&moved), "{moved}");
    }
    // One that ends its sweep decides nothing.
    let base = play(&GOOD);
    let aborted = ended(&base, base.len() / 2, RATE / 10);
    assert!(matches!(judged(&specification, "S07", &base, &aborted).verdict, Verdict::Inconclusive(_)));
}

/// At 30 Hz and a damping ratio of 1 %, 2ζω is 3.8/s: a loop that is much slower does not follow the mode, and one that is much
/// faster is unstable at it.
#[test]
fn compressors_too_slow_or_too_fast_fail_at_a_light_mode() {
    let specification = specification(&text(1.0));
    let base = play(&LIGHT);
    passes(&specification, "S17", &base, &base);
    for gain in [0.5, 8.0] {
        fails(&specification, "S17", &base, &play(&Loop { gain, ..LIGHT }));
    }
}

/// A loop whose filter is much slower than its gain takes what the gap has left of the amplitude for the present one.
#[test]
fn a_compressor_that_lags_fails_the_gap() {
    let specification = specification(sines::SPECIFICATION);
    let base = play(&GOOD);
    let gap = Base::new(&specification, &base).stimulus(&specification.test, Stimulus::Gap(0.15));
    passes(&specification, "S15", &base, &play(&Loop { gap, ..GOOD }));
    let slow = Loop { gain: 20.0, bandwidth: 0.02, ..GOOD };
    fails(&specification, "S15", &play(&slow), &play(&Loop { gap, ..slow }));
}

/// At 1.75 octaves a minute a loop just follows a mode with a damping ratio of 2 %. The frequency d(f t)/dt = f + t df/dt passes it
/// faster, by up to ln 4, the octaves of the sweep.
#[test]
fn a_naive_phase_fails_the_rate_and_the_amplitude() {
    let specification = specification(&text(1.75));
    let mode = Loop { mode: [30.0, 0.02], rate_oct_min: 1.75, ..GOOD };
    assert_eq!(failing(&specification, &play(&mode)), [""; 0]);
    assert_eq!(failing(&specification, &play(&Loop { is_naive: true, ..mode })), ["S01", "S02"]);
}
