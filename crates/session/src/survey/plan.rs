//! Plans of surveys: from a scenario and a request to the scenarios of all runs.

use core::fmt;
use std::collections::BTreeMap;

use serde_json::json;

use super::error::SurveyError;
use super::excitation::SurveyExcitation;
use super::index::{LeftOut, PlanSummary, RunState, SurveyRun};
use resonarm_analysis::structure_poles;
use resonarm_bench::excitation::{ExcitationSpec, Waveform};
use resonarm_bench::identify::Band;
use resonarm_bench::plant::TestedAssembly;
use resonarm_bench::rig::{InstrumentName, Load, MOST_MORE, Measured, PlaceName, SensorSpec, SensorSpecs};
use resonarm_dynamics::structure::Assembly;
use resonarm_numeric::noise::Noise;
use resonarm_scenario::{NetworkSection, Scenario, ScenarioError};

/// Largest number of accelerometers of a run besides the one at the exciter: B, and a channel for each other one.
pub const MOST_ACCELEROMETERS: usize = 1 + MOST_MORE;

/// Highest frequency of a band, as a part of the sample rate: beyond it the converters see images of the held force.
const HIGHEST_PART: f64 = 0.4;
/// Lowest frequency of a band over that of its first mode, and highest over that of its last one.
const BELOW_FIRST: f64 = 0.5;
const ABOVE_LAST: f64 = 1.3;
/// Lines of a whole record in the least half-power bandwidth, and the range of the durations that follow, s.
const LINES: f64 = 16.0;
const DURATIONS_S: [f64; 2] = [10.0, 600.0];
/// Modes below this part of the highest frequency are rigid: rounding of the matrices' entries gives them frequencies.
const RIGID: f64 = 1e-4;

impl fmt::Display for SurveyExcitation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A survey as it is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveyRequest {
    /// Points or degrees of freedom of the exciter; a point stands for all of its degrees of freedom. Empty takes where the
    /// scenario's load acts.
    pub exciters: Vec<String>,
    /// Groups of points or degrees of freedom of the accelerometers, a run for each. Empty takes all degrees of freedom, in as
    /// many groups as are needed.
    pub sensors: Vec<Vec<String>>,
    /// Factors of the force, positive, each once.
    pub levels: Vec<f64>,
    /// Peak force at level 1, N, positive; `None` takes that of the scenario.
    pub force_n: Option<f64>,
    /// What the exciter plays.
    pub excitation: SurveyExcitation,
    /// Highest mode in the band, from 1; `None` takes the highest one that the sample rate allows.
    pub highest_mode: Option<usize>,
    /// Lowest frequency, Hz; `None` is half of the first mode's.
    pub from_hz: Option<f64>,
    /// Highest frequency, Hz; `None` is 1.3 times the highest mode's, and not above the geometric mean with the next one.
    pub to_hz: Option<f64>,
    /// Length of a run, s; `None` has 16 lines in the least half-power bandwidth of the modes in the band, within 10 to 600 s.
    pub duration_s: Option<f64>,
    /// The seed from which those of all runs are derived.
    pub seed: u64,
}

/// A run with its whole scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedRun {
    /// The entry in the index.
    pub entry: SurveyRun,
    /// The scenario that is recorded.
    pub scenario: Scenario,
}

/// The runs of a survey.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveyPlan {
    /// What they have in common.
    pub summary: PlanSummary,
    /// The runs, by level, place of the exciter and group of accelerometers.
    pub runs: Vec<PlannedRun>,
}

/// A mode with its pole.
struct Known {
    number: usize,
    frequency_hz: f64,
    bandwidth_hz: f64,
}

