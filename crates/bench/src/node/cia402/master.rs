//! The exciter as the CANopen master of drives in cyclic synchronous torque mode (CiA 301 v4.2, CiA 402-2).
//!
//! It starts the drives by network management, sets their mode by SDO, enables them by controlwords, one for
//! each statusword that it receives, and then commands a target torque for each joint with each sample:
//!
//! ```text
//! statusword   switch on disabled ─► ready to switch on ─► switched on ─► operation enabled
//! controlword                     06                    07             0F
//! ```
//!
//! A sample consists of the positions of all drives, which they send at SYNC: in real time there is a SYNC
//! every sample period, in lockstep one behind the targets that it makes act. The first sample in lockstep is
//! answered before its positions have been received. The mapping of the PDOs is that of the drives after
//! power-on: RPDO 1 has controlword and target, TPDO 1 statusword, mode and torque, TPDO 2 position and
//! velocity.

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec::Vec;

use super::error_code;
use super::spec::{Cia402Spec, DriveSpec, TORQUE_MODE};
use crate::control::{Answer, Controller};
use crate::node::carried::{Carried, ExciterOutcome, retry_ns};
use crate::node::exciter_interface::ExciterInterface;
use crate::node::exciter_lack::{ExciterLack, ExciterRemark, names};
use crate::node::time_base::TimeBase;
use crate::rig::{Load, Measurement, Reading, Readings};
use crate::structure::{LOADS, OUTPUTS};
use resonarm_protocol::node::{FrameCheck, FrameFault, NodeCore, Phase, Timing, Unanswered, Work};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, FrameFormat, Id};
use resonarm_wire::canopen::cia402::DriveState;
use resonarm_wire::canopen::{EMERGENCY_BASE, HEARTBEAT_BASE, NMT_ID, SDO_REQUEST_BASE, SYNC_ID};

/// Base identifiers of RPDO 1, TPDO 1 and TPDO 2, to which the node id is added.
const COMMAND_BASE: u16 = 0x200;
const STATUS_BASE: u16 = 0x180;
const MOTION_BASE: u16 = 0x280;
/// State operational in a heartbeat.
const OPERATIONAL: u8 = 5;
/// Controlwords: disable voltage, shutdown, switch on, enable operation, fault reset.
const DISABLE_VOLTAGE: u16 = 0x00;
const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE: u16 = 0x0F;
const RESET: u16 = 0x80;

/// A frame that waits; it is built when it is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Message {
    /// Network management: start the drive.
    Start(usize),
    /// The mode of operation, written by SDO.
    Mode(usize),
    /// A controlword with the target.
    Control(usize, u16),
    /// SYNC, which asks for the positions.
    Sync,
}

/// A drive as the master knows it.
#[derive(Clone, Copy, Debug)]
struct Slave {
    spec: DriveSpec,
    /// State in its last statusword; `None` before the first.
    state: Option<DriveState>,
    /// Whether it is in the torque mode.
    has_mode: bool,
    /// Whether its position has come since the last sample.
    has_position: bool,
    /// Target torque, thousandths of the rated torque.
    target: i16,
}

impl Slave {
    /// Returns the identifier of one of its messages.
    fn id(&self, base: u16) -> Id {
        Id::Standard(base + u16::from(self.spec.node_id))
    }

    /// Returns the target closest to its part of a load; `None` if that exceeds 16 bits.
    fn target_of(&self, load: &Load) -> Option<i16> {
        let torque_nm = load.torque_nm[self.spec.joint];
        // Halves go to the even number, as in the codec of Resonarm's protocol.
        let target = libm::rint(torque_nm / self.spec.torque_step_nm());
        (f64::from(i16::MIN)..=f64::from(i16::MAX)).contains(&target).then_some(target as i16)
    }

    /// Returns the controlwords that lead from its state towards operation enabled.
    fn next_controlwords(&self) -> &'static [u16] {
        match self.state {
            Some(DriveState::SwitchOnDisabled) => &[SHUTDOWN],
            Some(DriveState::ReadyToSwitchOn) => &[SWITCH_ON],
            Some(DriveState::SwitchedOn) => &[ENABLE],
            Some(DriveState::QuickStopActive) => &[DISABLE_VOLTAGE],
            // Only a rising bit 7 resets a fault, so a word without it comes first.
            Some(DriveState::Fault) => &[DISABLE_VOLTAGE, RESET],
            Some(DriveState::NotReady | DriveState::FaultReactionActive | DriveState::OperationEnabled) | None => &[],
        }
    }
}

