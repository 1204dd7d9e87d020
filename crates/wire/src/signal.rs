//! Physical values of signals: value = scale · raw + offset.

use thiserror::Error;

use crate::layout::{InsertError, Layout, Number};

/// Largest width of an integer that an f64 represents exactly, bits.
pub const F64_INTEGER_BITS: u8 = 53;

/// Reason why a signal can't have a physical value.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SignalError {
    /// The scale is zero or not finite.
    #[error("its factor is {got}: it must be a finite number other than 0")]
    Scale {
        /// Scale that was given.
        got: f64,
    },
    /// The offset is not finite.
    #[error("its offset is {got}: it must be a finite number")]
    Offset {
        /// Offset that was given.
        got: f64,
    },
    /// The integer has more bits than an f64 represents exactly.
    #[error(
        "it is an integer of {bits} bits: it must have at most {F64_INTEGER_BITS}, which a floating-point number represents exactly"
    )]
    BeyondF64 {
        /// Width of the integer, bits.
        bits: u8,
    },
    /// The largest or the smallest value is not finite.
    #[error("with factor {scale} and offset {offset} its values go beyond the range of floating-point numbers")]
    Range {
        /// Scale that was given.
        scale: f64,
        /// Offset that was given.
        offset: f64,
    },
}

/// Reason why a value can't be written into a payload.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum EncodeError {
    /// The value is NaN or infinite.
    #[error("{value} is not a finite number")]
    NotFinite {
        /// Value that was given.
        value: f64,
    },
    /// The value is outside the range of the bits.
    #[error("{value} is outside of {least} to {most}, the range of its bits")]
    OutOfRange {
        /// Value that was given.
        value: f64,
        /// Least value that the bits can represent.
        least: f64,
        /// Largest value that the bits can represent.
        most: f64,
    },
    /// The layout rejects the raw number.
    #[error(transparent)]
    Insert(#[from] InsertError),
}

/// A signal with a physical value. All values of this type are valid, since the constructor checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    layout: Layout,
    scale: f64,
    offset: f64,
}

impl Signal {
    /// Returns a signal with the value scale · raw + offset, in the unit of both.
    ///
    /// # Errors
    /// [`SignalError`] if the scale is 0 or not finite, the offset is not finite, or an integer's largest value is not
    /// finite.
    pub fn new(layout: Layout, scale: f64, offset: f64) -> Result<Signal, SignalError> {
        if !scale.is_finite() || scale == 0.0 {
            return Err(SignalError::Scale { got: scale });
        }
        if !offset.is_finite() {
            return Err(SignalError::Offset { got: offset });
        }
        let signal = Signal { layout, scale, offset };
        // Only the ends need a check, as the value is monotonic in the raw number. A floating-point signal may
        // reach infinity.
        if layout.number() != Number::Float && !signal.ends().iter().all(|end| end.is_finite()) {
            return Err(SignalError::Range { scale, offset });
        }
        Ok(signal)
    }

    /// Checks that an `f64` represents each raw number exactly; an integer of more bits is rounded.
    ///
    /// # Errors
    /// [`SignalError::BeyondF64`].
    pub fn check_exact(&self) -> Result<(), SignalError> {
        if self.layout.number() != Number::Float && self.layout.bits() > F64_INTEGER_BITS {
            return Err(SignalError::BeyondF64 { bits: self.layout.bits() });
        }
        Ok(())
    }

    /// Returns the place and format of its bits.
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the value of one count, in the unit of the signal.
    pub const fn scale(&self) -> f64 {
        self.scale
    }

    /// Returns the value at raw 0, in the unit of the signal.
    pub const fn offset(&self) -> f64 {
        self.offset
    }

    /// Decodes the value in a payload; `None` if the payload ends before the signal. A floating-point signal
    /// may be NaN or infinite, which its user must reject.
    pub fn decode(&self, payload: &[u8]) -> Option<f64> {
        self.layout.extract_f64(payload).map(|raw| self.value(raw))
    }

    /// Encodes the closest value that the bits can represent, (value − offset)/scale rounded half to even, and
    /// leaves all other bits unchanged.
    ///
    /// # Errors
    /// [`EncodeError`] if the value is not finite or outside of [`Signal::range`] by more than half a count, or the
    /// payload ends before the signal; the payload is then unchanged.
    pub fn encode(&self, value: f64, payload: &mut [u8]) -> Result<(), EncodeError> {
        if !value.is_finite() {
            return Err(EncodeError::NotFinite { value });
        }
        let raw = (value - self.offset) / self.scale;
        let raw = if self.layout.number() == Number::Float { raw } else { libm::rint(raw) };
        // Written as a negated range check, so that a raw number that overflows to infinity or NaN counts as
        // out of range.
        if !(self.raw_ends()[0]..=self.raw_ends()[1]).contains(&raw) {
            let [least, most] = self.range();
            return Err(EncodeError::OutOfRange { value, least, most });
        }
        Ok(self.layout.insert_f64(raw, payload)?)
    }

    /// Returns the least and the largest value that the bits can represent, in the unit of the signal;
    /// [`Signal::encode`] rejects values beyond. They may be infinite for a floating-point signal with a large
    /// scale.
    pub fn range(&self) -> [f64; 2] {
        let [one, other] = self.ends();
        [one.min(other), one.max(other)]
    }

