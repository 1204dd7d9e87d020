//! The structures of the oracles, and one of the literature whose speed is compared.

use std::f64::consts::TAU;

use resonarm_analysis::Forced;
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, Dof, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, Side, StructureSpec, Term,
};
use serde_json::Value;

/// A case of an oracle file, with its structure under its load.
pub struct Case {
    pub data: Value,
    pub forced: Forced,
    /// The degree of freedom at which the response is read.
    pub read: Dof,
}

/// The cases of a kind in the text of an oracle file.
pub fn cases(file: &str, kind: &str) -> Vec<Case> {
    let file: Value = serde_json::from_str(file).unwrap();
    file[kind].as_array().unwrap().iter().map(|case| Case::new(case.clone())).collect()
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap()
}

fn place(name: &Value) -> Place {
    let point = name.as_str().unwrap().strip_suffix(".x").unwrap();
    Place::Dof { point: point.into(), axis: Axis::X }
}

fn law(of: &Value) -> Law {
    // A value that is not stated is zero.
    let at = |key: &str| of[key].as_f64().unwrap_or(0.0);
    let (stiffness, damping, gap) = (at("stiffness_n_m"), at("damping_n_s_m"), at("gap_m"));
    match of["kind"].as_str().unwrap() {
        "cubic" => Law::Cubic { stiffness3: at("stiffness3_n_m3"), stiffness5: 0.0 },
        "linear" => Law::Linear { stiffness, damping },
        "gap" => Law::Gap { stiffness, gap, preload: 0.0 },
        "contact" => Law::KelvinVoigt { stiffness, damping, gap, side: Side::Positive, preload: 0.0 },
        "friction" => Law::Friction { stiffness, slip: at("slip_force_n") },
        "tanh" => Law::Tanh { slip: at("slip_force_n"), velocity: at("velocity_m_s") },
        "lugre" => Law::Lugre {
            bristle_stiffness: stiffness,
            bristle_damping: damping,
            viscous: at("viscous_n_s_m"),
            coulomb: at("slip_force_n"),
            breakaway: at("breakaway_n"),
            stribeck: at("stribeck_m_s"),
        },
        other => panic!("no oracle has the law {other}"),
    }
}

impl Case {
    fn new(data: Value) -> Case {
        let of_modes = data["modes"].as_array().unwrap();
        let mode = |mode: &Value| ModeSpec {
            frequency_hz: number(mode, "frequency_hz"),
            damping_ratio: number(mode, "damping_ratio"),
        };
        let shapes = of_modes[0]["shape"].as_object().unwrap().keys().map(|name| ShapeSpec {
            point: name.strip_suffix(".x").unwrap().into(),
            axis: Axis::X,
            by_mode: of_modes.iter().map(|mode| number(&mode["shape"], name)).collect(),
        });
        let modal = ModalSpec { modes: of_modes.iter().map(mode).collect(), shapes: shapes.collect() };
        let elements = data["elements"].as_array().unwrap().iter();
        let elements = elements.map(|element| {
            let (at, to) = match element["between"].as_array() {
                Some(ends) => (place(&ends[0]), Some(place(&ends[1]))),
                None => (place(&element["at"]), None),
            };
            ElementSpec::Point { at, to, law: law(element) }
        });
        let spec = StructureSpec { body: BodySpec::Modal(modal), elements: elements.collect() };
        let assembly = Assembly::new(&spec).unwrap();
        let drive = assembly.dof(data["drive"].as_str().unwrap()).unwrap();
        let read = data["read"].as_str().map_or(drive, |read| assembly.dof(read).unwrap());
        let forced = Forced::new(assembly, drive, number(&data, "force_n"));
        Case { data, forced, read }
    }

    /// The name without the load at its end.
    pub fn name(&self) -> &str {
        let name = self.data["name"].as_str().unwrap();
        name.strip_suffix(&format!(" {} N", self.forced.amplitude())).unwrap_or(name)
    }

    pub fn number(&self, key: &str) -> f64 {
        number(&self.data, key)
    }

    /// The numbers of a key; none if the case does not have it.
    pub fn numbers(&self, key: &str) -> Vec<f64> {
        self.data[key].as_array().into_iter().flatten().map(|number| number.as_f64().unwrap()).collect()
    }
}

/// Example 6 of NLvib (M. Krack, J. Gross, 2019): quadratic and cubic springs over two modes, with the load on both.
pub fn nlvib_6(force_n: f64) -> Case {
    let (a, b) = (1.13 * 1.13, 4.0);
    let c = (a + b) / 8.0;
    let quadratic = [([3, 0], 0.5 * a), ([1, 2], 0.5 * a), ([0, 3], 0.5 * b), ([2, 1], 0.5 * b)];
    let cubic = [([4, 0], c), ([2, 2], 2.0 * c), ([0, 4], c)];
    let terms = quadratic.into_iter().chain(cubic);
    let terms = terms.map(|(powers, energy): ([u8; 2], f64)| Term { powers: powers.to_vec(), energy }).collect();
    let modes = [(1.13, 1e-3), (2.0, 5e-3)];
    let modes = modes.map(|(rad_s, damping_ratio)| ModeSpec { frequency_hz: rad_s / TAU, damping_ratio });
    let shape =
        |point: &str, by_mode: [f64; 2]| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: by_mode.into() };
    let shapes = vec![shape("q1", [1.0, 0.0]), shape("q2", [0.0, 1.0])];
    let at = ["q1", "q2"].map(|point| Place::Dof { point: point.into(), axis: Axis::X });
    let elements = vec![ElementSpec::Polynomial { at: at.into(), terms }];
    let body = BodySpec::Modal(ModalSpec { modes: modes.into(), shapes });
    let assembly = Assembly::new(&StructureSpec { body, elements }).unwrap();
    let [read, other] = ["q1.x", "q2.x"].map(|name| assembly.dof(name).unwrap());
    let forced = Forced::at_several(assembly, &[(read, 1.0), (other, 1.0)], force_n);
    Case { data: Value::Null, forced, read }
}
