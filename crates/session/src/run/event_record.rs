//! Converts the events and requests of a node, and the states and measurements of a plant, to records.

use resonarm_protocol::{EmergencyCode, Node, NodeState, Refusal};

use super::watch::Request;
use resonarm_bench::control::SetPoint;
use resonarm_bench::node::{FrameCheck, FrameFault, NodeEvent};
use resonarm_bench::plant::Plant;
use resonarm_bench::rig::{Load, Measurement, Reading};
use resonarm_bus::ControllerState;
use resonarm_files::recording::{Clipped, Record, SampleRecord, StateRecord};

/// Returns the name under which a rejected request is recorded.
const fn refusal_name(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::NotArmed => "plant.command.not_armed",
        Refusal::Late => "plant.command.late",
        Refusal::OutOfOrder => "plant.command.out_of_order",
        Refusal::Repeated => "plant.command.repeated",
        Refusal::OutOfRange => "plant.command.out_of_range",
        Refusal::RateOfChange => "plant.command.rate_of_change",
        Refusal::Travel => "plant.command.travel",
    }
}

/// Returns the name under which a rejected frame of a user protocol is recorded.
const fn check_name(check: FrameCheck) -> &'static str {
    match check {
        FrameCheck::Format => "frame.format",
        FrameCheck::Length => "frame.length",
        FrameCheck::Checksum => "frame.checksum",
        FrameCheck::Counter => "frame.counter",
        FrameCheck::Value => "frame.value",
    }
}

/// Returns the name under which a state of the controller is recorded.
pub(super) const fn controller_record(state: ControllerState) -> &'static str {
    match state {
        ControllerState::Active => "bus.error_active",
        ControllerState::Warning => "bus.error_warning",
        ControllerState::Passive => "bus.error_passive",
        ControllerState::BusOff => "bus.off",
    }
}

/// Returns the name and the number under which the event is recorded.
pub(super) fn event_record(event: &NodeEvent) -> (&'static str, i64) {
    match event {
        NodeEvent::State { to: NodeState::BootUp, .. } => ("state.boot_up", 0),
        NodeEvent::State { to: NodeState::PreOperational, .. } => ("state.pre_operational", 0),
        NodeEvent::State { to: NodeState::Operational, .. } => ("state.operational", 0),
        NodeEvent::State { to: NodeState::Fault, .. } => ("state.fault", 0),
        NodeEvent::Emergency(emergency) => match (emergency.code, emergency.node) {
            (EmergencyCode::ScheduleSlipped, _) => ("schedule.slipped", emergency.detail as i64),
            (EmergencyCode::Leaving, Node::Plant) => ("plant.leaving", emergency.detail as i64),
            (EmergencyCode::Leaving, Node::Exciter) => ("exciter.leaving", 0),
            (code, _) => ("emergency", code as i64),
        },
        NodeEvent::Refused(refusal) => (refusal_name(*refusal), 0),
        NodeEvent::PartnerEmergency(emergency) => ("partner.emergency", emergency.code as i64),
        NodeEvent::Frame(FrameFault::Protocol(_)) => ("frame.refused", 0),
        NodeEvent::Frame(FrameFault::Mapped { id, check }) => (check_name(*check), id.raw() as i64),
        NodeEvent::OtherSender(_) => ("frame.other_sender", 0),
        NodeEvent::Lost(events) => ("events.lost", i64::try_from(*events).unwrap_or(i64::MAX)),
    }
}

/// Returns the names and numbers under which a request is recorded. A set-point is recorded in thousandths of N or N·m,
/// of a hertz and of a degree.
pub(super) fn request_records(request: &Request) -> [Option<(&'static str, i64)>; 3] {
    let thousandths = |value: f64| libm::round(value * 1e3) as i64;
    match request {
        Request::Arm => [Some(("request.arm", 0)), None, None],
        Request::Disarm => [Some(("request.disarm", 0)), None, None],
        Request::Reset => [Some(("request.reset", 0)), None, None],
        Request::Set(SetPoint { load, frequency_hz, phase_deg }) => [
            Some(("request.load_thousandths", thousandths(*load))),
            Some(("request.frequency_mhz", thousandths(*frequency_hz))),
            Some(("request.phase_mdeg", thousandths(*phase_deg))),
        ],
    }
}

/// Returns the state of a plant as it is recorded, with the load held from its sample on.
pub fn state_record(plant: &Plant, load: &Load, is_end: bool) -> Record {
    let sample = plant.sample();
    let states = *plant.states();
    let taken = plant.inputs();
    Record::State(StateRecord { sample, states, load: *load, taken, is_end })
}

/// Returns the readings of a sample as they are recorded.
pub fn sample_record(measurement: &Measurement) -> SampleRecord {
    let values = |pair: [Reading; 2]| pair.map(|reading| reading.value);
    let clipped = |pair: [Reading; 2]| pair.map(|reading| reading.clipped);
    SampleRecord {
        sample: measurement.sample,
        acceleration_b_m_s2: values(measurement.acceleration_b_m_s2),
        acceleration_c_m_s2: values(measurement.acceleration_c_m_s2),
        head_force_n: values(measurement.head_force_n),
        clipped: Clipped {
            acceleration_b: clipped(measurement.acceleration_b_m_s2),
            acceleration_c: clipped(measurement.acceleration_c_m_s2),
            head_force: clipped(measurement.head_force_n),
        },
        more: measurement.more,
    }
}
