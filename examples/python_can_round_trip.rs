//! The round-trip time of a frame through python-can, with and without the bridge: two ends of one interface, of which
//! the far one answers at once.
//!
//! ```text
//! cargo run --release --features python-can --example python_can_round_trip -- interface=virtual,channel=0
//! ```
//!
//! The bridge works on separate threads, as in real time, or on the calling thread, as in lockstep. The other two are
//! a Python script with `can.Bus`: bare, or reading in a thread of python-can (`can.Notifier` with a
//! `can.BufferedReader`). Every frame sent is a new message, like a command. Each far end is a thread. Turns of all
//! four alternate, so that they run under the same load of the machine, and each opens and closes its ends.

use std::error::Error;
use std::thread;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use pyo3::prelude::*;
use pyo3::types::PyModule;
use resonarm::bus::Bus;
use resonarm::bus::python_can::{self, PythonCan};
use resonarm::protocol::{Frame, Id};

/// Turns of each kind.
const TURNS: u64 = 10;
/// Round trips in a turn, after a tenth as many to warm up.
const ROUND_TRIPS: u64 = 1000;
const PATIENCE: Duration = Duration::from_secs(2);
const REQUEST: u16 = 0x201;
const ANSWER: u16 = 0x203;

const BARE: &core::ffi::CStr = cr#"
import threading
import time

import can
from can.util import cast_from_string


def open_end(address):
    words = dict(word.split("=", 1) for word in address.split(","))
    return can.Bus(**{key: value if key == "channel" else cast_from_string(value) for key, value in words.items()})


def round_trips(near_address, far_address, request_id, answer_id, count, patience_s, notified):
    near, far = open_end(near_address), open_end(far_address)
    notifiers, receive = [], [near.recv, far.recv]
    if notified:
        readers = [can.BufferedReader(), can.BufferedReader()]
        notifiers = [can.Notifier(bus, [reader]) for bus, reader in zip((near, far), readers)]
        receive = [reader.get_message for reader in readers]
    near_receive, far_receive = receive

    def message(identifier, data):
        return can.Message(arbitration_id=identifier, is_extended_id=False, data=data)

    def echo():
        for _ in range(count):
            request = far_receive(patience_s)
            if request is None:
                return
            far.send(message(answer_id, request.data))

    thread = threading.Thread(target=echo)
    thread.start()
    took_ns = []
    for _ in range(count):
        begun = time.perf_counter_ns()
        near.send(message(request_id, bytes(8)))
        if near_receive(patience_s) is None:
            raise TimeoutError("the far end does not answer")
        took_ns.append(time.perf_counter_ns() - begun)
    thread.join()
    for notifier in notifiers:
        notifier.stop()
    near.shutdown()
    far.shutdown()
    return took_ns
"#;

#[allow(clippy::print_stdout, reason = "a measurement prints what it saw")]
fn main() -> Result<(), Box<dyn Error>> {
    let near =
        std::env::args().nth(1).ok_or("give the near end, and the far end if it is another port: KEY=VALUE,…")?;
    let far = std::env::args().nth(2).unwrap_or_else(|| near.clone());
    println!("python-can {}", python_can::version()?);
    let script: Py<PyModule> = Python::attach(|py| PyModule::from_code(py, BARE, c"bare.py", c"bare").map(Py::from))?;
    let mut kinds = [(); 4].map(|()| Histogram::<u64>::new(3));
    for _ in 0..TURNS {
        let turn = [
            python(&script, &near, &far, Work::OnCaller)?,
            python(&script, &near, &far, Work::OnThreads)?,
            bridge(&near, &far, Work::OnThreads)?,
            bridge(&near, &far, Work::OnCaller)?,
        ];
        for (kind, trips_ns) in kinds.iter_mut().zip(turn) {
            let kind = kind.as_mut().map_err(|error| *error)?;
            trips_ns.into_iter().try_for_each(|trip_ns| kind.record(trip_ns))?;
        }
    }
    let [bare, notified, threads, caller] = kinds;
    let [bare, notified, threads, caller] = [bare?, notified?, threads?, caller?];
    println!(
        "{:>4} {:>9} {:>22} {:>27} {:>30}",
        "", "bare, µs", "notifier, µs (×bare)", "bridge on threads (×bare)", "bridge on the caller (×bare)"
    );
    for (name, quantile) in [("p10", 0.1), ("p50", 0.5), ("p90", 0.9), ("p99", 0.99)] {
        let us = |trips: &Histogram<u64>| trips.value_at_quantile(quantile) as f64 / 1e3;
        let bare = us(&bare);
        print!("{name:>4} {bare:9.1}");
        for (trips, width) in [(&notified, 15), (&threads, 20), (&caller, 23)] {
            print!(" {:width$.1} ({:4.2})", us(trips), us(trips) / bare);
        }
        println!();
    }
    Ok(())
}

/// The reader: threads in between, or the caller.
#[derive(Clone, Copy, PartialEq)]
enum Work {
    OnThreads,
    OnCaller,
}

/// Round trips over the bridge at both ends, ns.
#[allow(clippy::disallowed_methods, reason = "a measurement reads the clock")]
fn bridge(near: &str, far: &str, work: Work) -> Result<Vec<u64>, Box<dyn Error>> {
    let (mut near, mut far) = (open(near)?, open(far)?);
    if work == Work::OnCaller {
        near.work_on_caller()?;
        far.work_on_caller()?;
    }
    let request = Frame::classic(Id::Standard(REQUEST), &[0; 8])?;
    let answer = Frame::classic(Id::Standard(ANSWER), &[0; 8])?;
    let count = ROUND_TRIPS + ROUND_TRIPS / 10;
    let echo = thread::spawn(move || -> Result<(), resonarm::bus::BusError> {
        let mut answered = 0;
        while answered < count && far.wait(PATIENCE)? {
            far.receive()?;
            far.send(&answer)?;
            answered += 1;
        }
        far.close()
    });
    let mut took_ns = Vec::new();
    for trip in 0..count {
        let start = Instant::now();
        near.send(&request)?;
        if !near.wait(PATIENCE)? {
            return Err("the far end does not answer".into());
        }
        near.receive()?;
        if trip >= count - ROUND_TRIPS {
            took_ns.push(start.elapsed().as_nanos() as u64);
        }
    }
    echo.join().map_err(|_| "the far end panicked")??;
    near.close()?;
    Ok(took_ns)
}

/// The same by `can.Bus` in Python, ns.
fn python(script: &Py<PyModule>, near: &str, far: &str, work: Work) -> Result<Vec<u64>, Box<dyn Error>> {
    let count = ROUND_TRIPS + ROUND_TRIPS / 10;
    let took_ns: Vec<u64> = Python::attach(|py| {
        let arguments = (near, far, REQUEST, ANSWER, count, PATIENCE.as_secs_f64(), work == Work::OnThreads);
        script.bind(py).getattr("round_trips")?.call1(arguments)?.extract()
    })?;
    Ok(took_ns[(count - ROUND_TRIPS) as usize..].to_vec())
}

fn open(address: &str) -> Result<PythonCan, Box<dyn Error>> {
    let pair = |pair: &str| pair.split_once('=').map(|(key, value)| (key.to_string(), value.to_string()));
    let options: Option<Vec<_>> = address.split(',').map(pair).collect();
    Ok(PythonCan::open(&options.ok_or("an address is KEY=VALUE,KEY=VALUE,…")?)?)
}
