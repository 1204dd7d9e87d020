//! `resonarm continue`: branches of periodic responses, their stability and bifurcations.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::continuation_flags::ContinuationFlags;
use crate::drive::{Drive, DriveFlags};
use crate::ended_early::{Early, of_branch};
use crate::failure::{Failure, Verdict};
use crate::figures::branches::{of_each, table, with_branches};
use crate::figures::captions;
use crate::figures::singular_curves::{BifurcationCurve, CurveFlags, Curves, LARGEST_STEP, coordinate, title, unit};
use crate::flags::{StructureFlags, interval};
use crate::help::heading;
use crate::output::{self, Inputs, PlotFlags};
use crate::progress::timed;
use crate::read_at::{ReadAt, dofs, read_at, readings, words};
use crate::start_state::StateFlag;
use resonarm::analysis::{
    self, Assess, Beat, Bifurcation, Branch, BranchEnd, Coordinate, EndedEarly, Forced, NotFollowed, Orbit, Origin,
    OriginKind, OtherBranch, OtherOptions, SearchOptions, Searched, Stability, SubHarmonicSearch, TraceOptions,
    Unlocated, phase_zero_state, trace, trace_branches, trace_singular_curves,
};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Figure, Subtitle, beside};
use resonarm_numeric::number::{rounded, short, significant};

const EXAMPLES: &str = "\
Examples:
  resonarm continue --drive joint1=60 --from-hz 21 --to-hz 23 --plot branch
  resonarm continue --drive tip.x=20 --angles-deg 30,120 --from-hz 60 \\
      --to-hz 20 --at joint1,joint2,tip.x
  resonarm continue --parameter amplitude --drive joint1 --frequency-hz 22.1 \\
      --from 0 --to 300
  resonarm continue --parameter link2.mass_kg --drive joint1=60 \\
      --frequency-hz 22 --from 40 --to 60
  resonarm continue --drive joint1=60 --from-hz 21 --to-hz 23 \\
      --curves-in amplitude --curves-to 5
  resonarm continue --drive joint1=800 --angles-deg 0,75 --from-hz 40 \\
      --to-hz 50 --branches
  resonarm continue --scenario hardening.toml --drive tip.x=4 --from-hz 21 \\
      --to-hz 24 --curves-in amplitude --curves-to 1

In JSON and CSV every response has its readings by degree of freedom: the largest displacement from rest, the mean, and the
component at the frequency of the drive, as its amplitude and the phase in degrees by which it leads the drive. With the
angular frequency Ω a velocity is iΩ times this component, an acceleration −Ω² times.

A walk that ends early prints what it found, says why on standard error, and ends with exit code 1.";

