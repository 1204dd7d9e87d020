//! Specifications of tests on the command line: a file, or a preset by its name.

use std::path::{Path, PathBuf};

use crate::failure::Failure;
use resonarm::scenario::specification;
use resonarm::specification::{PRESETS, Preset, Profile, Specification, Test, Tolerance};
use resonarm_figures::plot::{Axis, Color, Dash, Legend, Panel, Series, Style};

/// Returns the preset of this name, unless a file has the name.
pub(crate) fn preset(name: &Path) -> Option<Preset> {
    let found = PRESETS.into_iter().find(|preset| name.as_os_str() == preset.name);
    found.filter(|_| name.symlink_metadata().is_err())
}

/// Reads a specification from a file, or a preset.
pub(crate) fn read(name: &Path) -> Result<Specification, Failure> {
    if let Some(preset) = preset(name) {
        return Ok(specification::parse(preset.text, preset.name, Path::new(""))?);
    }
    match specification::read(name) {
        Err(specification::SpecificationFileError::Read { source, .. }) if !is_path(name) => {
            let name = name.display();
            let presets = PRESETS.map(|preset| preset.name).join(", ");
            Err(Failure::usage(format!("{name} is neither a preset nor a file ({source}): the presets are {presets}")))
        }
        result => Ok(result?),
    }
}

/// Says whether a text looks like the path of a file.
fn is_path(name: &Path) -> bool {
    name.components().count() > 1 || name.extension().is_some_and(|ending| ending == "toml")
}

/// Returns the files that a specification is read from.
pub(crate) fn files(name: &Path) -> Vec<PathBuf> {
    if preset(name).is_some() { Vec::new() } else { specification::files(name) }
}

/// Returns the name of a specification: its own, or that of its file.
pub(crate) fn title(specification: &Specification, name: &Path) -> String {
    specification.name.clone().unwrap_or_else(|| name.display().to_string())
}

/// Points of a curve over frequency, per octave.
const IN_OCTAVE: f64 = 48.0;

/// Returns frequencies between two, evenly spaced over a logarithmic axis, with further ones between them.
fn frequencies_hz([from_hz, to_hz]: [f64; 2], more: impl Iterator<Item = f64>) -> Vec<f64> {
    let count = (IN_OCTAVE * libm::log2(to_hz / from_hz)).ceil().max(1.0) as usize;
    let at = |k: usize| from_hz * libm::pow(to_hz / from_hz, k as f64 / count as f64);
    let mut all: Vec<f64> = (0..=count).map(at).chain(more.filter(|hz| *hz > from_hz && *hz < to_hz)).collect();
    // A curve runs through its points in order; ends of segments may be among the even ones.
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Level of a test over frequency, with its tolerance.
pub(crate) struct LevelCurve {
    pub frequency_hz: Vec<f64>,
    pub level: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

/// Returns the level over frequency; `None` of a classical shock.
pub(crate) fn level_curve(test: &Test) -> Option<LevelCurve> {
    let curve = |frequency_hz: Vec<f64>, level: &dyn Fn(f64) -> f64, ends: &dyn Fn(f64) -> [f64; 2]| {
        let levels: Vec<f64> = frequency_hz.iter().map(|hz| level(*hz)).collect();
        let end = |which: usize| -> Vec<f64> {
            frequency_hz.iter().zip(&levels).map(|(hz, level)| level * ends(*hz)[which]).collect()
        };
        LevelCurve { low: end(0), high: end(1), level: levels, frequency_hz }
    };
    let breaks = |tolerance: &Tolerance| -> Vec<f64> {
        // Just below a change of the tolerance, too, so that its step is steep.
        tolerance.bands().iter().flat_map(|band| [band.from_hz * (1.0 - 1e-6), band.from_hz]).collect()
    };
    // A decibel is a tenth of a decade of a density, which is a power, and a twentieth of one of an acceleration.
    let of_profile = |profile: &Profile, tolerance: &Tolerance, in_decade: f64| {
        let points = profile.points().iter().map(|[hz, _]| *hz).chain(breaks(tolerance));
        let all = frequencies_hz(profile.band_hz(), points);
        let level = |hz| profile.at(hz).unwrap_or(f64::NAN);
        Some(curve(all, &level, &|hz| tolerance.at(hz).map(|db| libm::pow(10.0, db / in_decade))))
    };
    match test {
        Test::Random(test) => of_profile(&test.profile, &test.tolerance, 10.0),
        Test::Srs(test) => of_profile(&test.profile, &test.tolerance, 20.0),
        Test::Sine(test) => {
            let all = frequencies_hz(test.band_hz(), test.segments.iter().map(|segment| segment.to_hz));
            let level = |hz| test.acceleration_m_s2(hz).unwrap_or(f64::NAN);
            Some(curve(all, &level, &|_| [1.0 - test.tolerance, 1.0 + test.tolerance]))
        }
        Test::Shock(_) => None,
    }
}

/// Points of a line.
type Points = Vec<(f64, f64)>;

/// Draws what is specified into a panel, with the lower and the upper limit of its tolerance.
fn with_tolerance(panel: Panel, [low, high]: [Points; 2], specified: Points) -> Panel {
    let dashed = Style::Line { color: Color::Vermillion, width: 1.2, dash: Dash::Dashed };
    panel
        .legend(Legend::Below)
        .with(Series::line("tolerance", Color::Vermillion, low).style(dashed))
        .with(Series::line("tolerance", Color::Vermillion, high).style(dashed).unlabelled())
        .with(Series::line("specified", Color::Black, specified))
}

/// Draws a level with its tolerance into a panel over logarithmic axes.
pub(crate) fn level_panel(curve: &LevelCurve, label: &str) -> Panel {
    let points = |values: &[f64]| curve.frequency_hz.iter().copied().zip(values.iter().copied()).collect();
    let panel = Panel::new(Axis::log("frequency (Hz)"), Axis::log(label));
    with_tolerance(panel, [&curve.low, &curve.high].map(|end| points(end)), points(&curve.level))
}

/// Draws the pulse of a shock with its tolerance into a panel over time.
pub(crate) fn pulse_panel(tolerance: [Points; 2], specified: Points) -> Panel {
    let x = Axis::linear("time from the start of the pulse (s)");
    with_tolerance(Panel::new(x, Axis::linear("acceleration (m/s²)")), tolerance, specified)
}

/// Returns the label of a test's level with its unit.
pub(crate) const fn level_label(test: &Test) -> &'static str {
    match test {
        Test::Random(_) => "density of acceleration ((m/s²)²/Hz)",
        Test::Sine(_) => "amplitude of acceleration (m/s²)",
        Test::Shock(_) => "acceleration (m/s²)",
        Test::Srs(_) => "largest acceleration of oscillators (m/s²)",
    }
}
