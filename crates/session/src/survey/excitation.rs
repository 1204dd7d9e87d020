//! What the exciter plays in a survey.

use serde::{Deserialize, Serialize};

use resonarm_bench::excitation::{Phases, SweepLaw, Waveform};
use resonarm_bench::identify::Band;

/// Periods of a multisine and of bursts in a run.
const PERIODS: u32 = 4;

/// What the exciter plays in a survey.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SurveyExcitation {
    /// Noise over the whole run.
    #[default]
    Random,
    /// Four bursts of noise, each as long as the silence after it.
    BurstRandom,
    /// Four periods of a multisine.
    Multisine,
    /// One impact at the beginning.
    Impact,
    /// A sine that sweeps through the band.
    Sine,
}

impl SurveyExcitation {
    /// All excitations, in the order of the help.
    pub const ALL: [SurveyExcitation; 5] = [
        SurveyExcitation::Random,
        SurveyExcitation::BurstRandom,
        SurveyExcitation::Multisine,
        SurveyExcitation::Impact,
        SurveyExcitation::Sine,
    ];

    /// Returns its name, as flags and files have it.
    pub const fn name(self) -> &'static str {
        match self {
            SurveyExcitation::Random => "random",
            SurveyExcitation::BurstRandom => "burst-random",
            SurveyExcitation::Multisine => "multisine",
            SurveyExcitation::Impact => "impact",
            SurveyExcitation::Sine => "sine",
        }
    }

    /// Returns whether it is made from a seed.
    pub(super) const fn has_seed(self) -> bool {
        !matches!(self, SurveyExcitation::Impact | SurveyExcitation::Sine)
    }

    /// Returns the length of a run, s, in whole samples, or in whole periods.
    pub(super) fn duration_s(self, wanted_s: f64, rate_hz: f64) -> f64 {
        match self {
            SurveyExcitation::BurstRandom | SurveyExcitation::Multisine => {
                f64::from(PERIODS) * whole_samples(wanted_s / f64::from(PERIODS), rate_hz)
            }
            _ => whole_samples(wanted_s, rate_hz),
        }
    }

    /// Returns the waveform of a run.
    pub(super) fn waveform(self, Band { from_hz, to_hz }: Band, duration_s: f64, rate_hz: f64, seed: u64) -> Waveform {
        let period_s = whole_samples(duration_s / f64::from(PERIODS), rate_hz);
        match self {
            SurveyExcitation::Random => Waveform::Random { from_hz, to_hz, duration_s, spectrum: None, seed },
            SurveyExcitation::BurstRandom => Waveform::BurstRandom {
                from_hz,
                to_hz,
                burst_s: whole_samples(0.5 * period_s, rate_hz),
                period_s,
                periods: PERIODS,
                spectrum: None,
                seed,
            },
            SurveyExcitation::Multisine => {
                Waveform::Multisine { from_hz, to_hz, period_s, periods: PERIODS, phases: Phases::Random, seed }
            }
            // The spectrum of a half sine of length τ falls by 10 dB up to 1/τ.
            SurveyExcitation::Impact => Waveform::Impulse { pulse_s: whole_samples(1.0 / to_hz, rate_hz), duration_s },
            SurveyExcitation::Sine => Waveform::SweptSine { from_hz, to_hz, duration_s, law: SweepLaw::Linear },
        }
    }
}

/// Rounds a time to whole samples, at least one, s.
fn whole_samples(time_s: f64, rate_hz: f64) -> f64 {
    libm::round(time_s * rate_hz).max(1.0) / rate_hz
}