/// Follows periodic responses around folds, with their stability and bifurcations.
///
/// The responses to a sine are followed in the frequency or the amplitude of the excitation, or in a parameter of the
/// structure.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
#[command(mut_args(output::explained(
    output::PLOT,
    "The curves of --curves-in are in STEM-curves.svg and STEM-curves.png."
)))]
pub(crate) struct Continue {
    #[command(flatten)]
    pub(crate) structure: StructureFlags,
    #[command(flatten)]
    drive: DriveFlags,
    /// Degrees of freedom to read, as tip.x,joint1 [default: where the loads act].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_delimiter = ',')]
    at: Vec<String>,
    /// Leave out the stability, and with it all bifurcations but folds.
    ///
    /// This is faster, most of all with many modes.
    #[arg(long, help_heading = heading::COMPUTATION, conflicts_with = "branches")]
    no_stability: bool,
    /// What varies: frequency, amplitude, or a parameter, as link2.angle_deg.
    ///
    /// Parameters of the structure are mode3.damping_ratio, element1.gap_m, gravity_m_s2 and others. The amplitude is that
    /// of the first load; others keep their ratio to it.
    #[arg(long, help_heading = heading::RANGE, value_name = "NAME", default_value = "frequency")]
    parameter: String,
    #[command(flatten)]
    range: RangeFlags,
    /// Start on the response near this state at phase 0 of the load.
    ///
    /// STATE is coordinates and rates, as 0.01,0,0.3,0, and possibly states of elements, or FILE:PLACE. PLACE is
    /// points/17 in the JSON of this command, sweeps/0/points/3 in that of sweep, motions/0 in that of basins, or a time
    /// in seconds in a recording, from which on the load comes to phase 0. A response may repeat after several periods of
    /// the load, up to 12.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "STATE", allow_hyphen_values = true, value_parser = StateFlag::parse, hide_short_help = true)]
    from_state: Option<StateFlag>,
    /// Frequency of the excitation if it does not vary, Hz.
    #[arg(long, help_heading = heading::LOADS, value_name = "F")]
    frequency_hz: Option<f64>,
    #[command(flatten)]
    walk: ContinuationFlags,
    /// Also follow the branches that leave others, and sub-harmonic ones.
    ///
    /// Branches leave at branch points and period doublings, and others leave these; they are followed up to 8 periods of the
    /// load. Of two branches that are mirror images of each other, one is followed. Sub-harmonic responses, of 2 and 3
    /// periods of the load, are sought near free vibrations.
    #[arg(long, help_heading = heading::COMPUTATION)]
    branches: bool,
    /// Search further for responses that the branch does not reach.
    ///
    /// By default they are searched at 5 frequencies, and along folds for loads from half to twice the amplitude where the
    /// forces are smooth; with this flag at 20 frequencies, along folds for loads from a quarter to four times the amplitude,
    /// along the folds of branches under 2 and 4 times the amplitude, and for 2 and 3 periods of the load. Responses of the
    /// period of the load are searched only where the frequency varies.
    #[arg(long, help_heading = heading::COMPUTATION)]
    search: bool,
    #[command(flatten)]
    curves: CurveFlags,
    #[command(flatten)]
    output: PlotFlags,
}

/// The interval of the quantity that varies.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::RANGE)]
struct RangeFlags {
    /// First frequency, Hz.
    #[arg(long, value_name = "F")]
    from_hz: Option<f64>,
    /// Last frequency, Hz; it may be below the first.
    #[arg(long, value_name = "F")]
    to_hz: Option<f64>,
    /// First amplitude or value of the parameter.
    ///
    /// An amplitude has the unit of the first load, a parameter the unit in its name.
    #[arg(long, value_name = "X")]
    from: Option<f64>,
    /// Last amplitude or value of the parameter.
    #[arg(long, value_name = "X")]
    to: Option<f64>,
}

/// The branch to compute, and the curves that start on it.
struct Walk {
    drive: Drive,
    read: Vec<ReadAt>,
    coordinate: Coordinate,
    ends: [f64; 2],
    /// The frequency at the start, Hz.
    frequency_hz: f64,
    /// The second coordinate of curves, and where they end.
    second: Option<(Coordinate, f64)>,
    /// The state near which the branch starts.
    near: Option<Vec<f64>>,
}

/// Results of the continuation: the branch, others and its curves.
struct Found {
    branch: Branch,
    /// The largest truncation error, relative to the size of the response.
    tolerance: f64,
    /// The other branches: first those to which none leads, then those that leave others.
    others: Vec<(Origin, Branch)>,
    left_out: Vec<(Origin, NotFollowed)>,
    searched: Searched,
    curves: Option<Curves>,
}

impl Found {
    /// Returns the other branches with their numbers: those that leave others, or those to which none leads.
    fn numbered(&self, leaving: bool) -> impl Iterator<Item = (usize, &Origin, &Branch)> {
        let all = (1..).zip(&self.others).map(|(number, (origin, branch))| (number, origin, branch));
        all.filter(move |(_, origin, _)| origin.parent.is_some() == leaving)
    }
}

