use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, Side, StructureSpec,
};
use serde_json::Value;

use super::*;

/// The cases of a kind; see `tests/oracles/README.md`.
fn oracles(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/structures.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap_or(0.0)
}

fn place(name: &str) -> Place {
    let (point, axis) = name.split_once('.').unwrap();
    assert_eq!(axis, "x");
    Place::Dof { point: point.into(), axis: Axis::X }
}

fn law(of: &Value) -> Law {
    let (stiffness, gap) = (number(of, "stiffness_n_m"), number(of, "gap_m"));
    match of["kind"].as_str().unwrap() {
        "cubic" => Law::Cubic { stiffness3: number(of, "stiffness3_n_m3"), stiffness5: 0.0 },
        "gap" => Law::Gap { stiffness, gap },
        "contact" => Law::KelvinVoigt { stiffness, damping: 0.0, gap, side: Side::Positive },
        "friction" => Law::Friction { stiffness, slip: number(of, "slip_force_n") },
        other => panic!("{other}"),
    }
}

fn modal(case: &Value) -> Assembly {
    let modes = case["modes"].as_array().unwrap();
    let body = ModalSpec {
        modes: modes
            .iter()
            .map(|mode| ModeSpec {
                frequency_hz: number(mode, "frequency_hz"),
                damping_ratio: number(mode, "damping_ratio"),
            })
            .collect(),
        shapes: ["tip", "mid"]
            .map(|point| ShapeSpec {
                point: point.into(),
                axis: Axis::X,
                by_mode: modes.iter().map(|mode| number(&mode["shape"], &[point, ".x"].concat())).collect(),
            })
            .into(),
    };
    let elements = case["elements"].as_array().unwrap().iter().map(|element| ElementSpec {
        at: place(element["at"].as_str().unwrap()),
        to: None,
        law: law(element),
    });
    Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements: elements.collect() }).unwrap()
}

/// The branch of an oracle.
fn branch_of(case: &Value) -> Branch {
    let assembly = modal(case);
    let [drive, read] = ["drive", "read"].map(|key| assembly.dof(case[key].as_str().unwrap()).unwrap());
    let forced = Forced::new(assembly, drive, number(case, "force_n"));
    let ends = [number(case, "from_hz"), number(case, "to_hz")];
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    match trace(&forced, 20.0, Coordinate::FrequencyHz, &options) {
        Ok(b) => b,
        Err(e) => {
            println!("{e}");
            *e.so_far
        }
    }
}

#[test]
fn branches_have_the_folds_and_peaks_of_independent_code() {
    for case in oracles("modal") {
        let start = std::time::Instant::now();
        let branch = branch_of(&case);
        let peak = branch.orbits.iter().max_by(|a, b| a.readings[0].largest.total_cmp(&b.readings[0].largest)).unwrap();
        println!(
            "{} {:?} points {} work {:?}",
            case["elements"][0]["kind"],
            start.elapsed(),
            branch.orbits.len(),
            branch.work
        );
        println!("  peak {} {} H {}", peak.frequency_hz, peak.readings[0].largest, peak.harmonics);
        println!("  oracle {} {}", case["peak_near_hz"], case["peak_amplitude_m"]);
        for b in &branch.bifurcations {
            println!("   {} {:?}", b.kind.name(), (b.orbit.value, b.orbit.readings[0].largest, b.orbit.harmonics));
        }
        println!("{}", case["folds"]);
    }
}
