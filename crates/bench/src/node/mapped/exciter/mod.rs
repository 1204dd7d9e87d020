//! The exciter's node on a user's own protocol: the same mapping as the plant's, with the roles swapped.
//!
//! It arms the plant by the mapping's events, lets its controller answer each sample of readings with a load, disarms.
//! A sample is whole with the last of its messages in the order of the mapping, if all the others have come since the
//! sample before; an index or a counter in them counts the lost ones. A wire has no heartbeats, so that the plant is
//! known by its readings alone: silence while it is armed is a fault.

mod interface;
mod listener;
mod page;
mod samples;

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;

use self::listener::{Heard, Listener, Reason};
use self::page::{Ask, Page};
use self::samples::Samples;
use super::mapping::{Arming, Lockstep, Mapping};
use crate::control::{Answer, Controller};
use crate::node::work::{Phase, Unanswered, Work};
use crate::node::{ExciterInterface, ExciterLack, ExciterOutcome, TimeBase, Timing};
use crate::rig::Measurement;
use resonarm_dynamics::arm::Load;
use resonarm_protocol::{Emergency, EmergencyCode, NodeState};

/// How often a plant that was asked to arm says that it is not before it is asked from the start: more than can be on
/// their way.
const UNARMED: u32 = 4;

/// On a bus in lockstep: how long no sample has come before the first one of an armed plant, ns. One that is not armed
/// repeats its readings every 50 ms, and one that is armed is silent for 500 ms before its first sample; either side may
/// be stopped for 150 ms by a busy machine.
const GAP_NS: u64 = 250_000_000;
/// For how long a sample must be the last one to count as the first of an armed plant without such a gap, ns: of a plant
/// that sends nothing before it is armed.
const LAST_NS: u64 = 1_000_000_000;
/// Samples closer than this waited on the bus, ns, and may all be of before the plant was asked to arm.
const TOGETHER_NS: u64 = 25_000_000;

/// A drive that takes commands.
#[derive(Clone, Copy, Debug)]
struct Drive {
    number: usize,
    /// Whether readings say its state.
    says_state: bool,
    /// The state that it said last.
    state: Option<NodeState>,
}

impl Drive {
    /// Whether it is armed; without a word of it, it is what it was asked for.
    fn is_armed(&self, asked: bool) -> bool {
        if self.says_state { self.state == Some(NodeState::Operational) } else { asked }
    }
}

/// The exciter as a node of a user's protocol, with its controller.
#[derive(Debug)]
pub struct MappedExciter {
    pages: Vec<Page>,
    /// The counter of each message's next frame.
    counters: Vec<u64>,
    listeners: Vec<Listener>,
    samples: Samples,
    drives: Vec<Drive>,
    lockstep: Option<Lockstep>,
    work: Work,
    /// The load that is commanded.
    load: Load,
    /// Pages that wait to be sent, with what they ask for.
    queue: VecDeque<(usize, Ask)>,
    /// How often the plant has said that it is not armed since it was asked to.
    unarmed: u32,
    /// Whether the plant sends readings before it is armed, though it is in lockstep.
    expects_unarmed_readings: bool,
    /// When the last whole sample came, ns of the clock.
    whole_at_ns: u64,
    /// Whether that one is by its time, or by what the plant had said, the first of the armed plant.
    is_first: bool,
    /// Whether the first sample of the armed plant is still to be told from those before it.
    is_first_due: bool,
    begins_anew: bool,
    /// Whether the plant was on the bus when it was asked to arm last.
    is_asked: bool,
    reason: Option<Reason>,
    /// When the readings have to be asked for next, and how often, ns of the clock.
    sync: Option<(u64, u64)>,
}

