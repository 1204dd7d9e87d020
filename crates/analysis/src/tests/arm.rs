//! Chains made from the two-link arm against what the arm's own equations and analysis gave: `tests/oracles/arm.json`.

use nalgebra::{Complex, Matrix2, Normed as _, Vector2};
use serde_json::Value;

use super::*;
use crate::floquet::Floquet;
use crate::tests::assembly_of;
use crate::time_domain;
use crate::time_domain::SettleOptions;
use resonarm_dynamics::integrate::Scheme;
use resonarm_dynamics::structure::{Armature, Coil, Dof, Linearised, Stepper};
use serde::Deserialize;

pub(super) fn oracles_of_the_arm() -> Value {
    serde_json::from_str(include_str!("../../../../tests/oracles/arm.json")).unwrap()
}

pub(super) fn numbers(of: &Value) -> Vec<f64> {
    of.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

pub(super) fn pair(of: &Value) -> [f64; 2] {
    numbers(of).try_into().unwrap()
}

/// The parameters of an arm by the symbols of Gierlak & Warmiński 2023, as the oracles state them.
#[derive(Deserialize)]
struct ArmParameters {
    /// I_A1 about joint A, and I_S2 about the centre of mass of link 2, kg·m².
    inertia1_kg_m2: f64,
    inertia2_kg_m2: f64,
    mass2_kg: f64,
    length1_m: f64,
    length2_m: f64,
    centre2_m: f64,
    stiffness1_nm_rad: f64,
    stiffness2_nm_rad: f64,
    damping1_nm_s_rad: f64,
    damping2_nm_s_rad: f64,
    gravity: Option<ArmGravity>,
}

/// What the weight of an arm needs beside its parameters.
#[derive(Deserialize)]
struct ArmGravity {
    gravity_m_s2: f64,
    mass1_kg: f64,
    centre1_m: f64,
}

impl ArmParameters {
    /// m₁ and lc₁ of the chain. The arm knows link 1 by its inertia about joint A, I_A1 = I₁ + m₁ lc₁², and with gravity
    /// by m₁ lc₁. Without gravity the chain has 1 kg at A. With it m₁ and lc₁ are the arm's, unless m₁ lc₁² is more than
    /// I_A1: then lc₁ is less and m₁ more, with the same product.
    fn mass_and_centre(&self) -> (f64, f64) {
        let Some(gravity) = &self.gravity else { return (1.0, 0.0) };
        let moment = gravity.mass1_kg * gravity.centre1_m;
        if moment == 0.0 {
            (1.0, 0.0)
        } else if moment * gravity.centre1_m < self.inertia1_kg_m2 {
            (gravity.mass1_kg, gravity.centre1_m)
        } else {
            let centre_m = 0.5 * self.inertia1_kg_m2 / moment;
            (moment / centre_m, centre_m)
        }
    }

    /// The chain that moves as the arm does, with its links at angles, degrees.
    fn chain(&self, angles_deg: [f64; 2]) -> Assembly {
        let (mass1_kg, centre1_m) = self.mass_and_centre();
        let first = Link {
            length_m: self.length1_m,
            mass_kg: mass1_kg,
            centre_of_mass_m: centre1_m,
            centre_of_mass_off_m: 0.0,
            inertia_kg_m2: self.inertia1_kg_m2 - mass1_kg * centre1_m * centre1_m,
            angle_deg: angles_deg[0],
            stiffness_nm_rad: self.stiffness1_nm_rad,
            damping_nm_s_rad: self.damping1_nm_s_rad,
        };
        let second = Link {
            length_m: self.length2_m,
            mass_kg: self.mass2_kg,
            centre_of_mass_m: self.centre2_m,
            centre_of_mass_off_m: 0.0,
            inertia_kg_m2: self.inertia2_kg_m2,
            angle_deg: angles_deg[1],
            stiffness_nm_rad: self.stiffness2_nm_rad,
            damping_nm_s_rad: self.damping2_nm_s_rad,
        };
        let gravity_m_s2 = self.gravity.as_ref().map_or(0.0, |gravity| gravity.gravity_m_s2);
        assembly_of(ChainSpec { links: vec![first, second], gravity_m_s2, unstated: vec![] })
    }
}

/// The preset of the analysis' cases under a torque at joint 1, without damping if there is to be none.
fn forced(case: &Value, torque1_nm: f64) -> Forced {
    let assembly = preset_at(Preset::Irb1600Fitted, [0.0, number(case, "beta2_deg")]);
    let joint = assembly.dof("joint1").unwrap();
    Forced::new(assembly, joint, torque1_nm)
}

fn joints(of: &Forced) -> [Dof; 2] {
    ["joint1", "joint2"].map(|name| of.assembly().dof(name).unwrap())
}

fn all_near(got: &[f64], expected: &[f64], relative: f64, what: &str) {
    let size = expected.iter().fold(0.0_f64, |size, number| size.max(number.abs()));
    for (got, number) in got.iter().zip(expected) {
        assert!((got - number).abs() <= relative * size, "{what}: {got}, expected {number} of {size}");
    }
    assert_eq!(got.len(), expected.len(), "{what}");
}

/// ẍ, its derivatives, energies and the motion of the points of random arms, with gravity or without, near rest and
/// far from it; of some with a mass on a spring and a damper at the tip, which is a shaker's armature.
#[test]
fn chains_have_the_equations_of_random_arms() {
    let cases = oracles_of_the_arm();
    let cases = cases["rates"].as_array().unwrap();
    assert_eq!(cases.len(), 100);
    for (index, case) in cases.iter().enumerate() {
        let parameters: ArmParameters = serde_json::from_value(case["parameters"].clone()).unwrap();
        let assembly = parameters.chain(pair(&case["pose_deg"]));
        let [x, v, torque, force] =
            ["alpha_rad", "alpha_dot_rad_s", "torque_nm", "force_n"].map(|key| pair(&case[key]));
        let expected = numbers(&case["acceleration_rad_s2"]);
        let what = |part: &str| format!("arm {index}, {part}");
        let state = [x, v].concat();
        let [joint1, joint2, tip_x, tip_y] =
            ["joint1", "joint2", "tip.x", "tip.y"].map(|name| assembly.dof(name).unwrap());
        let at = assembly.at(&x);
        let mut acceleration = [0.0; 2];
        if let Some(attachment) = case["attachment"].as_array() {
            let [mass_kg, stiffness_n_m, damping_n_s_m, direction_deg] =
                [0, 1, 2, 3].map(|i| attachment[i].as_f64().unwrap());
            let (sine, cosine) = libm::sincos(direction_deg.to_radians());
            let along = [Some((tip_x, cosine)), Some((tip_y, sine))];
            let coil = Coil::Current { force_factor_n_a: 1.0 };
            let armature = Armature { along, mass_kg, stiffness_n_m, damping_n_s_m, coil };
            let mut stepper = Stepper::shaken(&assembly, &armature, Scheme::Rk4, 1e5).unwrap();
            let current_a = force[0] * cosine + force[1] * sine;
            stepper.restore(&[&state[..], &[current_a]].concat()).unwrap();
            stepper.acceleration(&[current_a], &mut acceleration).unwrap();
            // The torques, which no shaker gives, by the mass that they meet.
            let mut linear = Linearised::new(2);
            at.linearise(&v, &acceleration, &[0.0; 2], &mut linear);
            let mut w = [0.0; 2];
            armature.direction(&at, &mut w);
            let mass = Matrix2::from_row_slice(&linear.by_acceleration)
                + Vector2::from(w) * Vector2::from(w).transpose() * mass_kg;
            let more = mass.try_inverse().unwrap() * Vector2::from(torque);
            acceleration = [acceleration[0] + more.x, acceleration[1] + more.y];
            let own_j = armature.energy_j(&armature.motion(&at, &v), 0.0);
            near(assembly.energy_j(&x, &v) + own_j, number(case, "energy_j"), 1e-12);
        } else {
            let drive = [joint1, joint2, tip_x, tip_y];
            let mut stepper = Stepper::new(&assembly, &drive, Scheme::Rk4, 1e5).unwrap();
            stepper.restore(&state).unwrap();
            stepper.acceleration(&[torque, force].concat(), &mut acceleration).unwrap();
            near(assembly.energy_j(&x, &v), number(case, "energy_j"), 1e-12);
            let (mut generalised, mut w) = (torque, [0.0; 2]);
            let mut linear = Linearised::new(2);
            for (dof, force) in [tip_x, tip_y].into_iter().zip(force) {
                at.direction(dof, &mut w);
                (0..2).for_each(|i| generalised[i] += force * w[i]);
            }
            at.linearise(&v, &expected, &generalised, &mut linear);
            for (dof, force) in [tip_x, tip_y].into_iter().zip(force) {
                at.add_curvature(dof, -force, &mut linear.by_position);
            }
            let matrix = |rows: &[f64]| Matrix2::from_row_slice(rows);
            let inverse = -matrix(&linear.by_acceleration).try_inverse().unwrap();
            for (rows, key) in [(&linear.by_position, "by_alpha"), (&linear.by_velocity, "by_alpha_dot")] {
                let by = (inverse * matrix(rows)).transpose();
                all_near(by.as_slice(), &numbers(&case[key]), 1e-11, &what(key));
            }
        }
        all_near(&acceleration, &expected, 1e-11, &what("acceleration"));
        let points = ["joint2.x", "joint2.y", "tip.x", "tip.y"].map(|name| assembly.dof(name).unwrap());
        all_near(
            &points.map(|dof| at.velocity(dof, &v)),
            &numbers(&case["velocities_m_s"]),
            1e-12,
            &what("velocities"),
        );
        let accelerations = points.map(|dof| at.acceleration(dof, &v, &expected));
        all_near(&accelerations, &numbers(&case["accelerations_m_s2"]), 1e-12, &what("accelerations"));
    }
}

/// A periodic response of the arm satisfies the equations of the chain, which are divided by the stiffness scale, and
/// has its multipliers.
fn has_orbit(forced: &Forced, orbit: &Value) {
    let x = numbers(&orbit["coefficients_rad"]);
    let hz = number(orbit, "frequency_hz");
    let mut balance = Balance::new(forced, hz, Coordinate::FrequencyHz, x.len() / 4);
    let mut residual = vec![0.0; x.len()];
    assert!(balance.evaluate(&x, hz, &mut residual, &mut vec![0.0; (x.len() + 1) * (x.len() + 1)]));
    let (size, off) = [&x, &residual].map(|of| of.iter().map(|x| x * x).sum::<f64>().sqrt()).into();
    assert!(off < 1e-10 * size, "{hz} Hz: {off} of {size}");
    let got = Floquet::default().stability(&balance, &x).unwrap();
    for (got, expected) in got.multipliers.iter().zip(orbit["multipliers"].as_array().unwrap()) {
        let [re, im] = pair(expected);
        // A double multiplier, as at a fold, has the root of the error.
        assert!((got - Complex::new(re, im)).norm() < 1e-6, "{hz} Hz: {got}, expected {expected}");
    }
    let trace = got.multipliers.iter().sum::<Complex<f64>>().re;
    let expected: f64 = orbit["multipliers"].as_array().unwrap().iter().map(|mu| pair(mu)[0]).sum();
    assert!((trace - expected).abs() < 1e-9, "{hz} Hz: {trace}, expected {expected}");
}

/// Every periodic response on the arm's branches is one of the chain, point by point; the chain's own branches have the
/// same bifurcations. Folds are located by equations of their own, period doublings from the multipliers beside them.
#[test]
fn chains_have_the_branches_of_the_arm() {
    let cases = oracles_of_the_arm();
    for case in cases["branches"].as_array().unwrap() {
        let forced = forced(case, number(case, "torque1_nm"));
        let of_arm = &case["branch"];
        let bifurcations = of_arm["bifurcations"].as_array().unwrap();
        let orbits = of_arm["orbits"].as_array().unwrap().iter();
        orbits.chain(bifurcations.iter().map(|found| &found["orbit"])).for_each(|orbit| has_orbit(&forced, orbit));
        let ends = pair(&case["hz"]);
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, joints(&forced).into());
        let got = super::super::trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
        assert_eq!(got.bifurcations.len(), bifurcations.len());
        for (got, expected) in got.bifurcations.iter().zip(bifurcations) {
            let orbit = &expected["orbit"];
            assert_eq!(got.kind.name(), expected["kind"]);
            let is_fold = got.kind == BifurcationKind::Fold;
            near(got.orbit.value, number(orbit, "value"), if is_fold { 1e-10 } else { 1e-8 });
            let [largest, harmonic1] = ["amplitude_rad", "harmonic1_rad"].map(|key| pair(&orbit[key]));
            for (joint, reading) in got.orbit.readings.iter().enumerate() {
                near(reading.largest, largest[joint], if is_fold { 1e-8 } else { 1e-6 });
                near(reading.harmonic1.norm(), harmonic1[joint], if is_fold { 1e-8 } else { 1e-6 });
            }
        }
    }
}

