//! Faults as numbers and by name.

use serde::Serialize;

use resonarm_protocol::{Emergency, EmergencyCode};

/// A fault, as numbers and by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// Number of the fault in the protocol's specification, section 9.
    pub code: u16,
    /// Name of the code in that section.
    pub name: &'static str,
    /// Further information; the meaning depends on the code.
    pub detail: u16,
    /// The index of the sample at which it was found.
    pub sample: u64,
}

impl Fault {
    /// Makes the fault of an emergency, which states its sample modulo 65536.
    pub(super) fn at(emergency: &Emergency, sample: u64) -> Fault {
        let Emergency { code, detail, .. } = *emergency;
        Fault { code: code as u16, name: name(code), detail, sample }
    }
}

const fn name(code: EmergencyCode) -> &'static str {
    match code {
        EmergencyCode::CommandTimeout => "command timeout",
        EmergencyCode::SensorTimeout => "sensor timeout",
        EmergencyCode::HeartbeatLost => "heartbeat lost",
        EmergencyCode::PartnerFault => "partner fault",
        EmergencyCode::Incompatible => "incompatible",
        EmergencyCode::CommandOutOfRange => "command out of range",
        EmergencyCode::SimulationFailed => "simulation failed",
        EmergencyCode::Overrun => "overrun",
        EmergencyCode::BusLoss => "bus loss",
        EmergencyCode::SampleSequence => "sample sequence",
        EmergencyCode::ScheduleSlipped => "schedule slipped",
        EmergencyCode::Leaving => "leaving",
        EmergencyCode::SecondSender => "second sender",
        EmergencyCode::ExciterTripped => "exciter tripped",
        EmergencyCode::StopRequested => "stop requested",
    }
}
