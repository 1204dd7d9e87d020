//! A node of the CAN bus, the plant's or the exciter's, on a terminal of FMI-LS-BUS.
//!
//! It works in the order of a free run ([`resonarm_session::run::HostedPlant`]), and gives the states of one: at the
//! start frames go to and fro until nothing moves, then sample 0 is measured; later the samples of a step are measured
//! at their times, and frames that come are read at the time of their event.

use crate::content::TxClock;
use crate::fault::{Fault, WrongCall};
use crate::model::{Inputs, Model, NO_STATES, Span, reached};
use crate::model_state::{Controller, Saved, SavedNode, of_other_interface};
use crate::operation::{BusErrorCode, Operation, Status};
use crate::tape::Tape;
use crate::terminal::Terminal;
use crate::variables::Source;
use resonarm_files::recording::Record;
use resonarm_protocol::bits::BitRates;
use resonarm_protocol::{NodeState, Profile};
use resonarm_session::run::{HostPort, HostedExciter, HostedPlant, Session};

/// The bit rate that a node asks of the bus if its scenario names none, Hz.
const BIT_RATE_HZ: u32 = 1_000_000;
/// A controller that is bus-off takes part again after 128 times 11 recessive bits.
const RECOVERY_BITS: u64 = 128 * 11;

/// The node at the terminal.
enum End {
    Plant(Box<HostedPlant>),
    Exciter(HostedExciter),
}

/// A node at its terminal.
pub(crate) struct Node {
    end: End,
    session: Session,
    terminal: Terminal,
    controller: Controller,
    rates: BitRates,
    now_ns: u64,
    /// Whether sample 0 is measured.
    samples: bool,
    tape: Option<Tape>,
}

impl Node {
    /// Creates the node of the plant, or of the exciter.
    pub fn new(session: Session, is_plant: bool, clock: TxClock) -> Result<Node, Fault> {
        let end = match is_plant {
            true => End::Plant(Box::new(session.hosted_plant()?)),
            false => End::Exciter(session.hosted_exciter()?),
        };
        let network = &session.scenario().network;
        let nominal_hz = network.bit_rate_hz.unwrap_or(BIT_RATE_HZ);
        // A scenario with one bit rate has it for the data of CAN FD frames as well.
        let rates = BitRates { nominal_hz, data_hz: network.data_bit_rate_hz.unwrap_or(nominal_hz) };
        let terminal = Terminal::new("can", clock);
        let controller = Controller::default();
        Ok(Node { end, terminal, controller, rates, now_ns: 0, samples: false, tape: None, session })
    }

    /// Tells the bus what it must know before the first frame.
    fn configure(&mut self) {
        self.terminal.send(&Operation::BaudRate(self.rates.nominal_hz));
        if self.session.scenario().network.profile == Profile::Fd {
            self.terminal.send(&Operation::FdBaudRate(self.rates.data_hz));
        }
        self.terminal.send(&Operation::Buffers(true));
    }

    /// Reads what has come, does what is due now, and sends.
    fn exchange(&mut self) -> Result<(), Fault> {
        if self.controller.recovers_ns.is_some_and(|recovers_ns| self.now_ns >= recovers_ns) {
            self.controller = Controller::default();
            self.port().set_bus_off(false);
            self.terminal.send(&Operation::Status(Status::Active));
        }
        match &mut self.end {
            End::Plant(plant) => plant.exchange(self.now_ns)?,
            End::Exciter(exciter) => exciter.exchange(self.now_ns),
        }
        let sent = self.port().sent();
        sent.into_iter().for_each(|frame| self.terminal.send(&Operation::Transmit(frame)));
        self.record()?;
        self.terminal.check()
    }

    fn port(&mut self) -> &mut HostPort {
        match &mut self.end {
            End::Plant(plant) => &mut plant.port,
            End::Exciter(exciter) => &mut exciter.port,
        }
    }

    /// Puts the node's records on the tape.
    fn record(&mut self) -> Result<(), Fault> {
        if let End::Plant(plant) = &mut self.end {
            let records: Vec<Record> = plant.take_records();
            if let Some(tape) = &mut self.tape {
                records.into_iter().for_each(|record| tape.push(record));
                tape.flush()?;
            }
        }
        Ok(())
    }

    /// Measures sample 0, if that is still to be done.
    fn begin_samples(&mut self) -> Result<(), Fault> {
        if !core::mem::replace(&mut self.samples, true)
            && let End::Plant(plant) = &mut self.end
        {
            plant.measure()?;
            self.exchange()?;
        }
        Ok(())
    }

    /// Follows an operation of the bus.
    fn follow(&mut self, operation: Operation) {
        match operation {
            Operation::Transmit(frame) => self.port().take(frame),
            Operation::Confirm(_) => {
                self.controller.transmit_errors = self.controller.transmit_errors.saturating_sub(1);
            }
            Operation::BusError { code, is_sender: true, .. } => self.note_error(code),
            _ => {}
        }
    }

    /// A frame of the node was destroyed: 8 errors more, unless nobody acknowledges the frames of a passive node; from
    /// 256 on it is bus-off.
    fn note_error(&mut self, code: BusErrorCode) {
        let errors = &mut self.controller.transmit_errors;
        let was_passive = *errors >= 128;
        // An error-passive node does not count a missing acknowledgement. Otherwise a node that is alone on the
        // bus would become bus-off (ISO 11898-1).
        if code == BusErrorCode::Bit || !was_passive {
            *errors += 8;
        }
        if *errors >= 256 && self.controller.recovers_ns.is_none() {
            let bits_ns = RECOVERY_BITS * 1_000_000_000 / u64::from(self.rates.nominal_hz);
            self.controller.recovers_ns = Some(self.now_ns + bits_ns);
            self.port().set_bus_off(true);
            self.terminal.send(&Operation::Status(Status::BusOff));
        } else if *errors >= 128 && !was_passive {
            self.terminal.send(&Operation::Status(Status::Passive));
        }
    }

