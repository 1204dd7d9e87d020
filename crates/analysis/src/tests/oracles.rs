//! `tests/oracles/arm.json` is what the two-link arm's own equations and analysis give, to which chains of two links are held.

use nalgebra::{Complex, Matrix2};
use serde_json::{Value, json};

use crate::tests::arm::{backbone_options, forced};
use crate::*;
use resonarm_dynamics::arm::{Arm, Attachment, Gravity, Load, Parameters, Pose, Preset, State};
use resonarm_numeric::noise::Noise;

const ARMS: usize = 100;

fn by_rows(matrix: &Matrix2<f64>) -> [f64; 4] {
    [matrix.m11, matrix.m12, matrix.m21, matrix.m22]
}

/// The preset with every parameter times ½ to 1½, every second time with gravity, and every third with an attachment.
fn arm(seed: u64, noise: &mut Noise) -> Option<Arm> {
    let mut times = |value: f64| value * (0.5 + noise.uniform());
    let of = Preset::Irb1600Fitted.parameters().unwrap();
    let parameters = Parameters {
        inertia1_kg_m2: times(of.inertia1_kg_m2),
        inertia2_kg_m2: times(of.inertia2_kg_m2),
        mass2_kg: times(of.mass2_kg),
        length1_m: times(of.length1_m),
        length2_m: times(of.length2_m),
        centre2_m: times(of.centre2_m),
        stiffness1_nm_rad: times(of.stiffness1_nm_rad),
        stiffness2_nm_rad: times(of.stiffness2_nm_rad),
        damping1_nm_s_rad: times(of.damping1_nm_s_rad),
        damping2_nm_s_rad: times(of.damping2_nm_s_rad),
        gravity: (!seed.is_multiple_of(2)).then(|| Gravity {
            gravity_m_s2: times(9.8),
            mass1_kg: times(40.0),
            centre1_m: times(0.2),
        }),
    };
    let mut turn_deg = || 360.0 * (noise.uniform() - 0.5);
    let arm = Arm::new(parameters, Pose { beta1_deg: turn_deg(), beta2_deg: turn_deg() }).ok()?;
    if !seed.is_multiple_of(3) {
        return Some(arm);
    }
    let direction_deg = turn_deg();
    let mut times = |value: f64| value * (0.5 + noise.uniform());
    let attachment =
        Attachment { mass_kg: times(2.0), stiffness_n_m: times(4e4), damping_n_s_m: times(70.0), direction_deg };
    arm.with_attachment(attachment).ok()
}

fn rates(seed: u64) -> Option<Value> {
    let mut noise = Noise::new(seed, 0);
    let arm = arm(seed, &mut noise)?;
    let mut pair = |size: f64| [(); 2].map(|()| size * (2.0 * noise.uniform() - 1.0));
    // Beyond 0.4 rad, too.
    let (x, v, torque_nm, mut force_n) = (pair(0.5), pair(20.0), pair(100.0), pair(300.0));
    if let Some(attachment) = arm.attachment() {
        // A shaker pushes along its own direction alone.
        let (sine, cosine) = libm::sincos(attachment.direction_deg.to_radians());
        force_n = [force_n[0] * cosine, force_n[0] * sine];
    }
    let state = State::new(x, v);
    let load = Load { torque_nm: torque_nm.into(), force_n: force_n.into() };
    let at = arm.acceleration_jacobian(&state, &load);
    let attachment = arm.attachment().map(|of| [of.mass_kg, of.stiffness_n_m, of.damping_n_s_m, of.direction_deg]);
    let [[bx, by], [cx, cy]] = [arm.point_velocities(&state)[0], arm.point_velocities(&state)[1]].map(|v| [v.x, v.y]);
    let points = arm.point_accelerations(&state, &at.acceleration_rad_s2);
    Some(json!({
        "parameters": arm.parameters(), "pose_deg": [arm.pose().beta1_deg, arm.pose().beta2_deg],
        "attachment": attachment, "alpha_rad": x, "alpha_dot_rad_s": v, "torque_nm": torque_nm, "force_n": force_n,
        "acceleration_rad_s2": [at.acceleration_rad_s2.x, at.acceleration_rad_s2.y],
        "by_alpha": by_rows(&at.by_alpha), "by_alpha_dot": by_rows(&at.by_alpha_dot),
        "energy_j": arm.energy(&state).total_j(),
        "velocities_m_s": [bx, by, cx, cy],
        "accelerations_m_s2": [points.b_m_s2.x, points.b_m_s2.y, points.c_m_s2.x, points.c_m_s2.y],
    }))
}

fn multipliers(of: &[Complex<f64>; 4]) -> Vec<[f64; 2]> {
    of.iter().map(|mu| [mu.re, mu.im]).collect()
}

fn orbit(of: &Orbit) -> Value {
    json!({
        "value": of.value, "frequency_hz": of.frequency_hz, "period": of.period, "coefficients_rad": of.coefficients,
        "amplitude_rad": of.amplitude_rad, "harmonic1_rad": of.harmonic1_rad, "multipliers": multipliers(of.multipliers()),
    })
}

fn branch(of: &Branch, every: usize) -> Value {
    let orbits: Vec<Value> = of.orbits.iter().step_by(every).map(orbit).collect();
    let bifurcations = of.bifurcations.iter().map(
        |found| json!({ "kind": found.kind.name(), "orbit": orbit(&found.orbit), "null_vector": found.null_vector }),
    );
    json!({ "points": of.orbits.len(), "orbits": orbits, "bifurcations": bifurcations.collect::<Vec<Value>>() })
}

