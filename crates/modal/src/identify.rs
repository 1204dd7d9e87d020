//! Identification as a whole: data, start, number of modes, fit, deviations.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;

use crate::deviations::covariance;
use crate::doubts::doubt;
use crate::error::ModalError;
use crate::fit::{Fit, Precision, Problem};
use crate::model::{Quantity, ResidueKind};
use crate::modes::{ChannelNoise, Floor, Identification, ResidualTerms, RunReport, modes, places};
use crate::noise::{correct, weigh};
use crate::order::{Excess, excess, select};
use crate::pole::{damping_ratio, frequency_hz};
use crate::run::{Band, Record, ResponseFunction, Run, TransientModel};
use crate::spectra::{CrossSpectra, Estimator, FrequencyResponses, Segments, Signals};
use crate::start::{Stabilisation, largest_peak};

/// Orders that a stabilisation diagram may have.
const ORDERS: core::ops::RangeInclusive<usize> = 4..=200;
/// A force above this part of its peak for less than `SHORT` of the record is an impact.
const STRUCK: f64 = 0.05;
const SHORT: f64 = 0.03;
/// Steps of the fits.
const FIRST: usize = 30;
const WEIGHTED: usize = 8;

/// Where the fit starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Start {
    /// At the clusters of the stabilisation diagram; the number of modes follows from the likelihood.
    #[default]
    Automatic,
    /// At poles λ that were chosen, rad/s, for example in the stabilisation diagram; every one stays a mode.
    Chosen(Vec<Complex<f64>>),
}

/// Settings of an identification.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Band in which modes are identified. The force must have power in all of it.
    pub band: Band,
    /// What the responses are; accelerations by default.
    pub quantity: Quantity,
    /// Residues that a mode may have; complex by default.
    pub residues: ResidueKind,
    /// Whether records have a transient; judged from their ends by default.
    pub transient: TransientModel,
    /// Highest order of the stabilisation diagram, 4 to 200; 40 by default.
    pub order: usize,
    /// Largest number of clusters from which the fit starts, those with the largest share; 64 by default. Modes that have no
    /// cluster can still be added.
    pub most_clusters: usize,
    /// Where the fit starts; automatically by default.
    pub start: Start,
    /// Systematic errors of the instruments; none by default.
    pub floor: Floor,
}

impl Options {
    /// Returns the defaults for a band.
    pub fn new(band: Band) -> Options {
        Options {
            band,
            quantity: Quantity::default(),
            residues: ResidueKind::default(),
            transient: TransientModel::default(),
            order: 40,
            most_clusters: 64,
            start: Start::default(),
            floor: Floor::default(),
        }
    }
}

