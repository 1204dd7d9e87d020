//! Modes from records of readings, by the degrees of freedom of the structure.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_modal as modal;
use serde::Serialize;

use super::error::IdentifyError;
use super::record::Record;
use super::words::{Names, Remark, of_doubt, of_warning};
use crate::rig::Converter;
use resonarm_modal::{Band, Channel, Floor, ModalError, Options, Quantity, ResponseFunction};

/// Largest noise of a force at a mode, as a share of its power.
pub const MOST_NOISE_SHARE: f64 = 0.01;
/// Systematic errors that were measured with a converter of order 5 and an ideal exciter: of frequencies, of damping ratios, and
/// of shapes over the share of an image.
const FLOOR: [f64; 3] = [2.5e-8, 5e-7, 3.0];
/// Largest sine of the angle between the forces of two records that excite the same point.
const SAME_DIRECTION: f64 = 0.01;

/// A mode that was identified from readings. A deviation is `None` where none can be stated honestly; `doubts` say why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentifiedMode {
    /// Pole λ, rad/s, as [real, imaginary].
    pub pole_rad_s: [f64; 2],
    /// Pole frequency |λ|/(2π) of the damped structure's eigenvalue λ, Hz. Unless the damping is proportional
    /// it differs from the natural frequency of the undamped structure; the command `modes` states both.
    pub pole_frequency_hz: f64,
    /// Standard deviation of the pole frequency, Hz.
    pub pole_frequency_deviation_hz: Option<f64>,
    /// Damping ratio of the pole, −Re λ/|λ|.
    pub pole_damping_ratio: f64,
    /// Standard deviation of the damping ratio.
    pub pole_damping_ratio_deviation: Option<f64>,
    /// Modal mass of the shape that is 1 at the driving point, kg; `None` if no accelerometer reads the motion there.
    pub modal_mass_kg: Option<f64>,
    /// Standard deviation of the modal mass, kg.
    pub modal_mass_deviation_kg: Option<f64>,
    /// Normal shape relative to its largest component, 1, at the degrees of freedom of [`Identification::at`]; `None` at those
    /// that were measured in runs with other forces only.
    pub shape: Vec<Option<f64>>,
    /// Complex shape relative to its largest component, 1, as [real, imaginary].
    pub complex_shape: Vec<Option<[f64; 2]>>,
    /// Normal shape for the modal mass 1 kg, 1/√kg, displacement over modal coordinate.
    pub shape_per_sqrt_kg: Option<Vec<Option<f64>>>,
    /// Standard deviations of its components, 1/√kg.
    pub shape_deviation_per_sqrt_kg: Option<Vec<Option<f64>>>,
    /// Complex shape for the modal mass 1 kg, 1/√kg, as [real, imaginary].
    pub complex_shape_per_sqrt_kg: Option<Vec<Option<[f64; 2]>>>,
    /// Modal phase collinearity of the shape, 0 to 1; 1 of a normal mode.
    pub collinearity: Option<f64>,
    /// Mean phase deviation of the shape, degrees; 0 of a normal mode.
    pub phase_deviation_deg: Option<f64>,
    /// Residues of the receptance, m/N per second, of each run and response.
    pub residues: Vec<IdentifiedResidue>,
    /// Reasons why no deviations are stated.
    pub doubts: Vec<Remark>,
    /// Properties of the mode that should be looked at; the deviations hold.
    pub warnings: Vec<Remark>,
}

/// A residue R of the receptance Σ R/(s − λ) + R̄/(s − λ̄).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentifiedResidue {
    /// Index of the run, from 0.
    pub run: usize,
    /// Degree of freedom of the response.
    pub response: String,
    /// Degree of freedom of the force.
    pub force: String,
    /// Value, as [real, imaginary].
    pub value: [f64; 2],
    /// Standard deviations of its real and its imaginary part.
    pub deviation: Option<[f64; 2]>,
}

