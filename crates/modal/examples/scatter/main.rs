//! Scatter of identified modes over seeds: are the stated deviations right?
//!
//! `cargo run --release -p resonarm-modal --example scatter [SEEDS [FIRST [NAME …]]]` identifies the modes of records in closed
//! form, SEEDS of each case from the seed FIRST on (100 from 1), and prints one row for each case: how often the number of
//! modes is right; how often the start has all modes within |Re λ|; the errors of frequencies, damping ratios and shapes in
//! their stated deviations, z, as mean, standard deviation and share within ±2; the errors of the damping ratios before and
//! after the fit; for how many seeds no deviation is in doubt; and the time for one, s.
#![allow(clippy::print_stdout, clippy::disallowed_methods, clippy::unwrap_used, reason = "a program that measures")]

mod closed_form;

use std::time::Instant;

use closed_form::{BAND, Case, Errors, cases, moments};
use nalgebra::Complex;
use resonarm_modal::{Options, identify_records};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(100, |seeds| seeds.parse().unwrap());
    let first: u64 = arguments.next().map_or(1, |first| first.parse().unwrap());
    let names: Vec<String> = arguments.collect();
    println!(
        "| case | right | fewer | more | start | z of f | z of ζ | z of shapes | ζ before | ζ after | stated | s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for case in cases() {
        if names.is_empty() || names.iter().any(|name| case.name.contains(name.as_str())) {
            println!("{}", row(&case, first..first + seeds));
        }
    }
}

/// Identifies the modes for all seeds.
fn row(case: &Case, seeds: std::ops::Range<u64>) -> String {
    let (mut right, mut fewer, mut more, mut started, mut stated) = (0, 0, 0, 0, 0);
    let (mut errors, mut before) = (Errors::default(), Vec::new());
    let (count, begin) = (seeds.end - seeds.start, Instant::now());
    for seed in seeds {
        let samples = case.samples(seed);
        let found = match identify_records(&case.records(&samples), &Options::new(BAND)) {
            Ok(found) => found,
            Err(error) => {
                println!("{}, seed {seed}: {error}", case.name);
                fewer += 1;
                continue;
            }
        };
        let nearest: Vec<Option<f64>> = case
            .modes
            .iter()
            .map(|mode| {
                let damped = (1.0 - mode.damping_ratio.powi(2)).sqrt();
                let pole = Complex::new(-mode.damping_ratio, damped) * (std::f64::consts::TAU * mode.frequency_hz);
                let distance = |other: Complex<f64>| (other - pole).norm_sqr().sqrt() / pole.re.abs();
                let poles = found.stabilisation.clusters.iter().map(|cluster| cluster.pole);
                let start = poles.min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
                (distance(start) < 1.0).then(|| -start.re / start.norm_sqr().sqrt() / mode.damping_ratio - 1.0)
            })
            .collect();
        started += usize::from(nearest.iter().all(Option::is_some));
        before.extend(nearest.into_iter().flatten());
        let modes = found.modes.len();
        if modes == case.modes.len() {
            right += 1;
            errors.add(&found.modes, &case.modes);
            stated += usize::from(found.modes.iter().all(|mode| mode.deviations().is_ok()));
        } else {
            let list: Vec<String> = found
                .modes
                .iter()
                .map(|m| format!("{:.3} Hz {:.3} %", m.frequency_hz, 100.0 * m.damping_ratio))
                .collect();
            println!("{}, seed {seed}: {}", case.name, list.join(", "));
            if modes < case.modes.len() { fewer += 1 } else { more += 1 }
        }
    }
    let seconds = begin.elapsed().as_secs_f64() / count as f64;
    let z = |values: &[f64]| {
        let [mean, deviation] = moments(values);
        let inside = values.iter().filter(|z| z.abs() < 2.0).count() as f64 / values.len() as f64;
        format!("{mean:.2} {deviation:.2} {inside:.2}")
    };
    let part = |values: &[f64]| {
        let [mean, deviation] = moments(values).map(|value| 100.0 * value);
        format!("{mean:.3} ± {deviation:.3} %")
    };
    format!(
        "| {} | {right} | {fewer} | {more} | {started} | {} | {} | {} | {} | {} | {stated} | {seconds:.2} |",
        case.name,
        z(&errors.frequency),
        z(&errors.damping),
        z(&errors.shape),
        part(&before),
        part(&errors.damping_part),
    )
}
