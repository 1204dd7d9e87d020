//! The modes of the scenario's structure that were identified, and the reasons why others were not.

use core::fmt::{self, Display, Formatter};

use serde::Serialize;

use resonarm_bench::identify::{Band, Identification, IdentifiedMode, MOST_NOISE_SHARE, Rejection};

/// Largest relative distance of a found mode from the scenario's: structures of the same make differ by less.
const SAME_MODE: f64 = 0.15;
/// Largest relative distance of a peak from the mode it is attributed to.
const NEAR: f64 = 0.05;

/// A mode of the scenario's structure that was not found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MissingMode {
    /// Number of the mode in the scenario's structure, from 1.
    pub mode: u8,
    /// Its pole frequency |λ|/(2π) in the scenario, Hz.
    pub pole_frequency_hz: f64,
    /// Reason why it was not found.
    #[serde(flatten)]
    pub reason: Reason,
}

/// Reason for which a mode was not found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "reason")]
pub enum Reason {
    /// No peak is near it.
    NoPeak,
    /// There is a peak, but no mode can be fitted to it.
    NoPole {
        /// Frequency of the peak, Hz.
        peak_hz: f64,
    },
    /// There is a peak, but the head reads too little force there.
    ForceInNoise {
        /// Frequency of the peak, Hz.
        peak_hz: f64,
        /// Share of the head's noise in the force's power.
        noise_share: f64,
    },
}

impl Display for MissingMode {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let MissingMode { mode, pole_frequency_hz, reason } = self;
        write!(f, "mode {mode}, at {pole_frequency_hz:.2} Hz in the scenario, was not found: ")?;
        match reason {
            Reason::NoPeak => write!(f, "there is no distinct peak near it; record for longer, or raise the force"),
            Reason::NoPole { peak_hz } => write!(
                f,
                "there is a peak at {peak_hz:.2} Hz, but a mode does not improve the fit; excite for longer, \
                 with a random force or a swept sine"
            ),
            Reason::ForceInNoise { peak_hz, noise_share } => write!(
                f,
                "there is a peak at {peak_hz:.2} Hz, but noise of the head is {:.0} % of the force's power there, more than \
                 {:.0} %; excite for longer, with a random force or a swept sine",
                100.0 * noise_share,
                100.0 * MOST_NOISE_SHARE
            ),
        }
    }
}

/// Returns the number of each mode that was found: that of the nearest of the structure's modes, each used once, by its
/// pole frequencies `known_hz`.
pub fn mode_numbers(found: &[IdentifiedMode], known_hz: &[f64]) -> Vec<Option<u8>> {
    // The logarithm makes the distance symmetric: twice the frequency is as far off as half of it. A mode without a
    // pole has NaN, is near nothing, and no found mode is nearer to it.
    let off = |mode: &IdentifiedMode, of_hz: f64| libm::fabs(libm::log(mode.pole_frequency_hz / of_hz));
    let nearest = |of_hz: f64| {
        let near = found.iter().enumerate().filter(|(_, mode)| off(mode, of_hz) < SAME_MODE);
        // If a found mode is near several, it belongs to the nearest one.
        let poles = || known_hz.iter().filter(|other| !other.is_nan());
        let candidates = near.filter(|(_, mode)| poles().all(|other| off(mode, of_hz) <= off(mode, *other)));
        candidates.min_by(|(_, a), (_, b)| off(a, of_hz).total_cmp(&off(b, of_hz))).map(|(index, _)| index)
    };
    let owners: Vec<Option<usize>> = known_hz.iter().map(|of_hz| nearest(*of_hz)).collect();
    let number = |index| (1..).zip(&owners).find(|(_, owner)| **owner == Some(index)).map(|(number, _)| number);
    (0..found.len()).map(number).collect()
}

/// Returns the structure's modes in the band that were not found, by its pole frequencies `known_hz`.
pub fn missing_modes(found: &Identification, numbers: &[Option<u8>], known_hz: &[f64], band: Band) -> Vec<MissingMode> {
    let is_missing = |(number, known_hz): &(u8, &f64)| {
        (band.from_hz..=band.to_hz).contains(*known_hz) && !numbers.contains(&Some(*number))
    };
    let reason = |frequency_hz: f64| {
        let off = |peak_hz: f64| libm::fabs(peak_hz / frequency_hz - 1.0);
        let near = found.rejected.iter().filter(|peak| off(peak.frequency_hz) < NEAR);
        match near.min_by(|a, b| off(a.frequency_hz).total_cmp(&off(b.frequency_hz))) {
            None => Reason::NoPeak,
            Some(peak) => match peak.reason {
                Rejection::NoPole => Reason::NoPole { peak_hz: peak.frequency_hz },
                Rejection::ForceInNoise { share } => {
                    Reason::ForceInNoise { peak_hz: peak.frequency_hz, noise_share: share }
                }
            },
        }
    };
    let modes = (1..).zip(known_hz).filter(is_missing);
    modes
        .map(|(mode, &pole_frequency_hz)| MissingMode { mode, pole_frequency_hz, reason: reason(pole_frequency_hz) })
        .collect()
}
