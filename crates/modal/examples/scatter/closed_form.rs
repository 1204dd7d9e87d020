//! Records in closed form: the exact response of known modes to a force, with noise. The force began long ago and the record
//! is cut out, or it begins at rest.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;
use resonarm_modal::{Band, Channel, Mode, Record};
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;

/// Band that the fits use, Hz, and that of the force around it.
pub const BAND: Band = Band { from_hz: 8.0, to_hz: 195.0 };
const FORCE_HZ: [f64; 2] = [5.0, 200.0];
pub const RATE_HZ: f64 = 1000.0;

/// A mode that a structure has.
#[derive(Clone, Debug)]
pub struct Truth {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// Components of the shape for unit modal mass, by degree of freedom.
    pub shape: Vec<f64>,
}

/// What the force is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Force {
    /// Stationary random noise of this root mean square, N.
    Random(f64),
    /// Random noise of this root mean square, N, from rest until [`BURST`] of the record.
    Burst(f64),
    /// Sines of random phases at all multiples of the frequency of [`PERIOD`] in the band, of this root mean square, N, from rest.
    Multisine(f64),
    /// A blow of this peak, N, about 6 ms long, 8 ms after the start.
    Blow(f64),
}

/// The part of the record after which a burst ends.
const BURST: f64 = 0.6;
/// The period of a multisine, samples: a power of two.
const PERIOD: usize = 4096;
/// The time in which a burst or a multisine begins and a burst ends, by half a cosine, s.
const RAMP_S: f64 = 0.05;

/// What passes the force to the structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exciter {
    /// The force acts as it is commanded.
    Ideal,
    /// The armature of a shaker moves with the structure: its mass, spring and dampers, that of the coil's circuit among
    /// them, take their part of the force, most of it at resonances.
    Shaker { moving_mass_kg: f64, damping_n_s_m: f64, stiffness_n_m: f64 },
}

/// Brüel & Kjær Type 4809 in voltage mode, with the values of `scenarios/bk4809.toml`: the circuit of 2 Ω adds 6.78²/2 N·s/m.
const SHAKER: Exciter =
    Exciter::Shaker { moving_mass_kg: 0.057, damping_n_s_m: 21.51 + 6.78 * 6.78 / 2.0, stiffness_n_m: 9932.0 };

/// Modal exciter for some hundred newtons in voltage mode, with the values of `scenarios/shaker.toml`: the circuit of 2 Ω adds
/// 20²/2 N·s/m.
const LARGE_SHAKER: Exciter =
    Exciter::Shaker { moving_mass_kg: 0.5, damping_n_s_m: 10.0 + 20.0 * 20.0 / 2.0, stiffness_n_m: 2000.0 };

/// Noise of the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Readings {
    /// Noise of the responses so many decibels below each, and none of the force.
    Ratio(f64),
    /// Standard deviations of the noise of responses and force, which are known to the identification.
    Instruments { response: f64, force: f64 },
}

/// A case: a structure and a test.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: &'static str,
    pub modes: Vec<Truth>,
    /// Degrees of freedom of the force, one run for each.
    pub references: Vec<usize>,
    pub seconds: f64,
    pub force: Force,
    pub exciter: Exciter,
    pub readings: Readings,
}

/// Force and responses of a run.
pub struct Samples {
    pub force: Vec<f64>,
    pub responses: Vec<Vec<f64>>,
}

fn mode(frequency_hz: f64, damping_ratio: f64, shape: &[f64]) -> Truth {
    Truth { frequency_hz, damping_ratio, shape: shape.to_vec() }
}

/// Modes at 31, 58 and 120 Hz with damping ratios; degrees of freedom tip and middle.
pub fn three(damping: [f64; 3]) -> Vec<Truth> {
    let shapes = [[0.9, 0.4], [-0.7, 0.8], [0.6, -0.5]];
    let modes = [31.0, 58.0, 120.0].into_iter().zip(damping).zip(shapes);
    modes.map(|((frequency_hz, damping_ratio), shape)| mode(frequency_hz, damping_ratio, &shape)).collect()
}

/// Two modes, `separation` half-power bandwidths apart, and two degrees of freedom.
pub fn pair(separation: f64, damping_ratio: f64) -> Vec<Truth> {
    let second_hz = 50.0 + separation * 2.0 * damping_ratio * 50.0;
    vec![mode(50.0, damping_ratio, &[0.9, 0.4]), mode(second_hz, damping_ratio, &[-0.7, 0.8])]
}