impl MappedExciter {
    /// A node that lets `controller` answer a plant of this mapping with `rate_hz` samples a second.
    ///
    /// # Errors
    /// [`ExciterLack`] says what the mapping lacks for it.
    pub fn new(
        mapping: &Mapping,
        (rate_hz, time_base): (u16, TimeBase),
        timing: Timing,
        controller: Box<dyn Controller>,
    ) -> Result<MappedExciter, ExciterLack> {
        let pages = page::pages(mapping)?;
        let (listeners, every) = listener::listeners(mapping, rate_hz).ok_or(ExciterLack::NoSamples)?;
        let period_ns = 1_000_000_000 / u64::from(rate_hz.max(1));
        let lockstep = (time_base == TimeBase::Lockstep).then_some(mapping.lockstep);
        let comes_on_sync = lockstep != Some(Lockstep::Sync) && listener::come_on_sync(mapping, &listeners);
        let exciter = MappedExciter {
            queue: VecDeque::with_capacity(8 * pages.len()),
            counters: vec![0; mapping.incoming.len()],
            drives: drives(mapping, &listeners),
            samples: Samples::new(&listeners, every),
            pages,
            listeners,
            lockstep,
            work: Work::new(time_base, timing, controller),
            load: Load::default(),
            unarmed: 0,
            expects_unarmed_readings: false,
            whole_at_ns: 0,
            is_first: false,
            is_first_due: false,
            begins_anew: false,
            is_asked: false,
            reason: None,
            sync: comes_on_sync.then_some((0, period_ns)),
        };
        exciter.check(mapping)?;
        exciter.check_load(&Load::default())?;
        Ok(exciter)
    }

    /// Refuses a mapping by which the plant can't be armed, disarmed, or read as the controller needs it.
    fn check(&self, mapping: &Mapping) -> Result<(), ExciterLack> {
        if mapping.arming == Arming::Operator {
            return Err(ExciterLack::Operator);
        }
        for Drive { number, .. } in &self.drives {
            let asks = |ask| {
                let mut pages = self.pages.iter().filter(|page| page.asks(ask) && !page.is_condition);
                pages.any(|page| mapping.incoming[page.message].drive == *number)
            };
            if !asks(Ask::Arm) {
                return Err(ExciterLack::Arming { drive: *number });
            }
            if !asks(Ask::Disarm) {
                return Err(ExciterLack::Disarming { drive: *number });
            }
        }
        let needs = self.work.carried.needs();
        let is_lacking = |place: &usize| needs[*place] && (self.samples.every > 1 || !self.reads(*place));
        let needed: Vec<usize> = (0..Measurement::CHANNELS).filter(is_lacking).collect();
        if needed.is_empty() { Ok(()) } else { Err(ExciterLack::Readings { needed }) }
    }

    /// Whether each sample has this reading.
    fn reads(&self, place: usize) -> bool {
        self.listeners.iter().any(|listener| listener.is_of_sample && listener.says(place))
    }

    /// Lets a page wait to be sent. One that waits already is sent with the newest load.
    fn push(&mut self, page: usize, ask: Ask) {
        if self.queue.contains(&(page, ask)) {
            self.work.frames.unsent += 1;
            return;
        }
        self.queue.push_back((page, ask));
        self.work.frame_waits();
    }

    /// Lets all pages wait that ask for this.
    fn ask(&mut self, ask: Ask) {
        for page in 0..self.pages.len() {
            if self.pages[page].asks(ask) {
                self.push(page, ask);
            }
        }
    }

    /// Drops the frames that wait, and commands no load.
    fn clear(&mut self) {
        self.queue.clear();
        self.load = Load::default();
        self.work.frame_sent(false);
    }

    /// Asks the plant to arm. A signal that counts when it changes goes back to rest before only if the plant says that
    /// it is not armed: one that has not answered yet would be disarmed.
    ///
    /// A plant in lockstep that waits for the answer to a sample is armed already, and will say so.
    fn ask_for_arming(&mut self, now_ns: u64) {
        self.work.asked(now_ns);
        if self.lockstep.is_some() && self.samples.is_whole && self.unarmed < UNARMED {
            return;
        }
        self.clear();
        let is_faulted = self.drives.iter().any(|drive| drive.state == Some(NodeState::Fault));
        if is_faulted || self.begins_anew {
            self.ask(Ask::Reset);
        }
        if is_faulted || self.begins_anew || self.unarmed >= UNARMED {
            self.ask(Ask::Rest);
        }
        self.ask(Ask::Arm);
        (self.begins_anew, self.unarmed) = (false, 0);
        self.samples.is_whole &= self.says_state();
        // In lockstep a plant may say nothing before it is armed.
        self.is_asked = self.work.has_heard || self.lockstep.is_some();
    }

