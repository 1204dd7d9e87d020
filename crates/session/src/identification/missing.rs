//! The modes of the scenario's structure that were identified, and the reasons why others were not.

use core::fmt::{self, Display, Formatter};

use serde::Serialize;

use resonarm_bench::identify::{Band, MOST_NOISE_SHARE, Record};

/// Largest relative distance of a found mode from the scenario's: structures of the same make differ by less.
const SAME_MODE: f64 = 0.15;

/// A pole of the scenario's structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPole {
    /// Frequency |λ|/(2π), Hz; not a number for a mode that does not oscillate, so that nothing is near it.
    pub frequency_hz: f64,
    /// Damping ratio −Re λ/|λ|.
    pub damping_ratio: f64,
}

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
    /// The readings are as likely without it.
    NotLikelier,
    /// The head reads too little force there.
    ForceInNoise {
        /// Share of the head's noise in the force's power.
        noise_share: f64,
    },
}

impl Display for MissingMode {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let MissingMode { mode, pole_frequency_hz, reason } = self;
        write!(f, "mode {mode}, at {pole_frequency_hz:.2} Hz in the scenario, was not found: ")?;
        match reason {
            Reason::NotLikelier => write!(
                f,
                "the readings are as likely without it; record for longer, raise the force, or place exciter and accelerometers \
                 where it moves"
            ),
            Reason::ForceInNoise { noise_share } => write!(
                f,
                "noise of the head is {:.0} % of the force's power there, more than {:.0} %; excite for longer, with a random \
                 force or a swept sine",
                100.0 * noise_share,
                100.0 * MOST_NOISE_SHARE
            ),
        }
    }
}

/// Returns the number of each mode that was found, by its pole frequency: that of the nearest of the structure's modes, each
/// used once, by their pole frequencies `known_hz`.
pub fn mode_numbers(found_hz: &[f64], known_hz: &[f64]) -> Vec<Option<u8>> {
    // The logarithm makes the distance symmetric: twice the frequency is as far off as half of it. A mode without a
    // pole has NaN, is near nothing, and no found mode is nearer to it.
    let off = |found_hz: f64, of_hz: f64| libm::fabs(libm::log(found_hz / of_hz));
    let nearest = |of_hz: f64| {
        let near = found_hz.iter().enumerate().filter(|(_, found)| off(**found, of_hz) < SAME_MODE);
        // If a found mode is near several, it belongs to the nearest one.
        let poles = || known_hz.iter().filter(|other| !other.is_nan());
        let candidates = near.filter(|(_, found)| poles().all(|other| off(**found, of_hz) <= off(**found, *other)));
        candidates.min_by(|(_, a), (_, b)| off(**a, of_hz).total_cmp(&off(**b, of_hz))).map(|(index, _)| index)
    };
    let owners: Vec<Option<usize>> = known_hz.iter().map(|of_hz| nearest(*of_hz)).collect();
    let number = |index| (1..).zip(&owners).find(|(_, owner)| **owner == Some(index)).map(|(number, _)| number);
    (0..found_hz.len()).map(number).collect()
}

/// Returns the structure's modes in the band that were not found in the records, by its poles.
pub fn missing_modes(records: &[&Record], numbers: &[Option<u8>], known: &[KnownPole], band: Band) -> Vec<MissingMode> {
    let is_missing = |(number, pole): &(u8, &KnownPole)| {
        (band.from_hz..=band.to_hz).contains(&pole.frequency_hz) && !numbers.contains(&Some(*number))
    };
    let reason = |pole: &KnownPole| {
        let shares = records.iter().map(|record| record.noise_share(pole.frequency_hz, pole.damping_ratio));
        let noise_share = shares.fold(1.0, f64::min);
        if noise_share > MOST_NOISE_SHARE { Reason::ForceInNoise { noise_share } } else { Reason::NotLikelier }
    };
    let missing = (1..).zip(known).filter(is_missing);
    missing
        .map(|(mode, pole)| MissingMode { mode, pole_frequency_hz: pole.frequency_hz, reason: reason(pole) })
        .collect()
}