#[derive(Serialize)]
struct Document {
    /// The inputs of the results; where the amplitude varies, the loads are those at the amplitude 1 of the first.
    configuration: Value,
    coordinates: Value,
    #[serde(flatten)]
    branch: BranchDocument,
    /// Bifurcations that were detected between two points and could not be located.
    unlocated: Vec<Value>,
    /// For each degree of freedom that is read, the response with the largest displacement, and whether it is at an end
    /// of the branch.
    peaks: Vec<Value>,
    /// Branches to which no other leads: isolas, and branches that leave the range.
    isolas: Vec<OtherDocument>,
    /// The branches that leave others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    branches: Vec<OtherDocument>,
    /// Places where branches begin that were not followed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    left_out: Vec<Value>,
    /// What was searched for responses that the branch does not reach.
    searched: Value,
    #[serde(skip_serializing_if = "Option::is_none")]
    curves: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_early: Option<Value>,
    wall_s: f64,
}

#[derive(Serialize)]
struct BranchDocument {
    /// How the branch ended.
    ended: &'static str,
    points: Vec<Value>,
    bifurcations: Vec<Value>,
}

impl BranchDocument {
    fn new(branch: &Branch, read: &[ReadAt], (forced, coordinate): (&Forced, Coordinate)) -> BranchDocument {
        let with_state = |mut value: Value, orbit: &Orbit| {
            value["state"] = json!(phase_zero_state(forced, coordinate, orbit));
            value
        };
        let found = branch.bifurcations.iter();
        BranchDocument {
            ended: branch.end.name(),
            points: branch.orbits.iter().map(|orbit| with_state(point(orbit, read), orbit)).collect(),
            bifurcations: found.map(|found| with_state(bifurcation(found, read), &found.orbit)).collect(),
        }
    }
}

/// A branch beside the first one.
#[derive(Serialize)]
struct OtherDocument {
    /// Its number: 1 and more in the order of the isolas and then of the branches that leave others.
    number: usize,
    /// The place where the branch begins.
    from: Value,
    /// The period of its responses, in periods of the drive.
    period: usize,
    /// Whether a mirror image of it exists, which is not listed.
    mirrored: bool,
    #[serde(flatten)]
    branch: BranchDocument,
}

/// Returns the place where a branch begins: the kind and the value of the bifurcation, and the number of the branch on
/// which it is, 0 for the first; or the value at which an isola was found.
fn beginning(origin: &Origin) -> Value {
    json!({ "kind": origin.kind.name(), "value": origin.value, "branch": origin.parent })
}

