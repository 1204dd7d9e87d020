//! Points measured on a bench in the position of Fig. 9: the document of `experiment fig9 --json`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use resonarm_dynamics::arm::{Arm, ArmError, Parameters, Pose, Preset};
use resonarm_numeric::number::short;
use resonarm_scenario::text_file;
use resonarm_scenario::{StructureSection, StructureSectionError};

/// Why a document of measured zones can't be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeasuredError {
    /// The file can't be read.
    #[error("can't read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is another document.
    #[error("{origin} is no document of `experiment fig9 --json`: {source}")]
    Parse {
        /// Its name.
        origin: String,
        /// The difference.
        source: serde_json::Error,
    },
    /// The arm is invalid.
    #[error("{origin}: {source}")]
    Arm {
        /// Name of the document.
        origin: String,
        /// The reason.
        source: ArmError,
    },
    /// The preset is unknown, or the arm no variant of it.
    #[error("{origin}: {source}")]
    Structure {
        /// Name of the document.
        origin: String,
        /// The reason.
        source: StructureSectionError,
    },
    /// It has no zones.
    #[error("{origin}: it has no zones")]
    NoZone {
        /// Name of the document.
        origin: String,
    },
    /// A number of a zone is impossible.
    #[error("{origin}: zone {zone}: {key} is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Name of the document.
        origin: String,
        /// The zone, from 1.
        zone: usize,
        /// The key.
        key: &'static str,
        /// The value.
        got: f64,
        /// The accepted values.
        expected: &'static str,
    },
    /// No point in it settled.
    #[error("{origin}: none of its points has settled: there is nothing to draw")]
    NothingSettled {
        /// Name of the document.
        origin: String,
    },
}

/// How points were measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Way {
    /// By a stepped sine with rising frequency.
    Up,
    /// By one with falling frequency.
    Down,
    /// By a walk of the phase.
    Walk,
}

impl Way {
    /// Every way.
    pub const ALL: [Way; 3] = [Way::Up, Way::Down, Way::Walk];

    /// In words, for figures.
    pub const fn label(self) -> &'static str {
        match self {
            Way::Up => "sine up",
            Way::Down => "sine down",
            Way::Walk => "phase walk",
        }
    }
}

/// A measured motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeasuredPoint {
    /// How it was measured.
    pub way: Way,
    /// Frequency of the excitation, Hz.
    pub frequency_hz: f64,
    /// The largest |α1| and |α2|, rad.
    pub amplitude_rad: [f64; 2],
}

/// A zone measured under one force.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredZone {
    /// Amplitude of the force at the tip along x, N.
    pub force_n: f64,
    /// First and last frequency, Hz.
    pub range_hz: [f64; 2],
    /// Its settled points, grouped by way.
    pub points: Vec<MeasuredPoint>,
}

/// The zones of an arm measured on a bench.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredZones {
    /// The preset.
    pub preset: Preset,
    /// The arm in its pose.
    pub arm: Arm,
    /// The preset and the differences from it.
    pub label: String,
    /// The zones in the order of the document, at least one.
    pub zones: Vec<MeasuredZone>,
}

#[derive(Deserialize)]
struct Document {
    configuration: Configuration,
    zones: Vec<Zone>,
}

#[derive(Deserialize)]
struct Configuration {
    #[serde(default)]
    name: Option<String>,
    preset: String,
    parameters: Parameters,
    beta1_deg: f64,
    beta2_deg: f64,
}

#[derive(Deserialize)]
struct Zone {
    force_n: [f64; 2],
    range_hz: [f64; 2],
    walk: Run,
    up: Run,
    down: Run,
}

#[derive(Deserialize)]
struct Run {
    points: Vec<Point>,
}

#[derive(Deserialize)]
struct Point {
    frequency_hz: f64,
    amplitude_rad: [f64; 2],
    settled: bool,
}