/// The exciter as master of the drives, with its controller.
#[derive(Debug)]
pub struct Cia402Exciter {
    slaves: Vec<Slave>,
    core: NodeCore,
    work: Work<Carried>,
    time_base: TimeBase,
    queue: VecDeque<Message>,
    /// Time of the next SYNC in real time; the next field is the period, ns of the clock.
    sync_at_ns: u64,
    sync_period_ns: u64,
    /// Number of SYNCs since the last answered sample.
    syncs: u64,
}

impl Cia402Exciter {
    /// Returns a master that lets `controller` answer these drives with `rate_hz` samples per second.
    ///
    /// # Errors
    /// [`ExciterLack::Drives`] if the controller needs readings.
    pub fn new(
        spec: &Cia402Spec,
        (rate_hz, time_base): (u16, TimeBase),
        timing: Timing,
        controller: Box<dyn Controller>,
    ) -> Result<Cia402Exciter, ExciterLack> {
        let slave =
            |drive: &DriveSpec| Slave { spec: *drive, state: None, has_mode: false, has_position: false, target: 0 };
        let slaves: Vec<Slave> = spec.drives.iter().map(slave).collect();
        let work = Work::new(Carried::new(controller), &timing, retry_ns(time_base));
        let needs = work.controller.controller.needs();
        if !needs.is_empty() {
            return Err(ExciterLack::Drives { needed: names(&needs) });
        }
        Ok(Cia402Exciter {
            // Room for a start, a mode and every controlword of each drive, and SYNC.
            queue: VecDeque::with_capacity(7 * slaves.len() + 1),
            slaves,
            core: NodeCore::new(&timing),
            work,
            time_base,
            sync_at_ns: 0,
            sync_period_ns: 1_000_000_000 / u64::from(rate_hz.max(1)),
            syncs: 0,
        })
    }

    /// Queues a frame for sending. A frame that already waits is sent with the newest target.
    fn push(&mut self, message: Message) {
        if self.queue.contains(&message) {
            self.core.counts.unsent += 1;
            return;
        }
        self.queue.push_back(message);
        self.core.frame_waits();
    }

    fn control(&mut self, controlword: u16) {
        (0..self.slaves.len()).for_each(|place| self.push(Message::Control(place, controlword)));
    }

    /// Drops the waiting frames and sets all targets to zero.
    fn clear(&mut self) {
        // Frames of the previous phase must not follow those of the next one.
        self.queue.clear();
        self.slaves.iter_mut().for_each(|slave| slave.target = 0);
        self.core.frame_sent(false);
    }

    /// Starts the drives that have not been heard.
    fn ask_for_arming(&mut self, now_ns: u64) {
        self.work.asked(now_ns);
        for place in 0..self.slaves.len() {
            if self.slaves[place].state.is_none() {
                self.push(Message::Start(place));
            }
        }
    }

    fn ask_for_disarming(&mut self, now_ns: u64) {
        self.work.asked(now_ns);
        self.clear();
        self.control(SHUTDOWN);
    }

    fn disarm(&mut self, now_ns: u64, outcome: ExciterOutcome) {
        self.work.disarm(&mut self.core, outcome);
        self.ask_for_disarming(now_ns);
    }

    fn disarm_again(&mut self, now_ns: u64, outcome: ExciterOutcome) {
        match self.work.unanswered() {
            Unanswered::Ask => self.ask_for_disarming(now_ns),
            Unanswered::Silent => self.work.phase = Phase::Done(outcome),
            Unanswered::StillArmed => self.fault(self.work.of_plant(None)),
        }
    }

    /// Ends the work and asks the drives to shut down, once.
    fn fault(&mut self, emergency: Emergency) {
        self.clear();
        self.control(SHUTDOWN);
        self.work.fault(&mut self.core, emergency);
    }

    /// Follows a statusword: takes the next step towards enabling, or ends the work.
    fn watch(&mut self, now_ns: u64, place: usize) {
        let (state, all) = (self.slaves[place].state, |slaves: &[Slave], enabled: bool| {
            slaves.iter().all(|slave| (slave.state == Some(DriveState::OperationEnabled)) == enabled)
        });
        match self.work.phase {
            Phase::Arming if all(&self.slaves, true) => self.begin(now_ns),
            Phase::Arming if !self.slaves[place].has_mode => self.push(Message::Mode(place)),
            Phase::Arming => {
                let words = self.slaves[place].next_controlwords();
                words.iter().for_each(|word| self.push(Message::Control(place, *word)));
            }
            Phase::Playing if state.is_some_and(DriveState::is_fault) => self.fault(self.work.of_plant(None)),
            Phase::Playing if state != Some(DriveState::OperationEnabled) => {
                self.disarm(now_ns, ExciterOutcome::Stopped);
            }
            Phase::Disarming(outcome) if all(&self.slaves, false) => self.work.phase = Phase::Done(outcome),
            Phase::Playing | Phase::Disarming(_) | Phase::Done(_) => {}
        }
    }