impl Continue {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let endings = [output::PLOTTED, &["-curves.svg", "-curves.png", "-curves.txt", "-curves.csv"]].concat();
        let from_state = self.from_state.as_ref().and_then(StateFlag::path);
        let inputs = Inputs::of_scenario(self.structure.scenario.as_deref()).and(from_state);
        self.output.check(&endings, &inputs)?;
        let scenario = self.structure.scenario()?;
        let tested = scenario.under_test()?;
        let walk = self.walk(&tested)?;
        let mut early = Early::default();
        let (found, wall_s) = timed(|| self.follow(&tested, &walk, &mut early));
        let found = found?;
        let forced = walk.drive.forced(&tested.assembly);
        let of_branch = |branch: &Branch| BranchDocument::new(branch, &walk.read, (&forced, walk.coordinate));
        let other = |(number, origin, branch): (usize, &Origin, &Branch)| OtherDocument {
            number,
            from: beginning(origin),
            period: origin.period,
            mirrored: origin.is_mirrored,
            branch: of_branch(branch),
        };
        let document = Document {
            configuration: self.configuration(&scenario, &tested, &walk, found.tolerance),
            coordinates: configuration::coordinates(&tested.assembly),
            branch: of_branch(&found.branch),
            unlocated: found.branch.unlocated.iter().map(unlocated).collect(),
            peaks: peaks(&found.branch, &walk.read),
            isolas: found.numbered(false).map(other).collect(),
            branches: found.numbered(true).map(other).collect(),
            left_out: found.left_out.iter().map(left_out).collect(),
            searched: searched_document(&found.searched, &walk.read),
            curves: found.curves.as_ref().map(|curves| curves.document(&walk.read)),
            ended_early: early.document(),
            wall_s,
        };
        let branches: Vec<&Branch> =
            core::iter::once(&found.branch).chain(found.others.iter().map(|(_, branch)| branch)).collect();
        let isolas = found.numbered(false).count();
        let drawn = || {
            let conditions = self.conditions(&scenario, &tested, &walk, &[walk.coordinate]);
            let figure = Figure::new("Periodic responses").subtitle(conditions);
            let drawn = |panel, index| with_branches(panel, &branches, isolas, index);
            let figure = of_each(figure, &title(walk.coordinate, &walk.drive), &walk.read, drawn);
            (figure, table(walk.coordinate, &branches, &walk.read))
        };
        let mut files = output::plot(self.output.plot.as_deref(), &document, drawn)?;
        if let (Some(stem), Some(curves)) = (&self.output.plot, &found.curves) {
            let stem = beside(stem, "-curves");
            let conditions = self.conditions(&scenario, &tested, &walk, &curves.coordinates);
            files.extend(output::draw(curves.figure(conditions, &walk.drive), &stem)?);
            files.push(output::write(beside(&stem, ".csv"), &curves.table(&walk.read))?);
        }
        self.output.json.show(&document, || self.text(&found, &walk, wall_s), &files)?;
        early.verdict()
    }

    /// Resolves the flags against the structure: the load, the coordinate that varies with its range, and the readings.
    fn walk(&self, tested: &TestedAssembly) -> Result<Walk, Failure> {
        let assembly = &tested.assembly;
        let coordinate = coordinate("--parameter", &self.parameter, assembly)?;
        let drive = self.drive.along(coordinate, assembly)?;
        let frequency_hz = match (coordinate, self.frequency_hz) {
            (Coordinate::FrequencyHz, Some(_)) => {
                return Err(Failure::usage(
                    "--frequency-hz is for runs in another parameter: leave --frequency-hz out",
                ));
            }
            (Coordinate::FrequencyHz, None) => None,
            (Coordinate::Amplitude | Coordinate::Parameter(_), _) => Some(self.positive_frequency_hz()?),
        };
        let RangeFlags { from_hz, to_hz, from, to } = self.range;
        let parameter = format!("--parameter {}", self.parameter);
        let ends = interval(&parameter, Some(coordinate), [from_hz, to_hz], [from, to])?.unwrap_or_default();
        // A walk in the frequency starts at the first end of its range.
        let frequency_hz = frequency_hz.unwrap_or(ends[0]);
        Ok(Walk {
            read: read_at(&self.at, &drive.driven(), assembly)?,
            second: self.curves.second(coordinate, assembly)?,
            near: self.from_state.as_ref().map(|state| state.state(frequency_hz)).transpose()?,
            frequency_hz,
            ends,
            coordinate,
            drive,
        })
    }

    fn positive_frequency_hz(&self) -> Result<f64, Failure> {
        match self.frequency_hz {
            Some(hz) if hz.is_finite() && hz > 0.0 => Ok(hz),
            got => {
                let got = got.map_or(String::from("missing"), |hz| short(&hz).to_string());
                Err(Failure::usage(format!("--frequency-hz is {got}: it must be a positive number")))
            }
        }
    }

    /// Follows the branch, and the branches and curves that leave it.
    fn follow(&self, tested: &TestedAssembly, walk: &Walk, early: &mut Early) -> Result<Found, Failure> {
        let Walk { coordinate, ends, frequency_hz, .. } = *walk;
        let forced = walk.drive.forced(&tested.assembly);
        let mut options = TraceOptions::new(&forced, coordinate, ends, dofs(&walk.read));
        options.branch = self.walk.options(options.branch)?;
        options.assess = if self.no_stability { Assess::Nothing } else { Assess::Multipliers };
        options.near.clone_from(&walk.near);
        let name = coordinate.to_string();
        let branch = early.keep(&name, trace(&forced, frequency_hz, coordinate, &options), of_branch)?;
        let mut search = if self.search { SearchOptions::further() } else { SearchOptions::default() };
        // Sub-harmonic branches are among those that --branches asks for, although none of them leaves another.
        search.sub_harmonics |= self.branches;
        let wanted = OtherOptions { leaving: self.branches, search: Some(search) };
        let found = trace_branches(&forced, &branch, coordinate, &options, &wanted);
        // Without a request for other branches one of them that ends early is marked, and the command has not failed.
        let asked = self.search || self.branches;
        let as_far = |traced: Result<Branch, EndedEarly<Branch>>| traced.unwrap_or_else(|ended| *ended.so_far);
        let mut others = Vec::new();
        for OtherBranch { origin, traced } in found.branches {
            others.push((origin, if asked { early.keep(&name, traced, of_branch)? } else { as_far(traced) }));
        }
        // A branch that can't be followed is reported at the end: the rest are results all the same.
        for (_, reason) in &found.left_out {
            if let (NotFollowed::Failed(reason), true) = (reason, asked) {
                early.keep_any(&name, Err(reason.clone().into()), of_branch)?;
            }
        }
        let curves = walk.second.map(|second| self.curves(&forced, &branch, walk, second, early)).transpose()?;
        let tolerance = options.branch.truncation;
        let left_out = found.left_out;
        let searched = found.searched.unwrap_or_default();
        Ok(Found { branch, tolerance, others, left_out, searched, curves })
    }

    /// Follows the curves of folds and period doublings of the branch.
    fn curves(
        &self,
        forced: &Forced,
        branch: &Branch,
        walk: &Walk,
        (second, to): (Coordinate, f64),
        early: &mut Early,
    ) -> Result<Curves, Failure> {
        // They begin at the value on the branch, whichever that is.
        let mut along = TraceOptions::new(forced, second, [0.0, to], dofs(&walk.read));
        along.branch = self.walk.options(along.branch)?;
        let largest_step = &mut along.branch.continuation.largest_step;
        *largest_step = largest_step.min(LARGEST_STEP);
        let coordinates = [walk.coordinate, second];
        let mut curves = Vec::new();
        for (kind, traced) in trace_singular_curves(forced, branch, coordinates, &along) {
            let curve = early.keep_any(&second.to_string(), traced, |curve| curve.points.len())?;
            curves.extend(curve.map(|curve| BifurcationCurve { kind, curve }));
        }
        Ok(Curves { coordinates, curves })
    }

    fn configuration(&self, scenario: &Scenario, tested: &TestedAssembly, walk: &Walk, tolerance: f64) -> Value {
        let mut configuration = configuration::of_structure(scenario, tested);
        walk.drive.describe(&mut configuration);
        configuration["continue"] = json!({
            "parameter": walk.coordinate.to_string(), "from": walk.ends[0], "to": walk.ends[1],
            "frequency_hz": self.frequency_hz, "stability": !self.no_stability,
            "tolerance": tolerance,
        });
        if let Some(near) = &walk.near {
            configuration["continue"]["from_state"] = json!(near);
        }
        configuration
    }

    /// Returns a figure's subtitle: the structure and its excitation, without the coordinates that vary.
    fn conditions(&self, scenario: &Scenario, tested: &TestedAssembly, walk: &Walk, varied: &[Coordinate]) -> Subtitle {
        // What varies is on an axis; the caption must not state a single value of it.
        let names: Vec<String> = varied.iter().map(Coordinate::to_string).collect();
        let load = walk.drive.words_without(varied);
        let hz = self.frequency_hz.filter(|_| !varied.contains(&Coordinate::FrequencyHz));
        let hz = hz.map_or(String::new(), |hz| format!("{hz} Hz"));
        captions::structure(scenario, tested, &names).and(load).and(hz)
    }

    /// Lists the bifurcations and peaks.
    fn text(&self, found: &Found, walk: &Walk, wall_s: f64) -> String {
        let branch = &found.branch;
        let read = &walk.read;
        let unit = unit(walk.coordinate, &walk.drive);
        let mut text = if self.no_stability {
            format!(
                "{} responses, in {wall_s:.3} s\nstability not computed: bifurcations other than folds are not found\n",
                branch.orbits.len()
            )
        } else {
            format!("{}, in {wall_s:.3} s\n", counted(branch))
        };
        text += &truncated(branch, found.tolerance, unit);
        for found in &branch.bifurcations {
            text += &format!("{}\n", bifurcation_in_words(found, read, unit));
        }
        if branch.bifurcations.is_empty() && branch.unlocated.is_empty() {
            // Folds are found by the direction of the walk alone; every other bifurcation needs the multipliers.
            text += if self.no_stability { "no folds were found\n" } else { "no bifurcations were found\n" };
        }
        for Unlocated { kind, between: [from, to], .. } in &branch.unlocated {
            let kind = kind.name();
            let [from, to] = [from, to].map(|value| rounded(value, 7));
            text += &format!(
                "{kind} between {from} and {to} {unit}, not located: \
                 use smaller steps or more harmonics (--largest-step, --most-harmonics)\n"
            );
        }
        for (orbit, ReadAt { name, .. }) in branch.peaks.iter().zip(read) {
            let end = if is_at_end(branch, orbit) { ", an end of the branch" } else { "" };
            let readings = words(&orbit.readings, read);
            text += &format!("largest response of {name} at {} {unit}{end}: {readings}\n", rounded(&orbit.value, 7));
        }
        let of_period_1 = found.numbered(false).filter(|(_, origin, _)| origin.period == 1).count();
        text += &searched_text(&found.searched, of_period_1, read, [walk.drive.unit(), unit]);
        for isola in found.numbered(false).chain(found.numbered(true)) {
            text += &other_in_words(isola, read, unit);
        }
        for (origin, reason) in &found.left_out {
            text += &format!("not followed from {}: {reason}\n", from(origin, unit));
        }
        text + &found.curves.as_ref().map_or_else(String::new, |curves| curves.text(&walk.drive))
    }
}

