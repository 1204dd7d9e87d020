//! `resonarm spec`: what a specification asks of exciter and structure.

use std::path::PathBuf;

use clap::Args;
use nalgebra::Complex;
use serde::Serialize;
use serde_json::Value;

use super::plot::table;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::flags::read_scenario;
use crate::help::heading;
use crate::output::{self, Inputs, PlotFlags};
use crate::read_at::size;
use crate::specifications::{self, LevelCurve, level_curve, level_label, level_panel, pulse_panel};
use resonarm::analysis::{LinearResponse, Quantity};
use resonarm::plant::TestedAssembly;
use resonarm::protocol::scaling;
use resonarm::rig::ShakerSpec;
use resonarm::scenario::Scenario;
use resonarm::specification::{
    GRAVITY_M_S2, PRESETS, RandomFigures, ShockFigures, SineFigures, Specification, SrsFigures, Test,
};
use resonarm::structure::Dof;
use resonarm_figures::plot::Figure;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::number::{rounded, short};

const EXAMPLES: &str = "\
Examples:
  resonarm spec
  resonarm spec navmat-p-9492 --mass-kg 10
  resonarm spec navmat-p-9492 --toml
  resonarm spec mine.toml --scenario bench.toml --plot mine
  resonarm spec mine.toml --json

docs/specifications.md lists the keys of a specification.";

/// Checks a specification, and prints what the test asks of exciter and structure.
///
/// It is a TOML file, or a preset by its name; without one the presets are listed. Peaks of a random test are those of the
/// sigma limit, or of 3 sigma. Forces follow from a mass (--mass-kg) and from the frequency response of a structure (--scenario),
/// which is often far from that of a mass. With a scenario the exciter is checked, too, and the exit code is 1 if the test asks
/// more of it, or of the bus, than they can carry.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
#[command(mut_args(output::explained("Plot the levels to STEM.svg and STEM.png, with caption, CSV and JSON", "")))]
pub(crate) struct Spec {
    /// Specification, a TOML file, or the name of a preset.
    file: Option<PathBuf>,
    /// Scenario of the structure and the exciter, a TOML file.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Mass that is moved as a whole, kg.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "KG")]
    mass_kg: Option<f64>,
    /// Print the specification of a preset as TOML, to start from.
    #[arg(long, help_heading = heading::OUTPUT, conflicts_with_all = ["json", "plot"])]
    toml: bool,
    #[command(flatten)]
    output: PlotFlags,
}

/// What a test asks for, in the figures of its kind.
#[derive(Serialize)]
#[serde(untagged)]
enum Figures {
    Random(RandomFigures),
    Sine(SineTotal),
    Shock(ShockFigures),
    Srs(SrsFigures),
}

/// Figures of all segments of a sine test.
#[derive(Serialize)]
struct SineTotal {
    /// Time of all sweeps, s.
    duration_s: f64,
    /// Cycles of all sweeps.
    cycles: f64,
    peak_m_s2: f64,
    velocity_peak_m_s: f64,
    displacement_peak_m: f64,
    segments: Vec<SineFigures>,
}

/// Force that a test asks for, N.
#[derive(Serialize)]
struct Force {
    /// What it follows from: the mass or the structure.
    of: String,
    /// Rms, of a random test.
    rms_n: Option<f64>,
    /// Peak; none of a response spectrum, which many shocks have.
    peak_n: Option<f64>,
}

/// Quantity that a test asks for, with its limit.
#[derive(Serialize)]
struct Check {
    what: String,
    needed: f64,
    limit: f64,
    unit: &'static str,
    fits: bool,
}

/// Mode of the structure that a sine sweeps over.
#[derive(Serialize)]
struct SweptMode {
    frequency_hz: f64,
    damping_ratio: f64,
    /// η = Q² ḟ/fₙ².
    sweep_parameter: f64,
}

#[derive(Serialize)]
struct Document<'a> {
    configuration: Option<Value>,
    #[serde(flatten)]
    specification: &'a Specification,
    #[serde(flatten)]
    figures: Figures,
    forces: Vec<Force>,
    checks: Vec<Check>,
    swept_modes: Vec<SweptMode>,
    /// Whether bus and exciter can carry the test.
    fits: bool,
}

#[derive(Serialize)]
struct Listed {
    name: &'static str,
    title: Option<String>,
    kind: &'static str,
    sources: Vec<String>,
}