    /// Begins the work when all drives are enabled. In lockstep the plant waits for an answer to a sample whose
    /// positions nobody has asked for.
    fn begin(&mut self, now_ns: u64) {
        self.work.begin(&mut self.core);
        // Positions from before the drives were enabled are of no sample.
        self.slaves.iter_mut().for_each(|slave| slave.has_position = false);
        self.syncs = 0;
        if self.time_base == TimeBase::Lockstep {
            self.answer(now_ns);
        }
    }

    /// Notes the position of a drive; the last one completes a sample.
    fn take_position(&mut self, now_ns: u64, place: usize) {
        self.slaves[place].has_position = true;
        if self.work.phase == Phase::Playing && self.slaves.iter().all(|slave| slave.has_position) {
            self.slaves.iter_mut().for_each(|slave| slave.has_position = false);
            self.answer(now_ns);
        }
    }

    fn answer(&mut self, now_ns: u64) {
        let sample = self.work.next_sample(&self.core, core::mem::take(&mut self.syncs), 1);
        // CANopen drives report neither forces nor accelerations. NaN keeps a controller from taking zeros for
        // readings.
        let none = [Reading { value: f64::NAN, clipped: false }; 2];
        let measurement = Measurement {
            sample,
            head_force_n: none,
            acceleration_b_m_s2: none,
            acceleration_c_m_s2: none,
            more: Readings::NONE,
        };
        match self.work.controller.answer_sample(&measurement) {
            Answer::Hold(load) if self.check_load(&load).is_ok() => {
                self.slaves.iter_mut().for_each(|slave| slave.target = slave.target_of(&load).unwrap_or(0));
                self.control(ENABLE);
                if self.time_base == TimeBase::Lockstep {
                    self.push(Message::Sync);
                }
            }
            Answer::Hold(_) => self.fault(self.work.own(EmergencyCode::CommandOutOfRange, 0)),
            Answer::Finished => self.disarm(now_ns, ExciterOutcome::Finished),
            Answer::Aborted(abort) => self.disarm(now_ns, ExciterOutcome::Aborted(abort)),
        }
    }

    /// Sends a SYNC every sample period in real time, to ask for the positions.
    fn synchronise(&mut self, now_ns: u64) {
        if self.time_base == TimeBase::Lockstep || self.work.phase != Phase::Playing || now_ns < self.sync_at_ns {
            return;
        }
        let next_ns = self.sync_at_ns.saturating_add(self.sync_period_ns);
        // Periods that were missed are not made up for: a burst of SYNCs would ask for the same positions again and
        // again.
        self.sync_at_ns = if next_ns > now_ns { next_ns } else { now_ns.saturating_add(self.sync_period_ns) };
        self.syncs += 1;
        self.push(Message::Sync);
    }

    /// Handles a frame of drive `place`.
    ///
    /// # Errors
    /// [`FrameCheck`] says what is wrong with it: nothing of it is used then.
    fn hear(&mut self, now_ns: u64, place: usize, frame: &Frame) -> Result<(), FrameCheck> {
        let slave = self.slaves[place];
        let id = frame.id();
        let data = frame.data();
        if frame.format() != FrameFormat::Classic {
            return Err(FrameCheck::Format);
        }
        let has_its_length = match id {
            id if id == slave.id(STATUS_BASE) => data.len() >= 3,
            id if id == slave.id(MOTION_BASE) => data.len() >= 8,
            id if id == slave.id(HEARTBEAT_BASE) => data.len() == 1,
            _ => data.len() == 8,
        };
        if !has_its_length {
            return Err(FrameCheck::Length);
        }
        // Only a frame that passed the checks is a sign of life of the plant.
        self.work.hear();
        if id == slave.id(STATUS_BASE) {
            let [low, high, mode, ..] = data else { return Err(FrameCheck::Length) };
            self.slaves[place].state = DriveState::of(u16::from_le_bytes([*low, *high]));
            self.slaves[place].has_mode = *mode == TORQUE_MODE as u8;
            self.watch(now_ns, place);
        } else if id == slave.id(MOTION_BASE) {
            self.take_position(now_ns, place);
        } else if id == slave.id(HEARTBEAT_BASE) {
            let state = data.first().ok_or(FrameCheck::Length)?;
            if self.work.phase == Phase::Arming && *state != OPERATIONAL {
                self.push(Message::Start(place));
            }
        } else {
            let [low, high, ..] = data else { return Err(FrameCheck::Length) };
            let code = u16::from_le_bytes([*low, *high]);
            // Code 0 announces that an error has gone.
            if self.work.phase == Phase::Playing && code != 0 {
                let known = EmergencyCode::ALL.into_iter().find(|known| error_code(*known) == code);
                self.fault(self.work.of_plant(known.filter(|known| error_code(*known) != error_code(OTHER))));
            }
        }
        Ok(())
    }