/// Estimated noise of a reading.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadingNoise {
    /// Index of the run, from 0.
    pub run: usize,
    /// Name of the reading, `head` or the sensor and its axis.
    pub reading: String,
    /// Name of the degree of freedom, as tip.x.
    pub at: String,
    /// Standard deviation of a sample as the residuals show it, N or m/s².
    pub estimated: f64,
    /// That of the instrument by its specification, with rounding; `None` of ideal instruments, and where filters colour it.
    pub instrument: Option<f64>,
}

/// Terms of a response for modes outside the band: as receptance, below/s² + above.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResidualTerm {
    /// Index of the run, from 0.
    pub run: usize,
    /// Degree of freedom of the response.
    pub response: String,
    /// Degree of freedom of the force.
    pub force: String,
    /// Of the modes below the band, 1/kg.
    pub below_per_kg: f64,
    /// Of the modes above the band, m/N.
    pub above_m_n: f64,
}

/// The modes that were identified in one recording or several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Identification {
    /// Modes in the order of their frequencies.
    pub modes: Vec<IdentifiedMode>,
    /// Degrees of freedom of the shapes' components.
    pub at: Vec<String>,
    /// Degree of freedom of each run's force; of measured responses, of all forces.
    pub forces: Vec<String>,
    /// Noise of all readings.
    pub noise: Vec<ReadingNoise>,
    /// Terms of all responses for modes outside the band.
    pub residual_terms: Vec<ResidualTerm>,
    /// What the estimator found; `None` if there is no mode. Its degrees of freedom are numbers.
    pub estimate: Option<modal::Identification>,
    runs: Vec<Run>,
    names: Names,
    pairs: Vec<Pair>,
}

/// Numbers of the degrees of freedom of a run.
#[derive(Clone, Debug, PartialEq)]
struct Run {
    /// Number of the force of each response, and what the response is made of.
    responses: Vec<(usize, Part)>,
    /// Name of each channel, in the order in which it was given to the estimator; the force of a record comes first.
    channels: Vec<String>,
}

/// A response in terms of the numbered degrees of freedom: Σ factor · component.
#[derive(Clone, Debug, PartialEq)]
enum Part {
    Own(usize),
    /// Axis x or y of the pair with this index.
    OfPair(usize, usize),
}

/// The axes x and y at a point whose force is along neither: they were turned to the direction of the force and across it.
#[derive(Clone, Debug, PartialEq)]
struct Pair {
    /// Names of the axes.
    axes: [String; 2],
    /// Direction of the force.
    direction: [f64; 2],
    /// Numbers of the degrees of freedom along and across.
    numbers: [usize; 2],
}

impl Pair {
    /// Factors of the components along and across for an axis.
    fn factors(&self, axis: usize) -> [f64; 2] {
        let [x, y] = self.direction;
        if axis == 0 { [x, -y] } else { [y, x] }
    }
}

/// The samples of a channel for the estimator.
struct Samples {
    dof: usize,
    values: Vec<f64>,
    noise: Option<f64>,
}

/// Identifies the modes in records of one structure. Records of several runs share the poles; forces and accelerometers may be
/// at other places in each. The band without modes is a result, not an error.
///
/// # Errors
/// [`IdentifyError`] if the band is not in the records, a force has no energy in it, or the readings don't allow a fit.
pub fn modes(records: &[&Record], band: Band) -> Result<Identification, IdentifyError> {
    records.iter().try_for_each(|record| record.check(band))?;
    let mut found = Identification::default();
    let mut samples: Vec<Vec<Samples>> = Vec::new();
    for (index, record) in records.iter().enumerate() {
        samples.push(found.add(index, record)?);
    }
    let given: Vec<modal::Record<'_>> = records
        .iter()
        .zip(&found.runs)
        .zip(&samples)
        .map(|((record, run), samples)| modal::Record {
            rate_hz: record.rate_hz(),
            references: [Channel {
                dof: run.responses[0].0,
                samples: &record.force_n,
                noise: record.known_force_noise_n,
            }]
            .into(),
            responses: samples
                .iter()
                .map(|own| Channel { dof: own.dof, samples: &own.values, noise: own.noise })
                .collect(),
        })
        .collect();
    let options = Options { floor: floor(records), ..Options::new(band) };
    found.take(modal::identify_records(&given, &options))
}

