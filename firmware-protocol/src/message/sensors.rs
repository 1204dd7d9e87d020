//! The readings of all instruments, as the FD profile sends them.

use super::acceleration::Acceleration;
use super::fd::{self, FdBytes, FdReader};
use super::impedance_head::ImpedanceHead;
use super::measured::Measured;
use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;

/// The readings of all instruments at one sample, each along x and y of the base frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorValues {
    /// The force at the tip, point C, in newtons.
    pub force_n: [Measured; 2],
    /// The acceleration of point B, the second joint, in m/s².
    pub acceleration_b_m_s2: [Measured; 2],
    /// The acceleration of point C, which is also that of the impedance head, in m/s².
    pub acceleration_c_m_s2: [Measured; 2],
}

/// A whole sample in one frame: the content of ImpedanceHead, AccelerometerB and AccelerometerC in the classic profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Readings of all instruments at this sample.
    pub values: SensorValues,
    /// The index of the sample, modulo 2¹⁶.
    pub sample: u16,
}

/// Two whole samples in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorPair {
    /// The readings at two successive samples.
    pub values: [SensorValues; 2],
    /// The index, modulo 2¹⁶, of the first sample.
    pub sample: u16,
}

impl SensorValues {
    const SIGNALS: [&'static str; 6] = [
        "force_x_n",
        "force_y_n",
        "acceleration_b_x_m_s2",
        "acceleration_b_y_m_s2",
        "acceleration_c_x_m_s2",
        "acceleration_c_y_m_s2",
    ];
    /// The bits of the flags: one for each signal, in their order.
    const FLAGS: u8 = 0x3F;

    /// The readings in the three messages of a sample in the classic profile.
    pub fn from_classic(head: &ImpedanceHead, b: &Acceleration, c: &Acceleration) -> SensorValues {
        SensorValues { force_n: head.axes(), acceleration_b_m_s2: b.axes(), acceleration_c_m_s2: c.axes() }
    }

    pub(super) fn all(&self) -> [Measured; 6] {
        let [a, b] = self.force_n;
        let [c, d] = self.acceleration_b_m_s2;
        let [e, f] = self.acceleration_c_m_s2;
        [a, b, c, d, e, f]
    }

    pub(super) fn from_all([a, b, c, d, e, f]: [Measured; 6]) -> SensorValues {
        SensorValues { force_n: [a, b], acceleration_b_m_s2: [c, d], acceleration_c_m_s2: [e, f] }
    }

    /// Writes the values from byte `at` on, and their flags.
    fn encode(&self, kind: MessageKind, bytes: &mut FdBytes, at: usize, flags_at: usize) -> Result<(), EncodeError> {
        for (k, (signal, measured)) in Self::SIGNALS.into_iter().zip(self.all()).enumerate() {
            let (single, beyond) = fd::measured(kind, signal, measured.value)?;
            bytes[at + 4 * k..][..4].copy_from_slice(&single.to_le_bytes());
            // Bit k of the flags belongs to signal k, in both samples of a pair.
            bytes[flags_at] |= u8::from(measured.saturated || beyond) << k;
        }
        Ok(())
    }

    fn decode(reader: &FdReader, at: usize, flags_at: usize) -> Result<SensorValues, DecodeError> {
        let flags = reader.flags(flags_at, Self::FLAGS)?;
        let mut all = [Measured::default(); 6];
        for (k, (signal, measured)) in Self::SIGNALS.into_iter().zip(&mut all).enumerate() {
            *measured = Measured { value: reader.single(signal, at + 4 * k)?, saturated: flags >> k & 1 != 0 };
        }
        Ok(SensorValues::from_all(all))
    }
}

impl Sensors {
    pub(super) fn encode(&self) -> Result<FdBytes, EncodeError> {
        let mut bytes = fd::with_sample(self.sample);
        self.values.encode(MessageKind::Sensors, &mut bytes, fd::VALUES, fd::FLAGS)?;
        Ok(bytes)
    }

    pub(super) fn decode(reader: &FdReader) -> Result<Sensors, DecodeError> {
        reader.zero(6..8)?;
        let values = SensorValues::decode(reader, fd::VALUES, fd::FLAGS)?;
        Ok(Sensors { values, sample: reader.sample() })
    }
}

impl SensorPair {
    /// The flags of the second sample.
    const SECOND_FLAGS: usize = 6;
    /// The values of the second sample.
    const SECOND_VALUES: usize = 32;

    pub(super) fn encode(&self) -> Result<FdBytes, EncodeError> {
        let kind = MessageKind::SensorPair;
        let mut bytes = fd::with_sample(self.sample);
        self.values[0].encode(kind, &mut bytes, fd::VALUES, fd::FLAGS)?;
        self.values[1].encode(kind, &mut bytes, Self::SECOND_VALUES, Self::SECOND_FLAGS)?;
        Ok(bytes)
    }

    pub(super) fn decode(reader: &FdReader) -> Result<SensorPair, DecodeError> {
        // Byte 6 has the flags of the second sample. Its values end at byte 32 + 6 · 4 = 56, and CAN FD has no length
        // between 48 and 64.
        reader.zero(7..8)?;
        reader.zero(56..64)?;
        let first = SensorValues::decode(reader, fd::VALUES, fd::FLAGS)?;
        let second = SensorValues::decode(reader, Self::SECOND_VALUES, Self::SECOND_FLAGS)?;
        Ok(SensorPair { values: [first, second], sample: reader.sample() })
    }
}
