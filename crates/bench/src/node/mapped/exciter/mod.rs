//! The exciter's node on a user protocol: the plant's mapping with the roles exchanged.
//!
//! It arms the plant by the mapping's events, lets its controller answer each sample of readings with a load,
//! and disarms the plant. A sample is complete with the last of its messages in the order of the mapping, if
//! all the others have come since the sample before; an index or a counter in them counts the lost ones. A user
//! protocol has no heartbeats, so the plant is known by its readings only: silence while it is armed is a
//! fault.

mod listener;
mod page;
mod samples;

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;

use self::listener::{Heard, Listener};
use self::page::{Ask, Page};
use self::samples::Samples;
use super::mapping::{Arming, Lockstep, Mapping};
use crate::control::{Answer, Controller, NeededReading};
use crate::node::carried::{Carried, ExciterOutcome, retry_ns};
use crate::node::exciter_interface::ExciterInterface;
use crate::node::exciter_lack::{ExciterLack, ExciterRemark, names};
use crate::node::time_base::TimeBase;
use crate::rig::Load;
use crate::structure::{ChannelName, LOADS, OUTPUTS};
use resonarm_protocol::node::{FrameFault, NodeCore, Phase, Timing, Unanswered, Work};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, FrameFormat, Id, NodeState};

/// Number of times that a plant must report not being armed before it is asked to arm from the start. It is
/// more than the number of frames that may be under way.
const UNARMED: u32 = 4;

/// Silence before a sample that marks it as the first one of an armed plant, on a bus in lockstep, ns. A plant that is
/// not armed repeats its readings every 50 ms, and one that is armed is silent for 500 ms before its first sample; a
/// busy machine may stop either node for 150 ms.
const GAP_NS: u64 = 250_000_000;
/// Time for which a sample must be the last one before it counts as the first of an armed plant, ns, where no
/// such silence precedes it: some plants send nothing before they are armed, and some are not silent
/// afterwards. The time is longer than the 500 ms of Resonarm's plant and a stop of 150 ms together, and
/// shorter than the second for which third-party plants often wait for a command.
const LAST_NS: u64 = 750_000_000;
/// Interval below which samples have waited on the bus, ns; they may all precede the request to arm.
const TOGETHER_NS: u64 = 25_000_000;

/// A drive that takes commands.
#[derive(Clone, Copy, Debug)]
struct Drive {
    number: usize,
    /// Whether readings report its state.
    says_state: bool,
    /// State that it reported last.
    state: Option<NodeState>,
}

impl Drive {
    /// Returns whether it is armed. A drive that reports no state is taken to be what it was asked for.
    fn is_armed(&self, asked: bool) -> bool {
        if self.says_state { self.state == Some(NodeState::Operational) } else { asked }
    }
}

/// The exciter as a node of a user protocol, with its controller.
#[derive(Debug)]
pub struct MappedExciter {
    pages: Vec<Page>,
    /// Counter of each message's next frame.
    counters: Vec<u64>,
    listeners: Vec<Listener>,
    samples: Samples,
    drives: Vec<Drive>,
    lockstep: Option<Lockstep>,
    core: NodeCore,
    work: Work<Carried>,
    /// Load that is commanded now.
    load: Load,
    /// Pages that wait to be sent, with the request that each makes.
    queue: VecDeque<(usize, Ask)>,
    /// Number of times that the plant has reported not being armed since it was asked to arm.
    unarmed: u32,
    /// Whether the plant sends readings before it is armed, although it is in lockstep.
    expects_unarmed_readings: bool,
    /// Time of the last complete sample, ns of the clock.
    whole_at_ns: u64,
    /// Whether that sample is the first of the armed plant, judged by its time or by the plant's state.
    is_first: bool,
    /// Whether the first sample of the armed plant is still to be distinguished from those before it.
    is_first_due: bool,
    begins_anew: bool,
    /// Whether the plant was on the bus when it was last asked to arm.
    is_asked: bool,
    /// Code of the plant's fault, if its readings state one.
    reason: Option<EmergencyCode>,
    /// Next time to ask for readings, and the period, ns of the clock.
    sync: Option<(u64, u64)>,
}