impl MeasuredZones {
    /// Reads a file.
    ///
    /// # Errors
    /// [`MeasuredError::Read`] if it can't be read; else as [`MeasuredZones::parse`].
    pub fn read(path: &Path) -> Result<MeasuredZones, MeasuredError> {
        let text =
            text_file::read_numbers(path).map_err(|source| MeasuredError::Read { path: path.to_path_buf(), source })?;
        MeasuredZones::parse(&text, &path.display().to_string())
    }

    /// Reads a document; `origin` is its name in messages. Other keys are ignored.
    ///
    /// # Errors
    /// [`MeasuredError`] names what is missing or impossible.
    pub fn parse(text: &str, origin: &str) -> Result<MeasuredZones, MeasuredError> {
        let name = || origin.to_string();
        let document: Document =
            serde_json::from_str(text).map_err(|source| MeasuredError::Parse { origin: name(), source })?;
        let Configuration { name: arm_name, preset, parameters, beta1_deg, beta2_deg } = document.configuration;
        let no_arm = |source| MeasuredError::Arm { origin: name(), source };
        let pose = Pose { beta1_deg, beta2_deg };
        let arm = Arm::new(parameters, pose).map_err(no_arm)?;
        let no_structure = |source| MeasuredError::Structure { origin: name(), source };
        let of_arm = StructureSection::of_arm(&preset, &parameters, pose).map_err(no_structure)?;
        let section = StructureSection { name: arm_name, ..of_arm };
        let zones = document.zones.iter().enumerate().map(|(index, zone)| zone.measured(origin, index + 1));
        let measured = MeasuredZones {
            preset: preset.parse().map_err(|source| no_structure(StructureSectionError::from(source)))?,
            arm,
            label: section.label(),
            zones: zones.collect::<Result<_, _>>()?,
        };
        if measured.zones.is_empty() {
            return Err(MeasuredError::NoZone { origin: name() });
        }
        if measured.zones.iter().all(|zone| zone.points.is_empty()) {
            return Err(MeasuredError::NothingSettled { origin: name() });
        }
        Ok(measured)
    }

    /// The frequencies of all zones, Hz.
    pub fn range_hz(&self) -> [f64; 2] {
        self.zones
            .iter()
            .fold([f64::INFINITY, 0.0], |[low, high], zone| [low.min(zone.range_hz[0]), high.max(zone.range_hz[1])])
    }
}

