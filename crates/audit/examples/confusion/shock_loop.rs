//! A controller of classical shocks that drives them through the inverse of the identified response, and its flaws.

use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_audit::Record;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;
use resonarm_specification::{Specification, Test};

use super::plant::{Plant, RATE, Structure};

pub const SPECIFICATION: &str = "[spec]
kind = 'shock'
sources = []
[shock]
pulse = 'half-sine'
peak_m_s2 = 20
duration_s = 0.02
band = 0.2
velocity_tolerance = 0.15
end_velocity_tolerance = 0.1
outside = 0.25
pre_s = 0.1
post_s = 0.1
shots = [{ level_db = -12, count = 2 }, { level_db = -6, count = 2 }, { level_db = 0, count = 2 }]
";

/// What is wrong with a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShockFlaw {
    None,
    /// The pulse is 30 % too high.
    High,
    /// The pulse lasts 14 ms in place of 20 ms.
    Brief,
    /// The pulse has the other direction.
    Inverted,
    /// One shot less.
    TooFew,
    /// The force is that of a mass, whatever the structure.
    Rigid,
    /// The pulse is followed by one of 40 % and its opposite.
    Echo,
    /// The pulse has no compensation.
    NoCompensation,
    /// All shots have the full level.
    FullFirst,
}

/// The controllers with their names, and the cases that are meant to find each flaw: one of them must.
pub const CONTROLLERS: &[(ShockFlaw, &str, &[&str])] = &[
    (ShockFlaw::None, "correct", &[]),
    (ShockFlaw::High, "pulse 30 % too high", &["K01"]),
    (ShockFlaw::Inverted, "pulse in the other direction", &["K01"]),
    (ShockFlaw::TooFew, "one shot less", &["K01"]),
    (ShockFlaw::Rigid, "takes the structure for a mass", &["K01"]),
    (ShockFlaw::Brief, "pulse of 70 % of the time", &["K02"]),
    (ShockFlaw::Echo, "a weaker pulse after it", &["K03"]),
    (ShockFlaw::NoCompensation, "no compensation", &["K04"]),
    (ShockFlaw::FullFirst, "full level at once", &["K05"]),
];

/// Samples of a shot, a power of two, and those before the pulse in it.
const SHOT: usize = 4 * RATE;
const BEFORE: usize = RATE;
/// Frames of the identification, which overlap by half, and the rms of its noise, N.
const FRAMES: usize = 14;
const WEAK_N: f64 = 0.5;
/// Part of the largest response below which it is not inverted.
const FLOOR: f64 = 1e-3;
const NOISE_M_S2: f64 = 0.01;