impl MappedExciter {
    /// Returns a node that lets `controller` answer a plant of this mapping with `rate_hz` samples per second.
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
        let controller = Carried::new(controller);
        let channels = controller.controller.needs().iter().map(|needed| needed.place + 1).max().unwrap_or(0);
        let exciter = MappedExciter {
            // A page waits at most once with each of the four requests. With room for twice as many the queue never
            // grows while the node runs.
            queue: VecDeque::with_capacity(8 * pages.len()),
            counters: vec![0; mapping.incoming.len()],
            drives: drives(mapping, &listeners),
            samples: Samples::new(&listeners, every, channels),
            pages,
            listeners,
            lockstep,
            core: NodeCore::new(&timing),
            work: Work::new(controller, &timing, retry_ns(time_base)),
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
        // A load of zero must be possible, since requests are sent with it.
        exciter.check_load(&Load::default())?;
        Ok(exciter)
    }

    /// Rejects a mapping by which the plant can't be armed, disarmed, or read as the controller requires.
    fn check(&self, mapping: &Mapping) -> Result<(), ExciterLack> {
        if mapping.arming == Arming::Operator {
            return Err(ExciterLack::Operator);
        }
        for Drive { number, .. } in &self.drives {
            let asks = |ask| {
                // A page that only meets a condition is sent with a request, and makes none.
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
        let needs = self.work.controller.controller.needs().into_iter();
        let is_lacking = |needed: &NeededReading| self.samples.every > 1 || !self.reads(needed.place);
        let needed: Vec<_> = needs.filter(is_lacking).collect();
        if needed.is_empty() { Ok(()) } else { Err(ExciterLack::Readings { needed: names(&needed) }) }
    }

    /// Returns whether every sample has this reading.
    fn reads(&self, place: usize) -> bool {
        self.listeners.iter().any(|listener| listener.is_of_sample && listener.says(place))
    }

    /// Queues a page for sending. A page that already waits is sent with the newest load.
    fn push(&mut self, page: usize, ask: Ask) {
        if self.queue.contains(&(page, ask)) {
            self.core.counts.unsent += 1;
            return;
        }
        self.queue.push_back((page, ask));
        self.core.frame_waits();
    }

    /// Queues all pages that make this request.
    fn ask(&mut self, ask: Ask) {
        for page in 0..self.pages.len() {
            if self.pages[page].asks(ask) {
                self.push(page, ask);
            }
        }
    }

    /// Drops the waiting frames and commands no load.
    fn clear(&mut self) {
        self.queue.clear();
        self.load = Load::default();
        self.core.frame_sent(false);
    }

    /// Asks the plant to arm. A signal that counts on change returns to rest first only if the plant reports
    /// that it is not armed: a plant that has not answered yet would be disarmed by that.
    ///
    /// A plant in lockstep that waits for the answer to a sample is armed already and will report it.
    fn ask_for_arming(&mut self, now_ns: u64) {
        self.work.asked(now_ns);
        if self.lockstep.is_some() && self.samples.is_whole && self.unarmed < UNARMED {
            return;
        }
        self.clear();
        // A fault is reset before arming. So is a plant that may be in fault without reporting it.
        let is_faulted = self.drives.iter().any(|drive| drive.state == Some(NodeState::Fault));
        if is_faulted || self.begins_anew {
            self.ask(Ask::Reset);
        }
        if is_faulted || self.begins_anew || self.unarmed >= UNARMED {
            self.ask(Ask::Rest);
        }
        self.ask(Ask::Arm);
        self.begins_anew = false;
        self.unarmed = 0;
        self.samples.is_whole &= self.says_state();
        // In lockstep a plant may say nothing before it is armed.
        self.is_asked = self.work.has_heard || self.lockstep.is_some();
    }

    /// Begins the work: the plant is armed, and its samples are answered from the next complete or waiting one
    /// on.
    fn begin(&mut self, now_ns: u64) {
        self.work.begin(&mut self.core);
        self.is_first_due = self.expects_unarmed_readings;
        self.answer_if_whole(now_ns);
    }

    fn disarm(&mut self, now_ns: u64, outcome: ExciterOutcome) {
        self.work.disarm(&mut self.core, outcome);
        self.ask_for_disarming(now_ns);
    }

    fn ask_for_disarming(&mut self, now_ns: u64) {
        self.work.asked(now_ns);
        self.clear();
        self.ask(Ask::Disarm);
    }

    /// Handles a plant that has not reported that it is disarmed.
    fn disarm_again(&mut self, now_ns: u64, outcome: ExciterOutcome) {
        match self.work.unanswered() {
            Unanswered::Ask => self.ask_for_disarming(now_ns),
            Unanswered::Silent => self.work.phase = Phase::Done(outcome),
            Unanswered::StillArmed => self.fault(self.work.of_plant(None)),
        }
    }

    /// Ends the work and asks the plant to disarm, once.
    fn fault(&mut self, emergency: Emergency) {
        self.clear();
        self.ask(Ask::Disarm);
        self.work.fault(&mut self.core, emergency);
    }

    /// Handles a frame of the plant.
    fn take(&mut self, now_ns: u64, place: usize, heard: Heard) {
        let is_first = self.work.hear();
        self.reason = heard.fault.or(self.reason.filter(|_| heard.state.is_none()));
        // In lockstep the plant repeats the readings of sample 0 before it is armed.
        let is_repeated = self.expects_unarmed_readings && matches!(self.work.phase, Phase::Arming);
        let mut is_closed = false;
        if self.listeners[place].is_of_sample && (heard.ahead > 0 || is_repeated || self.is_first_due) {
            self.samples.join(&mut self.listeners, place, heard.ahead);
            is_closed = place == self.samples.closing && self.samples.is_whole;
        }
        if is_closed && self.expects_unarmed_readings {
            let since_ns = now_ns.saturating_sub(self.whole_at_ns);
            // The first sample of all never counts: a plant sends it before it is armed.
            self.is_first = self.whole_at_ns > 0 && since_ns >= GAP_NS;
            self.whole_at_ns = now_ns;
            if is_repeated && (TOGETHER_NS..GAP_NS).contains(&since_ns) && !self.says_state() {
                self.unarmed = self.unarmed.saturating_add(1);
            }
        }
        if let Some(state) = heard.state {
            self.watch(now_ns, self.listeners[place].message.drive, state);
        }
        // A plant reports that it is armed after the last sample from before.
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
            (Phase::Playing, NodeState::BootUp | NodeState::Fault) => self.fault(self.work.of_plant(self.reason)),
            (Phase::Playing, NodeState::PreOperational) => self.disarm(now_ns, ExciterOutcome::Stopped),
            (Phase::Disarming(outcome), _) if !self.drives.iter().any(|drive| drive.is_armed(false)) => {
                self.work.phase = Phase::Done(outcome);
            }
            _ => {}
        }
    }

    /// Answers a complete sample that waits.
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
        self.is_first_due = false;
        self.samples.is_whole = false;
        let ahead = core::mem::take(&mut self.samples.ahead);
        let measurement = self.samples.measurement(self.work.next_sample(&self.core, ahead, self.samples.every));
        match self.work.controller.answer_sample(&measurement) {
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

    /// Returns whether the plant must be armed although it reports no state: it was asked to arm, and sends
    /// samples.
    fn is_armed_unsaid(&self, now_ns: u64) -> bool {
        let is_first = self.is_first || now_ns >= self.last_at_ns();
        self.may_be_armed_unsaid() && (!self.expects_unarmed_readings || is_first)
    }

    fn may_be_armed_unsaid(&self) -> bool {
        let is_asked = self.work.phase == Phase::Arming && self.is_asked && self.queue.is_empty();
        is_asked && self.samples.is_whole && !self.says_state()
    }

    /// Returns whether a complete sample waits that is the first of the armed plant if no other comes.
    fn awaits_quiet(&self) -> bool {
        let is_due = self.is_first_due && self.samples.is_whole;
        is_due || (self.expects_unarmed_readings && self.may_be_armed_unsaid())
    }

    /// Returns the time at which the last complete sample counts as the first of an armed plant if no other
    /// comes, ns.
    fn last_at_ns(&self) -> u64 {
        self.whole_at_ns.saturating_add(LAST_NS)
    }

    /// Asks for readings that come only on request.
    fn synchronise(&mut self, now_ns: u64) {
        let Some((due_ns, period_ns)) = self.sync else { return };
        if now_ns < due_ns || self.work.outcome().is_some() {
            return;
        }
        let next_ns = due_ns.saturating_add(period_ns);
        self.sync = Some((if next_ns > now_ns { next_ns } else { now_ns.saturating_add(period_ns) }, period_ns));
        for page in 0..self.pages.len() {
            if self.pages[page].is_sync {
                self.push(page, Ask::Arm);
            }
        }
    }

    /// Handles another node that sends this one's messages: either of the two could control the plant.
    fn meet_second_sender(&mut self, id: Id) {
        self.core.counts.refused += 1;
        self.core.reject_sender(id);
        if self.outcome().is_none() {
            self.fault(self.work.own(EmergencyCode::SecondSender, id.raw() as u16));
        }
    }

    /// Returns whether the plant reports the state of a drive.
    fn says_state(&self) -> bool {
        self.drives.iter().any(|drive| drive.says_state)
    }
}

impl ExciterInterface for MappedExciter {
    fn core(&self) -> &NodeCore {
        &self.core
    }

    fn core_mut(&mut self) -> &mut NodeCore {
        &mut self.core
    }

    fn work(&self) -> &Work<Carried> {
        &self.work
    }

    fn work_mut(&mut self) -> &mut Work<Carried> {
        &mut self.work
    }

    fn waiting(&self) -> usize {
        self.queue.len()
    }

    fn start(&mut self, now_ns: u64) {
        self.core.start(now_ns);
        // A plant that reports no state may be in fault, with its enable signal still set.
        self.begins_anew = !self.says_state();
        // In real time the load in a frame that arms answers the sample before it. A plant that has sent none
        // is not asked yet.
        if self.lockstep.is_some() { self.ask_for_arming(now_ns) } else { self.work.asked(now_ns) }
    }

    fn check_load(&self, load: &Load) -> Result<(), ExciterLack> {
        if page::can_command(&self.pages, load) {
            return Ok(());
        }
        let alone = |place: usize| {
            let mut parts = [0.0; Load::PARTS];
            parts[place] = load.parts()[place];
            Load::from_parts(&parts)
        };
        let part = (0..Load::PARTS).find(|place| !page::can_command(&self.pages, &alone(*place)));
        let part = part.map_or(ChannelName::new("several parts"), |place| LOADS[place].name);
        Err(ExciterLack::Load { part })
    }

    fn remarks(&self) -> Vec<ExciterRemark> {
        let unread = OUTPUTS.iter().enumerate().filter(|(place, _)| !self.reads(*place));
        let unread: Vec<_> = unread.map(|(_, channel)| channel.name).collect();
        let every = self.samples.every;
        let remarks = [
            (!unread.is_empty()).then_some(ExciterRemark::Unread { unread }),
            (every > 1).then_some(ExciterRemark::Sparse { every }),
            self.drives.iter().any(|drive| !drive.says_state).then_some(ExciterRemark::State),
            (self.listeners[self.samples.counting].counts() == 0).then_some(ExciterRemark::Index),
        ];
        remarks.into_iter().flatten().collect()
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.core.listening.look(now_ns);
        if frame.format() == FrameFormat::Remote {
            return;
        }
        let id = frame.id();
        if let Some(place) = self.listeners.iter().position(|listener| listener.message.id == id) {
            match self.listeners[place].hear(frame, &mut self.samples.readings) {
                Ok(heard) => self.take(now_ns, place, heard),
                Err(check) => self.core.reject(FrameFault::Mapped { id, check }),
            }
        } else if self.pages.iter().any(|page| page.id == id && (page.is_command() || page.asks(Ask::Arm))) {
            self.meet_second_sender(id);
        }
    }

    fn handle_deadline(&mut self, now_ns: u64) {
        self.core.listening.look(now_ns);
        self.synchronise(now_ns);
        match self.work.phase {
            Phase::Arming if self.work.is_due(now_ns) => self.ask_for_arming(now_ns),
            Phase::Disarming(outcome) if self.work.is_due(now_ns) => self.disarm_again(now_ns, outcome),
            _ => {
                self.work.timed_out(&self.core, self.waiting()).into_iter().for_each(|emergency| self.fault(emergency))
            }
        }
        if self.expects_unarmed_readings {
            self.answer_if_whole(now_ns);
        }
    }

    fn next_deadline_ns(&self) -> u64 {
        let sync_ns = self.sync.filter(|_| self.outcome().is_none()).map_or(u64::MAX, |(due_ns, _)| due_ns);
        let first_ns = if self.awaits_quiet() { self.last_at_ns() } else { u64::MAX };
        self.work.deadline_ns(&self.core).min(sync_ns).min(first_ns)
    }

    fn rearm(&mut self, now_ns: u64) -> bool {
        if !self.work.rearm(&mut self.core, now_ns) {
            return false;
        }
        self.begins_anew = true;
        self.reason = None;
        self.drives.iter_mut().for_each(|drive| drive.state = None);
        self.listeners.iter_mut().for_each(Listener::forget);
        self.samples.ahead = 0;
        self.samples.is_whole = false;
        self.clear();
        true
    }

    fn leave(&mut self, now_ns: u64) {
        if self.work.leave() {
            self.disarm(now_ns, ExciterOutcome::Stopped);
        }
    }

    fn bus_lost(&mut self, _now_ns: u64) {
        if self.work.phase == Phase::Playing {
            self.fault(self.work.own(EmergencyCode::BusLoss, self.core.not_sent(self.waiting())));
        }
    }

    fn expect_unarmed_readings(&mut self) {
        self.expects_unarmed_readings = true;
    }

    fn plant_ended(&mut self, _now_ns: u64) {
        self.work.plant_ended(&mut self.core);
    }

    fn next_frame(&mut self) -> Option<Frame> {
        while let Some((page, ask)) = self.queue.front().copied() {
            let page = &self.pages[page];
            if let Some(frame) = page.frame(ask, &self.load, self.counters[page.message]) {
                return Some(frame);
            }
            // Loads are checked when they are commanded, so this is never reached.
            self.queue.pop_front();
            self.core.counts.unsent += 1;
        }
        None
    }

    fn frame_sent(&mut self) {
        if let Some((page, _)) = self.queue.pop_front() {
            let page = &self.pages[page];
            self.counters[page.message] = page.after(self.counters[page.message]);
        }
        self.core.frame_sent(!self.queue.is_empty());
        // A plant that reports no state counts as disarmed once all is sent.
        if let Phase::Disarming(outcome) = self.work.phase
            && self.queue.is_empty()
            && !self.says_state()
        {
            self.work.phase = Phase::Done(outcome);
        }
    }
}

/// Returns the drives that take commands.
fn drives(mapping: &Mapping, listeners: &[Listener]) -> Vec<Drive> {
    let mut drives: Vec<Drive> = Vec::new();
    for message in mapping.incoming.iter().filter(|message| !message.commands.is_empty()) {
        let number = message.drive;
        if drives.iter().all(|drive| drive.number != number) {
            let says_state = listeners.iter().any(|listener| listener.message.drive == number && listener.says_state());
            drives.push(Drive { number, says_state, state: None });
        }
    }
    drives
}

#[cfg(test)]
mod tests;
