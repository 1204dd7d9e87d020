//! What a node tells of itself, as it is recorded.

use resonarm_protocol::node::NodeEvent;
use resonarm_protocol::{EmergencyCode, Node, NodeState, Refusal};

/// The name under which a refusal is recorded.
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

/// The name and the number under which the event is recorded.
pub(super) const fn event_record(event: &NodeEvent) -> (&'static str, i64) {
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
        NodeEvent::Frame(_) => ("frame.refused", 0),
    }
}