/// `count` modes from 20 to 180 Hz with random places, damping ratios from 0.5 to 1.5 % and shapes of three degrees of freedom.
pub fn many(count: usize) -> Vec<Truth> {
    let mut noise = Noise::new(count as u64, 0);
    let mut between = |low: f64, high: f64| low + (high - low) * noise.uniform();
    (0..count)
        .map(|k| {
            let frequency_hz = 20.0 + 160.0 * k as f64 / (count - 1) as f64 + between(-6.0, 6.0);
            let damping_ratio = 0.01 * between(0.5, 1.5);
            let mut component = || between(0.4, 1.0) * if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            let shape = [component(), component(), component()];
            mode(frequency_hz, damping_ratio, &shape)
        })
        .collect()
}

/// Modes at frequencies 1.22 times apart, from 15 Hz on: on the circle of the start the lower ones are crowded.
pub fn over_octaves(count: usize) -> Vec<Truth> {
    let mut noise = Noise::new(100 + count as u64, 0);
    let mut between = |low: f64, high: f64| low + (high - low) * noise.uniform();
    (0..count)
        .map(|k| {
            let frequency_hz = 15.0 * libm::pow(1.22, k as f64);
            let damping_ratio = 0.01 * between(0.5, 2.0);
            let mut component = || between(0.4, 1.0) * if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            let shape = [component(), component(), component()];
            mode(frequency_hz, damping_ratio, &shape)
        })
        .collect()
}

/// All cases.
pub fn cases() -> Vec<Case> {
    let case = |name, modes, seconds, readings| Case {
        name,
        modes,
        references: vec![0],
        seconds,
        force: Force::Random(1.0),
        exciter: Exciter::Ideal,
        readings,
    };
    let plain = |name, modes| case(name, modes, 20.0, Readings::Ratio(40.0));
    let two = |name, modes| Case { references: vec![0, 1], ..plain(name, modes) };
    let noisy = |name, modes, seconds, force| Case {
        force,
        ..case(name, modes, seconds, Readings::Instruments { response: 0.0247, force: 0.0115 })
    };
    let same = |damping: f64| three([damping; 3]);
    let base = |name, force, exciter| Case { exciter, ..noisy(name, three([0.01, 0.015, 0.02]), 10.0, force) };
    vec![
        plain("three 0.1 %", same(0.001)),
        plain("three 1 %", same(0.01)),
        plain("three 2 %", same(0.02)),
        plain("three 5 %", same(0.05)),
        plain("three 10 %", same(0.1)),
        case("three 2 %, 60 dB", same(0.02), 20.0, Readings::Ratio(60.0)),
        case("three 2 %, 20 dB", same(0.02), 20.0, Readings::Ratio(20.0)),
        case("three 0.1 %, 60 dB", same(0.001), 20.0, Readings::Ratio(60.0)),
        case("three 0.1 %, 20 dB", same(0.001), 20.0, Readings::Ratio(20.0)),
        case("three 10 %, 20 dB", same(0.1), 20.0, Readings::Ratio(20.0)),
        case("three 1 %, 10 s", same(0.01), 10.0, Readings::Ratio(40.0)),
        plain("pair 0.5, 1 reference", pair(0.5, 0.01)),
        two("pair 0.5, 2 references", pair(0.5, 0.01)),
        plain("pair 1, 1 reference", pair(1.0, 0.01)),
        plain("pair 2, 1 reference", pair(2.0, 0.01)),
        plain("pair 0.5 of 5 %, 1 reference", pair(0.5, 0.05)),
        plain("2 modes", many(2)),
        plain("4 modes", many(4)),
        plain("6 modes", many(6)),
        plain("8 modes", many(8)),
        plain("13 modes over octaves", over_octaves(13)),
        noisy("noisy force, 1/1.5/2 %", three([0.01, 0.015, 0.02]), 10.0, Force::Random(5.0)),
        noisy("noisy force, 10 %", same(0.1), 10.0, Force::Random(5.0)),
        noisy("noisy force, 0.1 %", same(0.001), 10.0, Force::Random(5.0)),
        noisy("noisy force, 0.1 %, 5 s", same(0.001), 5.0, Force::Random(5.0)),
        noisy("noisy force, 50 and 51 Hz", pair(1.0, 0.01), 10.0, Force::Random(5.0)),
        noisy("blow, 2 %", same(0.02), 8.0, Force::Blow(300.0)),
        base("burst, 1/1.5/2 %", Force::Burst(5.0), Exciter::Ideal),
        base("multisine, 1/1.5/2 %", Force::Multisine(5.0), Exciter::Ideal),
        base("shaker, random, 1/1.5/2 %", Force::Random(5.0), SHAKER),
        base("shaker, burst, 1/1.5/2 %", Force::Burst(5.0), SHAKER),
        base("shaker, multisine, 1/1.5/2 %", Force::Multisine(5.0), SHAKER),
        base("large shaker, random, 1/1.5/2 %", Force::Random(50.0), LARGE_SHAKER),
        base("large shaker, burst, 1/1.5/2 %", Force::Burst(50.0), LARGE_SHAKER),
        base("large shaker, multisine, 1/1.5/2 %", Force::Multisine(50.0), LARGE_SHAKER),
    ]
}

