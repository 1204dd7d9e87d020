//! Random tests that are equalised by the reading, on a structure with a resonance and an antiresonance: flaws of the loop.

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;
use resonarm_specification::{RandomTest, Test};

use super::{Oscillator, RATE, ended, failing, passes, randoms, specification};
use crate::Record;

/// What is wrong with a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Flaw {
    None,
    /// Frames overlap by half without a window. The loop corrects the power of their sum, but their ends spread it over all lines.
    NoWindow,
    /// The drive is white noise with a uniform distribution, of the specified rms.
    Uniform,
    /// Eleven lines are equalised by their mean.
    ElevenLines,
    /// Averages go on at a new level.
    KeepsAverages,
    /// The profile is straight between its points over linear axes.
    LinearProfile,
}

const LINES: usize = RATE / 2 + 1;
const HOP: usize = RATE / 2;
/// Averages after which the drive is corrected, by this power of the error, and frames in the memory of the averages.
const EVERY: u32 = 8;
const POWER: f64 = 0.3;
const MEMORY: u32 = 32;
/// Hops of a level before the averages begin.
const SETTLED: usize = 3;

fn random() -> RandomTest {
    match specification(randoms::SPECIFICATION).test {
        Test::Random(test) => test,
        other => panic!("{other:?}"),
    }
}

/// The specified density at the lines, as the controller reads it.
fn demand(flaw: Flaw) -> Vec<f64> {
    let test = random();
    let corners = [[10.0, 0.02], [20.0, 0.2], [100.0, 0.2], [200.0, 0.05]];
    let linear = |hz: f64| {
        let [[low_hz, low], [high_hz, high]] =
            corners.windows(2).find(|pair| hz <= pair[1][0]).map(|pair| [pair[0], pair[1]])?;
        (hz >= low_hz).then(|| low + (high - low) * (hz - low_hz) / (high_hz - low_hz))
    };
    let at = |line: usize| {
        let hz = line as f64;
        if flaw == Flaw::LinearProfile { linear(hz) } else { test.profile.at(hz) }.unwrap_or(0.0)
    };
    (0..LINES).map(at).collect()
}

/// Means over five lines to either side, or the values themselves.
fn equalised(values: &[f64], flaw: Flaw) -> Vec<f64> {
    let reach = if flaw == Flaw::ElevenLines { 5 } else { 0 };
    let mean = |line: usize| {
        let (from, to) = (line.saturating_sub(reach).max(10), (line + reach + 1).min(201));
        values[from..to.max(from)].iter().sum::<f64>() / (to.max(from + 1) - from) as f64
    };
    (0..values.len()).map(|line| if (10..=200).contains(&line) { mean(line) } else { 0.0 }).collect()
}

