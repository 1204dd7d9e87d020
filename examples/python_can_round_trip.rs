//! How long a frame takes through python-can and back: two ends of one channel, the far one answers at once.
//!
//! ```text
//! cargo run --release --features python-can --example python_can_round_trip -- interface=virtual,channel=0
//! ```

use std::error::Error;
use std::thread;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use resonarm::bus::Bus;
use resonarm::bus::python_can::PythonCan;
use resonarm::protocol::{Frame, Id};

/// Round trips measured, after a tenth as many to warm up.
const ROUND_TRIPS: u64 = 10_000;
const PATIENCE: Duration = Duration::from_secs(2);

#[allow(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "a measurement reads the clock and prints what it saw"
)]
fn main() -> Result<(), Box<dyn Error>> {
    let address =
        std::env::args().nth(1).ok_or("give the near end, and the far end if it is another port: KEY=VALUE,…")?;
    let mut near = open(&address)?;
    let mut far = open(&std::env::args().nth(2).unwrap_or(address))?;
    let request = Frame::classic(Id::Standard(0x201), &[0; 8])?;
    let answer = Frame::classic(Id::Standard(0x203), &[0; 8])?;
    let echo = thread::spawn(move || -> Result<(), resonarm::bus::BusError> {
        while far.wait(PATIENCE)? {
            while far.receive()?.is_some() {
                far.send(&answer)?;
            }
        }
        far.close()
    });
    let mut round_trip_ns = Histogram::<u64>::new(3)?;
    for trip in 0..ROUND_TRIPS + ROUND_TRIPS / 10 {
        let start = Instant::now();
        near.send(&request)?;
        if !near.wait(PATIENCE)? {
            return Err("the far end does not answer".into());
        }
        near.receive()?;
        if trip >= ROUND_TRIPS / 10 {
            round_trip_ns.record(start.elapsed().as_nanos() as u64)?;
        }
    }
    near.close()?;
    echo.join().map_err(|_| "the far end panicked")??;
    for (name, quantile) in [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("max", 1.0)] {
        println!("{name:>5} {:8.1} µs", round_trip_ns.value_at_quantile(quantile) as f64 / 1e3);
    }
    Ok(())
}

fn open(address: &str) -> Result<PythonCan, Box<dyn Error>> {
    let pair = |pair: &str| pair.split_once('=').map(|(key, value)| (key.to_string(), value.to_string()));
    let options: Option<Vec<_>> = address.split(',').map(pair).collect();
    Ok(PythonCan::open(&options.ok_or("an address is KEY=VALUE,KEY=VALUE,…")?)?)
}