fn traced(forced: &ForcedArm, [from, to]: [f64; 2]) -> Branch {
    trace(forced.clone(), from, Coordinate::FrequencyHz, &BranchOptions::new(from, to)).unwrap()
}

fn curve(of: &SingularCurve) -> Value {
    let point = |of: &SingularPoint| json!({ "lambda": of.lambda, "mu": of.mu, "harmonic1_rad": of.harmonic1_rad, "coefficients_rad": of.coefficients });
    let count = of.points.len();
    let some = of.points.iter().step_by(count.div_ceil(8)).chain(of.points.last());
    let turns = of.turns.iter().map(|turn| json!({ "is_cusp": turn.is_cusp, "point": point(&turn.point) }));
    json!({
        "points": count, "some": some.map(point).collect::<Vec<_>>(), "turns": turns.collect::<Vec<_>>(),
    })
}

fn curves() -> Vec<Value> {
    let cases = [
        (60.0, 60.0, [21.0, 23.5], ArmParameter::Amplitude, 5.0),
        (60.0, 60.0, [21.0, 23.5], ArmParameter::Beta2Deg, 64.0),
        (60.0, 60.0, [21.0, 23.5], ArmParameter::Stiffness2, 110e3),
        (75.0, 800.0, [40.0, 50.0], ArmParameter::Amplitude, 1000.0),
    ];
    let mut curves = Vec::new();
    for (beta2_deg, torque1_nm, ends, parameter, to) in cases {
        let forced = forced(beta2_deg, torque1_nm);
        let mu = Coordinate::Parameter(parameter);
        let options = BranchOptions::new(0.0, to);
        for (kind, of) in trace_singular_curves(&forced, &traced(&forced, ends), Coordinate::FrequencyHz, mu, &options)
        {
            let (of, ended) = match of {
                Ok(of) => (of, None),
                Err(early) => (*early.so_far, Some(early.reason.to_string())),
            };
            curves.push(json!({
                "beta2_deg": beta2_deg, "torque1_nm": torque1_nm, "hz": ends, "parameter": parameter.to_string(),
                "to": to, "kind": kind.name(), "curve": curve(&of), "ended_early": ended,
            }));
        }
    }
    curves
}

fn backbones() -> Vec<Value> {
    let mut backbones = Vec::new();
    for (beta2_deg, mode, is_damped) in [(60.0, 0, true), (60.0, 0, false), (75.0, 0, false), (60.0, 1, true)] {
        let damped = forced(beta2_deg, 0.0);
        let forced = if is_damped { damped } else { damped.undamped().unwrap() };
        let mut options = backbone_options();
        if mode == 1 {
            (options.largest_rad, options.branch) = (0.1, BranchOptions::new(40.0, 80.0));
        }
        let of = backbone(forced, mode, ArmParameter::Amplitude, &options).unwrap();
        let point = |at: &BackbonePoint| {
            json!({
                "frequency_hz": at.frequency_hz, "drive_nm": at.drive, "amplitude_rad": at.amplitude_rad,
                "harmonic1_rad": at.harmonic1_rad, "coefficients_rad": at.coefficients,
            })
        };
        let count = of.points.len();
        let some = of.points.iter().step_by(count.div_ceil(6)).chain(of.points.last());
        backbones.push(json!({
            "beta2_deg": beta2_deg, "mode": mode, "damped": is_damped, "points": count,
            "largest_rad": options.largest_rad, "some": some.map(point).collect::<Vec<_>>(),
        }));
    }
    backbones
}

/// Whether two documents have the same structure and texts, and numbers within 1e-6.
fn is_near(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(one, other)| is_near(one, other))
        }
        (Value::Object(one), Value::Object(other)) => {
            let near = |(key, one): (&String, &Value)| other.get(key).is_some_and(|other| is_near(one, other));
            one.len() == other.len() && one.iter().all(near)
        }
        (Value::Number(one), Value::Number(other)) => {
            let [one, other] = [one, other].map(|of| of.as_f64().unwrap());
            (one - other).abs() <= 1e-6 * other.abs().max(1.0)
        }
        _ => one == other,
    }
}

/// Chains are held to the file elsewhere, to its sections, too, which code of the arm gave that is no more.
#[test]
fn the_oracles_are_what_the_code_of_the_arm_gives() {
    let mut branches = Vec::new();
    for (beta2_deg, torque1_nm, ends, every) in
        [(60.0, 60.0, [21.0, 23.5], 2), (120.0, 60.0, [39.0, 42.0], 12), (75.0, 800.0, [40.0, 50.0], 24)]
    {
        let forced = forced(beta2_deg, torque1_nm);
        let of = traced(&forced, ends);
        let doubled = trace_doublings(&forced, &of, Coordinate::FrequencyHz, &BranchOptions::new(ends[0], ends[1]));
        let doubled: Vec<Value> = doubled.into_iter().map(|of| branch(&of.unwrap(), 24)).collect();
        branches.push(json!({
            "beta2_deg": beta2_deg, "torque1_nm": torque1_nm, "hz": ends, "branch": branch(&of, every),
            "doubled": doubled,
        }));
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/oracles/arm.json");
    let kept: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    for (name, found) in [
        ("rates", (0..).filter_map(rates).take(ARMS).collect()),
        ("branches", branches),
        ("curves", curves()),
        ("backbones", backbones()),
    ] {
        assert!(is_near(&Value::Array(found), &kept[name]), "{name}");
    }
}