/// Plays the schedule of the specification after 3 s of silence and 6 s of weak noise, by which the response is identified.
fn play(flaw: Flaw, seed: u64) -> Record {
    let demand = demand(flaw);
    let levels: Vec<f64> = [(0.0, 3), (1e-3, 6), (0.063, 5), (0.251, 5), (0.501, 5), (1.0, 60)]
        .iter()
        .flat_map(|&(power, seconds)| vec![power; 2 * seconds])
        .collect();
    let mut noise = Noise::new(seed, 3);
    let transform = Fft::at_least(RATE);
    let window: Vec<f64> =
        (0..RATE).map(|k| 0.5 - 0.5 * libm::cos(core::f64::consts::TAU * k as f64 / RATE as f64)).collect();
    let mut plant = Oscillator::new([60.0, 0.02]);
    let mut density = demand.clone();
    let (mut average, mut count, mut since) = (vec![0.0; LINES], 0, 0);
    let (mut drive, mut reading, mut rest) = (Vec::new(), Vec::new(), vec![0.0; HOP]);
    for (hop, power) in levels.iter().enumerate() {
        let is_new = hop > 0 && levels[hop - 1] != *power;
        if is_new && levels[hop - 1] == 1e-3 {
            // The weak noise has the specified density times 1e-3.
            let (wanted, got) = (equalised(&demand, flaw), equalised(&average, flaw));
            // Uniform noise is white, and has one level.
            let all = wanted.iter().sum::<f64>() / average.iter().sum::<f64>();
            let factor = |k: usize| if flaw == Flaw::Uniform { all } else { wanted[k] / got[k].max(1e-12) };
            density = (0..LINES).map(|k| demand[k] * factor(k) * 1e-3).collect();
        }
        if is_new {
            since = 0;
            if flaw != Flaw::KeepsAverages || *power < 0.01 || levels[hop - 1] < 0.01 {
                (average, count) = (vec![0.0; LINES], 0);
            }
        }
        let mut values = vec![Complex::new(0.0, 0.0); RATE];
        for (k, value) in values.iter_mut().enumerate().take(LINES) {
            // Lines X of N samples have the density 2|X|²/(fs N).
            let size = libm::sqrt(density[k] * power * (RATE * RATE) as f64 / 4.0);
            *value = Complex::new(size * noise.normal(), size * noise.normal());
        }
        transform.backward(&mut values);
        let shape = |k: usize| if flaw == Flaw::NoWindow { 1.0 } else { libm::sqrt(window[k]) };
        // The real part of a one-sided spectrum is half of the two-sided one's.
        let frame: Vec<f64> = (0..RATE).map(|k| 2.0 * values[k].re / RATE as f64 * shape(k)).collect();
        let rms = libm::sqrt(density.iter().sum::<f64>() * power);
        for k in 0..HOP {
            // A uniform distribution of this width has the variance 1.
            let uniform = libm::sqrt(12.0) * (noise.uniform() - 0.5);
            let force = if flaw == Flaw::Uniform { rms * uniform } else { rest[k] + frame[k] };
            drive.push(force);
            // A body of 1 kg with an oscillator of 0.3 kg on it.
            let own = force + 0.3 * plant.step(force);
            reading.push(own + 0.01 * noise.normal());
        }
        rest = frame[HOP..].to_vec();
        since += 1;
        if since < SETTLED && flaw != Flaw::KeepsAverages {
            continue;
        }
        let Some(segment) = reading.len().checked_sub(RATE).map(|from| &reading[from..]) else { continue };
        let mut lines: Vec<Complex<f64>> =
            segment.iter().zip(&window).map(|(value, window)| Complex::new(value * window, 0.0)).collect();
        transform.forward(&mut lines);
        count += 1;
        let weight = 1.0 / f64::from(count.min(MEMORY));
        for (average, line) in average.iter_mut().zip(&lines) {
            // The mean square of the window is 3/8.
            *average += (2.0 * line.norm_sqr() / (0.375 * (RATE * RATE) as f64) - *average) * weight;
        }
        if *power > 0.01 && count % EVERY == 0 && flaw != Flaw::Uniform {
            let (wanted, got) = (equalised(&demand, flaw), equalised(&average, flaw));
            for k in 10..=200 {
                density[k] *= libm::pow((power * wanted[k] / got[k]).clamp(0.5, 2.0), POWER);
            }
        }
    }
    let end = drive.len();
    for values in [&mut drive, &mut reading] {
        values.resize(end + randoms::QUIET, 0.0);
    }
    let responses = vec![reading.iter().map(|reading| 0.5 * reading).collect()];
    let record = Record { rate_hz: RATE as f64, drive, reading, responses, is_disarmed: false };
    ended(&record, end - RATE / 10, RATE / 10)
}

#[test]
fn an_honest_loop_passes() {
    let specification = specification(randoms::SPECIFICATION);
    for seed in [5, 6, 7] {
        let record = play(Flaw::None, seed);
        for id in ["R01", "R02", "R03", "R04", "R05", "R06", "R07", "R08", "R09", "R23"] {
            passes(&specification, id, &record, &record);
        }
    }
}

#[test]
fn a_flaw_of_the_loop_fails_the_case_for_it() {
    let specification = specification(randoms::SPECIFICATION);
    for (flaw, expected) in [
        (Flaw::NoWindow, &["R02", "R06"][..]),
        (Flaw::Uniform, &["R04"]),
        (Flaw::ElevenLines, &["R02", "R23"]),
        (Flaw::KeepsAverages, &["R03", "R06"]),
        (Flaw::LinearProfile, &["R23"]),
    ] {
        for seed in [5, 6, 7] {
            let found = failing(&specification, &play(flaw, seed));
            assert!(expected.iter().all(|id| found.contains(id)), "{flaw:?}, {seed}: {found:?}");
        }
    }
}
