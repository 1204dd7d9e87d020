//! A resonance zone, measured: walk, backbone, and stepped sines up and down.

use super::{Measured, measure, session};
use crate::run::{RunError, Signals};
use crate::study::on_all_cores;
use resonarm_analysis::longest_time_constant_s;
use resonarm_bench::control::{
    CancelHarmonics, ControlSpec, ForceControlSpec, ModeNumber, PhaseWalkSpec, ResponsePoint,
};
use resonarm_bench::excitation::{ExcitationSpec, Waveform};
use resonarm_bench::plant::{ShakerAcross, TestedAssembly};
use resonarm_bench::rig::{Amplifier, Load, ShakerSpec};
use resonarm_dynamics::structure::Armature;
use resonarm_scenario::structure::StructureSectionError;
use resonarm_scenario::{Scenario, ScenarioError};

/// Runs of a zone: walk, backbone, up, down.
const RUNS: usize = 4;

/// Length of a try of the stepped sine, in time constants of the slowest mode with the shaker on it: waiting, and
/// reading. A try leaves e⁻³ of its change in the head's force; of its change in the response it must leave less, as a
/// shaker that brakes takes many times what the structure does.
const SETTLE: f64 = 3.0;
const READ: f64 = 0.6;
/// Least length of a reading, periods.
const LEAST_PERIODS: f64 = 40.0;
/// Duration of a change of the force from one amplitude to the next, s.
const RAMP_S: f64 = 0.3;
/// Frequencies nearer together than this, relative, are one.
const SAME_FREQUENCY: f64 = 1e-7;

/// A resonance zone and the settings of its measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zone {
    /// The mode whose resonance is in it.
    pub mode_number: ModeNumber,
    /// Amplitude and direction of the force.
    pub amplitude: Load,
    /// Its lowest and its highest frequency, Hz.
    pub range_hz: [f64; 2],
    /// Largest distance of the stepped sine's frequencies apart from the resonance, Hz.
    pub step_hz: f64,
    /// Points of the walk, whose frequencies the stepped sines take over.
    pub walk_points: usize,
    /// Points of the backbone.
    pub backbone_points: usize,
    /// Harmonics of the force that are brought to zero in every run.
    pub cancel_harmonics: CancelHarmonics,
}

/// Results of the four runs of a zone.
#[derive(Clone, Debug)]
pub struct ZoneMeasured {
    /// The whole response at constant force, stable or not.
    pub walk: Measured,
    /// The responses at a lag of 90°, up to that force.
    pub backbone: Measured,
    /// The stepped sine up.
    pub up: Measured,
    /// The stepped sine down, from the highest frequency to the lowest.
    pub down: Measured,
}

impl Zone {
    /// Returns the largest number of responses that are read in the zone.
    pub fn responses(&self) -> usize {
        self.walk_points + self.backbone_points + 2 * (self.walk_points + self.steps() + 1)
    }

    fn steps(&self) -> usize {
        let [low_hz, high_hz] = self.range_hz;
        libm::ceil((high_hz - low_hz) / self.step_hz).max(1.0) as usize
    }

    /// Returns the phase-resonance tests of the zone: over the whole response, and along the backbone.
    fn walks(&self) -> [ControlSpec; 2] {
        let Zone { mode_number, amplitude, cancel_harmonics, .. } = *self;
        let walk = PhaseWalkSpec { points: self.walk_points, ..PhaseWalkSpec::new(amplitude) };
        let backbone = PhaseWalkSpec { points: self.backbone_points, ..PhaseWalkSpec::backbone(amplitude) };
        [walk, backbone].map(|spec| ControlSpec::PhaseWalk(PhaseWalkSpec { mode_number, cancel_harmonics, ..spec }))
    }

    /// Returns frequencies evenly over the zone, and those at which the walk has read the response: its points crowd
    /// where the response turns.
    fn frequencies_hz(&self, walked: &[ResponsePoint]) -> Vec<f64> {
        let [low_hz, high_hz] = self.range_hz;
        let steps = self.steps();
        let even = (0..=steps).map(|i| low_hz + (high_hz - low_hz) * (i as f64 / steps as f64));
        let settled = walked.iter().filter(|point| point.settled).map(|point| point.frequency_hz);
        let mut all: Vec<f64> =
            even.chain(settled.filter(|frequency_hz| (low_hz..=high_hz).contains(frequency_hz))).collect();
        all.sort_by(f64::total_cmp);
        all.dedup_by(|next, kept| *next - *kept < SAME_FREQUENCY * *kept);
        all
    }

    /// Returns a stepped sine at controlled force; `alone_s` and `coupled_s` are time constants of the slowest mode
    /// without and with the shaker.
    fn stepped(&self, frequencies_hz: Vec<f64>, (alone_s, coupled_s): (f64, f64)) -> ControlSpec {
        // After this time exp(−settle/T_coupled) = e⁻³ · T_coupled/T_alone of the change is left in the response: less
        // than e⁻³ by the ratio of the damping without the shaker to that with it.
        let settle_s = (SETTLE + libm::log(alone_s / coupled_s)) * coupled_s;
        let dwell_s = settle_s + (READ * coupled_s).max(LEAST_PERIODS / self.range_hz[0]);
        let profile = Waveform::SineList { frequencies_hz, dwell_s, settle_s };
        let excitation = ExcitationSpec { amplitude: self.amplitude, ramp_s: RAMP_S, profile };
        let spec = ForceControlSpec::new(&excitation);
        ControlSpec::ForceControl(ForceControlSpec { cancel_harmonics: self.cancel_harmonics, ..spec })
    }
}

