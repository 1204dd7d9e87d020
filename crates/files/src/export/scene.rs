//! Draws the moving structure as `foxglove.SceneUpdate`, which replaces that of the sample before: its lines, and a
//! sphere at each of its points.

use serde_json::{Value, json};

use super::error::ExportError;
use crate::drawing::Drawing;
use crate::recording::{Recording, StateRecord};
use resonarm_scenario::Scenario;

/// The full name of the schema.
pub const SCHEMA: &str = "foxglove.SceneUpdate";
/// The frame of the points' coordinates: the base frame.
const FRAME: &str = "base";
/// Type of a line (foxglove.dev, "LineType") that goes from each point to the next.
const LINE_STRIP: u8 = 0;
/// Thickness of lines, and diameter of points, relative to the size of the structure.
const THICKNESS: f64 = 0.015;
const DIAMETER: f64 = 0.03;

/// The topic of its messages.
pub const TOPIC: &str = "/structure";

/// Draws the structure of a recording.
pub struct Scene {
    drawing: Drawing,
    /// Magnification of the drawn vibrations.
    magnification: f64,
}

impl Scene {
    /// Draws the structure of the recording's scenario.
    ///
    /// # Errors
    /// [`ExportError::NoPlaces`] if the positions of the structure's points are not known, and [`ExportError::Scenario`]
    /// if the recording's scenario has no valid structure.
    pub fn new(recording: &Recording, magnification: f64) -> Result<Scene, ExportError> {
        let drawing = Drawing::of(&Scenario::from_configuration(recording.configuration())?)?;
        Ok(Scene { drawing: drawing.ok_or(ExportError::NoPlaces)?, magnification })
    }

    /// Returns the message of a state.
    pub fn message(&self, state: &StateRecord, time_ns: u64) -> Value {
        message(&self.drawing, state.states.coordinates(), self.magnification, time_ns)
    }
}

/// Returns the message of a structure at its coordinates, its vibration drawn `magnification` times as large, which the
/// metadata state.
pub fn message(drawing: &Drawing, coordinates: &[f64], magnification: f64, time_ns: u64) -> Value {
    let positions: Vec<Value> =
        drawing.positions_m(coordinates, magnification).iter().map(|[x, y, z]| vector(*x, *y, *z)).collect();
    let size_m = drawing.size_m();
    let line = |line: &Vec<usize>| {
        let points: Vec<&Value> = line.iter().filter_map(|point| positions.get(*point)).collect();
        json!({
            "type": LINE_STRIP, "pose": pose(&vector(0.0, 0.0, 0.0)), "thickness": THICKNESS * size_m,
            "scale_invariant": false, "points": points, "color": color(), "colors": [], "indices": []
        })
    };
    let spheres: Vec<Value> = positions.iter().map(|at| sphere(at, DIAMETER * size_m)).collect();
    let entity = json!({
        "timestamp": time(time_ns),
        "frame_id": FRAME,
        "id": "structure",
        "lifetime": { "sec": 0, "nsec": 0 },
        "frame_locked": false,
        "metadata": [{ "key": "magnification", "value": magnification.to_string() }],
        "arrows": [],
        "cubes": [],
        "spheres": spheres,
        "cylinders": [],
        "lines": drawing.lines.iter().map(line).collect::<Vec<_>>(),
        "triangles": [],
        "texts": [],
        "models": []
    });
    json!({ "deletions": [], "entities": [entity] })
}

fn vector(x: f64, y: f64, z: f64) -> Value {
    json!({ "x": x, "y": y, "z": z })
}

fn pose(position: &Value) -> Value {
    json!({ "position": position, "orientation": { "x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0 } })
}

fn color() -> Value {
    json!({ "r": 0.9, "g": 0.5, "b": 0.1, "a": 1.0 })
}

fn sphere(at: &Value, diameter_m: f64) -> Value {
    json!({ "pose": pose(at), "size": vector(diameter_m, diameter_m, diameter_m), "color": color() })
}

/// Returns the schema of the fields of `foxglove.SceneUpdate` that are written. The lists of other primitives are
/// always empty.
pub fn schema() -> Value {
    let numbers = |names: &[&str]| -> Value {
        let fields = names.iter().map(|name| ((*name).to_owned(), json!({ "type": "number" })));
        json!({ "type": "object", "properties": fields.collect::<serde_json::Map<_, _>>() })
    };
    let text = json!({ "type": "string" });
    let pair =
        json!({ "title": "foxglove.KeyValuePair", "type": "object", "properties": { "key": text, "value": text } });
    let list = |items: Value| json!({ "type": "array", "items": items });
    let empty = || list(json!({ "type": "object" }));
    let pose = json!({
        "type": "object",
        "properties": { "position": numbers(&["x", "y", "z"]), "orientation": numbers(&["x", "y", "z", "w"]) }
    });
    let sphere = json!({
        "title": "foxglove.SpherePrimitive",
        "type": "object",
        "properties": { "pose": pose, "size": numbers(&["x", "y", "z"]), "color": numbers(&["r", "g", "b", "a"]) }
    });
    let line = json!({
        "title": "foxglove.LinePrimitive",
        "type": "object",
        "properties": {
            "type": { "type": "integer" },
            "pose": pose,
            "thickness": { "type": "number" },
            "scale_invariant": { "type": "boolean" },
            "points": list(numbers(&["x", "y", "z"])),
            "color": numbers(&["r", "g", "b", "a"]),
            "colors": list(numbers(&["r", "g", "b", "a"])),
            "indices": list(json!({ "type": "integer" }))
        }
    });
    let entity = json!({
        "title": "foxglove.SceneEntity",
        "type": "object",
        "properties": {
            "timestamp": time_schema("time"),
            "frame_id": { "type": "string" },
            "id": { "type": "string" },
            "lifetime": time_schema("duration"),
            "frame_locked": { "type": "boolean" },
            "metadata": list(pair),
            "arrows": empty(),
            "cubes": empty(),
            "spheres": list(sphere),
            "cylinders": empty(),
            "lines": list(line),
            "triangles": empty(),
            "texts": empty(),
            "models": empty()
        }
    });
    json!({
        "title": SCHEMA,
        "type": "object",
        "properties": { "deletions": empty(), "entities": list(entity) }
    })
}

/// Returns the schema of a `time` or a `duration` of Foxglove.
pub(super) fn time_schema(title: &str) -> Value {
    let integer = json!({ "type": "integer" });
    json!({ "type": "object", "title": title, "properties": { "sec": integer, "nsec": integer } })
}

/// Returns a point in time, ns, as JSON.
pub(super) fn time(time_ns: u64) -> Value {
    json!({ "sec": time_ns / 1_000_000_000, "nsec": time_ns % 1_000_000_000 })
}