impl Spec {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let Some(name) = &self.file else { return self.list() };
        if self.mass_kg.is_some_and(|mass_kg| mass_kg.is_nan() || mass_kg <= 0.0) {
            return Err(Failure::value("--mass-kg", self.mass_kg.unwrap_or_default(), "it must be positive"));
        }
        let inputs = Inputs::of(specifications::files(name)).and(self.scenario.as_deref());
        self.output.check(output::PLOTTED, &inputs)?;
        if self.toml {
            let preset = specifications::preset(name);
            let preset = preset.ok_or_else(|| Failure::usage("--toml prints presets: name one of them"))?;
            output::print(preset.text)?;
            return Ok(Verdict::Positive);
        }
        let specification = specifications::read(name)?;
        let scenario = self.scenario.as_deref().map(read_scenario).transpose()?;
        let document = self.compute(&specification, scenario.as_ref())?;
        let title = specifications::title(&specification, name);
        self.output.show(&document, || figure(&specification, &title), || document.text(&title))?;
        // Without a scenario the bus is only the usual one.
        Ok(Verdict::of(document.fits || self.scenario.is_none()))
    }

    /// Prints the presets, each with its sources.
    fn list(&self) -> Result<Verdict, Failure> {
        if self.output.plot.is_some() || self.toml || self.scenario.is_some() || self.mass_kg.is_some() {
            return Err(Failure::usage("the specification is missing: name a TOML file or a preset"));
        }
        let listed = PRESETS.iter().map(|preset| {
            let specification = specifications::read(preset.name.as_ref())?;
            let Specification { name: title, sources, test, .. } = specification;
            Ok(Listed { name: preset.name, title, kind: test.kind(), sources })
        });
        let listed = listed.collect::<Result<Vec<_>, Failure>>()?;
        let text = || {
            let line = |one: &Listed| {
                let title = one.title.clone().unwrap_or_default();
                format!("{:28} {:7} {title}\n{:28} {:7} {}\n", one.name, one.kind, "", "", one.sources.join("; "))
            };
            listed.iter().map(line).collect()
        };
        self.output.json.show(&listed, text, &[])
    }

    fn compute<'a>(
        &self,
        specification: &'a Specification,
        scenario: Option<&Scenario>,
    ) -> Result<Document<'a>, Failure> {
        let test = &specification.test;
        let figures = figures(specification);
        let mut forces: Vec<Force> = self.mass_kg.iter().map(|mass_kg| of_mass(&figures, *mass_kg)).collect();
        let mut swept_modes = Vec::new();
        let bus = scenario.cloned().unwrap_or_default();
        let mut checks = vec![rate_check(test, bus.simulation.rate_hz)];
        let profile = bus.network.profile;
        if let Some(peak_m_s2) = figures.peak_m_s2() {
            checks.push(check("peak acceleration on the bus", peak_m_s2, scaling::ACCELERATION.limit(profile), "m/s²"));
        }
        if let Some(scenario) = scenario {
            let Some(tested) = configuration::computable(scenario)? else {
                return Err(Failure::usage(
                    "--scenario: the equations of its structure are not known to Resonarm: leave it out, and give --mass-kg",
                ));
            };
            let path = DrivePath::new(&tested, &specification.control.channels)?;
            let force = path.force(specification, &figures, scenario.simulation.rate_hz);
            if let Some(peak_n) = force.peak_n {
                checks.push(check("peak force on the bus", peak_n, scaling::FORCE.limit(profile), "N"));
                let (limit_n, _) = scenario.rig.drive().limits();
                checks.push(check("peak force of the exciter", peak_n, limit_n, "N"));
            }
            if let Some(shaker) = &scenario.rig.shaker {
                checks.extend(path.shaker_checks(shaker, specification, &figures));
            }
            if let Test::Sine(test) = test {
                let [from_hz, to_hz] = test.band_hz();
                let modes = tested.assembly.modes();
                let within = modes.iter().filter(|mode| mode.frequency_hz >= from_hz && mode.frequency_hz <= to_hz);
                swept_modes.extend(within.filter(|mode| mode.damping_ratio > 0.0).map(|mode| SweptMode {
                    frequency_hz: mode.frequency_hz,
                    damping_ratio: mode.damping_ratio,
                    sweep_parameter: test.sweep_parameter(mode.frequency_hz, mode.damping_ratio),
                }));
            }
            forces.push(force);
        }
        if let Some(limit_n) = specification.limits.drive_peak_n {
            let of = forces.iter().filter_map(|force| Some((&force.of, force.peak_n?)));
            checks.extend(
                of.map(|(of, peak_n)| check(&format!("peak force of {of} within drive_peak_n"), peak_n, limit_n, "N")),
            );
        }
        let fits = checks.iter().all(|check| check.fits);
        let configuration = scenario.map(configuration::of_scenario).transpose()?;
        Ok(Document { configuration, specification, figures, forces, checks, swept_modes, fits })
    }
}