    /// The plant is armed: its samples are answered from the next whole one on, or from one that waits.
    fn begin(&mut self, now_ns: u64) {
        self.work.begin();
        self.is_first_due = self.expects_unarmed_readings;
        self.answer_if_whole(now_ns);
    }

    fn disarm(&mut self, now_ns: u64, outcome: ExciterOutcome) {
        self.work.disarm(outcome);
        self.ask_for_disarming(now_ns);
    }

    fn ask_for_disarming(&mut self, now_ns: u64) {
        self.work.asked(now_ns);
        self.clear();
        self.ask(Ask::Disarm);
    }

    /// The plant has not said that it is disarmed.
    fn disarm_again(&mut self, now_ns: u64, outcome: ExciterOutcome) {
        match self.work.unanswered() {
            Unanswered::Ask => self.ask_for_disarming(now_ns),
            Unanswered::Silent => self.work.phase = Phase::Done(outcome),
            Unanswered::StillArmed => self.fault(self.work.of_plant(None)),
        }
    }

    /// Ends the work; the plant is asked to disarm, once.
    fn fault(&mut self, emergency: Emergency) {
        self.clear();
        self.ask(Ask::Disarm);
        self.work.fault(emergency);
    }

    /// The plant's fault, by what its readings say of it.
    fn fault_of_plant(&mut self) {
        let code = match self.reason {
            Some(Reason::Code(code)) => Some(code),
            Some(Reason::Other) | None => None,
        };
        self.fault(self.work.of_plant(code));
    }

    /// A frame of the plant.
    fn take(&mut self, now_ns: u64, place: usize, heard: Heard) {
        let is_first = self.work.hear();
        self.reason = heard.fault.or(self.reason.filter(|_| heard.state.is_none()));
        // In lockstep the readings of sample 0 are repeated before the plant is armed.
        let is_repeated = self.expects_unarmed_readings && matches!(self.work.phase, Phase::Arming);
        let mut is_closed = false;
        if self.listeners[place].is_of_sample && (heard.ahead > 0 || is_repeated || self.is_first_due) {
            self.samples.join(&mut self.listeners, place, heard.ahead);
            is_closed = self.samples.closes(place) && self.samples.is_whole;
        }
        if is_closed && self.expects_unarmed_readings {
            let since_ns = now_ns.saturating_sub(self.whole_at_ns);
            // The very first sample is one of before, as a plant begins with it.
            self.is_first = self.whole_at_ns > 0 && since_ns >= GAP_NS;
            self.whole_at_ns = now_ns;
            if is_repeated && (TOGETHER_NS..GAP_NS).contains(&since_ns) && !self.says_state() {
                self.unarmed = self.unarmed.saturating_add(1);
            }
        }
        if let Some(state) = heard.state {
            self.watch(now_ns, self.listeners[place].drive(), state);
        }
        // A plant says that it is armed after the last sample of before.
        self.is_first |= is_closed && self.says_state() && self.work.phase == Phase::Playing;
        if is_first && self.work.phase == Phase::Arming && self.lockstep.is_none() {
            self.begins_anew |= !self.says_state();
            self.ask_for_arming(now_ns);
        }
        self.answer_if_whole(now_ns);
    }