/// Wherever the points of a continuation lie, it has the same bifurcations: also the two close pairs of period doublings,
/// which leave the signs of test functions as they are. They are those that the arm's analysis found.
#[test]
fn chains_have_the_close_pairs_of_the_arm() {
    let forced = forced(&serde_json::json!({ "beta2_deg": 60.0 }), 200.0);
    let traced = |from: f64| {
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [from, 21.0], vec![joints(&forced)[0]]);
        super::super::trace(&forced, from, Coordinate::FrequencyHz, &options).unwrap()
    };
    use BifurcationKind::*;
    let expected = [
        (PeriodDoubling, 21.864_711_977_381_038),
        (PeriodDoubling, 21.854_677_258_455_88),
        (Fold, 21.842_690_244_792_063),
        (PeriodDoubling, 21.849_984_388_804_046),
        (PeriodDoubling, 21.859_012_185_472_498),
        (Fold, 22.106_802_267_864_822),
    ];
    for from in [22.6, 22.12, 22.15, 24.0] {
        let found = traced(from).bifurcations;
        let kinds: Vec<_> = found.iter().map(|found| (found.kind, found.orbit.value)).collect();
        assert_eq!(kinds.len(), expected.len(), "from {from} Hz: {kinds:?} {expected:?}");
        for (got, expected) in kinds.iter().zip(&expected) {
            assert_eq!(got.0, expected.0, "from {from} Hz: {kinds:?}");
            near(got.1, expected.1, 1e-9);
        }
    }
}