fn check(what: &str, needed: f64, limit: f64, unit: &'static str) -> Check {
    Check { what: what.to_owned(), needed, limit, unit, fits: needed <= limit }
}

/// Checks the sample rate: five samples in a cycle of the highest frequency, ten in a pulse and in one of the highest oscillator
/// of a response spectrum.
fn rate_check(test: &Test, rate_hz: f64) -> Check {
    let needed = match test {
        Test::Random(_) | Test::Sine(_) => 5.0 * test.band_hz().map_or(0.0, |[_, to_hz]| to_hz),
        Test::Shock(test) => 10.0 / test.duration_s,
        Test::Srs(test) => test.figures().least_rate_hz,
    };
    // Frequencies from slopes and durations are rounded.
    Check { fits: needed <= rate_hz * (1.0 + 1e-9), ..check("sample rate", needed, rate_hz, "Hz") }
}

fn figures(specification: &Specification) -> Figures {
    match &specification.test {
        Test::Random(test) => Figures::Random(test.figures(specification.limits.sigma)),
        Test::Sine(test) => {
            let segments = test.figures();
            let sum = |of: fn(&SineFigures) -> f64| f64::from(test.sweeps) * segments.iter().map(of).sum::<f64>();
            let largest = |of: fn(&SineFigures) -> f64| segments.iter().map(of).fold(0.0, f64::max);
            Figures::Sine(SineTotal {
                duration_s: sum(|segment| segment.seconds),
                cycles: sum(|segment| segment.cycles),
                peak_m_s2: largest(|segment| segment.peak_m_s2),
                velocity_peak_m_s: largest(|segment| segment.velocity_peak_m_s),
                displacement_peak_m: largest(|segment| segment.displacement_peak_m),
                segments,
            })
        }
        Test::Shock(test) => Figures::Shock(test.figures()),
        Test::Srs(test) => Figures::Srs(test.figures()),
    }
}

impl Figures {
    /// Returns the peak acceleration of the test; `None` of a response spectrum, which many shocks have.
    fn peak_m_s2(&self) -> Option<f64> {
        match self {
            Figures::Random(figures) => Some(figures.peak_m_s2),
            Figures::Sine(figures) => Some(figures.peak_m_s2),
            Figures::Shock(figures) => Some(figures.peak_m_s2),
            Figures::Srs(_) => None,
        }
    }
}

fn of_mass(figures: &Figures, mass_kg: f64) -> Force {
    let rms_n = match figures {
        Figures::Random(figures) => Some(mass_kg * figures.rms_m_s2),
        _ => None,
    };
    let peak_n = figures.peak_m_s2().map(|peak| mass_kg * peak);
    Force { of: format!("a mass of {} kg", short(&mass_kg)), rms_n, peak_n }
}

/// The way from the exciter's force to the acceleration at the control channel.
struct DrivePath {
    linear: LinearResponse,
    drive: Dof,
    response: Dof,
    /// Their names, for messages.
    names: [String; 2],
}

/// Part of the largest accelerance below which a shock's force does not follow its inverse, and the part of half of the sample
/// rate from which on it is faded out.
const FLOOR: f64 = 1e-4;
const FADED: [f64; 2] = [0.4, 0.48];
/// Zeros behind a shock for the transform, in lengths of it.
const CONTINUED: usize = 8;

