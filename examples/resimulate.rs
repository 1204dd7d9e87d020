//! A recording simulated again: `cargo run --example resimulate -- recordings/free-sweep.mcap`.

use std::error::Error;
use std::io::Write;

use resonarm::recording::Recording;
use resonarm::replay::resimulate;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: resimulate RECORDING")?;
    let verdict = resimulate(&Recording::open(&path)?)?;
    writeln!(std::io::stdout(), "{} samples, identical: {}", verdict.samples, verdict.identical)?;
    if verdict.identical { Ok(()) } else { Err("the recorded states differ".into()) }
}