impl Zone {
    /// The zone number `zone` of a document, checked.
    fn measured(&self, origin: &str, zone: usize) -> Result<MeasuredZone, MeasuredError> {
        let require = |key, got: f64, fits: bool, expected| {
            let refusal = || MeasuredError::Value { origin: origin.to_string(), zone, key, got, expected };
            if fits { Ok(()) } else { Err(refusal()) }
        };
        let ([x, y], [from, to]) = (self.force_n, self.range_hz);
        require("force_n along x", x, x > 0.0, "a positive number")?;
        require("force_n along y", y, y == 0.0, "0, since Fig. 9 is of a force along x")?;
        require("range_hz, its start,", from, from > 0.0, "a positive number")?;
        require("range_hz, its end,", to, to > from, "larger than its start")?;
        let runs = Way::ALL.into_iter().zip([&self.up, &self.down, &self.walk]);
        let mut points = Vec::new();
        for (way, point) in runs.flat_map(|(way, run)| run.points.iter().map(move |point| (way, point))) {
            let Point { frequency_hz, amplitude_rad, settled } = *point;
            require("frequency_hz of a point", frequency_hz, frequency_hz > 0.0, "a positive number")?;
            for amplitude in amplitude_rad {
                require("amplitude_rad of a point", amplitude, amplitude >= 0.0, "zero or a positive number")?;
            }
            if settled {
                points.push(MeasuredPoint { way, frequency_hz, amplitude_rad });
            }
        }
        Ok(MeasuredZone { force_n: x, range_hz: self.range_hz, points })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A document of two zones, with one point each way in each.
    fn document() -> serde_json::Value {
        let run = |hz: f64| {
            serde_json::json!({ "points": [
                { "frequency_hz": hz, "amplitude_rad": [0.01, 0.02], "settled": true, "phase_deg": null },
                { "frequency_hz": hz + 1.0, "amplitude_rad": [0.02, 0.03], "settled": false },
            ], "outcome": "finished" })
        };
        let zone = |force_n: f64, range_hz: [f64; 2]| {
            let [up, down, walk] = [1.0, 2.0, 3.0].map(|part| run(range_hz[0] + part));
            serde_json::json!({
                "force_n": [force_n, 0.0], "range_hz": range_hz, "up": up, "down": down, "walk": walk, "backbone": run(1.0)
            })
        };
        let parameters = Preset::Irb1600Fitted.parameters().unwrap();
        serde_json::json!({
            "configuration": {
                "preset": "irb1600-fitted", "parameters": parameters, "beta1_deg": -76.5, "beta2_deg": 120.0
            },
            "zones": [zone(100.0, [26.0, 33.5]), zone(15.0, [33.5, 46.0])],
        })
    }

    #[test]
    fn settled_points_are_read() {
        let read = MeasuredZones::parse(&document().to_string(), "zones.json").unwrap();
        assert_eq!((read.label.as_str(), read.range_hz()), ("irb1600-fitted", [26.0, 46.0]));
        assert_eq!(read.arm.pose(), Pose { beta1_deg: -76.5, beta2_deg: 120.0 });
        let point = |way, frequency_hz| MeasuredPoint { way, frequency_hz, amplitude_rad: [0.01, 0.02] };
        assert_eq!(read.zones[1].force_n, 15.0);
        assert_eq!(read.zones[1].points, [point(Way::Up, 34.5), point(Way::Down, 35.5), point(Way::Walk, 36.5)]);
    }

    /// The error message for the document with another value at a place.
    fn says(place: &str, value: serde_json::Value) -> String {
        let mut document = document();
        *document.pointer_mut(place).unwrap() = value;
        MeasuredZones::parse(&document.to_string(), "zones.json").unwrap_err().to_string()
    }

    #[test]
    fn errors_say_what_is_wrong_where() {
        insta::assert_snapshot!(says("/zones", [0; 0].into()), @"zones.json: it has no zones");
        insta::assert_snapshot!(says("/zones/0/force_n/0", (-1).into()), @"zones.json: zone 1: force_n along x is -1: it must be a positive number");
        insta::assert_snapshot!(says("/zones/1/force_n/1", 3.into()), @"zones.json: zone 2: force_n along y is 3: it must be 0, since Fig. 9 is of a force along x");
        insta::assert_snapshot!(says("/zones/1/range_hz/1", 30.into()), @"zones.json: zone 2: range_hz, its end, is 30: it must be larger than its start");
        insta::assert_snapshot!(says("/zones/0/up/points/1/frequency_hz", 0.into()), @"zones.json: zone 1: frequency_hz of a point is 0: it must be a positive number");
        insta::assert_snapshot!(says("/zones/0/walk/points/0/amplitude_rad/1", (-0.5).into()), @"zones.json: zone 1: amplitude_rad of a point is -0.5: it must be zero or a positive number");
        insta::assert_snapshot!(says("/configuration/beta2_deg", serde_json::Value::Null), @"zones.json is no document of `experiment fig9 --json`: invalid type: null, expected f64 at line 1 column 52");
        insta::assert_snapshot!(says("/configuration/preset", "irb".into()), @"zones.json: structure: there is no preset `irb`: the presets are irb1600-table1, irb1600-fitted");
        let mut unsettled = document();
        for zone in unsettled["zones"].as_array_mut().unwrap() {
            for run in ["up", "down", "walk"] {
                zone[run]["points"][0]["settled"] = false.into();
            }
        }
        let unsettled = MeasuredZones::parse(&unsettled.to_string(), "zones.json").unwrap_err();
        insta::assert_snapshot!(unsettled, @"zones.json: none of its points has settled: there is nothing to draw");
        let absent = MeasuredZones::read("/nonexistent/zones.json".as_ref()).unwrap_err();
        insta::assert_snapshot!(absent, @"can't read /nonexistent/zones.json: No such file or directory (os error 2)");
    }
}