    /// Says when the clock ticks next, if it is a countdown clock: now, if something waits or sample 0 does, else at
    /// the next sample.
    fn schedule(&mut self) {
        let due_ns = match &self.end {
            // Operations that wait, and the exchange before sample 0, need an event at this very time.
            _ if self.terminal.is_sending() || !self.samples => Some(self.now_ns),
            End::Plant(plant) => Some(plant.due_ns()),
            End::Exciter(_) => None,
        };
        self.terminal.schedule(self.now_ns, due_ns);
    }
}

impl Model for Node {
    fn begin(&mut self) -> Result<(), Fault> {
        if matches!(self.end, End::Plant(_)) && self.tape.is_none() {
            self.tape = Tape::open(&self.session, "fmu")?;
        }
        self.configure();
        match &mut self.end {
            End::Plant(plant) => plant.start(),
            End::Exciter(exciter) => exciter.start(),
        }
        self.exchange()?;
        self.schedule();
        Ok(())
    }

    fn step(&mut self, span: Span, _inputs: &Inputs) -> Result<bool, Fault> {
        self.begin_samples()?;
        let last = reached(span.to_s, self.session.scenario().simulation.rate_hz);
        // The samples of the step are simulated one by one, each at its own time, and frames are exchanged in
        // between, as in a free run.
        while let End::Plant(plant) = &mut self.end
            && plant.plant().sample() < last
        {
            self.now_ns = self.now_ns.max(plant.due_ns());
            plant.next_sample()?;
            self.exchange()?;
        }
        // The step may end between two samples: frames of that time are exchanged, too.
        let to_ns = libm::round(span.to_s * 1e9) as u64;
        if to_ns > self.now_ns {
            self.now_ns = to_ns;
            self.exchange()?;
        }
        self.schedule();
        Ok(self.terminal.tx_clock())
    }

    fn update(&mut self) -> Result<bool, Fault> {
        let sent_nothing = self.terminal.end_iteration();
        let received = self.terminal.received();
        let is_quiet = sent_nothing && received.is_empty();
        received.into_iter().for_each(|operation| self.follow(operation));
        if !is_quiet {
            self.exchange()?;
        } else {
            self.begin_samples()?;
        }
        self.schedule();
        // Sample 0 waits until no frame moves. With a triggered clock the importer has to be kept iterating until
        // then; a countdown clock brings it back by itself.
        Ok(self.terminal.tx_clock() || (!self.samples && !self.terminal.counts_down()))
    }

    fn terminal(&mut self, _index: usize) -> Option<&mut Terminal> {
        Some(&mut self.terminal)
    }

    fn number(&self, source: Source) -> f64 {
        match (&self.end, source) {
            (End::Plant(plant), Source::State(index)) => plant.plant().states().get(index).copied().unwrap_or(f64::NAN),
            _ => f64::NAN,
        }
    }

    fn count(&self, source: Source) -> u64 {
        let state = |state: NodeState| u64::from(state.heartbeat_byte());
        match (&self.end, source) {
            (End::Plant(plant), Source::Sample) => plant.plant().sample(),
            (End::Plant(plant), Source::NodeState) => state(plant.node().state()),
            (End::Plant(plant), Source::FaultCode) => {
                plant.node().latched_fault().map_or(0, |emergency| emergency.code as u64)
            }
            (End::Exciter(exciter), Source::NodeState) => state(exciter.node().state()),
            (End::Exciter(exciter), Source::Played) => exciter.node().samples_played(),
            (End::Exciter(exciter), Source::Responses) => exciter.responses().len() as u64,
            _ => 0,
        }
    }

    fn save(&mut self) -> Result<Saved, Fault> {
        let End::Plant(plant) = &self.end else {
            return Err(WrongCall::NotOffered { why: NO_STATES }.into());
        };
        Ok(Saved::Node(Box::new(SavedNode {
            plant: plant.clone(),
            terminal: self.terminal.clone(),
            controller: self.controller,
            now_ns: self.now_ns,
            samples: self.samples,
            mark: self.tape.as_mut().map(Tape::mark),
        })))
    }

    fn restore(&mut self, saved: &Saved) -> Result<(), Fault> {
        let Saved::Node(saved) = saved else { return Err(of_other_interface()) };
        if let Some(tape) = &mut self.tape {
            tape.rewind(saved.mark.as_deref(), saved.plant.plant().sample())?;
        }
        let saved = (**saved).clone();
        self.end = End::Plant(saved.plant);
        self.terminal = saved.terminal;
        self.controller = saved.controller;
        self.now_ns = saved.now_ns;
        self.samples = saved.samples;
        Ok(())
    }

    fn end(&mut self) -> Result<(), Fault> {
        if let End::Plant(plant) = &mut self.end {
            plant.record_end();
        }
        self.record()?;
        match (self.tape.take(), &self.end) {
            (Some(tape), End::Plant(plant)) => {
                Ok(tape.finish(&self.session, plant.plant().sample(), plant.statistics())?)
            }
            _ => Ok(()),
        }
    }
}
