//! The moving arm as `foxglove.SceneUpdate`: a line over base, elbow and tip, which replaces that of the sample before.

use nalgebra::Vector2;
use serde_json::{Value, json};

use super::ExportError;
use super::foxglove::{time, time_schema};
use crate::recording::{Recording, StateRecord};
use crate::scenario::Scenario;
use resonarm_dynamics::arm::Arm;

/// The topic.
pub const TOPIC: &str = "/arm";
/// The full name of the schema.
pub const SCHEMA: &str = "foxglove.SceneUpdate";
/// The frame in which the points stand: the base frame of the arm.
const FRAME: &str = "base";
/// Of a line (foxglove.dev, "LineType"): from each point to the next.
const LINE_STRIP: u8 = 0;
const THICKNESS_M: f64 = 0.05;

/// Draws the arm.
pub struct Scene {
    arm: Arm,
    /// How many times as large as they are the vibrations α are drawn.
    magnification: f64,
}

impl Scene {
    /// The arm of the recording's scenario.
    ///
    /// # Errors
    /// [`ExportError::Magnification`], and [`ExportError::Scenario`] if the recording has no scenario with an arm.
    pub fn new(recording: &Recording, magnification: f64) -> Result<Scene, ExportError> {
        if !(magnification.is_finite() && magnification > 0.0) {
            return Err(ExportError::Magnification { got: magnification });
        }
        let arm = Scenario::from_configuration(recording.configuration()).and_then(|scenario| scenario.build_arm())?;
        Ok(Scene { arm, magnification })
    }

    /// The message of a state.
    pub fn message(&self, state: &StateRecord, time_ns: u64) -> Value {
        message(&self.arm, &state.alpha_rad(), self.magnification, time_ns)
    }
}

/// The message of an arm at vibration angles α1 and α2, drawn `magnification` times as large, which its metadata say.
pub fn message(arm: &Arm, alpha_rad: &[f64; 2], magnification: f64, time_ns: u64) -> Value {
    let points = arm.points(&(magnification * Vector2::from(*alpha_rad)));
    let point = |position: Vector2<f64>| json!({ "x": position.x, "y": position.y, "z": 0.0 });
    let line = json!({
        "type": LINE_STRIP,
        "pose": {
            "position": { "x": 0.0, "y": 0.0, "z": 0.0 },
            "orientation": { "x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0 }
        },
        "thickness": THICKNESS_M,
        "scale_invariant": false,
        "points": [point(Vector2::zeros()), point(points.b_m), point(points.c_m)],
        "color": { "r": 0.9, "g": 0.5, "b": 0.1, "a": 1.0 },
        "colors": [],
        "indices": []
    });
    let entity = json!({
        "timestamp": time(time_ns),
        "frame_id": FRAME,
        "id": "arm",
        "lifetime": { "sec": 0, "nsec": 0 },
        "frame_locked": false,
        "metadata": [{ "key": "magnification", "value": magnification.to_string() }],
        "arrows": [],
        "cubes": [],
        "spheres": [],
        "cylinders": [],
        "lines": [line],
        "triangles": [],
        "texts": [],
        "models": []
    });
    json!({ "deletions": [], "entities": [entity] })
}

/// The fields of `foxglove.SceneUpdate` that are written. The lists of other primitives are always empty.
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
    let line = json!({
        "title": "foxglove.LinePrimitive",
        "type": "object",
        "properties": {
            "type": { "type": "integer" },
            "pose": {
                "type": "object",
                "properties": {
                    "position": numbers(&["x", "y", "z"]),
                    "orientation": numbers(&["x", "y", "z", "w"])
                }
            },
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
            "spheres": empty(),
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
