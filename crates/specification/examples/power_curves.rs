//! How often the verdict on a random test is right: shares of simulated records that are *in*, *out*, or flagged by the count of
//! lines, over the length of the record.
//!
//! ```sh
//! cargo run --release -p resonarm-specification --example power_curves -- 200
//! ```
//!
//! The argument is the number of records for each cell. A record is Gaussian noise of the specified density with a deviation that
//! is known, made of overlapping frames, so nothing of the estimator is in it.
#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "a program that measures")]

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;
use resonarm_specification::verdict::{RandomOptions, RandomVerdict, Verdict, judge_random};
use resonarm_specification::{Average, Limits, RandomTest, Specification, SpecificationFile, Test};

/// Samples a second, and in a frame: lines are 1 Hz apart.
const RATE: usize = 1024;
/// Lengths of the records, s.
const LENGTHS_S: [usize; 5] = [30, 60, 120, 240, 480];
/// The count of lines flags a controller below this probability of a perfect one.
const FLAGGED: f64 = 0.01;

/// Deviation of the density from the specified one, dB, at a line.
type Deviation = fn(line: usize) -> f64;

/// A perfect controller; ten lines side by side that are wrong; and nine lines alone.
const CONTROLLERS: [(&str, Deviation); 4] = [
    ("perfect", |_| 0.0),
    ("+2 dB on 10 lines together", |line| if (72..82).contains(&line) { 2.0 } else { 0.0 }),
    ("+2 dB on 9 single lines", |line| if line % 20 == 15 { 2.0 } else { 0.0 }),
    ("+4 dB on 10 lines together", |line| if (72..82).contains(&line) { 4.0 } else { 0.0 }),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let records: u64 = std::env::args().nth(1).ok_or("expected the number of records for each cell")?.parse()?;
    let tests = [specified("3")?, specified("1.5")?];
    println!("{records} records for each cell\n");
    print!("| controller | seconds |");
    println!(" in ±3 dB | out ±3 dB | in ±1.5 dB | out ±1.5 dB | flagged by the count |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    for (k, (name, deviation)) in CONTROLLERS.iter().enumerate() {
        let mut shares = [[0_u32; 5]; LENGTHS_S.len()];
        for seed in 0..records {
            let record = record(&tests[0], *deviation, seed, k as u64);
            for (share, seconds) in shares.iter_mut().zip(LENGTHS_S) {
                let [wide, narrow] = [&tests[0], &tests[1]].map(|test| judged(test, &record[..seconds * RATE]));
                let [wide, narrow] = [wide?, narrow?];
                let found = [
                    wide.verdict == Verdict::In,
                    wide.verdict == Verdict::Out,
                    narrow.verdict == Verdict::In,
                    narrow.verdict == Verdict::Out,
                    wide.perfect_probability < FLAGGED,
                ];
                share.iter_mut().zip(found).for_each(|(count, is)| *count += u32::from(is));
            }
        }
        for (share, seconds) in shares.iter().zip(LENGTHS_S) {
            let cells: Vec<String> =
                share.iter().map(|count| format!("{:.3}", f64::from(*count) / records as f64)).collect();
            println!("| {name} | {seconds} | {} |", cells.join(" | "));
        }
    }
    Ok(())
}

/// The test whose records are judged, with a tolerance, dB.
fn specified(tolerance_db: &str) -> Result<RandomTest, Box<dyn std::error::Error>> {
    let text = format!(
        "spec = {{ kind = 'random', sources = [] }}\n[random]\nunit = '(m/s2)2/Hz'\nlines_hz = 1\n\
         breakpoints = [[10, 0.02], [20, 0.2], [100, 0.2], [200, 0.05]]\n\
         tolerance_db = [-{tolerance_db}, {tolerance_db}]"
    );
    let file: SpecificationFile = toml::from_str(&text)?;
    match Specification::new(&file, |_| Err(String::from("there are no files")))?.test {
        Test::Random(test) => Ok(test),
        _ => Err("the specification is not one of a random test".into()),
    }
}

fn judged(test: &RandomTest, record: &[f64]) -> Result<RandomVerdict, resonarm_specification::VerdictError> {
    let options = RandomOptions { control: &[record], responses: &[], average: Average::Mean };
    judge_random(test, &Limits::default(), RATE as f64, &options)
}

/// A record of the longest length. Frames of Gaussian lines overlap by half, each under the root of Hann's window, so that the
/// power of their sum is constant. A line X of N samples has the density 2|X|²/(fs N).
fn record(test: &RandomTest, deviation_db: Deviation, seed: u64, stream: u64) -> Vec<f64> {
    let mut noise = Noise::new(seed, stream);
    let transform = Fft::at_least(RATE);
    let samples = LENGTHS_S[LENGTHS_S.len() - 1] * RATE;
    let frames = 2 * samples / RATE + 2;
    let mut record = vec![0.0; (frames + 1) * RATE / 2];
    for frame in 0..frames {
        let mut lines = vec![Complex::new(0.0, 0.0); RATE];
        for (line, value) in lines.iter_mut().enumerate().take(201).skip(10) {
            let density = test.profile.at(line as f64).unwrap_or(0.0) * 10_f64.powf(0.1 * deviation_db(line));
            let size = (density * (RATE * RATE) as f64 / 4.0).sqrt();
            *value = Complex::new(noise.normal() * size, noise.normal() * size);
        }
        transform.backward(&mut lines);
        for (k, value) in lines.iter().enumerate() {
            let window = 0.5 - 0.5 * (std::f64::consts::TAU * k as f64 / RATE as f64).cos();
            // The real part of a one-sided spectrum is half of the two-sided one's.
            record[frame * RATE / 2 + k] += 2.0 * value.re / RATE as f64 * window.sqrt();
        }
    }
    // The first half frame has no partner.
    record[RATE / 2..RATE / 2 + samples].to_vec()
}
