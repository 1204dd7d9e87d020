//! The change of a backbone's frequency along it.

use alloc::vec::Vec;

/// The change of a backbone's frequency with the amplitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bending {
    /// It rises: the response curves lean to higher frequencies (stiff).
    Hardening,
    /// The frequency falls with the amplitude (soft).
    Softening,
    /// It first rises, then falls.
    HardeningThenSoftening,
    /// It first falls, then rises.
    SofteningThenHardening,
    /// It turns more than once.
    Mixed,
}

/// Relative changes of frequency below this are none.
const STILL: f64 = 1e-9;

impl Bending {
    /// The name of the kind in results.
    pub const fn name(self) -> &'static str {
        match self {
            Bending::Hardening => "hardening",
            Bending::Softening => "softening",
            Bending::HardeningThenSoftening => "hardening-then-softening",
            Bending::SofteningThenHardening => "softening-then-hardening",
            Bending::Mixed => "mixed",
        }
    }

    /// Returns how a curve with these frequencies bends; `None` if they don't change.
    pub(crate) fn of(frequencies_hz: impl Iterator<Item = f64>) -> Option<Bending> {
        let mut rises = Vec::new();
        let mut before = None::<f64>;
        for hz in frequencies_hz {
            let change = before.map_or(0.0, |before| hz / before - 1.0);
            if change.abs() > STILL {
                rises.push(change > 0.0);
            }
            before = Some(hz);
        }
        // Only the turns count, not how many points lie between them.
        rises.dedup();
        Some(match rises.as_slice() {
            [] => return None,
            [true] => Bending::Hardening,
            [false] => Bending::Softening,
            [true, false] => Bending::HardeningThenSoftening,
            [false, true] => Bending::SofteningThenHardening,
            _ => Bending::Mixed,
        })
    }
}

/// df/ds at s = 0 of a curve with points (s, f), s the square of an amplitude.
///
/// f is even in the amplitude. The parabola in s through the first point, one at about ten times its amplitude and one
/// at about thirty (or the last two of a shorter curve) has this slope at s = 0, with an error of the order of s₂s₃ f‴.
pub(crate) fn curvature(points: &[(f64, f64)]) -> Option<f64> {
    let (first, rest) = points.split_first()?;
    let (last, between) = rest.split_last()?;
    let beyond = |times: f64, among: &[(f64, f64)]| {
        among.iter().position(|point| point.0 >= times * times * first.0).unwrap_or(among.len() - 1)
    };
    let second = if between.is_empty() { return None } else { beyond(10.0, between) };
    let third = &rest[second + 1..];
    let third = third.get(beyond(30.0, third)).unwrap_or(last);
    let [(s1, f1), (s2, f2), (s3, f3)] = [*first, between[second], *third];
    // Newton's form: f = f1 + d12 (s − s1) + d123 (s − s1)(s − s2).
    let d12 = (f2 - f1) / (s2 - s1);
    let d23 = (f3 - f2) / (s3 - s2);
    let slope = d12 - (d23 - d12) / (s3 - s1) * (s1 + s2);
    slope.is_finite().then_some(slope)
}