    fn watch(&mut self, now_ns: u64, number: usize, state: NodeState) {
        let Some(drive) = self.drives.iter_mut().find(|drive| drive.number == number && drive.says_state) else {
            return;
        };
        drive.state = Some(state);
        match (self.work.phase, state) {
            (Phase::Arming, NodeState::PreOperational) => self.unarmed = self.unarmed.saturating_add(1),
            (Phase::Arming, NodeState::Operational) if self.drives.iter().all(|drive| drive.is_armed(true)) => {
                self.begin(now_ns);
            }
            (Phase::Playing, NodeState::BootUp | NodeState::Fault) => self.fault_of_plant(),
            (Phase::Playing, NodeState::PreOperational) => self.disarm(now_ns, ExciterOutcome::Stopped),
            (Phase::Disarming(outcome), _) if !self.drives.iter().any(|drive| drive.is_armed(false)) => {
                self.work.phase = Phase::Done(outcome);
            }
            _ => {}
        }
    }

    /// Answers a whole sample that waits.
    fn answer_if_whole(&mut self, now_ns: u64) {
        if self.is_armed_unsaid(now_ns) {
            return self.begin(now_ns);
        }
        if self.work.phase != Phase::Playing || !self.samples.is_whole {
            return;
        }
        if self.is_first_due && !self.is_first && now_ns < self.last_at_ns() {
            return;
        }
        (self.is_first_due, self.samples.is_whole) = (false, false);
        let ahead = core::mem::take(&mut self.samples.ahead);
        let measurement = self.samples.measurement(self.work.next_sample(ahead, self.samples.every));
        match self.work.carried.answer_sample(&measurement) {
            Answer::Hold(load) if page::can_command(&self.pages, &load) => {
                self.load = load;
                for page in 0..self.pages.len() {
                    let is_answer = self.lockstep == Some(Lockstep::Sync) && self.pages[page].is_sync;
                    if self.pages[page].is_command() || is_answer {
                        self.push(page, Ask::Arm);
                    }
                }
            }
            Answer::Hold(_) => self.fault(self.work.own(EmergencyCode::CommandOutOfRange, 0)),
            Answer::Finished => self.disarm(now_ns, ExciterOutcome::Finished),
            Answer::Aborted(abort) => self.disarm(now_ns, ExciterOutcome::Aborted(abort)),
        }
    }

    /// Whether the plant is armed by all that is known: it says no state, was asked to arm, and sends samples.
    fn is_armed_unsaid(&self, now_ns: u64) -> bool {
        let is_first = self.is_first || now_ns >= self.last_at_ns();
        self.may_be_armed_unsaid() && (!self.expects_unarmed_readings || is_first)
    }

    fn may_be_armed_unsaid(&self) -> bool {
        let is_asked = self.work.phase == Phase::Arming && self.is_asked && self.queue.is_empty();
        is_asked && self.samples.is_whole && !self.says_state()
    }

    /// Whether a whole sample waits that may be the first of the armed plant, if no other comes.
    fn awaits_quiet(&self) -> bool {
        let is_due = self.is_first_due && self.samples.is_whole;
        is_due || (self.expects_unarmed_readings && self.may_be_armed_unsaid())
    }

    /// When the last whole sample counts as the first of an armed plant if no other comes, ns.
    fn last_at_ns(&self) -> u64 {
        self.whole_at_ns.saturating_add(LAST_NS)
    }

    /// Whether the plant says the state of a drive.
    fn says_state(&self) -> bool {
        self.drives.iter().any(|drive| drive.says_state)
    }

    /// Nothing waits to be sent any more: a plant that says no state has disarmed.
    fn all_is_sent(&mut self) {
        if let Phase::Disarming(outcome) = self.work.phase
            && !self.says_state()
        {
            self.work.phase = Phase::Done(outcome);
        }
    }
}

/// The drives that take commands.
fn drives(mapping: &Mapping, listeners: &[Listener]) -> Vec<Drive> {
    let mut drives: Vec<Drive> = Vec::new();
    for message in mapping.incoming.iter().filter(|message| !message.commands.is_empty()) {
        let number = message.drive;
        if drives.iter().all(|drive| drive.number != number) {
            let says_state = listeners.iter().any(|listener| listener.drive() == number && listener.says_state());
            drives.push(Drive { number, says_state, state: None });
        }
    }
    drives
}

#[cfg(test)]
mod tests;
