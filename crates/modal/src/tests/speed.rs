//! Processor time of large identifications, printed: run these with `--release --ignored --nocapture`.
#![allow(clippy::disallowed_methods, reason = "a measurement")]

use std::println;
use std::time::Instant;

use nalgebra::Complex;
use resonarm_numeric::noise::Noise;

use super::reference::{Truth, accelerance};
use crate::start::Stabilisation;
use crate::{Band, Options, ResponseFunction, Start, identify_records, identify_responses};

/// Seconds of the processor that the calling thread has used; wall time where Linux's counter is missing.
struct Clock(Instant, Option<f64>);

impl Clock {
    fn start() -> Clock {
        Clock(Instant::now(), Clock::processor_s())
    }

    fn processor_s() -> Option<f64> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
    }

    fn elapsed_s(&self) -> f64 {
        match (self.1, Clock::processor_s()) {
            (Some(begin), Some(now)) => now - begin,
            _ => self.0.elapsed().as_secs_f64(),
        }
    }
}

/// A record of 60 s at 1 kHz with two sensors and three modes.
#[test]
#[ignore = "a measurement"]
fn record_of_a_minute() {
    for (name, damping) in [("1, 1.5, 2 %", [0.01, 0.015, 0.02]), ("10 %", [0.1; 3])] {
        let case = super::closed_form::Case {
            name: "",
            modes: super::closed_form::three(damping),
            references: vec![0],
            seconds: 60.0,
            force: super::closed_form::Force::Random(5.0),
            readings: super::closed_form::Readings::Instruments { response: 0.0247, force: 0.0115 },
        };
        let samples = case.samples(1);
        let records = case.records(&samples);
        let clock = Clock::start();
        let found = identify_records(&records, &Options::new(super::closed_form::BAND)).unwrap();
        println!("{name}: {} modes in {:.3} s", found.modes.len(), clock.elapsed_s());
        assert_eq!(found.modes.len(), 3);
    }
}

/// 32 sensors, 4 references, 4096 lines and 17 modes; the diagram up to order 60.
#[test]
#[ignore = "a measurement"]
fn survey_of_32_sensors_and_4_references() {
    let mut noise = Noise::new(1, 0);
    let modes: Vec<Truth> = (0..17)
        .map(|k| Truth {
            frequency_hz: 20.0 + 10.0 * k as f64 + 3.0 * noise.uniform(),
            damping_ratio: 0.005 + 0.01 * noise.uniform(),
            shape: (0..32).map(|_| noise.normal()).collect(),
        })
        .collect();
    let frequency_hz: Vec<f64> = (0..4096).map(|k| 10.0 + 190.0 * f64::from(k) / 4095.0).collect();
    let values = |reference: usize, response: usize, noise: &mut Noise| -> Vec<Complex<f64>> {
        let mut line =
            |f: &f64| accelerance(&modes, *f, response, reference) + Complex::new(noise.normal(), noise.normal()) * 0.1;
        frequency_hz.iter().map(&mut line).collect()
    };
    let all: Vec<(usize, usize, Vec<Complex<f64>>)> =
        (0..128).map(|k| (k % 4, k / 4, values(k % 4, k / 4, &mut noise))).collect();
    let functions: Vec<ResponseFunction<'_>> = all
        .iter()
        .map(|(reference, response, values)| ResponseFunction { reference: *reference, response: *response, values })
        .collect();
    let arranged: Vec<Vec<Vec<Complex<f64>>>> =
        all.chunks_exact(4).map(|of_output| of_output.iter().map(|(.., values)| values.clone()).collect()).collect();
    let band = Band { from_hz: 10.0, to_hz: 200.0 };
    let clock = Clock::start();
    let diagram = Stabilisation::of_responses(&arranged, &frequency_hz, 60, band);
    let start_s = clock.elapsed_s();
    println!("start: {} clusters in {start_s:.3} s", diagram.clusters.len());
    let options = Options { order: 60, ..Options::new(band) };
    let clock = Clock::start();
    let found = identify_responses(&frequency_hz, &functions, &options).unwrap();
    println!("number of modes and fit: {} modes in {:.3} s", found.modes.len(), clock.elapsed_s() - start_s);
    assert_eq!(found.modes.len(), 17);
    let poles = diagram.clusters.iter().take(17).map(|cluster| cluster.pole).collect();
    let clock = Clock::start();
    let chosen = identify_responses(&frequency_hz, &functions, &Options { start: Start::Chosen(poles), ..options });
    println!("fit of chosen poles: {:.3} s", clock.elapsed_s() - start_s);
    assert_eq!(chosen.unwrap().modes.len(), 17);
}