/// With a hardening spring at the elbow the branch has a fold and, 1.3 µHz above it, a Neimark–Sacker point. Both are
/// real: by the stroboscopic map, which is integrated in time, the two multipliers near 1 have the product 1.000014 at
/// the fold, so that both leave it above 1; and they are a pair on the unit circle at the other point.
#[test]
fn a_fold_and_a_neimark_sacker_point_side_by_side() {
    let body = BodySpec::Chain(Preset::Irb1600Fitted.chain().unwrap().at_angles_deg(&[0.0, 60.0]));
    let law = Law::Cubic { stiffness3: 3e9, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: Place::Joint(2), to: None, law }];
    let assembly = Assembly::new(&StructureSpec { body, elements }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, 40.0);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [21.9, 23.1], vec![tip]);
    let branch = super::super::trace(&forced, 21.9, Coordinate::FrequencyHz, &options).unwrap();
    let near_the_fold = |found: &&Bifurcation| (found.orbit.value - 22.62937).abs() < 1e-4;
    let found: Vec<&Bifurcation> = branch.bifurcations.iter().filter(near_the_fold).collect();
    let [fold, pair] = found[..] else { panic!("{found:?}") };
    assert_eq!([fold.kind, pair.kind], [BifurcationKind::Fold, BifurcationKind::NeimarkSacker]);
    assert!((1e-6..2e-6).contains(&(pair.orbit.value - fold.orbit.value)));
    let of_pair = pair.orbit.stability.as_ref().unwrap().multipliers[0];
    assert!(of_pair.im > 1e-3 && (of_pair.norm_sqr() - 1.0).abs() < 1e-12, "{of_pair}");
    for (orbit, expected) in [(&fold.orbit, 1.000_014), (&pair.orbit, 1.0)] {
        let state = super::start_of_two(orbit);
        let map = time_domain::StroboscopicMap::new(&forced, orbit.frequency_hz).unwrap();
        let mut derivative = map.derivative(&map.to_point(&state), 1).unwrap();
        let mut multipliers = resonarm_numeric::eigenvalues::eigenvalues(4, derivative.as_mut_slice()).unwrap();
        multipliers.sort_by(|a, b| (a - 1.0).norm_sqr().total_cmp(&(b - 1.0).norm_sqr()));
        let product = (multipliers[0] * multipliers[1]).re;
        assert!((product - expected).abs() < 2e-7, "{product}, expected {expected}: {multipliers:?}");
    }
}