impl SurveyPlan {
    /// Plans the runs of a survey of the scenario's structure with its instruments.
    ///
    /// Each run has the scenario's simulation, head and accelerometer C, which is where the force acts. Accelerometers at the
    /// other degrees of freedom are like those that the scenario has there, and otherwise like C. Other sensors, the bus, a user
    /// protocol and a control law play no part.
    ///
    /// # Errors
    /// [`SurveyError`] with what the structure or the instruments do not allow.
    pub fn new(base: &Scenario, request: &SurveyRequest) -> Result<SurveyPlan, SurveyError> {
        if base.foreign_structure().is_some() {
            return Err(SurveyError::NoEquations { kind: base.structure.kind });
        }
        // Without the rig: places that the plan replaces don't matter.
        let assembly = base.structure.assembly().map_err(ScenarioError::from)?;
        let exciters = match request.exciters.as_slice() {
            [] => driven(base, &base.under_test()?),
            given => resolved(&assembly, "--exciters", given)?,
        };
        let mut groups = groups(&assembly, &request.sensors)?;
        // Every force is measured together with the motion at all the others, so that shapes of any driving point are whole.
        for exciter in &exciters {
            if !groups.iter().any(|group| group.contains(exciter)) {
                groups.iter_mut().take(1).for_each(|first| first.push(exciter.clone()));
            }
        }
        check_levels(&request.levels)?;
        let force_n = force_n(base, request.force_n)?;
        let modes = known(&assembly);
        let band = band(&modes, request, base.simulation.rate_hz)?;
        let in_band = || modes.iter().filter(|mode| (band.from_hz..=band.to_hz).contains(&mode.frequency_hz));
        let bandwidth_hz = in_band().map(|mode| mode.bandwidth_hz).fold(f64::INFINITY, f64::min);
        let wanted_s = match request.duration_s {
            Some(given) if given.is_finite() && given > 0.0 => given,
            Some(got) => return Err(positive("--duration-s", got)),
            None => match in_band().find(|mode| mode.bandwidth_hz <= 0.0) {
                Some(undamped) => return Err(SurveyError::Undamped { mode: undamped.number }),
                None => libm::ceil((LINES / bandwidth_hz).clamp(DURATIONS_S[0], DURATIONS_S[1])),
            },
        };
        let duration_s = request.excitation.duration_s(wanted_s, base.simulation.rate_hz);
        let left_out = modes.iter().filter_map(|mode| {
            let place = match mode.frequency_hz {
                hz if hz.is_nan() => "rigid",
                hz if hz < band.from_hz => "below",
                hz if hz > band.to_hz => "above",
                _ => return None,
            };
            Some(LeftOut { mode: mode.number, place: place.to_owned() })
        });
        let summary = PlanSummary {
            seed: request.seed,
            excitation: request.excitation,
            from_hz: band.from_hz,
            to_hz: band.to_hz,
            duration_s,
            rate_hz: base.simulation.rate_hz,
            force_n,
            levels: request.levels.clone(),
            exciters: exciters.clone(),
            sensors: groups.clone(),
            modes: in_band().map(|mode| mode.number).collect(),
            left_out: left_out.collect(),
            // Without a mode in a band that was given there is none, and JSON has no infinity.
            bandwidth_hz: if bandwidth_hz.is_finite() { bandwidth_hz } else { 0.0 },
            scenario: json!(base),
        };
        let mut runs: Vec<PlannedRun> = Vec::new();
        let total = request.levels.len() * exciters.len() * groups.len();
        for level in &request.levels {
            for exciter in &exciters {
                for (group, sensors) in groups.iter().enumerate() {
                    let number = runs.len() + 1;
                    let mut others = sensors.clone();
                    others.retain(|at| at != exciter);
                    if others.len() > MOST_ACCELEROMETERS {
                        let got = others.len();
                        let most = MOST_ACCELEROMETERS;
                        return Err(SurveyError::TooManySensors { group: group + 1, got, most });
                    }
                    let scenario = run_scenario(base, &summary, (number as u64, *level), exciter, &others)?;
                    // The waveforms of the others differ by their seeds alone.
                    if runs.is_empty() {
                        scenario.profile()?;
                    }
                    runs.push(planned(&summary, (number, total), *level, exciter, others, scenario));
                }
            }
        }
        Ok(SurveyPlan { summary, runs })
    }
}

