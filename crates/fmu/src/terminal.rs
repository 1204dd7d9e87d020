//! A terminal of FMI-LS-BUS: bytes that leave by the clock Tx and come in by the clock Rx.

use crate::content::TxClock;
use crate::fault::Fault;
use crate::operation::{self, Operation};

/// The most bytes that wait for the importer: seconds of a full bus.
const MOST_BYTES: usize = 1 << 20;

/// A network terminal of FMI-LS-BUS, by which a node exchanges operations with the bus.
#[derive(Clone, Debug, Default)]
pub(crate) struct Terminal {
    name: String,
    clock: TxClock,
    /// Encoded operations that wait to be sent.
    outgoing: Vec<u8>,
    /// Whether the importer has let a countdown clock tick in this iteration.
    ticks: bool,
    incoming: Vec<Operation>,
    /// Format errors that answer what could not be read; they are sent in the next iteration.
    answers: Vec<Operation>,
    /// Time at which a countdown clock ticks next, ns from the start.
    due_ns: Option<u64>,
    /// The interval that was said for it, s, and whether it is to be said as a new one.
    interval: Option<(f64, bool)>,
}

/// `fmi3IntervalQualifier`, with the interval, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interval {
    /// The time is not known: the clock does not tick for now.
    Unknown,
    /// The interval has not changed since it was last read.
    Unchanged(f64),
    /// A new interval, from this event on.
    Changed(f64),
}

impl Terminal {
    pub fn new(name: &str, clock: TxClock) -> Terminal {
        Terminal { name: name.to_string(), clock, ..Terminal::default() }
    }

    /// Sends an operation with the next tick.
    pub fn send(&mut self, operation: &Operation) {
        operation.write(&mut self.outgoing);
    }

    /// Whether something is to be sent.
    pub fn is_sending(&self) -> bool {
        !self.outgoing.is_empty()
    }

    /// Refuses to keep what no importer fetches.
    pub fn check(&self) -> Result<(), Fault> {
        let bytes = self.outgoing.len();
        if bytes > MOST_BYTES { Err(Fault::Untaken { name: self.name.clone(), bytes }) } else { Ok(()) }
    }

    /// Returns the operations to be sent, as `Tx_Data` has them.
    pub fn tx_data(&self) -> &[u8] {
        &self.outgoing
    }

    /// Whether the clock Tx ticks in this iteration.
    pub fn tx_clock(&self) -> bool {
        match self.clock {
            TxClock::Triggered => self.is_sending(),
            TxClock::Countdown => self.ticks,
        }
    }

    /// Whether the clock Tx is a countdown clock.
    pub fn counts_down(&self) -> bool {
        self.clock == TxClock::Countdown
    }

    /// The importer lets the clock Tx tick, a countdown clock.
    pub fn tick(&mut self, ticks: bool) {
        self.ticks = ticks;
        if ticks {
            // The interval has passed: what is due next is said as a new one.
            self.due_ns = None;
            self.interval = None;
        }
    }

    /// Takes what came with a tick of the clock Rx; answers what can't be read.
    pub fn take(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        for operation in operation::read(&self.name, bytes)? {
            match operation {
                Ok(operation) => self.incoming.push(operation),
                Err(answer) => self.answers.push(answer),
            }
        }
        Ok(())
    }

    /// Ends an iteration of event mode: what was sent is sent. Returns whether nothing was, though it could be.
    pub fn end_iteration(&mut self) -> bool {
        let could = self.clock == TxClock::Triggered || self.ticks;
        let is_quiet = could && !self.is_sending();
        if self.tx_clock() {
            self.outgoing.clear();
        }
        self.ticks = false;
        // After what was sent is cleared: an answer is to what came in this iteration, and leaves in the next.
        core::mem::take(&mut self.answers).iter().for_each(|answer| self.send(answer));
        is_quiet
    }

    /// Returns the operations received in this iteration.
    pub fn received(&mut self) -> Vec<Operation> {
        core::mem::take(&mut self.incoming)
    }

    /// Says when a countdown clock ticks next, seen from `now_ns`.
    pub fn schedule(&mut self, now_ns: u64, due_ns: Option<u64>) {
        // The same time as before has been said already: a new interval would make the importer schedule the clock
        // again.
        if self.due_ns != due_ns {
            let interval = |due_ns: u64| (due_ns.saturating_sub(now_ns) as f64 * 1e-9, true);
            self.due_ns = due_ns;
            self.interval = due_ns.map(interval);
        }
    }

    /// Returns the interval until a countdown clock ticks next.
    pub fn interval(&mut self) -> Interval {
        match &mut self.interval {
            None => Interval::Unknown,
            Some((interval_s, is_new)) => {
                let said = if *is_new { Interval::Changed(*interval_s) } else { Interval::Unchanged(*interval_s) };
                *is_new = false;
                said
            }
        }
    }
}