/// Returns the armature of the scenario's shaker on the structure. In voltage mode the coil brakes with Bl²/R.
fn braked(tested: &TestedAssembly, shaker: &ShakerSpec) -> Result<Armature, ShakerAcross> {
    let mut armature = shaker.armature_at(&tested.places.exciter)?;
    if shaker.amplifier == Amplifier::Voltage {
        // A coil that moves with v has the voltage Bl·v. At a fixed voltage of the amplifier its current changes by
        // −Bl·v/R, and its force by Bl times that.
        armature.damping_n_s_m += shaker.force_factor_n_a * shaker.force_factor_n_a / shaker.resistance_ohm;
    }
    Ok(armature)
}

/// Zones to be measured, with signals that show the progress.
#[derive(Debug)]
pub struct ZoneExperiment {
    zones: Vec<Zone>,
    /// Signals of each zone's walk and backbone, then of each zone's sines up and down.
    signals: [Vec<Signals>; 2],
}

impl ZoneExperiment {
    /// Returns an experiment that measures these zones.
    pub fn new(zones: &[Zone]) -> ZoneExperiment {
        let signals = || (0..RUNS / 2 * zones.len()).map(|_| Signals::default()).collect();
        ZoneExperiment { zones: zones.to_vec(), signals: [signals(), signals()] }
    }

    /// Returns the number of responses read so far.
    pub fn responses(&self) -> u64 {
        self.signals.iter().flatten().map(Signals::responses).sum()
    }

    /// Asks all runs to end in order.
    pub fn stop(&self) {
        self.signals.iter().flatten().for_each(Signals::stop);
    }

    fn walks(&self) -> impl Iterator<Item = ControlSpec> + '_ {
        self.zones.iter().flat_map(Zone::walks)
    }

    /// Checks that the walks can start: errors in a scenario or a zone are found before anything runs.
    ///
    /// # Errors
    /// [`RunError`] with the reason.
    pub fn check(&self, scenario: &Scenario) -> Result<(), RunError> {
        self.walks().try_for_each(|control| session(scenario, control).map(drop))
    }

    /// Measures the zones with the structure, the instruments and the shaker of a scenario: first walks and backbones, then
    /// the stepped sines, over all cores.
    ///
    /// [`RunError`] if a run can't start, or an error ends it.
    pub fn measure(&self, scenario: &Scenario) -> Result<Vec<ZoneMeasured>, RunError> {
        let tested = scenario.under_test()?;
        let armature = scenario.rig.shaker.as_ref().map(|shaker| braked(&tested, shaker)).transpose();
        let armature = armature.map_err(|across| ScenarioError::from(StructureSectionError::from(across)))?;
        let [alone_s, coupled_s] =
            [None, armature.as_ref()].map(|armature| longest_time_constant_s(&tested.assembly, armature));
        let constants_s = (alone_s, coupled_s);
        let run = |(control, signals): &(ControlSpec, &Signals)| measure(scenario, control.clone(), signals);
        self.check(scenario)?;
        let [for_walks, for_sines] = &self.signals;
        let walks = self.walks().zip(for_walks).collect::<Vec<_>>();
        // The sines need the frequencies of the walks, so all walks come first. Runs are independent of each other,
        // and their results do not depend on the number of cores.
        let walks = on_all_cores(&walks, run, || ()).into_iter().collect::<Result<Vec<_>, _>>()?;
        let sines = self.zones.iter().zip(walks.chunks_exact(2)).flat_map(|(zone, walks)| {
            let up_hz = zone.frequencies_hz(&walks[0].points);
            let down_hz = up_hz.iter().rev().copied().collect();
            [zone.stepped(up_hz, constants_s), zone.stepped(down_hz, constants_s)]
        });
        let sines = sines.zip(for_sines).collect::<Vec<_>>();
        let sines = on_all_cores(&sines, run, || ()).into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut walks = walks.into_iter();
        let mut sines = sines.into_iter();
        let mut measured = Vec::with_capacity(self.zones.len());
        while let (Some(walk), Some(backbone), Some(up), Some(down)) =
            (walks.next(), walks.next(), sines.next(), sines.next())
        {
            measured.push(ZoneMeasured { walk, backbone, up, down });
        }
        Ok(measured)
    }
}

impl ZoneMeasured {
    /// Returns the length of all runs together, s of simulated time.
    pub fn simulated_s(&self) -> f64 {
        self.runs().iter().map(|run| run.simulated_s).sum()
    }

    /// Returns the four runs: walk, backbone, up, down.
    pub fn runs(&self) -> [&Measured; RUNS] {
        [&self.walk, &self.backbone, &self.up, &self.down]
    }
}