/// Returns the entry of a run with its scenario.
fn planned(
    summary: &PlanSummary,
    (number, total): (usize, usize),
    level: f64,
    exciter: &str,
    others: Vec<String>,
    scenario: Scenario,
) -> PlannedRun {
    let digits = total.to_string().len().max(2);
    let excitation_seed = match scenario.excitation.as_ref().map(|excitation| &excitation.profile) {
        Some(Waveform::Random { seed, .. } | Waveform::BurstRandom { seed, .. } | Waveform::Multisine { seed, .. }) => {
            Some(*seed)
        }
        _ => None,
    };
    let entry = SurveyRun {
        file: format!("run-{number:0digits$}.mcap").into(),
        level,
        force_n: Some(level * summary.force_n),
        exciter: vec![exciter.to_owned()],
        sensors: [vec![exciter.to_owned()], others].concat(),
        seed: Some(scenario.simulation.seed),
        excitation_seed,
        duration_s: summary.duration_s,
        state: RunState::Planned,
        reason: None,
    };
    PlannedRun { entry, scenario }
}

/// Returns the scenario of a run by its number, from 1, and its level.
fn run_scenario(
    base: &Scenario,
    summary: &PlanSummary,
    (number, level): (u64, f64),
    exciter: &str,
    others: &[String],
) -> Result<Scenario, SurveyError> {
    let mut scenario = base.clone();
    // A stream for each run, so that other runs don't change its seeds. 53 bits, which JSON readers keep exactly.
    let mut seeds = Noise::new(summary.seed, number);
    let mut seed = || seeds.bits() >> 11;
    scenario.simulation.seed = seed();
    scenario.simulation.duration_s = None;
    scenario.network = NetworkSection::default();
    scenario.wire = None;
    scenario.control = None;
    let band = Band { from_hz: summary.from_hz, to_hz: summary.to_hz };
    let excitation_seed = if summary.excitation.has_seed() { seed() } else { 0 };
    let profile = summary.excitation.waveform(band, summary.duration_s, summary.rate_hz, excitation_seed);
    // At a degree of freedom the exciter pushes along it alone, which is its x.
    let amplitude = Load::force_n(level * summary.force_n, 0.0);
    scenario.excitation = Some(ExcitationSpec { amplitude, ramp_s: 0.0, profile });
    let rig = &mut scenario.rig;
    rig.exciter.at = Some(place(exciter)?);
    if let Some(shaker) = &mut rig.shaker {
        shaker.direction_deg = 0.0;
    }
    let SensorSpecs { b, c, more: known } = core::mem::take(&mut rig.sensors);
    // The scenario's accelerometer at a place, or one like C there. Gravity is a constant, which only an axis y reads.
    let sensor = |at: &str| -> Result<SensorSpec, SurveyError> {
        let is_there = |sensor: &&SensorSpec| {
            sensor.measures == Measured::Acceleration && sensor.at.as_ref().is_some_and(|place| place.as_str() == at)
        };
        let own = [&b].into_iter().chain(known.values()).find(is_there).unwrap_or(&c);
        Ok(SensorSpec { at: Some(place(at)?), gravity_m_s2: None, ..*own })
    };
    let (first, rest) = match others {
        [] => (exciter, others),
        [first, rest @ ..] => (first.as_str(), rest),
    };
    let mut more = BTreeMap::new();
    for (at, number) in rest.iter().zip(1..) {
        // Two digits, as there are at most 26: no name is longer than they may be.
        let name = format!("s{number:02}");
        if let Some(name) = InstrumentName::new(&name) {
            more.insert(name, sensor(at)?);
        }
    }
    let driving = SensorSpec { at: Some(place(exciter)?), gravity_m_s2: None, ..c };
    rig.sensors = SensorSpecs { b: sensor(first)?, c: driving, more };
    // B, and sensors with names, are others than the scenario's.
    let is_same = |name: InstrumentName| [InstrumentName::HEAD, InstrumentName::C].contains(&name);
    rig.faults.retain(|fault| is_same(fault.instrument));
    if let Some(limits) = &mut scenario.limits {
        limits.sensors.retain(|name, _| is_same(*name));
    }
    scenario.check()?;
    scenario.wire_rate_hz()?;
    scenario.under_test()?;
    Ok(scenario)
}