/// Receptance of an output over a reference, φₒφᵢ/(s² + 2ζωs + ω²) over all modes.
fn receptance(modes: &[Truth], s: Complex<f64>, output: usize, reference: usize) -> Complex<f64> {
    let term = |mode: &Truth| {
        let omega = TAU * mode.frequency_hz;
        let stiffness = s * s + s * (2.0 * mode.damping_ratio * omega) + omega * omega;
        Complex::from(mode.shape[output] * mode.shape[reference]) / stiffness
    };
    modes.iter().map(term).sum()
}

/// Accelerance of an output over a reference: s² times the receptance.
pub fn accelerance(modes: &[Truth], frequency_hz: f64, output: usize, reference: usize) -> Complex<f64> {
    let s = Complex::new(0.0, TAU * frequency_hz);
    s * s * receptance(modes, s, output, reference)
}

/// Sets the lines of a signal in the band of the force, with random phases; the amplitudes are random, too, or equal.
fn set_lines(spectrum: &mut [Complex<f64>], rms: f64, equal: bool, noise: &mut Noise) {
    let spacing_hz = RATE_HZ / spectrum.len() as f64;
    let [first, last] = FORCE_HZ.map(|f| (f / spacing_hz).ceil() as usize);
    // Lines of both signs carry the power.
    let scale = rms / (4.0 * (last - first) as f64).sqrt();
    for line in &mut spectrum[first..last] {
        *line = if equal {
            let (sine, cosine) = libm::sincos(TAU * noise.uniform());
            Complex::new(cosine, sine) * (scale * std::f64::consts::SQRT_2)
        } else {
            Complex::new(noise.normal(), noise.normal()) * scale
        };
    }
}

/// Replaces a signal by the lines of the signal that begins at rest and ends after so many seconds.
fn set_lines_from_rest(fft: &Fft, signal: &mut [Complex<f64>], end_s: f64) {
    let ramp = |seconds: f64| 0.5 - 0.5 * libm::cos(PI * (seconds / RAMP_S).clamp(0.0, 1.0));
    for (n, value) in signal.iter_mut().enumerate() {
        let seconds = n as f64 / RATE_HZ;
        *value *= ramp(seconds) * ramp(end_s - seconds);
    }
    fft.forward(signal);
    let length = signal.len();
    signal.iter_mut().for_each(|line| *line /= length as f64);
    signal[0] *= 0.5;
    signal[length / 2..].fill(Complex::new(0.0, 0.0));
}

impl Case {
    /// The samples of all runs for a seed.
    pub fn samples(&self, seed: u64) -> Vec<Samples> {
        let runs = self.references.iter().enumerate();
        runs.map(|(run, reference)| self.run(*reference, Noise::new(seed, run as u64))).collect()
    }