/// Along backbones, with damping or without, of both modes. The points of both curves lie elsewhere, so the periodic
/// responses are put into the chain's equations; the drive may have either sign.
#[test]
fn chains_have_the_backbones_of_the_arm() {
    let cases = oracles_of_the_arm();
    for case in cases["backbones"].as_array().unwrap() {
        for point in case["some"].as_array().unwrap() {
            let mut forced = forced(case, number(point, "drive_nm"));
            if case["damped"] == false {
                forced = forced.undamped().unwrap();
            }
            let (x, hz) = (numbers(&point["coefficients_rad"]), number(point, "frequency_hz"));
            let mut balance = Balance::new(&forced, hz, Coordinate::FrequencyHz, x.len() / 4);
            let mut residual = vec![0.0; x.len()];
            assert!(balance.evaluate(&x, hz, &mut residual, &mut vec![0.0; (x.len() + 1) * (x.len() + 1)]));
            let (size, off) = [&x, &residual].map(|of| of.iter().map(|x| x * x).sum::<f64>().sqrt()).into();
            assert!(off < 1e-10 * size, "{hz} Hz: {off} of {size}");
        }
    }
}

/// From the same start a period of the drive ends in the same state, and the response settles in the same section. The
/// structure is one of a sweep over the angle of link 2 that begins elsewhere.
#[test]
fn chains_settle_as_the_arm() {
    let cases = oracles_of_the_arm();
    for case in cases["sections"].as_array().unwrap() {
        let (expected, angle_deg) = (forced(case, number(case, "torque1_nm")), number(case, "beta2_deg"));
        let elsewhere = forced(&serde_json::json!({ "beta2_deg": 10.0 }), number(case, "torque1_nm"));
        let over = Coordinate::Parameter(elsewhere.assembly().parameter("link2.angle_deg").unwrap());
        let frequency_hz = number(case, "frequency_hz");
        let sweep = time_domain::Sweep { forced: elsewhere, frequency_hz, over, values: vec![angle_deg] };
        let map = sweep.map(angle_deg).unwrap();
        assert_eq!(*map.forced(), expected);
        let after = map.advance(&numbers(&case["start"])).unwrap();
        all_near(&after, &numbers(&case["after_a_period"]), 1e-9, "after a period");
        let rest = vec![0.0; 4];
        let got = time_domain::settle(&map, &joints(&expected), &rest, &SettleOptions::default(), &|| false).unwrap();
        assert_eq!(got.period.map(u64::from), case["period"].as_u64());
        near(got.largest_multiplier.unwrap(), number(case, "largest_multiplier"), 1e-7);
        let sections: Vec<Vec<f64>> = case["section"].as_array().unwrap().iter().map(numbers).collect();
        // The sections begin at one of the points of their cycle.
        let off = |shift: usize| {
            let own = got.section.iter().cycle().skip(shift).flatten();
            let [mut off, mut size] = [0.0; 2];
            for (own, expected) in own.zip(sections.iter().flatten()) {
                off += (own - expected) * (own - expected);
                size += expected * expected;
            }
            libm::sqrt(off / size)
        };
        let least = (0..sections.len()).map(off).fold(f64::INFINITY, f64::min);
        assert!(got.section.len() == sections.len() && least < 1e-9, "{least}: {case} {got:?}");
        let [largest, harmonic1] = ["amplitude_rad", "harmonic1_rad"].map(|key| pair(&case[key]));
        for joint in 0..2 {
            near(got.readings[joint].largest, largest[joint], 1e-9);
            near(got.readings[joint].harmonic1.norm(), harmonic1[joint], 1e-9);
        }
    }
}
