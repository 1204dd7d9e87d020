//! A measurement as the messages of a sample, and back; a load as a command.

use resonarm_protocol::{
    Acceleration, ForceCommand, ImpedanceHead, Measured, Message, SensorValues, Sensors, TorqueCommand,
};

use crate::arm::Load;
use crate::control::LoadKind;
use crate::rig::{Measurement, Reading};

/// The three messages of the classic profile, in the order in which they are sent.
pub(super) fn classic(measurement: &Measurement) -> [Message; 3] {
    let sample = measurement.sample as u16;
    let [x, y] = measurement.head_force_n;
    let head = ImpedanceHead {
        force_x_n: x.value,
        force_y_n: y.value,
        x_saturated: x.clipped,
        y_saturated: y.clipped,
        sample,
    };
    let acceleration = |[x, y]: [Reading; 2]| Acceleration {
        acceleration_x_m_s2: x.value,
        acceleration_y_m_s2: y.value,
        x_saturated: x.clipped,
        y_saturated: y.clipped,
        sample,
    };
    [
        Message::Head(head),
        Message::AccelerometerB(acceleration(measurement.acceleration_b_m_s2)),
        Message::AccelerometerC(acceleration(measurement.acceleration_c_m_s2)),
    ]
}

/// Sample `n` from its three messages.
pub(super) fn from_classic(n: u64, head: &ImpedanceHead, b: &Acceleration, c: &Acceleration) -> Measurement {
    let reading = |value, clipped| Reading { value, clipped };
    let axes = |a: &Acceleration| {
        [reading(a.acceleration_x_m_s2, a.x_saturated), reading(a.acceleration_y_m_s2, a.y_saturated)]
    };
    let head_force_n = [reading(head.force_x_n, head.x_saturated), reading(head.force_y_n, head.y_saturated)];
    Measurement { sample: n, head_force_n, acceleration_b_m_s2: axes(b), acceleration_c_m_s2: axes(c) }
}

/// The one message of the FD profile.
pub(super) fn sensors(measurement: &Measurement) -> Sensors {
    let axes = |pair: [Reading; 2]| pair.map(|r| Measured { value: r.value, saturated: r.clipped });
    let values = SensorValues {
        force_n: axes(measurement.head_force_n),
        acceleration_b_m_s2: axes(measurement.acceleration_b_m_s2),
        acceleration_c_m_s2: axes(measurement.acceleration_c_m_s2),
    };
    Sensors { values, sample: measurement.sample as u16 }
}

/// Sample `n` from what the instruments read.
pub(super) fn from_values(n: u64, values: &SensorValues) -> Measurement {
    let axes = |pair: [Measured; 2]| pair.map(|m| Reading { value: m.value, clipped: m.saturated });
    Measurement {
        sample: n,
        head_force_n: axes(values.force_n),
        acceleration_b_m_s2: axes(values.acceleration_b_m_s2),
        acceleration_c_m_s2: axes(values.acceleration_c_m_s2),
    }
}

/// The command that answers the sample of this index with a load.
pub(super) fn command(kind: LoadKind, load: &Load, sample: u16) -> Message {
    match kind {
        LoadKind::Torque => {
            let (torque1_nm, torque2_nm) = (load.torque_nm.x, load.torque_nm.y);
            Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample })
        }
        LoadKind::Force => {
            let (force_x_n, force_y_n) = (load.force_n.x, load.force_n.y);
            Message::Force(ForceCommand { force_x_n, force_y_n, sample })
        }
    }
}
