//! Points measured on a bench in the position of Fig. 9: the document of `experiment fig9 --json`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use resonarm_dynamics::structure::Assembly;
use resonarm_numeric::number::short;
use resonarm_scenario::{StructureSection, StructureSectionError, text_file};

/// Error of a document of measured zones.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeasuredError {
    /// The file can't be read.
    #[error("can't read {}: {source}", path.display())]
    Read {
        /// File that can't be read.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is another document.
    #[error("{origin} is not a document of `experiment fig9 --json`: {source}")]
    Parse {
        /// Name of the document.
        origin: String,
        /// The place and the kind of the difference.
        source: serde_json::Error,
    },
    /// The structure is invalid.
    #[error("{origin}: {source}")]
    Structure {
        /// Name of the document.
        origin: String,
        /// Error in the structure.
        source: Box<StructureSectionError>,
    },
    /// The measured structure has no tip that is driven along x.
    #[error("{origin}: the structure has no degree of freedom {name}; it has {known}")]
    NoDof {
        /// Name of the document.
        origin: String,
        /// The degree of freedom.
        name: String,
        /// The degrees of freedom that there are.
        known: String,
    },
    /// The document has no zones.
    #[error("{origin}: the document has no zones, so there is nothing to draw; measure at least one")]
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
        /// Key of the number.
        key: &'static str,
        /// Value in the document.
        got: f64,
        /// Description of the valid numbers.
        expected: &'static str,
    },
    /// None of the measured points settled.
    #[error("{origin}: none of the measured points has settled, so there is nothing to draw")]
    NothingSettled {
        /// Name of the document.
        origin: String,
    },
}

/// The way in which points were measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Way {
    /// Stepped sine with rising frequency.
    Up,
    /// Stepped sine with falling frequency.
    Down,
    /// Phase-resonance test, which steps the phase lag (`experiment walk`).
    Walk,
}

impl Way {
    /// All ways of measuring.
    pub const ALL: [Way; 3] = [Way::Up, Way::Down, Way::Walk];

    /// Returns the name in figures.
    pub const fn label(self) -> &'static str {
        match self {
            Way::Up => "sine up",
            Way::Down => "sine down",
            Way::Walk => "phase walk",
        }
    }
}

/// A measured periodic response.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredPoint {
    /// Way in which the point was measured.
    pub way: Way,
    /// Frequency of the excitation, Hz.
    pub frequency_hz: f64,
    /// The amplitude of the fundamental at each degree of freedom of [`MeasuredZones::read`], m; `None` where it was not
    /// measured.
    pub amplitude: Vec<Option<f64>>,
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

/// The zones of a structure measured on a bench.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredZones {
    /// The name of the preset, or that of the structure.
    pub name: String,
    /// The structure that was measured.
    pub structure: Assembly,
    /// The structure in words.
    pub label: String,
    /// Degrees of freedom at which it was measured: for each point the axis along which it moves most.
    pub read: Vec<String>,
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
    structure: serde_json::Value,
}

#[derive(Deserialize)]
struct Zone {
    drive: BTreeMap<String, Reading>,
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
    readings: BTreeMap<String, Reading>,
    settled: bool,
}

/// A reading or a load in the document.
#[derive(Deserialize)]
struct Reading {
    amplitude: f64,
}

