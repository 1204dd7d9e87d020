//! Conversion between a measurement and the messages of a sample.

use resonarm_protocol::{Acceleration, ImpedanceHead, Measured, Message, SensorValues, Sensors};

use crate::rig::{Measurement, Reading, Readings};

/// Returns the three messages of the classic profile, in the order of sending.
pub(super) fn classic(measurement: &Measurement) -> [Message; 3] {
    // Frames carry the index modulo 2¹⁶.
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

/// Returns the single message of the FD profile.
pub(super) fn sensors(measurement: &Measurement) -> Sensors {
    let axes = |pair: [Reading; 2]| pair.map(|r| Measured { value: r.value, saturated: r.clipped });
    let values = SensorValues {
        force_n: axes(measurement.head_force_n),
        acceleration_b_m_s2: axes(measurement.acceleration_b_m_s2),
        acceleration_c_m_s2: axes(measurement.acceleration_c_m_s2),
    };
    Sensors { values, sample: measurement.sample as u16 }
}

/// Returns the measurement of sample `n` from received values.
pub(super) fn from_values(n: u64, values: &SensorValues) -> Measurement {
    let axes = |pair: [Measured; 2]| pair.map(|m| Reading { value: m.value, clipped: m.saturated });
    Measurement {
        sample: n,
        head_force_n: axes(values.force_n),
        acceleration_b_m_s2: axes(values.acceleration_b_m_s2),
        acceleration_c_m_s2: axes(values.acceleration_c_m_s2),
        more: Readings::NONE,
    }
}
