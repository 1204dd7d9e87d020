//! Time of an identification, by the number of sensors, references and lines.
//!
//! `cargo run --release -p resonarm-modal --example speed [SEEDS [FIRST]]` identifies the modes of records in closed form, SEEDS
//! of each case from the seed FIRST on (3 from 1), and prints one row for each: seconds on one processor, and how many modes were
//! found.
#![allow(
    dead_code,
    clippy::print_stdout,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "a program that measures"
)]

#[path = "../scatter/closed_form.rs"]
mod closed_form;

use std::time::Instant;

use closed_form::{BAND, Case, Exciter, Force, Readings, Truth, cases};
use resonarm_modal::{Options, identify_records};
use resonarm_numeric::noise::Noise;

/// Lines of a survey in the band.
const LINES: f64 = 4096.0;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(3, |seeds| seeds.parse().unwrap());
    let first: u64 = arguments.next().map_or(1, |first| first.parse().unwrap());
    println!("| case | seed | s | modes | found |\n| --- | --- | --- | --- | --- |");
    for seed in first..first + seeds {
        let minute = cases().into_iter().find(|case| case.name == "noisy force, 1/1.5/2 %").unwrap();
        print_row(&Case { name: "60 s, two sensors, three modes", seconds: 60.0, ..minute }, 40, seed);
        print_row(&survey(seed), 60, seed);
    }
}

/// A survey: 12 modes with random shapes, read by 32 sensors while the force roves over four of them. The band has
/// [`LINES`].
fn survey(seed: u64) -> Case {
    let mut noise = Noise::new(seed, 0);
    let mut between = |low: f64, high: f64| low + (high - low) * noise.uniform();
    let modes = (0..12)
        .map(|k| {
            let frequency_hz = 20.0 + 160.0 * f64::from(k) / 11.0 + between(-6.0, 6.0);
            let damping_ratio = 0.01 * between(0.1, 1.5);
            let shape = (0..32).map(|_| between(-1.0, 1.0)).collect();
            Truth { frequency_hz, damping_ratio, shape }
        })
        .collect();
    Case {
        name: "32 sensors, 4 references",
        modes,
        references: vec![0, 8, 16, 29],
        seconds: LINES / (BAND.to_hz - BAND.from_hz),
        force: Force::Random(5.0),
        exciter: Exciter::Ideal,
        readings: Readings::Instruments { response: 0.0247, force: 0.0115 },
    }
}

/// Identifies the modes with stabilisation diagrams up to an order.
fn print_row(case: &Case, order: usize, seed: u64) {
    let samples = case.samples(seed);
    let records = case.records(&samples);
    let begun = Instant::now();
    let found = identify_records(&records, &Options { order, ..Options::new(BAND) }).unwrap();
    let seconds = begun.elapsed().as_secs_f64();
    println!("| {} | {seed} | {seconds:.2} | {} | {} |", case.name, case.modes.len(), found.modes.len());
}