impl MeasuredZones {
    /// Reads the document from a file.
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
    /// [`MeasuredError`] with the key that is missing or impossible.
    pub fn parse(text: &str, origin: &str) -> Result<MeasuredZones, MeasuredError> {
        let name = || origin.to_string();
        let document: Document =
            serde_json::from_str(text).map_err(|source| MeasuredError::Parse { origin: name(), source })?;
        let stated = document.configuration.structure;
        let word = |key: &str| stated[key].as_str().map(str::to_owned);
        // A structure that is given by its preset has no name of its own.
        let called = word("name").or(word("preset")).unwrap_or_else(|| String::from("structure"));
        let angles = stated["angles_deg"].as_array().map_or(String::new(), |angles| {
            let angles: Vec<String> =
                angles.iter().filter_map(serde_json::Value::as_f64).map(|angle_deg| format!("{angle_deg}°")).collect();
            format!(" at {}", angles.join(", ").replace('-', "−"))
        });
        let section = StructureSection::from_document(stated)
            .map_err(|source| MeasuredError::Parse { origin: name(), source })?;
        let invalid = |source| MeasuredError::Structure { origin: name(), source: Box::new(source) };
        let structure = section.assembly().map_err(invalid)?;
        let read = read_at(&document.zones);
        let known = structure.dof_names();
        if let Some(absent) = read.iter().find(|name| !known.contains(name)) {
            let name = absent.clone();
            let known = known.join(", ");
            return Err(MeasuredError::NoDof { origin: origin.to_string(), name, known });
        }
        let zones = document.zones.iter().enumerate().map(|(index, zone)| zone.measured(origin, index + 1, &read));
        let measured = MeasuredZones {
            zones: zones.collect::<Result<_, _>>()?,
            structure,
            label: format!("{called}{angles}"),
            name: called,
            read,
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

/// Returns for each point that was measured, as `tip`, the axis along which it moves most.
fn read_at(zones: &[Zone]) -> Vec<String> {
    let points = || {
        let runs = zones.iter().flat_map(|zone| [&zone.up, &zone.down, &zone.walk]);
        runs.flat_map(|run| &run.points).filter(|point| point.settled)
    };
    let names: BTreeSet<&String> = points().flat_map(|point| point.readings.keys()).collect();
    let largest = |name: &str| {
        points().filter_map(|point| point.readings.get(name)).map(|reading| reading.amplitude).fold(0.0, f64::max)
    };
    let mut best: BTreeMap<&str, &String> = BTreeMap::new();
    // The names are in order: of axes with equal amplitudes the first one is kept.
    for name in names {
        let point = name.split('.').next().unwrap_or_default();
        let kept = best.entry(point).or_insert(name);
        if largest(name) > largest(kept) {
            *kept = name;
        }
    }
    best.into_values().cloned().collect()
}

impl Zone {
    /// The zone number `zone` of a document, checked.
    fn measured(&self, origin: &str, zone: usize, read: &[String]) -> Result<MeasuredZone, MeasuredError> {
        let require = |key, got: f64, fits: bool, expected| {
            let refusal = || MeasuredError::Value { origin: origin.to_string(), zone, key, got, expected };
            if fits { Ok(()) } else { Err(refusal()) }
        };
        // A force that is missing is reported like one of 0.
        let x = self.drive.get("tip.x").map_or(0.0, |load| load.amplitude);
        let [from, to] = self.range_hz;
        require("drive.tip.x", x, x > 0.0, "a positive number, since Fig. 9 is of a force along x")?;
        let other = self.drive.iter().find(|(name, load)| name.as_str() != "tip.x" && load.amplitude != 0.0);
        require(
            "another drive",
            other.map_or(0.0, |(_, load)| load.amplitude),
            other.is_none(),
            "left out, since Fig. 9 is of a force along x",
        )?;
        require("range_hz, its start,", from, from > 0.0, "a positive number")?;
        require("range_hz, its end,", to, to > from, "larger than its start")?;
        let runs = Way::ALL.into_iter().zip([&self.up, &self.down, &self.walk]);
        let mut points = Vec::new();
        for (way, point) in runs.flat_map(|(way, run)| run.points.iter().map(move |point| (way, point))) {
            // Points that have not settled are left out, but checked: an impossible number there means a damaged
            // document.
            let Point { frequency_hz, readings, settled } = point;
            require("frequency_hz of a point", *frequency_hz, *frequency_hz > 0.0, "a positive number")?;
            for Reading { amplitude } in readings.values() {
                require("amplitude of a point", *amplitude, *amplitude >= 0.0, "zero or a positive number")?;
            }
            if *settled {
                let amplitude = read.iter().map(|name| readings.get(name).map(|reading| reading.amplitude)).collect();
                points.push(MeasuredPoint { way, frequency_hz: *frequency_hz, amplitude });
            }
        }
        Ok(MeasuredZone { force_n: x, range_hz: self.range_hz, points })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::{Settings, Subject};
    use resonarm_dynamics::structure::Preset;

    /// A document of two zones, with one point each way in each.
    fn document() -> serde_json::Value {
        let run = |hz: f64| {
            let readings = |x: f64, y: f64| serde_json::json!({ "tip.x": { "amplitude": x, "unit": "m" }, "tip.y": { "amplitude": y } });
            serde_json::json!({ "points": [
                { "frequency_hz": hz, "readings": readings(0.01, 0.02), "settled": true, "lag_deg": null },
                { "frequency_hz": hz + 1.0, "readings": readings(0.2, 0.03), "settled": false },
            ], "outcome": "finished" })
        };
        let zone = |force_n: f64, range_hz: [f64; 2]| {
            let [up, down, walk] = [1.0, 2.0, 3.0].map(|part| run(range_hz[0] + part));
            serde_json::json!({
                "drive": { "tip.x": { "amplitude": force_n, "unit": "N" } }, "range_hz": range_hz, "up": up, "down": down, "walk": walk, "backbone": run(1.0)
            })
        };
        let subject = Subject::new(Preset::Irb1600Fitted, &Settings::embedded().unwrap()).unwrap();
        let structure = serde_json::json!({
            "preset": "irb1600-fitted", "angles_deg": [-76.5, 120.0], "links": subject.chain.links
        });
        serde_json::json!({
            "configuration": { "structure": structure, "drive": null },
            "zones": [zone(100.0, [26.0, 33.5]), zone(15.0, [33.5, 46.0])],
        })
    }

    #[test]
    fn settled_points_are_read_along_the_axis_that_moves_most() {
        let read = MeasuredZones::parse(&document().to_string(), "zones.json").unwrap();
        assert_eq!((read.label.as_str(), read.range_hz()), ("irb1600-fitted at −76.5°, 120°", [26.0, 46.0]));
        assert_eq!((read.read, read.structure.coordinates()), (vec![String::from("tip.y")], 2));
        let point = |way, frequency_hz| MeasuredPoint { way, frequency_hz, amplitude: vec![Some(0.02)] };
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
        insta::assert_snapshot!(says("/zones", [0; 0].into()), @"zones.json: the document has no zones, so there is nothing to draw; measure at least one");
        insta::assert_snapshot!(says("/zones/0/drive/tip.x/amplitude", (-1).into()), @"zones.json: zone 1: drive.tip.x is -1: it must be a positive number, since Fig. 9 is of a force along x");
        insta::assert_snapshot!(says("/zones/1/drive", serde_json::json!({ "tip.x": { "amplitude": 1.0 }, "tip.y": { "amplitude": 3.0 } })), @"zones.json: zone 2: another drive is 3: it must be left out, since Fig. 9 is of a force along x");
        insta::assert_snapshot!(says("/zones/1/range_hz/1", 30.into()), @"zones.json: zone 2: range_hz, its end, is 30: it must be larger than its start");
        insta::assert_snapshot!(says("/zones/0/up/points/1/frequency_hz", 0.into()), @"zones.json: zone 1: frequency_hz of a point is 0: it must be a positive number");
        insta::assert_snapshot!(says("/zones/0/walk/points/0/readings/tip.y/amplitude", (-0.5).into()), @"zones.json: zone 1: amplitude of a point is -0.5: it must be zero or a positive number");
        insta::assert_snapshot!(says("/configuration", serde_json::json!({})), @"zones.json is not a document of `experiment fig9 --json`: missing field `structure` at line 1 column 19");
        insta::assert_snapshot!(says("/configuration/structure/links", [0; 0].into()), @"zones.json: structure: `links` are missing: add a table [[structure.links]] for every link, from the base out");
        let mut unsettled = document();
        for zone in unsettled["zones"].as_array_mut().unwrap() {
            for run in ["up", "down", "walk"] {
                zone[run]["points"][0]["settled"] = false.into();
            }
        }
        let unsettled = MeasuredZones::parse(&unsettled.to_string(), "zones.json").unwrap_err();
        insta::assert_snapshot!(unsettled, @"zones.json: none of the measured points has settled, so there is nothing to draw");
        let absent = MeasuredZones::read("/nonexistent/zones.json".as_ref()).unwrap_err();
        insta::assert_snapshot!(absent, @"can't read /nonexistent/zones.json: No such file or directory (os error 2)");
    }
}