    /// Returns the distance between neighbouring values, in the unit of the signal; `None` for a floating-point
    /// signal, where it depends on the value.
    pub fn resolution(&self) -> Option<f64> {
        (self.layout.number() != Number::Float).then_some(self.scale.abs())
    }

    fn value(&self, raw: f64) -> f64 {
        raw * self.scale + self.offset
    }

    fn ends(&self) -> [f64; 2] {
        self.raw_ends().map(|raw| self.value(raw))
    }

    /// Returns the least and the largest raw number: 0 to 2ⁿ − 1, or −2ⁿ⁻¹ to 2ⁿ⁻¹ − 1 for n bits.
    fn raw_ends(&self) -> [f64; 2] {
        let mask = self.layout.mask();
        match self.layout.number() {
            Number::Unsigned => [0.0, mask as f64],
            Number::Signed => [-((mask / 2) as f64) - 1.0, (mask / 2) as f64],
            Number::Float if self.layout.bits() == 32 => [-f64::from(f32::MAX), f64::from(f32::MAX)],
            Number::Float => [f64::MIN, f64::MAX],
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::layout::{ByteOrder, LayoutError};

    fn signal(bits: u64, number: Number, scale: f64, offset: f64) -> Result<Signal, SignalError> {
        let layout: Result<Layout, LayoutError> = Layout::new(8, bits, ByteOrder::Intel, number, 16);
        Signal::new(layout.unwrap(), scale, offset)
    }

    proptest! {
        #[test]
        fn every_raw_number_comes_back(
            bits in 1_u64..=53, raw in any::<u64>(), signed in any::<bool>(), down in any::<bool>()
        ) {
            let scale = if down { -0.02 } else { 0.02 };
            let number = if signed { Number::Signed } else { Number::Unsigned };
            let signal = signal(bits, number, scale, -40.0).unwrap();
            let mut payload = [0x77; 16];
            signal.layout().insert_u64(raw & signal.layout().mask(), &mut payload).unwrap();
            let value = signal.decode(&payload).unwrap();
            let [least, most] = signal.range();
            prop_assert!((least..=most).contains(&value));
            // Near 2⁵³ counts the offset takes the last bits of the sum.
            if bits < 45 {
                let before = payload;
                signal.encode(value, &mut payload).unwrap();
                prop_assert_eq!(payload, before);
            }
        }
    }

    #[test]
    fn rounds_to_the_nearest_and_never_limits() {
        let signal = signal(8, Number::Signed, 0.5, 0.0).unwrap();
        assert_eq!(signal.range(), [-64.0, 63.5]);
        assert_eq!(signal.resolution(), Some(0.5));
        let mut payload = [0; 4];
        for (value, raw) in [(1.2, 2), (1.3, 3), (0.25, 0), (0.75, 2), (-64.2, -128), (63.74, 127)] {
            signal.encode(value, &mut payload).unwrap();
            assert_eq!(signal.layout().extract_i64(&payload), Some(raw), "{value}");
        }
        let beyond = EncodeError::OutOfRange { value: 63.8, least: -64.0, most: 63.5 };
        assert_eq!(signal.encode(63.8, &mut payload), Err(beyond));
        assert_eq!(beyond.to_string(), "63.8 is outside of -64 to 63.5, the range of its bits");
        let infinite = Err(EncodeError::NotFinite { value: f64::INFINITY });
        assert_eq!(signal.encode(f64::INFINITY, &mut payload), infinite);
        let short = EncodeError::Insert(InsertError::Short { got: 1, needed: 2 });
        assert_eq!(signal.encode(0.0, &mut payload[..1]), Err(short));
        assert_eq!(signal.decode(&payload[..1]), None);
    }

    #[test]
    fn a_floating_point_signal_may_be_nan_and_is_never_made_so() {
        let signal = signal(32, Number::Float, 1.0, 0.0).unwrap();
        let mut payload = [0xFF; 5];
        assert!(signal.decode(&payload).unwrap().is_nan());
        assert!(signal.encode(f64::NAN, &mut payload).is_err());
        assert!(signal.encode(1e39, &mut payload).is_err());
        signal.encode(0.1, &mut payload).unwrap();
        assert_eq!(signal.decode(&payload), Some(f64::from(0.1_f32)));
        assert_eq!(signal.resolution(), None);
    }

    #[test]
    fn refuses_what_has_no_value() {
        assert_eq!(signal(8, Number::Signed, 0.0, 0.0), Err(SignalError::Scale { got: 0.0 }));
        assert_eq!(signal(8, Number::Signed, f64::INFINITY, 0.0), Err(SignalError::Scale { got: f64::INFINITY }));
        assert!(signal(8, Number::Signed, 1.0, f64::NAN).is_err());
        let exact = |bits| signal(bits, Number::Unsigned, 1.0, 0.0).unwrap().check_exact();
        assert_eq!((exact(53), exact(54)), (Ok(()), Err(SignalError::BeyondF64 { bits: 54 })));
        assert_eq!(signal(8, Number::Signed, 1e307, 0.0), Err(SignalError::Range { scale: 1e307, offset: 0.0 }));
        assert!(signal(64, Number::Float, 1.0, 0.0).is_ok());
    }
}
