//! The plant with its node and its tape: the steps that all run loops share.

use super::{RunError, Tape};
use crate::arm::Load;
use crate::bus::{Bus, Received, Sent};
use crate::node::{NodeEvent, PlantNode};
use crate::plant::{Plant, PlantError};
use crate::protocol::{EmergencyCode, Frame, NodeState};
use crate::recording::{Clipped, Direction, Event, FrameRecord, Record, SampleRecord, StepRecord};
use crate::rig::Reading;

/// Frames taken from the bus in one go: bounds the work of a tick. At 1 Mbit/s a sample of 1 ms has at most 9 frames.
const FRAMES_AT_ONCE: usize = 256;

/// The plant, its node and its tape.
#[derive(Debug)]
pub struct PlantSide {
    plant: Plant,
    node: PlantNode,
    tape: Tape,
    ended: bool,
}

/// What the plant's side counted, in frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames of the protocol refused for their checks.
    pub refused_frames: u64,
    /// Frames that could not be sent in time.
    pub unsent_frames: u64,
}

impl PlantSide {
    /// Puts the three together.
    pub fn new(plant: Plant, node: PlantNode, tape: Tape) -> PlantSide {
        PlantSide { plant, node, tape, ended: false }
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The node.
    pub fn node(&self) -> &PlantNode {
        &self.node
    }

    /// What was counted so far.
    pub fn counts(&self) -> Counts {
        Counts { refused_frames: self.node.refused_frames(), unsent_frames: self.node.unsent_frames() }
    }

    /// Whether the plant was armed once and has been disarmed or has faulted.
    pub(super) fn has_left_armed(&self) -> bool {
        self.ended
    }

    /// Tells the recording when the run began, by the loop's clock.
    pub(super) fn begin(&mut self, clock_ns: u64) {
        self.tape.begin(clock_ns);
    }

    pub(super) fn start(&mut self, now_ns: u64) {
        self.node.start(now_ns);
    }

    /// Records a record that the loop itself makes.
    pub(super) fn record(&mut self, record: Record) -> Result<(), RunError> {
        Ok(self.tape.record(record)?)
    }

    pub(super) fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u16) {
        self.node.fault(now_ns, code, detail);
    }

    /// Takes in everything that has come over the bus.
    pub(super) fn receive(&mut self, now_ns: u64, bus: &mut dyn Bus) -> Result<(), RunError> {
        for _ in 0..FRAMES_AT_ONCE {
            let Some(received) = bus.receive()? else { break };
            self.take(now_ns, &received)?;
        }
        Ok(())
    }

    /// Takes in one frame.
    pub(super) fn take(&mut self, now_ns: u64, received: &Received) -> Result<(), RunError> {
        self.tape.record(Record::Frame(FrameRecord {
            step: self.plant.step(),
            direction: Direction::Received,
            time_ns: now_ns,
            bus_timestamp_ns: received.timestamp_ns,
            frame: received.frame,
        }))?;
        self.node.handle_frame(now_ns, &received.frame);
        Ok(())
    }

    /// Does what is due, and records what happened.
    pub(super) fn handle_deadline(&mut self, now_ns: u64) -> Result<(), RunError> {
        self.node.handle_deadline(now_ns);
        while let Some(event) = self.node.poll_event() {
            if matches!(event, NodeEvent::State { from: NodeState::Operational, .. }) {
                self.ended = true;
            }
            let (name, value) = event.record();
            self.tape.record(Record::Event(Event { step: self.plant.step(), time_ns: now_ns, name, value }))?;
        }
        Ok(())
    }

    /// Measures the sample, records and publishes it.
    pub(super) fn measure(&mut self) -> Result<(), RunError> {
        let measurement = self.plant.measure();
        let values = |pair: [Reading; 2]| pair.map(|reading| reading.value);
        let clipped = |pair: [Reading; 2]| pair.map(|reading| reading.clipped);
        self.tape.record(Record::Sample(SampleRecord {
            step: measurement.step,
            acceleration_b_m_s2: values(measurement.acceleration_b_m_s2),
            acceleration_c_m_s2: values(measurement.acceleration_c_m_s2),
            head_force_n: values(measurement.head_force_n),
            clipped: Some(Clipped {
                acceleration_b: clipped(measurement.acceleration_b_m_s2),
                acceleration_c: clipped(measurement.acceleration_c_m_s2),
                head_force: clipped(measurement.head_force_n),
            }),
        }))?;
        Ok(self.node.publish(&measurement)?)
    }

    /// Advances to the next sample with the command that is held now. If the simulation fails the node faults, and the
    /// plant stays where it is.
    pub(super) fn advance(&mut self, now_ns: u64) -> Result<(), RunError> {
        let load = self.node.load();
        self.record_step(&load, false)?;
        if let Err(error) = self.plant.advance(&load) {
            let PlantError::Integrate { .. } = error;
            self.node.fault(now_ns, EmergencyCode::SimulationFailed, 0);
            self.handle_deadline(now_ns)?;
            return Err(RunError::Plant(error));
        }
        Ok(())
    }

    /// Records the last state, from which nothing was advanced.
    pub(super) fn finish(&mut self) -> Result<(), RunError> {
        self.record_step(&Load::default(), true)
    }

    fn record_step(&mut self, load: &Load, is_end: bool) -> Result<(), RunError> {
        let state = self.plant.state();
        self.record(Record::Step(StepRecord {
            step: self.plant.step(),
            alpha_rad: state.alpha_rad.into(),
            alpha_dot_rad_s: state.alpha_dot_rad_s.into(),
            torque_nm: load.torque_nm.into(),
            force_n: load.force_n.into(),
            is_end,
        }))
    }

    /// The next frame to send, recorded as sent at `now_ns`.
    pub(super) fn next_frame(&mut self, now_ns: u64) -> Result<Option<Frame>, RunError> {
        let Some(frame) = self.node.poll_transmit() else { return Ok(None) };
        self.record_sent(now_ns, frame)?;
        Ok(Some(frame))
    }

    fn record_sent(&mut self, now_ns: u64, frame: Frame) -> Result<(), RunError> {
        let (step, direction) = (self.plant.step(), Direction::Sent);
        self.record(Record::Frame(FrameRecord { step, direction, time_ns: now_ns, bus_timestamp_ns: None, frame }))
    }

    /// Sends what there is to send; what finds the queue full waits for the next call. `true` if all is sent.
    pub(super) fn transmit(&mut self, now_ns: u64, bus: &mut dyn Bus) -> Result<bool, RunError> {
        while let Some(frame) = self.node.next_frame() {
            match bus.send(&frame)? {
                Sent::Queued => {
                    self.node.frame_sent();
                    self.record_sent(now_ns, frame)?;
                }
                Sent::QueueFull => return Ok(false),
            }
        }
        Ok(true)
    }
}