    fn run(&self, reference: usize, mut noise: Noise) -> Samples {
        let samples = (self.seconds * RATE_HZ) as usize;
        let fft = Fft::at_least(2 * samples);
        let length = fft.length();
        let spacing_hz = RATE_HZ / length as f64;
        let mut force = vec![Complex::new(0.0, 0.0); length];
        match self.force {
            Force::Random(rms) => set_lines(&mut force, rms, false, &mut noise),
            Force::Burst(rms) => {
                set_lines(&mut force, rms, false, &mut noise);
                fft.backward(&mut force);
                force.iter_mut().for_each(|value| *value = Complex::from(2.0 * value.re));
                set_lines_from_rest(&fft, &mut force, BURST * self.seconds);
            }
            Force::Multisine(rms) => {
                let of_period = Fft::at_least(PERIOD);
                let mut period = vec![Complex::new(0.0, 0.0); PERIOD];
                set_lines(&mut period, rms, true, &mut noise);
                of_period.backward(&mut period);
                let cycle = period.iter().cycle();
                force.iter_mut().zip(cycle).for_each(|(value, sample)| *value = Complex::from(2.0 * sample.re));
                // It goes on after the record.
                set_lines_from_rest(&fft, &mut force, self.seconds + 4.0 * RAMP_S);
            }
            Force::Blow(peak) => {
                // A Gaussian pulse of 1.5 ms, whose spectrum ends below half the sample rate.
                for (line, value) in force[..length / 2].iter_mut().enumerate() {
                    let omega = TAU * line as f64 * spacing_hz;
                    let size = libm::exp(-0.5 * (omega * 0.0015).powi(2)) * peak * 0.0015 * TAU.sqrt() * spacing_hz;
                    let (sine, cosine) = libm::sincos(-omega * 0.008);
                    *value = Complex::new(cosine, sine) * size;
                }
                force[0] *= 0.5;
            }
        }
        if let Exciter::Shaker { moving_mass_kg, damping_n_s_m, stiffness_n_m } = self.exciter {
            for (line, value) in force[..length / 2].iter_mut().enumerate() {
                let s = Complex::new(0.0, TAU * line as f64 * spacing_hz);
                let armature = s * s * moving_mass_kg + s * damping_n_s_m + stiffness_n_m;
                *value /= armature * receptance(&self.modes, s, reference, reference) + 1.0;
            }
        }
        // A random record is cut from the end, when the response has lasted for long; the others begin at rest.
        let from = if matches!(self.force, Force::Random(_)) { length - samples } else { 0 };
        let cut = |spectrum: &[Complex<f64>]| {
            let mut values = spectrum.to_vec();
            fft.backward(&mut values);
            values[from..from + samples].iter().map(|value| 2.0 * value.re).collect::<Vec<f64>>()
        };
        let outputs = self.modes[0].shape.len();
        let mut responses: Vec<Vec<f64>> = (0..outputs)
            .map(|output| {
                let line = |(line, value): (usize, &Complex<f64>)| {
                    if *value == Complex::new(0.0, 0.0) {
                        *value
                    } else {
                        value * accelerance(&self.modes, line as f64 * spacing_hz, output, reference)
                    }
                };
                cut(&force.iter().enumerate().map(line).collect::<Vec<_>>())
            })
            .collect();
        let mut force = cut(&force);
        let mut add = |channel: &mut Vec<f64>, sigma: f64| {
            channel.iter_mut().for_each(|value| *value += sigma * noise.normal());
        };
        match self.readings {
            Readings::Ratio(decibels) => {
                for response in &mut responses {
                    let rms = (response.iter().map(|x| x * x).sum::<f64>() / samples as f64).sqrt();
                    add(response, rms * libm::pow(10.0, -decibels / 20.0));
                }
            }
            Readings::Instruments { response, force: sigma } => {
                add(&mut force, sigma);
                responses.iter_mut().for_each(|channel| add(channel, response));
            }
        }
        Samples { force, responses }
    }

    /// The records of all runs.
    pub fn records<'a>(&self, samples: &'a [Samples]) -> Vec<Record<'a>> {
        let known = |which: fn(f64, f64) -> f64| match self.readings {
            Readings::Ratio(_) => None,
            Readings::Instruments { response, force } => Some(which(response, force)),
        };
        let record = |(reference, samples): (&usize, &'a Samples)| Record {
            rate_hz: RATE_HZ,
            references: vec![Channel { dof: *reference, samples: &samples.force, noise: known(|_, force| force) }],
            responses: samples
                .responses
                .iter()
                .enumerate()
                .map(|(dof, samples)| Channel { dof, samples, noise: known(|response, _| response) })
                .collect(),
        };
        self.references.iter().zip(samples).map(record).collect()
    }
}

/// Errors of a mode in deviations.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    pub frequency: Vec<f64>,
    pub damping: Vec<f64>,
    pub shape: Vec<f64>,
    /// Of the sum of the driving point's component and each other one, whose errors are not independent.
    pub sum: Vec<f64>,
    /// Relative errors of the damping ratios, and of the shapes.
    pub damping_part: Vec<f64>,
    pub shape_part: Vec<f64>,
}

impl Errors {
    /// Adds the errors of as many modes as there are.
    pub fn add(&mut self, found: &[Mode], truth: &[Truth]) {
        for (mode, truth) in found.iter().zip(truth) {
            self.frequency.push((mode.frequency_hz - truth.frequency_hz) / mode.computed.frequency_hz);
            self.damping.push((mode.damping_ratio - truth.damping_ratio) / mode.computed.damping_ratio);
            self.damping_part.push(mode.damping_ratio / truth.damping_ratio - 1.0);
            let Some(shape) = &mode.shape else { continue };
            let sign = truth.shape[shape.driving_point].signum();
            let driving = shape.components.iter().find(|component| component.dof == shape.driving_point);
            for component in &shape.components {
                let expected = sign * truth.shape[component.dof];
                if let Some(driving) = driving.filter(|driving| driving.dof != component.dof) {
                    let sum = component.value.re + driving.value.re - expected - truth.shape[driving.dof].abs();
                    let variance = component.deviation.re.powi(2) + driving.deviation.re.powi(2);
                    self.sum.push(sum / (variance + 2.0 * component.with_driving_point.re).sqrt());
                }
                self.shape.push((component.value.re - expected) / component.deviation.re);
                self.shape_part.push(component.value.re / expected - 1.0);
            }
        }
    }
}

/// Mean and standard deviation.
pub fn moments(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    [mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()]
}