/// Rounds a positive frequency to four digits.
fn rounded(hz: f64) -> f64 {
    let scale = libm::exp10(3.0 - libm::floor(libm::log10(hz)));
    libm::round(hz * scale) / scale
}

fn positive(flag: &'static str, got: f64) -> SurveyError {
    SurveyError::Value { flag, got, expected: String::from("a positive number") }
}

/// Returns a name as a place of the rig.
fn place(name: &str) -> Result<PlaceName, SurveyError> {
    PlaceName::new(name).ok_or_else(|| SurveyError::LongPlace { got: name.to_owned() })
}

/// Returns the degrees of freedom along which a structure moves, by name: without angles and a moving base.
pub fn displacements(assembly: &Assembly) -> Vec<String> {
    let moves = |name: &String| assembly.dof(name).is_ok_and(|dof| !dof.is_angle() && !dof.is_base());
    assembly.dof_names().into_iter().filter(moves).collect()
}

/// Returns the degrees of freedom of points or degrees of freedom, each once.
fn resolved(assembly: &Assembly, flag: &'static str, given: &[String]) -> Result<Vec<String>, SurveyError> {
    let all = displacements(assembly);
    let mut found: Vec<String> = Vec::new();
    for got in given {
        let of_point = |name: &&String| name.rsplit_once('.').is_some_and(|(point, _)| point == got);
        let mut these: Vec<&String> = all.iter().filter(|name| *name == got).collect();
        if these.is_empty() {
            these = all.iter().filter(of_point).collect();
        }
        if these.is_empty() {
            return Err(SurveyError::Place { flag, got: got.clone(), known: all.join(", ") });
        }
        for name in these {
            if !found.contains(name) {
                found.push(name.clone());
            }
        }
    }
    Ok(found)
}

/// Returns the degrees of freedom at which the scenario's force acts; without a force the first one of the exciter.
fn driven(base: &Scenario, tested: &TestedAssembly) -> Vec<String> {
    let force = base.amplitude().filter(|load| load.has_force());
    let acting = force.map_or(Vec::new(), |load| tested.driven(load));
    let acting: Vec<_> = acting.into_iter().map(|(dof, _)| dof).filter(|dof| !dof.is_angle()).collect();
    let [x, y] = tested.places.exciter.along;
    let first = [x, y, tested.places.exciter_z].into_iter().flatten().next();
    let dofs = if acting.is_empty() { first.into_iter().collect() } else { acting };
    dofs.into_iter().map(|dof| tested.dof_name(dof)).collect()
}

/// Returns the degrees of freedom of each group of accelerometers.
fn groups(assembly: &Assembly, given: &[Vec<String>]) -> Result<Vec<Vec<String>>, SurveyError> {
    if given.is_empty() {
        return Ok(displacements(assembly).chunks(MOST_ACCELEROMETERS).map(<[String]>::to_vec).collect());
    }
    given.iter().map(|group| resolved(assembly, "--sensors", group)).collect()
}

fn check_levels(levels: &[f64]) -> Result<(), SurveyError> {
    for (index, level) in levels.iter().enumerate() {
        if !(level.is_finite() && *level > 0.0) {
            return Err(positive("--levels", *level));
        }
        if levels[..index].contains(level) {
            return Err(SurveyError::SameLevel { level: *level });
        }
    }
    Ok(())
}

/// Returns the peak force at level 1.
fn force_n(base: &Scenario, given: Option<f64>) -> Result<f64, SurveyError> {
    match given {
        Some(force_n) if force_n.is_finite() && force_n > 0.0 => Ok(force_n),
        Some(got) => Err(positive("--force-n", got)),
        None => base
            .amplitude()
            .map(|load| load.force_n.norm())
            .filter(|force_n| *force_n > 0.0)
            .ok_or(SurveyError::NoForce),
    }
}