impl DrivePath {
    /// Finds the degrees of freedom of the exciter and of the first control channel, as `c.x`; without one, of accelerometer C.
    fn new(tested: &TestedAssembly, channels: &[String]) -> Result<DrivePath, Failure> {
        let (sensor, axis) = match channels.first() {
            Some(channel) => channel.split_once('.').unwrap_or((channel, "")),
            None => ("c", ""),
        };
        let places = &tested.places;
        let [x, y] = places.exciter.along;
        let axes = [("x", x), ("y", y), ("z", places.exciter_z)];
        let wanted = axes.into_iter().filter(|(name, _)| axis.is_empty() || axis == *name);
        let Some((axis, drive)) = wanted.filter_map(|(name, dof)| Some((name, dof?))).next() else {
            return Err(Failure::usage(format!("the exciter of the scenario acts along no axis of {sensor}.{axis}")));
        };
        let along = |placed: &[Option<Dof>; 2]| match axis {
            "x" => placed[0],
            "y" => placed[1],
            _ => None,
        };
        let response = match sensor {
            "b" => along(&places.accelerometer_b.along),
            "c" => along(&places.accelerometer_c.along).or((axis == "z").then_some(drive)),
            other => {
                let more = places.more.iter().filter(|more| more.name.to_string() == other);
                more.flat_map(|more| &more.along).find(|(of, _)| of.name() == axis).map(|(_, dof)| *dof)
            }
        };
        let Some(response) = response else {
            return Err(Failure::usage(format!(
                "the scenario has no accelerometer {sensor}.{axis}: name one of it in `control.channels`"
            )));
        };
        let names = [drive, response].map(|dof| tested.dof_name(dof));
        Ok(DrivePath { linear: LinearResponse::new(&tested.assembly), drive, response, names })
    }

    /// Returns a response to the force, or 0 where it is not defined.
    fn at(&self, quantity: Quantity, response: Dof, hz: f64) -> Complex<f64> {
        self.linear.at(quantity, self.drive, response, hz).unwrap_or(Complex::new(0.0, 0.0))
    }

    /// Returns the force over the acceleration at the control channel, N per m/s².
    fn force_per_acceleration(&self, hz: f64) -> Complex<f64> {
        Complex::new(1.0, 0.0) / self.at(Quantity::Accelerance, self.response, hz)
    }

    /// Returns rms, of a random test, and peak of a quantity with this response to the acceleration.
    fn rms_and_peak(
        &self,
        specification: &Specification,
        figures: &Figures,
        gain: &dyn Fn(f64) -> f64,
    ) -> Option<(Option<f64>, f64)> {
        match (&specification.test, figures) {
            (Test::Random(test), Figures::Random(figures)) => {
                let rms = test.rms_through(gain);
                Some((Some(rms), figures.crest * rms))
            }
            (Test::Sine(test), _) => Some((None, test.largest_through(gain).0)),
            _ => None,
        }
    }

    fn force(&self, specification: &Specification, figures: &Figures, rate_hz: f64) -> Force {
        let gain = |hz: f64| size(self.force_per_acceleration(hz));
        let found = self.rms_and_peak(specification, figures, &gain);
        let peak_n = match &specification.test {
            Test::Shock(test) => test.compensated(rate_hz).map(|(record, _)| self.shock_force_n(&record, rate_hz)),
            _ => found.map(|(_, peak)| peak),
        };
        let [drive, response] = &self.names;
        Force { of: format!("the structure at {drive}, for {response}"), rms_n: found.and_then(|(rms, _)| rms), peak_n }
    }

    /// Returns the peak force that gives a record of acceleration: its transform times H*/(|H|² + (ε max |H|)²), since H is 0 at
    /// antiresonances.
    fn shock_force_n(&self, record: &[f64], rate_hz: f64) -> f64 {
        let transform = Fft::at_least(CONTINUED * record.len());
        let length = transform.length();
        let mut values: Vec<Complex<f64>> = record.iter().map(|sample| Complex::new(*sample, 0.0)).collect();
        values.resize(length, Complex::new(0.0, 0.0));
        transform.forward(&mut values);
        let hz = |line: usize| line as f64 * rate_hz / length as f64;
        let responses: Vec<Complex<f64>> =
            (0..=length / 2).map(|line| self.at(Quantity::Accelerance, self.response, hz(line))).collect();
        let fade = |line: usize| ((FADED[1] * rate_hz - hz(line)) / ((FADED[1] - FADED[0]) * rate_hz)).clamp(0.0, 1.0);
        let largest = responses.iter().enumerate().filter(|(line, _)| fade(*line) > 0.0);
        let floor = FLOOR * largest.map(|(_, response)| size(*response)).fold(0.0, f64::max);
        for (line, response) in responses.iter().enumerate() {
            let inverse = response.conj() * (fade(line) / (response.norm_sqr() + floor * floor));
            values[line] *= inverse;
            // Of a real record lines mirror each other, conjugate: the first and the one in the middle are their own
            // mirrors.
            if line > 0 && 2 * line < length {
                values[length - line] *= inverse.conj();
            }
        }
        transform.backward(&mut values);
        // The backward transform is not divided by the number of lines.
        values.iter().fold(0.0, |largest: f64, value| largest.max(value.re.abs() / length as f64))
    }