/// Runs a controller: it identifies the response by noise, and corrects the force after each shot by what is missing,
/// U ← U + a (R − C)/H; if the error did not fall, a is halved.
pub fn run(structure: &Structure, specification: &Specification, flaw: ShockFlaw, seed: u64) -> Record {
    let Test::Shock(test) = &specification.test else { return Record::default() };
    let mut own = test.clone();
    if flaw == ShockFlaw::Brief {
        own.duration_s *= 0.7;
    }
    let (mut pulse, start) = own.compensated(RATE as f64).unwrap_or_default();
    let length = own.samples(RATE as f64).len();
    match flaw {
        ShockFlaw::NoCompensation => {
            pulse[..start].fill(0.0);
            pulse[start + length..].fill(0.0);
        }
        ShockFlaw::Echo => {
            for k in 0..length {
                let later = 0.4 * pulse[start + k];
                pulse[start + 2 * length + k] += later;
                pulse[start + 3 * length + k] -= later;
            }
        }
        _ => {}
    }
    let factor = match flaw {
        ShockFlaw::High => 1.3,
        ShockFlaw::Inverted => -1.0,
        _ => 1.0,
    };
    let mut wanted = vec![0.0; SHOT];
    for (sample, value) in wanted[BEFORE..].iter_mut().zip(&pulse) {
        *sample = factor * value;
    }
    let (mut plant, mut noise) = (Plant::new(structure), Noise::new(seed, 5));
    let mut record = Record { rate_hz: RATE as f64, ..Record::default() };
    let mut force = 0.0;
    let mut play = |drive: &[f64], noise: &mut Noise| -> Vec<f64> {
        let from = record.reading.len();
        for next in drive {
            let [control, _] = plant.step(force);
            record.reading.push(control + NOISE_M_S2 * noise.normal());
            record.drive.push(*next);
            force = *next;
        }
        record.reading[from..].to_vec()
    };
    let weak: Vec<f64> = (0..SHOT / 2 * (FRAMES + 1)).map(|_| WEAK_N * noise.normal()).collect();
    let read = play(&weak, &mut noise);
    play(&vec![0.0; 2 * RATE], &mut noise);
    let transform = Fft::at_least(SHOT);
    let inverse = if flaw == ShockFlaw::Rigid { rigid(structure) } else { inverse(&transform, &weak, &read) };
    let through = |values: &[f64]| -> Vec<f64> {
        let mut lines: Vec<Complex<f64>> = values.iter().map(|value| Complex::new(*value, 0.0)).collect();
        transform.forward(&mut lines);
        lines.iter_mut().zip(&inverse).for_each(|(line, inverse)| *line *= *inverse);
        transform.backward(&mut lines);
        lines.iter().map(|line| line.re / SHOT as f64).collect()
    };
    let mut levels: Vec<f64> = test
        .shots
        .iter()
        .flat_map(|shots| vec![libm::pow(10.0, 0.05 * shots.level_db); shots.count as usize])
        .collect();
    match flaw {
        ShockFlaw::TooFew => drop(levels.pop()),
        ShockFlaw::FullFirst => levels.fill(1.0),
        _ => {}
    }
    let mut drive = through(&wanted);
    let (mut share, mut best) = (1.0, (f64::INFINITY, drive.clone()));
    for level in levels {
        let scaled: Vec<f64> = drive.iter().map(|drive| level * drive).collect();
        let read = play(&scaled, &mut noise);
        let missing: Vec<f64> = wanted.iter().zip(&read).map(|(wanted, read)| wanted - read / level).collect();
        let error: f64 = missing.iter().map(|missing| missing * missing).sum();
        if flaw == ShockFlaw::Rigid {
            continue;
        }
        if error < best.0 {
            best = (error, drive.clone());
            let correction = through(&missing);
            drive.iter_mut().zip(correction).for_each(|(drive, correction)| *drive += share * correction);
        } else {
            share *= 0.5;
            drive.clone_from(&best.1);
        }
    }
    play(&vec![0.0; RATE], &mut noise);
    record
}

/// What a structure that is a mass takes for an acceleration, with the delay of a sample.
fn rigid(structure: &Structure) -> Vec<Complex<f64>> {
    let [gain, _] = structure.body_1_kg;
    let turn = |k: usize| {
        let (sine, cosine) = libm::sincos(TAU * k as f64 / SHOT as f64);
        Complex::new(cosine, sine) / gain
    };
    (0..SHOT).map(turn).collect()
}

/// The inverse of the response from a record of noise, Σ F* A/Σ F* F, over frames under Hann's window; of weak lines less.
fn inverse(transform: &Fft, drive: &[f64], read: &[f64]) -> Vec<Complex<f64>> {
    let window: Vec<f64> = (0..SHOT).map(|k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / SHOT as f64)).collect();
    let mut cross = vec![Complex::new(0.0, 0.0); SHOT];
    let mut power = vec![0.0; SHOT];
    for frame in 0..FRAMES {
        let range = frame * SHOT / 2..frame * SHOT / 2 + SHOT;
        let [force, read] = [drive, read].map(|values| {
            let windowed = values[range.clone()].iter().zip(&window);
            let mut lines: Vec<Complex<f64>> =
                windowed.map(|(value, window)| Complex::new(value * window, 0.0)).collect();
            transform.forward(&mut lines);
            lines
        });
        for k in 0..SHOT {
            cross[k] += force[k].conj() * read[k];
            power[k] += force[k].norm_sqr();
        }
    }
    let response: Vec<Complex<f64>> = cross.iter().zip(&power).map(|(cross, power)| cross / *power).collect();
    let largest = response.iter().map(|line| line.norm_sqr()).fold(0.0, f64::max);
    let floor = FLOOR * FLOOR * largest;
    response.iter().map(|line| line.conj() / (line.norm_sqr() + floor)).collect()
}