/// Lists the bifurcations of a branch beside the first one, and the largest responses of one to which no other leads.
fn other_in_words((number, origin, branch): (usize, &Origin, &Branch), read: &[ReadAt], unit: &str) -> String {
    let period = if origin.period > 1 { format!(", {} periods of the load", origin.period) } else { String::new() };
    let mirrored = if origin.is_mirrored { ", one of two mirror images" } else { "" };
    let is_detached = origin.parent.is_none();
    let begins = if is_detached { extent(branch, unit) } else { format!("from {}", from(origin, unit)) };
    let kind = if is_detached && branch.end == BranchEnd::Closed { "isola" } else { "branch" };
    let mut text = format!("{kind} {number} {begins}{period}{mirrored}: {}\n", counted(branch));
    for found in &branch.bifurcations {
        text += &format!("  {}\n", bifurcation_in_words(found, read, unit));
    }
    for (orbit, ReadAt { name, .. }) in branch.peaks.iter().zip(read).filter(|_| is_detached) {
        let at = rounded(&orbit.value, 7);
        let readings = words(&orbit.readings, read);
        text += &format!("  largest response of {name} at {at} {unit}: {readings}\n");
    }
    text += match branch.end {
        BranchEnd::Early => "  it ends early\n",
        BranchEnd::AtEnd | BranchEnd::AtStart => "  it leaves the range\n",
        BranchEnd::Rejoined => "  it ends at the last branch point\n",
        BranchEnd::Closed => "  it is closed\n",
    };
    text
}