    /// Returns what a random test or a sine asks of a shaker: the stroke of its armature, the current and the voltage.
    fn shaker_checks(&self, shaker: &ShakerSpec, specification: &Specification, figures: &Figures) -> Vec<Check> {
        // Per acceleration: the force H into the structure, the displacement s of the armature, the current i with Bl i = H + m s̈
        // + c ṡ + k s, and the voltage V = (R + jωL) i + jω Bl s.
        let each = |hz: f64| {
            let omega = core::f64::consts::TAU * hz;
            let force = self.force_per_acceleration(hz);
            let stroke = force * self.at(Quantity::Receptance, self.drive, hz);
            let reaction = Complex::new(
                shaker.stiffness_n_m - omega * omega * shaker.moving_mass_kg,
                omega * shaker.damping_n_s_m,
            );
            let current = (force + reaction * stroke) / shaker.force_factor_n_a;
            let voltage = current * Complex::new(shaker.resistance_ohm, omega * shaker.inductance_h)
                + Complex::new(0.0, omega * shaker.force_factor_n_a) * stroke;
            [stroke, current, voltage].map(size)
        };
        let limits = [
            ("stroke of the shaker", shaker.stroke_m, "m"),
            ("current of the shaker", shaker.current_limit_a, "A"),
            ("voltage of the shaker", shaker.voltage_limit_v, "V"),
        ];
        let checks = limits.into_iter().enumerate().filter_map(|(place, (what, limit, unit))| {
            let (_, peak) = self.rms_and_peak(specification, figures, &|hz| each(hz)[place])?;
            Some(check(what, peak, limit, unit))
        });
        checks.collect()
    }
}

/// Formats a number with four digits.
pub(crate) fn figure_of(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return short(&value).to_string();
    }
    // Three digits behind the first one, and never behind the ninth decimal place.
    let places = (3.0 - libm::floor(libm::log10(value.abs()))).clamp(0.0, 9.0) as usize;
    let text = rounded(&value, places).to_string();
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