/// Identifies the modes of a structure from records of its excitation and response. Several records share the poles: a force
/// or sensors that rove over the structure, or repetitions.
///
/// The whole record's spectra without a window are fitted, with transients, weights from the noise of responses and forces,
/// and the most likely forces in place of the measured ones.
///
/// # Errors
/// [`ModalError`] if the records don't fit each other or the band, or there is no mode.
pub fn identify_records(records: &[Record<'_>], options: &Options) -> Result<Identification, ModalError> {
    check(options)?;
    if records.is_empty() {
        return Err(ModalError::NoData);
    }
    let runs: Result<Vec<Run>, ModalError> = records
        .iter()
        .enumerate()
        .map(|(index, record)| Run::of_record(index, record, options.band, options.quantity, options.transient))
        .collect();
    let problem = Problem { runs: runs?, residues: options.residues };
    let measured = functions_of_records(records, options)?;
    identify(problem, &measured, options, true)
}

/// Identifies the modes of a structure from measured frequency responses at equally spaced frequencies. Noise is taken as
/// uniform over the lines of a function.
///
/// Frequency responses from windowed segments are biased by leakage where a half-power bandwidth has few lines, and the
/// deviations don't cover that. Records are better.
///
/// # Errors
/// [`ModalError`] if the functions don't fit the frequencies or the band, or there is no mode.
pub fn identify_responses(
    frequency_hz: &[f64],
    functions: &[ResponseFunction<'_>],
    options: &Options,
) -> Result<Identification, ModalError> {
    check(options)?;
    let run = Run::of_functions(frequency_hz, functions, options.band, options.quantity)?;
    let lines = run.grid.lines();
    let pairs = (0..functions.len()).map(|output| {
        let [reference, response] = run.pairs.dofs(output, 0);
        (reference, response, (0..lines).map(|line| run.responses.value(output, line)).collect())
    });
    let measured = Measured { frequency_hz: run.grid.frequency_hz.clone(), responses: arrange(pairs.collect()) };
    identify(Problem { runs: vec![run], residues: options.residues }, &measured, options, false)
}

/// Frequency responses for the start: `[output][reference][line]`.
struct Measured {
    frequency_hz: Vec<f64>,
    responses: Vec<Vec<Vec<Complex<f64>>>>,
}

fn check(options: &Options) -> Result<(), ModalError> {
    if !ORDERS.contains(&options.order) {
        return Err(ModalError::Order { order: options.order, least: *ORDERS.start(), most: *ORDERS.end() });
    }
    if let Start::Chosen(poles) = &options.start {
        let Band { from_hz, to_hz } = options.band;
        for (index, pole) in poles.iter().enumerate() {
            let frequency_hz = frequency_hz(*pole);
            let damping_ratio = damping_ratio(*pole);
            let fits = pole.im > 0.0 && damping_ratio > 0.0 && (from_hz..to_hz).contains(&frequency_hz);
            if !fits {
                return Err(ModalError::ChosenPole { pole: index, frequency_hz, damping_ratio });
            }
        }
    }
    Ok(())
}

fn identify(
    mut problem: Problem,
    measured: &Measured,
    options: &Options,
    weighted: bool,
) -> Result<Identification, ModalError> {
    let stabilisation =
        Stabilisation::of_responses(&measured.responses, &measured.frequency_hz, options.order, options.band);
    let poles = match &options.start {
        Start::Chosen(poles) => poles.clone(),
        Start::Automatic => {
            // Clusters come by falling share, so that the surest ones are kept.
            let most = options.most_clusters.min(most_modes(&problem));
            let clusters = stabilisation.clusters.iter().take(most);
            let mut start: Vec<Complex<f64>> = clusters.map(|cluster| cluster.pole).collect();
            if start.is_empty() {
                start.extend(largest_peak(&measured.responses, &measured.frequency_hz));
            }
            check_lines(&problem, start.len())?;
            select(&mut problem, &start, options.band, weighted).ok_or(ModalError::NoModes)?
        }
    };
    if poles.is_empty() {
        return Err(ModalError::NoModes);
    }
    check_lines(&problem, poles.len())?;
    let (fit, excess) = finish(&mut problem, &poles, weighted);
    let covariance = covariance(&problem, &fit);
    let mut modes = modes(&problem, &fit, &covariance, &options.floor);
    let runs = reports(&problem, &fit);
    doubt(&mut modes, &problem, &fit, &covariance, &runs, excess);
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let residual_terms = residual_terms(&problem, &fit);
    Ok(Identification { modes, stabilisation, quantity: options.quantity, residual_terms, runs })
}

/// Checks that each output has more real data than unknowns.
fn check_lines(problem: &Problem, modes: usize) -> Result<(), ModalError> {
    for run in &problem.runs {
        let lines = run.grid.lines();
        let least = problem.layout(run, modes).unknowns() / 2 + 1;
        if lines < least {
            return Err(ModalError::TooFewLines { lines, least });
        }
    }
    Ok(())
}

/// Returns the number of modes from which a fit may start: the unknowns of an output are at most half of its data.
fn most_modes(problem: &Problem) -> usize {
    let fits = |modes: usize| problem.runs.iter().all(|run| problem.layout(run, modes).unknowns() <= run.grid.lines());
    (1..).find(|modes| !fits(*modes)).unwrap_or(1) - 1
}

/// The last fit: without weights, with weights, and with weights and the most likely references. The residual is judged before
/// the references are corrected.
fn finish(problem: &mut Problem, poles: &[Complex<f64>], weighted: bool) -> (Fit, Option<Excess>) {
    problem.runs.iter_mut().for_each(Run::reset);
    let fit = problem.minimise(poles, FIRST, Precision::FULL);
    if !weighted {
        let excess = excess(problem, &fit);
        return (fit, excess);
    }
    weigh(problem, &fit);
    let fit = problem.minimise(&fit.poles, WEIGHTED, Precision::FULL);
    weigh(problem, &fit);
    let excess = excess(problem, &fit);
    correct(problem, &fit);
    (problem.minimise(&fit.poles, WEIGHTED, Precision::FULL), excess)
}

fn reports(problem: &Problem, fit: &Fit) -> Vec<RunReport> {
    let of_run = |(index, run): (usize, &Run)| {
        let noise = |dof: usize, variance: f64, known: Option<f64>| ChannelNoise {
            dof,
            estimated: libm::sqrt(variance),
            known,
        };
        let variances = run.noise.as_ref();
        let reference = |(input, variance): (usize, &f64)| {
            noise(run.pairs.dofs(0, input)[0], *variance, run.reference_noise[input])
        };
        let response = |output: usize| {
            // The real and the imaginary part of a residual have this variance each.
            let uniform = 2.0 * fit.runs[index].variance(run, output);
            let variance = variances.map_or(uniform, |variances| variances.responses[output]);
            noise(run.pairs.dofs(output, 0)[1], variance, run.response_noise[output])
        };
        RunReport {
            lines: run.grid.lines(),
            spacing_hz: run.spacing_hz,
            transient: run.transient,
            reference_noise: variances
                .map_or_else(Vec::new, |variances| variances.references.iter().enumerate().map(reference).collect()),
            response_noise: (0..run.outputs()).map(response).collect(),
        }
    };
    problem.runs.iter().enumerate().map(of_run).collect()
}

fn residual_terms(problem: &Problem, fit: &Fit) -> Vec<ResidualTerms> {
    let of_place = |place: crate::deviations::Place| {
        let run = &problem.runs[place.run];
        let found = &fit.runs[place.run];
        let [reference, response] = run.pairs.dofs(place.output, place.reference);
        let unknowns = &found.outputs[place.output].unknowns[found.layout.residual_terms(place.reference)];
        let [below, above] = [0, 1].map(|term| unknowns[term] * run.grid.residual_scales[term]);
        ResidualTerms { reference, response, run: place.run, below, above }
    };
    places(problem).into_iter().map(of_place).collect()
}

/// Frequency responses of records, H1: of the whole record for impacts, else of half-overlapping segments with Hann's window,
/// at least seven of them.
fn functions_of_records(records: &[Record<'_>], options: &Options) -> Result<Measured, ModalError> {
    let rate_hz = records[0].rate_hz;
    if let Some(run) = records.iter().position(|record| record.rate_hz != rate_hz) {
        return Err(ModalError::Rates { run, rate_hz: records[run].rate_hz, first_hz: rate_hz });
    }
    let samples = records.iter().map(|record| record.references[0].samples.len()).min().unwrap_or(0);
    let struck = records.iter().all(is_struck);
    let mut functions = Vec::new();
    let mut frequency_hz = Vec::new();
    for record in records {
        let inputs: Vec<&[f64]> = record.references.iter().map(|channel| channel.samples).collect();
        let outputs: Vec<&[f64]> = record.responses.iter().map(|channel| channel.samples).collect();
        let quarter = if samples < 8 { samples } else { 1 << (samples / 4).ilog2() };
        let segments =
            if struck && inputs.len() == 1 { Segments::rectangular(samples) } else { Segments::hann(quarter) };
        let signals = [Signals { inputs: &inputs, outputs: &outputs }];
        let found: FrequencyResponses =
            CrossSpectra::estimate(rate_hz, &signals, &segments)?.responses(Estimator::H1)?;
        for (o, of_output) in found.responses.into_iter().enumerate() {
            for (i, values) in of_output.into_iter().enumerate() {
                functions.push((record.references[i].dof, record.responses[o].dof, values));
            }
        }
        frequency_hz = found.frequency_hz;
    }
    // Lines in the band at which every response is defined.
    let Band { from_hz, to_hz } = options.band;
    let kept: Vec<usize> = (0..frequency_hz.len())
        .filter(|line| (from_hz..=to_hz).contains(&frequency_hz[*line]))
        .filter(|line| functions.iter().all(|(_, _, values)| values[*line].norm_sqr().is_finite()))
        .collect();
    if kept.is_empty() {
        return Err(ModalError::TooFewLines { lines: 0, least: 1 });
    }
    let keep = |values: &[Complex<f64>]| kept.iter().map(|line| values[*line]).collect::<Vec<_>>();
    let functions = functions.iter().map(|(reference, response, values)| (*reference, *response, keep(values)));
    Ok(Measured {
        responses: arrange(functions.collect()),
        frequency_hz: kept.iter().map(|line| frequency_hz[*line]).collect(),
    })
}

/// Whether all forces of a record are short blows.
fn is_struck(record: &Record<'_>) -> bool {
    record.references.iter().all(|channel| {
        let peak = channel.samples.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        let struck = channel.samples.iter().filter(|value| value.abs() > STRUCK * peak).count();
        (struck as f64) < SHORT * channel.samples.len() as f64
    })
}

/// Arranges functions (reference, response, values) as `[output][reference][line]`. If a pair is missing or there twice, all
/// functions are responses to one reference: they still have the poles in common.
fn arrange(functions: Vec<(usize, usize, Vec<Complex<f64>>)>) -> Vec<Vec<Vec<Complex<f64>>>> {
    let unique = |mut dofs: Vec<usize>| {
        dofs.sort_unstable();
        dofs.dedup();
        dofs
    };
    let references = unique(functions.iter().map(|(reference, ..)| *reference).collect());
    let responses = unique(functions.iter().map(|(_, response, _)| *response).collect());
    let mut pairs: Vec<(usize, usize)> =
        functions.iter().map(|(reference, response, _)| (*reference, *response)).collect();
    pairs.sort_unstable();
    pairs.dedup();
    if pairs.len() != functions.len() || pairs.len() != references.len() * responses.len() {
        return functions.into_iter().map(|(.., values)| vec![values]).collect();
    }
    let mut sorted = functions;
    sorted.sort_by_key(|(reference, response, _)| (*response, *reference));
    let mut values = sorted.into_iter().map(|(.., values)| values);
    responses.iter().map(|_| values.by_ref().take(references.len()).collect()).collect()
}