/// A measured frequency response over a force.
#[derive(Clone, Copy, Debug)]
pub struct FunctionOf<'a> {
    /// Degree of freedom of the force.
    pub force: &'a str,
    /// Degree of freedom of the response.
    pub response: &'a str,
    /// Values at the frequencies of the set, in SI units.
    pub values: &'a [Complex<f64>],
}

/// Identifies the modes in measured frequency responses at equally spaced frequencies, Hz.
///
/// # Errors
/// [`IdentifyError`] if the responses don't allow a fit.
pub fn modes_of_responses(
    frequency_hz: &[f64],
    functions: &[FunctionOf<'_>],
    quantity: Quantity,
    band: Band,
) -> Result<Identification, IdentifyError> {
    let mut found = Identification::default();
    let mut run = Run { responses: Vec::new(), channels: Vec::new() };
    let mut given: Vec<ResponseFunction<'_>> = Vec::new();
    for function in functions {
        let [force, response] = [function.force, function.response].map(|name| found.names.number(name));
        for (name, list) in [(function.force, &mut found.forces), (function.response, &mut found.at)] {
            if !list.iter().any(|known| known == name) {
                list.push(String::from(name));
            }
        }
        run.responses.push((force, Part::Own(response)));
        run.channels.push(format!("{} over {}", function.response, function.force));
        given.push(ResponseFunction { reference: force, response, values: function.values });
    }
    found.runs.push(run);
    let options = Options { quantity, ..Options::new(band) };
    found.take(modal::identify_responses(frequency_hz, &given, &options))
}

/// Systematic errors of the readings. An image at fs − f passes a converter of order N by its share to the power N, and a held
/// force has it by its share.
fn floor(records: &[&Record]) -> Floor {
    let order = |record: &Record| match record.converter {
        // Images of an instantaneous reading are not bounded by this; the caller warns of them.
        Converter::Instant | Converter::Unknown => None,
        converter => Some(converter.order() as u8 + 1),
    };
    let Some(image_order) = records.iter().copied().filter_map(order).min() else { return Floor::default() };
    let [frequency, damping_ratio, shape] = FLOOR;
    Floor { frequency, damping_ratio, shape, image_order }
}

impl Identification {
    /// Completes the identification with an estimate. That there is no mode is a result.
    fn take(mut self, estimate: Result<modal::Identification, ModalError>) -> Result<Identification, IdentifyError> {
        self.estimate = match estimate {
            Ok(estimate) => Some(estimate),
            Err(ModalError::NoModes) => None,
            Err(ModalError::Silent { dof, .. }) => return Err(IdentifyError::Silent { at: self.names.of(dof) }),
            Err(ModalError::NoPower { dof, .. }) => return Err(IdentifyError::NoPower { at: self.names.of(dof) }),
            Err(error) => return Err(error.into()),
        };
        self.describe();
        Ok(self)
    }

    /// Numbers the degrees of freedom of a record, and returns the samples of its channels.
    fn add(&mut self, index: usize, record: &Record) -> Result<Vec<Samples>, IdentifyError> {
        let [x, y] = record.direction();
        let (force, pair) = match (&record.exciter, [x == 0.0, y == 0.0]) {
            ([Some(at), _], [_, true]) | ([_, Some(at)], [true, _]) => (self.names.number(at), None),
            ([Some(along_x), Some(along_y)], _) => {
                let pair = self.pair([along_x, along_y], [x, y]).ok_or(IdentifyError::OtherDirection { run: index })?;
                (self.pairs[pair].numbers[0], Some(pair))
            }
            // The structure moves along one axis there, or none.
            ([Some(at), None], _) | ([None, Some(at)], _) => (self.names.number(&format!("{at} (oblique)")), None),
            ([None, None], _) => (self.names.number("force"), None),
        };
        self.forces.push(self.names.of(force));
        let mut run = Run { responses: Vec::new(), channels: [String::from("head")].into() };
        let mut samples: Vec<Samples> = Vec::new();
        let mut left: Vec<(usize, &super::RecordedResponse)> = record.responses().iter().enumerate().collect();
        run.responses = left.iter().map(|_| (force, Part::Own(0))).collect();
        // An accelerometer that reads both axes of the driven point is turned to the force.
        if let Some(index) = pair {
            let Pair { axes, direction: [x, y], numbers } = self.pairs[index].clone();
            let sensor = |name: &str| name.rsplit_once('-').map(|(sensor, _)| String::from(sensor));
            while let Some((first, second)) = left.iter().find_map(|(first, along_x)| {
                let is_other = |(_, other): &&(usize, &super::RecordedResponse)| {
                    other.at == axes[1] && sensor(&other.name) == sensor(&along_x.name)
                };
                (along_x.at == axes[0]).then(|| left.iter().find(is_other)).flatten().map(|other| (*first, other.0))
            }) {
                let [a, b] = [first, second].map(|place| &record.responses()[place]);
                let turned = |p: f64, q: f64| {
                    a.acceleration_m_s2.iter().zip(&b.acceleration_m_s2).map(|(a, b)| p * a + q * b).collect()
                };
                samples.push(Samples { dof: numbers[0], values: turned(x, y), noise: a.noise_m_s2 });
                samples.push(Samples { dof: numbers[1], values: turned(-y, x), noise: a.noise_m_s2 });
                run.channels.push(format!("{} along the force", sensor(&a.name).unwrap_or_default()));
                run.channels.push(format!("{} across the force", sensor(&a.name).unwrap_or_default()));
                run.responses[first].1 = Part::OfPair(index, 0);
                run.responses[second].1 = Part::OfPair(index, 1);
                left.retain(|(place, _)| *place != first && *place != second);
            }
        }
        for (place, response) in left {
            let dof = self.names.number(&response.at);
            let values = response.acceleration_m_s2.clone();
            samples.push(Samples { dof, values, noise: response.noise_m_s2 });
            run.channels.push(response.name.clone());
            run.responses[place].1 = Part::Own(dof);
        }
        for response in record.responses() {
            if !self.at.contains(&response.at) {
                self.at.push(response.at.clone());
            }
        }
        self.runs.push(run);
        Ok(samples)
    }

    /// Returns the index of the pair of axes of an oblique force; `None` if another record has a force along another direction
    /// there.
    fn pair(&mut self, axes: [&String; 2], direction: [f64; 2]) -> Option<usize> {
        let [x, y] = direction;
        if let Some(known) = self.pairs.iter().position(|pair| [&pair.axes[0], &pair.axes[1]] == axes) {
            let [of_x, of_y] = self.pairs[known].direction;
            return (libm::fabs(x * of_y - y * of_x) < SAME_DIRECTION).then_some(known);
        }
        let names = ["along", "across"].map(|which| format!("{} and {} {which} the force", axes[0], axes[1]));
        let numbers = names.map(|name| self.names.number(&name));
        self.pairs.push(Pair { axes: axes.map(Clone::clone), direction, numbers });
        Some(self.pairs.len() - 1)
    }

    /// States the estimate in words and by degrees of freedom.
    fn describe(&mut self) {
        let Some(estimate) = self.estimate.take() else { return };
        self.modes = estimate.modes.iter().map(|mode| self.mode(mode)).collect();
        // `compare_levels` states the estimate again, and the list must not become twice as long.
        self.noise.clear();
        for (index, (run, report)) in self.runs.iter().zip(&estimate.runs).enumerate() {
            for (channel, noise) in run.channels.iter().zip(report.reference_noise.iter().chain(&report.response_noise))
            {
                self.noise.push(ReadingNoise {
                    run: index,
                    reading: channel.clone(),
                    at: self.names.of(noise.dof),
                    estimated: noise.estimated,
                    instrument: noise.known,
                });
            }
        }
        let terms = |terms: &modal::ResidualTerms| ResidualTerm {
            run: terms.run,
            response: self.names.of(terms.response),
            force: self.names.of(terms.reference),
            below_per_kg: terms.below,
            above_m_n: terms.above,
        };
        self.residual_terms = estimate.residual_terms.iter().map(terms).collect();
        self.estimate = Some(estimate);
    }

    fn mode(&self, mode: &modal::Mode) -> IdentifiedMode {
        let deviations = mode.deviations().ok();
        // A mode that is in doubt has values and no deviations: a deviation without meaning would be taken for one.
        let is_sure = deviations.is_some();
        let scaled: Option<Vec<Option<[Complex<f64>; 2]>>> =
            mode.shape.as_ref().map(|shape| self.at.iter().map(|at| self.component(shape, at)).collect());
        let components: Vec<Option<Complex<f64>>> = match &scaled {
            Some(scaled) => scaled.iter().map(|component| component.map(|[value, _]| value)).collect(),
            None => self.at.iter().map(|at| self.unscaled(mode, at)).collect(),
        };
        let normal = normal(&components);
        let largest = normal
            .iter()
            .flatten()
            .fold(0.0, |largest: f64, part| if libm::fabs(*part) > libm::fabs(largest) { *part } else { largest });
        let largest_complex = components.iter().flatten().copied().fold(Complex::default(), |largest, part| {
            if part.norm_sqr() > largest.norm_sqr() { part } else { largest }
        });
        let relative = |part: Complex<f64>| {
            let part = part / largest_complex;
            [part.re, part.im]
        };
        let residue = |residue: &modal::Residue| IdentifiedResidue {
            run: residue.run,
            response: self.names.of(residue.response),
            force: self.names.of(residue.reference),
            value: [residue.value.re, residue.value.im],
            deviation: is_sure.then_some([residue.deviation.re, residue.deviation.im]),
        };
        IdentifiedMode {
            pole_rad_s: [mode.pole.re, mode.pole.im],
            pole_frequency_hz: mode.frequency_hz,
            pole_frequency_deviation_hz: deviations.map(|deviations| deviations.frequency_hz),
            pole_damping_ratio: mode.damping_ratio,
            pole_damping_ratio_deviation: deviations.map(|deviations| deviations.damping_ratio),
            modal_mass_kg: mode.shape.as_ref().map(|shape| shape.modal_mass),
            modal_mass_deviation_kg: mode.shape.as_ref().filter(|_| is_sure).map(|shape| shape.modal_mass_deviation),
            shape: normal.iter().map(|part| part.map(|part| part / largest)).collect(),
            complex_shape: components.iter().map(|part| part.map(relative)).collect(),
            shape_per_sqrt_kg: scaled.is_some().then(|| normal.clone()),
            shape_deviation_per_sqrt_kg: scaled
                .as_ref()
                .filter(|_| is_sure)
                .map(|scaled| scaled.iter().map(|part| part.map(|[_, deviation]| deviation.re)).collect()),
            complex_shape_per_sqrt_kg: scaled
                .is_some()
                .then(|| components.iter().map(|part| part.map(|part| [part.re, part.im])).collect()),
            collinearity: mode.shape.as_ref().map(|shape| shape.collinearity),
            phase_deviation_deg: mode.shape.as_ref().map(|shape| shape.phase_deviation_deg),
            residues: mode.residues.iter().map(residue).collect(),
            doubts: mode.doubts.iter().map(|doubt| of_doubt(doubt, &self.names)).collect(),
            warnings: mode.warnings.iter().map(|warning| of_warning(warning, &self.names)).collect(),
        }
    }

    /// Returns a component of a shape and its deviation at a degree of freedom. At a point whose force is oblique it is the sum
    /// of those along and across the force, which have errors in common.
    fn component(&self, shape: &modal::Shape, at: &str) -> Option<[Complex<f64>; 2]> {
        let of = |number: usize| shape.components.iter().find(|component| component.dof == number);
        if let Some(component) = self.names.find(at).and_then(of) {
            return Some([component.value, component.deviation]);
        }
        let (pair, [p, q]) = self.oblique(at)?;
        let [along, across] = [of(pair.numbers[0])?, of(pair.numbers[1])?];
        // The covariance is known if the force of this point is the driving one.
        let common =
            if shape.driving_point == pair.numbers[0] { across.with_driving_point } else { Complex::default() };
        let spread =
            |a: f64, b: f64, common: f64| libm::sqrt((p * p * a * a + q * q * b * b + 2.0 * p * q * common).max(0.0));
        Some([
            along.value * p + across.value * q,
            Complex::new(
                spread(along.deviation.re, across.deviation.re, common.re),
                spread(along.deviation.im, across.deviation.im, common.im),
            ),
        ])
    }

    /// Returns the pair of axes of which one has this name, with the factors of the components along and across for it.
    fn oblique(&self, at: &str) -> Option<(&Pair, [f64; 2])> {
        self.pairs.iter().find_map(|pair| Some((pair, pair.factors(pair.axes.iter().position(|axis| axis == at)?))))
    }

    /// Returns a component of a shape without a scale, from the residues to the first run's force.
    fn unscaled(&self, mode: &modal::Mode, at: &str) -> Option<Complex<f64>> {
        let (force, _) = self.runs.first()?.responses.first()?;
        let of = |number: usize| {
            let fits = |residue: &&modal::Residue| residue.reference == *force && residue.response == number;
            mode.residues.iter().find(fits).map(|residue| residue.value)
        };
        if let Some(value) = self.names.find(at).and_then(of) {
            return Some(value);
        }
        let (pair, [p, q]) = self.oblique(at)?;
        Some(of(pair.numbers[0])? * p + of(pair.numbers[1])? * q)
    }

    /// Returns the fitted accelerance of a response of a run, by its place in the record; `None` if there is no mode.
    pub fn fitted(&self, run: usize, response: usize, frequency_hz: f64) -> Option<Complex<f64>> {
        let estimate = self.estimate.as_ref()?;
        let of_run = self.runs.get(run)?;
        let (force, part) = of_run.responses.get(response)?;
        let of = |number: usize| estimate.response(run, *force, number, frequency_hz);
        match part {
            Part::Own(number) => of(*number),
            Part::OfPair(pair, axis) => {
                let pair = &self.pairs[*pair];
                let [p, q] = pair.factors(*axis);
                Some(of(pair.numbers[0])? * p + of(pair.numbers[1])? * q)
            }
        }
    }
}

/// Compares the modes of a structure that was driven at two levels. If it is not linear, no mode of both keeps its deviations.
/// Indices are those of the modes.
pub fn compare_levels(first: &mut Identification, second: &mut Identification) -> Vec<modal::ModeShift> {
    let (Some(one), Some(other)) = (&mut first.estimate, &mut second.estimate) else { return Vec::new() };
    let shifts = modal::judge_levels(&mut one.modes, &mut other.modes);
    first.describe();
    second.describe();
    shifts
}

/// Returns the normal shape of the components that are known.
fn normal(components: &[Option<Complex<f64>>]) -> Vec<Option<f64>> {
    let known: Vec<Complex<f64>> = components.iter().flatten().copied().collect();
    let mut parts = modal::normal(&known).into_iter();
    components.iter().map(|component| component.and_then(|_| parts.next())).collect()
}