impl Document<'_> {
    fn text(&self, title: &str) -> String {
        let mut text = format!("{title} ({})\n", self.specification.test.kind());
        text.extend(self.specification.sources.iter().map(|source| format!("  {source}\n")));
        let mut line = |name: &str, value: String| text += &format!("{name:28} {value}\n");
        let n = figure_of;
        let peaks = |acceleration: f64, velocity: f64, displacement_m: f64| {
            let millimetres = n(1e3 * displacement_m);
            format!("{} m/s², {} m/s, {millimetres} mm", n(acceleration), n(velocity))
        };
        match &self.figures {
            Figures::Random(figures) => {
                let RandomFigures { rms_m_s2, velocity_rms_m_s, displacement_rms_m, crest, .. } = *figures;
                let sigma = short(&crest);
                line("rms acceleration", format!("{} m/s², {} g", n(rms_m_s2), n(rms_m_s2 / GRAVITY_M_S2)));
                line("rms velocity", format!("{} m/s", n(velocity_rms_m_s)));
                line("rms displacement", format!("{} mm", n(1e3 * displacement_rms_m)));
                let peaks = peaks(figures.peak_m_s2, figures.velocity_peak_m_s, figures.displacement_peak_m);
                line(&format!("peaks of {sigma} sigma"), peaks);
                line("zero crossings", format!("{} a second", n(figures.zero_crossings_hz)));
                if let (Some(duration_s), Some(cycles)) = (figures.duration_s, figures.cycles) {
                    line("duration", format!("{} s, {} cycles at full level", n(duration_s), n(cycles)));
                }
                if let (Some(freedom), Some([low, high])) = (figures.degrees_of_freedom, figures.perfect_db) {
                    line("degrees of freedom", format!("{} at full level", rounded(&freedom, 0)));
                    let band = format!("{} to +{} dB for 95 % of the lines", rounded(&low, 2), rounded(&high, 2));
                    line("perfect controller", band);
                }
            }
            Figures::Sine(total) => {
                line("duration", format!("{} s, {} cycles", n(total.duration_s), n(total.cycles)));
                for segment in &total.segments {
                    let peaks = peaks(segment.peak_m_s2, segment.velocity_peak_m_s, segment.displacement_peak_m);
                    let [seconds, cycles] = [segment.seconds, segment.cycles].map(n);
                    let value = format!("up to {peaks}; {seconds} s and {cycles} cycles a sweep");
                    line(&format!("{} to {} Hz", n(segment.from_hz), n(segment.to_hz)), value);
                }
            }
            Figures::Shock(figures) => {
                line("peak acceleration", format!("{} m/s²", n(figures.peak_m_s2)));
                line("velocity change", format!("{} m/s", n(figures.velocity_change_m_s)));
                line("peak velocity", format!("{} m/s", n(figures.velocity_peak_m_s)));
                match (figures.compensation, figures.stroke_m) {
                    (Some(part), Some(stroke_m)) => {
                        line("compensation", format!("{} % of the peak", n(100.0 * part)));
                        line("stroke", format!("{} mm", n(1e3 * stroke_m)));
                    }
                    _ => line("stroke", String::from("not limited: the specification has no pre_s and post_s")),
                }
                line("shots at full level", figures.shots.to_string());
            }
            Figures::Srs(figures) => {
                line("lines", figures.lines.to_string());
                line("largest acceleration", format!("{} m/s² of oscillators", n(figures.largest_m_s2)));
                line("largest pseudo-velocity", format!("{} m/s", n(figures.pseudo_velocity_m_s)));
                line("shots at full level", figures.shots.to_string());
            }
        }
        for Force { of, rms_n, peak_n } in &self.forces {
            let rms = rms_n.map(|rms_n| format!("rms {} N", n(rms_n)));
            let peak = peak_n.map(|peak_n| format!("peak {} N", n(peak_n)));
            let all: Vec<String> = rms.into_iter().chain(peak).collect();
            let value =
                if all.is_empty() { String::from("not known: many shocks have this spectrum") } else { all.join(", ") };
            line("force", format!("{value}, of {of}"));
        }
        for SweptMode { frequency_hz, damping_ratio, sweep_parameter } in &self.swept_modes {
            let [eta, part] = [*sweep_parameter, 100.0 * sweep_parameter / core::f64::consts::PI].map(n);
            let value = format!("ζ {}, η {eta}: a feedback loop errs by about {part} % at it", n(*damping_ratio));
            line(&format!("mode at {} Hz", n(*frequency_hz)), value);
        }
        for Check { what, needed, limit, unit, fits } in &self.checks {
            let verdict = if *fits { "fits" } else { "does not fit" };
            line(what, format!("{verdict}: {} of {} {unit}", n(*needed), n(*limit)));
        }
        text
    }
}

/// Draws the level with its tolerance, and returns it as a table.
fn figure(specification: &Specification, title: &str) -> (Figure, String) {
    let figure = Figure::new(title).subtitle(specification.sources.join("; "));
    if let Test::Shock(test) = &specification.test {
        // So many samples draw the pulse as smoothly as a formula.
        let rate_hz = 500.0 / test.duration_s;
        let (record, start) = test.compensated(rate_hz).unwrap_or_else(|| (test.samples(rate_hz), 0));
        let times: Vec<f64> = (0..record.len()).map(|k| (k as f64 - start as f64) / rate_hz).collect();
        let points = |shift: f64, all: bool| {
            let within = |t_s: f64| all || (t_s >= 0.0 && t_s <= test.duration_s);
            let each = times.iter().zip(&record).filter(|(t_s, _)| within(**t_s));
            each.map(|(t_s, sample)| (*t_s, sample + shift)).collect::<Vec<_>>()
        };
        let half = test.band * test.peak_m_s2;
        let panel = pulse_panel([-half, half].map(|shift| points(shift, false)), points(0.0, true));
        return (figure.with(panel), table(&[("time_s", times), ("acceleration_m_s2", record)]));
    }
    let Some(curve) = level_curve(&specification.test) else { return (figure, String::new()) };
    let panel = level_panel(&curve, level_label(&specification.test));
    let LevelCurve { frequency_hz, level, low, high } = curve;
    (figure.with(panel), table(&[("frequency_hz", frequency_hz), ("level", level), ("low", low), ("high", high)]))
}
