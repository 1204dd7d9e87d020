//! The bus between nodes as an FMU: [`resonarm_bus::timed`] with a terminal of FMI-LS-BUS for each node.
//!
//! Frames of an event are on the bus when the event ends, so that those of one instant contend, whichever was there
//! first. A frame that ends goes to all others with their next ticks, its sender has a Confirm; one that is destroyed
//! is a Bus Error to all who see it.

use std::collections::VecDeque;

use crate::content::TxClock;
use crate::fault::Fault;
use crate::model::{Inputs, Model, Span};
use crate::operation::{BusErrorCode, Operation};
use crate::terminal::Terminal;
use crate::variables::Source;
use resonarm_bus::timed::{self, ErrorCause, Outcome, TimedBus};
use resonarm_bus::{Bus, Sent, VirtualBus};
use resonarm_protocol::Frame;
use resonarm_protocol::bits::BitRates;
use resonarm_realtime::{Clock, VirtualClock};

/// A node at its terminal.
struct Port {
    terminal: Terminal,
    end: TimedBus<VirtualClock>,
    /// Frames for which its mailboxes have no room yet.
    waiting: VecDeque<Frame>,
}

/// Model of a CAN bus to which nodes of other FMUs are connected.
pub(crate) struct BusModel {
    clock: VirtualClock,
    ports: Vec<Port>,
    rates: BitRates,
}

impl BusModel {
    /// A bus with so many terminals.
    pub fn new(spec: &timed::Spec, nodes: u8, clock_kind: TxClock) -> BusModel {
        let clock = VirtualClock::default();
        let ends = timed::hub(usize::from(nodes), spec, &clock);
        let port = |(index, mut end): (usize, TimedBus<VirtualClock>)| {
            // From the first call on, the end notes what became of frames.
            end.take_outcomes();
            let terminal = Terminal::new(&format!("node{}", index + 1), clock_kind);
            Port { terminal, end, waiting: VecDeque::new() }
        };
        BusModel { ports: ends.into_iter().enumerate().map(port).collect(), clock, rates: spec.rates }
    }

    /// Moves frames between the terminals and the bus, as far as the time allows.
    fn carry(&mut self) -> Result<(), Fault> {
        for port in &mut self.ports {
            // The frame stays in the queue until a mailbox takes it, so that the frames of a node keep their order.
            while let Some(frame) = port.waiting.front() {
                match port.end.send(frame) {
                    Ok(Sent::Queued) => _ = port.waiting.pop_front(),
                    Ok(Sent::QueueFull) => break,
                    // A controller that is bus-off sends when it has recovered.
                    Err(error) if error.is_recoverable() => break,
                    Err(error) => return Err(resonarm_session::run::RunError::from(error).into()),
                }
            }
            while let Ok(Some(received)) = port.end.receive() {
                port.terminal.send(&Operation::Transmit(received.frame));
            }
            for outcome in port.end.take_outcomes() {
                port.terminal.send(&operation(outcome));
            }
            port.terminal.check()?;
        }
        Ok(())
    }

    /// Follows an operation of node `index`.
    fn follow(&mut self, index: usize, operation: Operation) -> Result<(), Fault> {
        let (got_hz, expected_hz, key) = match operation {
            Operation::Transmit(frame) => {
                self.ports[index].waiting.push_back(frame);
                return Ok(());
            }
            Operation::BaudRate(rate_hz) => (rate_hz, self.rates.nominal_hz, "bit_rate_hz"),
            Operation::FdBaudRate(rate_hz) => (rate_hz, self.rates.data_hz, "data_bit_rate_hz"),
            Operation::Buffers(false) => {
                // A frame that loses the arbitration always stays in its mailbox here, so the request to
                // discard it can't be met.
                let mut refused = Vec::new();
                Operation::Buffers(false).write(&mut refused);
                self.ports[index].terminal.send(&Operation::FormatError(refused));
                return Ok(());
            }
            _ => return Ok(()),
        };
        if got_hz == expected_hz { Ok(()) } else { Err(Fault::BitRate { node: index + 1, key, got_hz, expected_hz }) }
    }

    fn are_sending(&self) -> bool {
        self.ports.iter().any(|port| port.terminal.tx_clock())
    }
}

/// Returns the operation that tells a node the outcome of a frame.
fn operation(outcome: Outcome) -> Operation {
    match outcome {
        Outcome::Sent(frame) => Operation::Confirm(frame.id().raw()),
        Outcome::Destroyed { frame, cause, is_own } => {
            let code = match cause {
                ErrorCause::Bit => BusErrorCode::Bit,
                ErrorCause::Acknowledgement => BusErrorCode::Acknowledgement,
            };
            Operation::BusError { id: frame.id().raw(), code, is_sender: is_own }
        }
    }
}

impl Model for BusModel {
    fn step(&mut self, span: Span, _inputs: &Inputs) -> Result<bool, Fault> {
        // Rounded and not cut: the sum of many steps may lie a rounding error below a whole nanosecond.
        self.clock.advance_to_ns(libm::round(span.to_s * 1e9) as u64);
        self.carry()?;
        Ok(self.are_sending())
    }

    fn update(&mut self) -> Result<bool, Fault> {
        for index in 0..self.ports.len() {
            // Before the frames of this iteration are taken up: what answers them leaves with the next iteration.
            self.ports[index].terminal.end_iteration();
            for operation in self.ports[index].terminal.received() {
                self.follow(index, operation)?;
            }
        }
        self.carry()?;
        Ok(self.are_sending())
    }

    fn terminal(&mut self, index: usize) -> Option<&mut Terminal> {
        self.ports.get_mut(index).map(|port| &mut port.terminal)
    }

    /// Says when countdown clocks tick next: now where something waits, else with the next event on the bus.
    fn before_interval(&mut self) {
        let now_ns = self.clock.now_ns();
        // All ends share one bus, so the first knows the next event of each.
        let next_ns = self.ports.first_mut().and_then(|port| port.end.next_event_ns());
        for Port { terminal, .. } in &mut self.ports {
            let due_ns = if terminal.is_sending() { Some(now_ns) } else { next_ns };
            terminal.schedule(now_ns, due_ns);
        }
    }

    fn count(&self, source: Source) -> u64 {
        // All ends see the traffic of the one bus, so the first answers for all.
        let traffic = self.ports.first().map(|port| port.end.traffic()).unwrap_or_default();
        match source {
            Source::Frames => traffic.frames,
            Source::ErrorFrames => traffic.error_frames,
            _ => 0,
        }
    }
}