/// Returns the interval of the coordinate on a branch in words.
fn extent(branch: &Branch, unit: &str) -> String {
    let orbits = || branch.orbits.iter().chain(branch.bifurcations.iter().map(|found| &found.orbit));
    // `min` and `max` pass over NaN, so that the first value takes its place.
    let [least, most] = [f64::min, f64::max].map(|of| orbits().map(|orbit| orbit.value).fold(f64::NAN, of));
    format!("between {} and {} {unit}", rounded(&least, 7), rounded(&most, 7))
}

/// Returns the place where a branch begins in words.
fn from(origin: &Origin, unit: &str) -> String {
    let kind = match origin.kind {
        OriginKind::BranchPoint => "the branch point",
        OriginKind::PeriodDoubling => "the period doubling",
        OriginKind::Detached => "a response",
        OriginKind::SubHarmonic => "a sub-harmonic response",
    };
    let of = origin.parent.filter(|parent| *parent > 0).map_or(String::new(), |parent| format!(" of branch {parent}"));
    format!("{kind} at {} {unit}{of}", rounded(&origin.value, 7))
}

/// Returns the place of a branch that was not followed, with the reason.
fn left_out((origin, reason): &(Origin, NotFollowed)) -> Value {
    let mut value = beginning(origin);
    value["period"] = json!(origin.period);
    value["reason"] = json!(reason.to_string());
    value
}