/// Returns the modes of a structure with the poles of the damped one. Rigid ones have no frequency: it is not a number.
fn known(assembly: &Assembly) -> Vec<Known> {
    let poles = structure_poles(assembly);
    let frequency_hz = |index: usize| poles[index].map_or(f64::NAN, |pole| pole.pole_frequency_hz);
    let highest_hz = (0..poles.len()).map(frequency_hz).fold(0.0, f64::max);
    let mode = |index: usize| {
        let hz = frequency_hz(index);
        let is_rigid = hz.is_nan() || hz <= RIGID * highest_hz;
        let damping_ratio = poles[index].map_or(0.0, |pole| pole.pole_damping_ratio);
        Known {
            number: index + 1,
            frequency_hz: if is_rigid { f64::NAN } else { hz },
            bandwidth_hz: 2.0 * damping_ratio * hz,
        }
    };
    (0..poles.len()).map(mode).collect()
}

/// Returns the band of a survey.
fn band(modes: &[Known], request: &SurveyRequest, rate_hz: f64) -> Result<Band, SurveyError> {
    let highest_hz = HIGHEST_PART * rate_hz;
    let vibrating: Vec<&Known> = modes.iter().filter(|mode| !mode.frequency_hz.is_nan()).collect();
    let first = vibrating.first().ok_or(SurveyError::Rigid)?;
    let fits = |mode: &&&Known| mode.frequency_hz * ABOVE_LAST <= highest_hz;
    let last = match request.highest_mode {
        None => vibrating.iter().rfind(fits),
        Some(number) => {
            let Some(wanted) = vibrating.iter().find(|mode| mode.number == number) else {
                let numbers: Vec<String> = vibrating.iter().map(|mode| mode.number.to_string()).collect();
                let expected = format!("the number of a mode that vibrates: {}", numbers.join(", "));
                return Err(SurveyError::Value { flag: "--highest-mode", got: number as f64, expected });
            };
            if !fits(&wanted) && request.to_hz.is_none() {
                let needed_hz = libm::ceil(wanted.frequency_hz * ABOVE_LAST / HIGHEST_PART);
                let expected = format!(
                    "a mode that the sample rate of {rate_hz} Hz allows; this one, at {:.1} Hz, needs simulation.rate_hz of {needed_hz}",
                    wanted.frequency_hz
                );
                return Err(SurveyError::Value { flag: "--highest-mode", got: number as f64, expected });
            }
            Some(wanted)
        }
    };
    let to_hz = match (request.to_hz, last) {
        (Some(given), _) => given,
        (None, Some(last)) => {
            let next = vibrating.iter().find(|mode| mode.number > last.number);
            // On the logarithmic axis of a response this is halfway to the next mode.
            let between = next.map(|next| libm::sqrt(last.frequency_hz * next.frequency_hz));
            rounded(between.unwrap_or(f64::INFINITY).min(ABOVE_LAST * last.frequency_hz)).min(highest_hz)
        }
        (None, None) => {
            let needed_hz = libm::ceil(first.frequency_hz * ABOVE_LAST / HIGHEST_PART);
            return Err(SurveyError::NoMode { lowest_hz: first.frequency_hz, rate_hz, needed_hz });
        }
    };
    let from_hz = request.from_hz.unwrap_or_else(|| rounded(BELOW_FIRST * first.frequency_hz));
    if !(to_hz > 0.0 && to_hz <= highest_hz) {
        let expected = format!("positive, and at most {highest_hz} Hz, 0.4 times the sample rate");
        return Err(SurveyError::Value { flag: "--to-hz", got: to_hz, expected });
    }
    if !(from_hz > 0.0 && from_hz < to_hz) {
        let expected = format!("positive, and below the highest frequency, {to_hz:.2} Hz");
        return Err(SurveyError::Value { flag: "--from-hz", got: from_hz, expected });
    }
    Ok(Band { from_hz, to_hz })
}