    /// Handles another node that sends this one's messages: either of the two could control the plant.
    fn meet_second_sender(&mut self, id: Id) {
        self.core.counts.refused += 1;
        self.core.reject_sender(id);
        if self.outcome().is_none() {
            self.fault(self.work.own(EmergencyCode::SecondSender, id.raw() as u16));
        }
    }

    fn frame(&self, message: Message) -> Option<Frame> {
        let classic = |id, data: &[u8]| Frame::classic(id, data).ok();
        match message {
            Message::Start(place) => classic(Id::Standard(NMT_ID), &[1, self.slaves[place].spec.node_id]),
            Message::Mode(place) => {
                // Expedited transfer of one byte to object 6060.
                let request = [0x2F, 0x60, 0x60, 0, TORQUE_MODE as u8, 0, 0, 0];
                classic(self.slaves[place].id(SDO_REQUEST_BASE), &request)
            }
            Message::Control(place, controlword) => {
                let slave = &self.slaves[place];
                let [a, b] = controlword.to_le_bytes();
                let [c, d] = slave.target.to_le_bytes();
                classic(slave.id(COMMAND_BASE), &[a, b, c, d])
            }
            Message::Sync => classic(Id::Standard(SYNC_ID), &[]),
        }
    }
}

/// Fault whose error code stands for all faults without a code of their own.
const OTHER: EmergencyCode = EmergencyCode::Incompatible;

impl ExciterInterface for Cia402Exciter {
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
        self.ask_for_arming(now_ns);
    }

    fn check_load(&self, load: &Load) -> Result<(), ExciterLack> {
        // The places of torques among the parts of a load are those of the joints.
        let has =
            |place: usize| self.slaves.iter().any(|slave| slave.spec.joint == place && slave.target_of(load).is_some());
        match load.parts().into_iter().enumerate().find(|(place, part)| *part != 0.0 && !has(*place)) {
            None => Ok(()),
            Some((place, _)) => Err(ExciterLack::Torque { part: LOADS[place].name }),
        }
    }

    fn remarks(&self) -> Vec<ExciterRemark> {
        alloc::vec![ExciterRemark::Unread { unread: OUTPUTS.iter().map(|channel| channel.name).collect() }]
    }

    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.core.listening.look(now_ns);
        if frame.format() == FrameFormat::Remote {
            return;
        }
        let id = frame.id();
        let heard = [STATUS_BASE, MOTION_BASE, HEARTBEAT_BASE, EMERGENCY_BASE];
        if self.slaves.iter().any(|slave| slave.id(COMMAND_BASE) == id) {
            self.meet_second_sender(id);
        } else if let Some(place) = self.slaves.iter().position(|slave| heard.iter().any(|base| slave.id(*base) == id))
            && let Err(check) = self.hear(now_ns, place, frame)
        {
            self.core.reject(FrameFault::Mapped { id, check });
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
    }

    fn next_deadline_ns(&self) -> u64 {
        let is_clocked = self.time_base == TimeBase::Clock && self.work.phase == Phase::Playing;
        self.work.deadline_ns(&self.core).min(if is_clocked { self.sync_at_ns } else { u64::MAX })
    }

    fn rearm(&mut self, now_ns: u64) -> bool {
        if !self.work.rearm(&mut self.core, now_ns) {
            return false;
        }
        self.slaves.iter_mut().for_each(|slave| slave.state = None);
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

    fn plant_ended(&mut self, _now_ns: u64) {
        self.work.plant_ended(&mut self.core);
    }

    fn next_frame(&mut self) -> Option<Frame> {
        self.frame(*self.queue.front()?)
    }

    fn frame_sent(&mut self) {
        self.queue.pop_front();
        self.core.frame_sent(!self.queue.is_empty());
    }
}