/// Says how many responses a branch has, and how many of them are unstable.
fn counted(branch: &Branch) -> String {
    let count = |wanted: analysis::Verdict| {
        let verdicts = branch.orbits.iter().filter_map(|orbit| orbit.stability.as_ref().map(Stability::verdict));
        verdicts.filter(|verdict| *verdict == wanted).count()
    };
    let mut text =
        format!("{} responses, {} of them unstable", branch.orbits.len(), count(analysis::Verdict::Unstable));
    if let undecided @ 1.. = count(analysis::Verdict::Undecided) {
        text += &format!(", {undecided} undecided within the accuracy of their multipliers");
    }
    if let conservative @ 1.. = count(analysis::Verdict::Conservative) {
        text += &format!(", {conservative} neither stable nor unstable: the structure is conservative");
    }
    text
}

/// Says how many responses would need more harmonics than are allowed, and where the error is largest; empty if there is
/// none.
fn truncated(branch: &Branch, tolerance: f64, unit: &str) -> String {
    let beyond = || branch.orbits.iter().filter(|orbit| orbit.truncation_error > tolerance);
    let Some(worst) = beyond().max_by(|a, b| a.truncation_error.total_cmp(&b.truncation_error)) else {
        return String::new();
    };
    format!(
        "{} responses would need more than {} harmonics for the tolerance {tolerance:e}: the error is up to {:.1e} of \
         the response, at {} {unit} (--most-harmonics, --tolerance)\n",
        beyond().count(),
        worst.harmonics,
        worst.truncation_error,
        rounded(&worst.value, 7)
    )
}

/// Returns a response with its readings.
fn point(orbit: &Orbit, read: &[ReadAt]) -> Value {
    let multipliers = orbit.stability.as_ref().map(|stability| {
        stability.multipliers.iter().map(|multiplier| [multiplier.re, multiplier.im]).collect::<Vec<_>>()
    });
    json!({
        "value": orbit.value, "frequency_hz": orbit.frequency_hz, "drive": orbit.drive, "period": orbit.period,
        "readings": readings(&orbit.readings, read), "stable": orbit.is_stable(),
        "stability": orbit.stability.as_ref().map(|stability| stability.verdict().name()),
        "multiplier_accuracy": orbit.stability.as_ref().map(|stability| stability.accuracy),
        "multipliers": multipliers, "harmonics": orbit.harmonics,
        "truncation_error": orbit.truncation_error,
    })
}

fn bifurcation(found: &Bifurcation, read: &[ReadAt]) -> Value {
    let mut value = point(&found.orbit, read);
    value["kind"] = json!(found.kind.name());
    value["index"] = json!(found.index);
    if let Some(Beat { rotation_number, frequency_hz }) = found.beat() {
        value["rotation_number"] = json!(rotation_number);
        value["beat_hz"] = json!(frequency_hz);
    }
    value
}

fn bifurcation_in_words(found: &Bifurcation, read: &[ReadAt], unit: &str) -> String {
    let Bifurcation { kind, orbit, .. } = found;
    let beat = found.beat().map_or_else(String::new, |Beat { rotation_number, frequency_hz }| {
        let [number, hz] = [rotation_number, frequency_hz].map(|value| rounded(&value, 6).to_string());
        format!("; beyond it the response beats at {hz} Hz (rotation number {number})")
    });
    format!("{} at {} {unit}: {}{beat}", kind.name(), rounded(&orbit.value, 7), words(&orbit.readings, read))
}

/// Returns the largest response of each degree of freedom.
fn peaks(branch: &Branch, read: &[ReadAt]) -> Vec<Value> {
    let peak = |(orbit, at): (&Orbit, &ReadAt)| {
        let mut value = point(orbit, read);
        value["at"] = json!(at.name);
        value["at_end"] = json!(is_at_end(branch, orbit));
        value
    };
    branch.peaks.iter().zip(read).map(peak).collect()
}

/// Says whether a response is the first or the last of the branch: beyond it there may be larger ones.
fn is_at_end(branch: &Branch, orbit: &Orbit) -> bool {
    let ends = [branch.orbits.first(), branch.orbits.last()];
    // Compared exactly: a peak at an end is a copy of that orbit, with the same bits.
    ends.into_iter().flatten().any(|end| end.arclength == orbit.arclength)
}

fn unlocated(found: &Unlocated) -> Value {
    json!({ "kind": found.kind.name(), "between": found.between, "index": found.index })
}

/// Returns what was searched, or why nothing was.
fn searched_document(searched: &Searched, read: &[ReadAt]) -> Value {
    let mut document = match searched.not_searched {
        Some(reason) => json!({ "not_searched": reason.name() }),
        None => {
            let largest = searched.largest.iter().zip(read);
            let largest = largest.map(|(size, at)| (at.name.clone(), json!({ "largest": size, "unit": at.unit() })));
            json!({
                "frequencies_hz": searched.frequencies_hz, "starts": searched.starts,
                "largest": Value::Object(largest.collect()), "loads": searched.loads,
                "attached": searched.attached, "evaluations": searched.work.evaluations,
            })
        }
    };
    if let Some(SubHarmonicSearch { values, error }) = &searched.sub_harmonics {
        document["sub_harmonics"] = json!({
            "periods": SubHarmonicSearch::PERIODS, "values": values, "error": error.as_ref().map(ToString::to_string),
        });
    }
    document
}

/// Says what was searched, or why nothing was, and how many branches with the period of the load were found. The load has
/// the first unit, the coordinate that varies the second.
fn searched_text(searched: &Searched, found: usize, read: &[ReadAt], [load, varied]: [&str; 2]) -> String {
    let mut text = match searched.not_searched {
        Some(reason) => format!("{reason}\n"),
        None => searched_in_words(searched, found, read, load),
    };
    match searched.attached {
        0 => {}
        1 => text += "a branch that leaves a known one was found and is not listed (--branches)\n",
        count => {
            text += &format!("{count} branches that leave known ones were found and are not listed (--branches)\n")
        }
    }
    text + &searched.sub_harmonics.as_ref().map_or_else(String::new, |search| sub_harmonics_text(search, varied))
}

/// Says where responses with the period of the load were searched.
fn searched_in_words(searched: &Searched, found: usize, read: &[ReadAt], load: &str) -> String {
    let frequencies = searched.frequencies_hz.len();
    let starts = searched.starts;
    let mut text = format!("responses were searched at {frequencies} frequencies with {starts} starts each");
    if let (Some(largest), Some(at)) = (searched.largest.first(), read.first()) {
        text += &format!(", up to {largest:.2e} {} at {}", at.unit(), at.name);
    }
    if let Some([from, to]) = searched.loads {
        text +=
            &format!(", and along folds for loads from {} to {} {load}", significant(&from, 3), significant(&to, 3));
    }
    let found = if found == 0 { String::from("none") } else { found.to_string() };
    text + &format!(": found {found}; others may exist\n")
}

/// Says where sub-harmonic responses were sought.
fn sub_harmonics_text(search: &SubHarmonicSearch, unit: &str) -> String {
    match (&search.error, search.values.as_slice()) {
        (Some(error), _) => format!("sub-harmonic responses were not sought: {error}\n"),
        (None, []) => String::from(
            "sub-harmonic responses were not sought: no free vibration has a half or a third of the frequency\n",
        ),
        (None, values @ [first, ..]) => {
            let [from, to] = [first, values.last().unwrap_or(first)].map(|value| rounded(value, 7));
            format!(
                "sub-harmonic responses of 2 and 3 periods were sought near free vibrations at {} values from {from} to {to} \
                 {unit}; others may exist\n",
                values.len()
            )
        }
    }
}
