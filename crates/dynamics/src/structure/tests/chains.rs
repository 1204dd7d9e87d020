//! Chains against independent numbers and finite differences.

use core::f64::consts::TAU;

use super::*;
use crate::integrate::{Dynamics, Motion, Scheme};
use crate::structure::body::Body;
use crate::structure::links::{Links, LinksLoad};

#[test]
fn modes_are_those_of_independent_code() {
    for case in oracles("chains") {
        let assembly = assembly(BodySpec::Chain(chain_of(&case)), vec![]);
        let near = |what: &str, of: fn(&StructureMode) -> f64| {
            let expected = numbers(&case[what]);
            assert_eq!(assembly.modes().len(), expected.len());
            for (mode, expected) in assembly.modes().iter().zip(expected) {
                assert!((of(mode) / expected - 1.0).abs() < 1e-10, "{what}: {mode:?}, expected {expected}");
            }
        };
        near("frequencies_hz", |mode| mode.frequency_hz);
        near("damping_ratios", |mode| mode.damping_ratio);
    }
}

/// The ends of links at 30° and −60°, and where a link that sags ends.
#[test]
fn points_of_a_chain_are_where_its_links_end_at_rest() {
    let link = |length_m, angle_deg, stiffness_nm_rad| Link {
        length_m,
        mass_kg: 2.0,
        centre_of_mass_m: 0.2,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: 0.1,
        angle_deg,
        stiffness_nm_rad,
        damping_nm_s_rad: 1.0,
    };
    let chain = |links: Vec<Link>, gravity_m_s2| {
        assembly(BodySpec::Chain(ChainSpec { links, gravity_m_s2, unstated: vec![] }), vec![])
    };
    let rest_m = chain(vec![link(0.5, 30.0, 1e4), link(0.4, -90.0, 1e4)], 0.0).rest_m().unwrap();
    let (s30, c30) = (0.5, f64::sqrt(0.75));
    let expected = [[0.0, 0.0], [0.5 * c30, 0.5 * s30], [0.5 * c30 + 0.4 * s30, 0.5 * s30 - 0.4 * c30]];
    for (found, expected) in rest_m.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-15, "{rest_m:?}");
    }
    // k s = −m g lc cos s.
    let sagging = chain(vec![link(0.5, 0.0, 30.0)], 9.81).rest_m().unwrap();
    let sag_rad = libm::atan2(sagging[1][1], sagging[1][0]);
    assert!((30.0 * sag_rad + 2.0 * 9.81 * 0.2 * libm::cos(sag_rad)).abs() < 1e-9 && sag_rad < -0.1, "{sag_rad}");
    assert_eq!(two_modes(vec![]).rest_m(), None);
}

/// The largest difference of two states, of rates relative to 10 rad/s.
fn apart(got: &[f64], expected: &[f64]) -> f64 {
    let scale = |i: usize| if 2 * i < got.len() { 1.0 } else { 0.1 };
    let each = got.iter().zip(expected).enumerate().map(|(i, (got, expected))| scale(i) * (got - expected).abs());
    each.fold(0.0, f64::max)
}

#[test]
fn free_vibration_is_that_of_independent_code() {
    for case in oracles("chains") {
        let assembly = assembly(BodySpec::Chain(chain_of(&case)), vec![]);
        for scheme in [Scheme::Dop853, Scheme::Gl6, Scheme::Exponential8] {
            let mut stepper = Stepper::new(&assembly, &[], scheme, 16_000.0).unwrap();
            stepper.restore(&numbers(&case["initial"])).unwrap();
            // 0.2 s, as long as the oracle has integrated.
            for k in 0..3200 {
                stepper.advance(f64::from(k) / 16_000.0, &[]).unwrap();
            }
            let mut end = vec![0.0; stepper.saved_len()];
            stepper.save(&mut end).unwrap();
            let error = apart(&end, &numbers(&case["end_after_0_2_s"]));
            assert!(error < 1e-9, "{scheme}: {error:e}");
        }
    }
}

#[test]
fn forced_vibration_is_that_of_independent_code() {
    for case in oracles("chains") {
        let assembly = assembly(BodySpec::Chain(chain_of(&case)), vec![]);
        let number = |name: &str| case[name].as_f64().unwrap();
        let drive = [assembly.dof("tip.x").unwrap()];
        let mut stepper = Stepper::new(&assembly, &drive, Scheme::Exponential8, 8000.0).unwrap();
        stepper.restore(&numbers(&case["initial"])).unwrap();
        let load = StepLoad::Sine { amplitude: &[number("force_x_n")], omega_rad_s: TAU * number("excitation_hz") };
        for k in 0..1600 {
            stepper.advance_under(f64::from(k) / 8000.0, &load).unwrap();
        }
        let mut end = vec![0.0; stepper.saved_len()];
        stepper.save(&mut end).unwrap();
        let error = apart(&end, &numbers(&case["forced_end_after_0_2_s"]));
        assert!(error < 1e-9, "{error:e}");
    }
}

/// A chain of four links under gravity with a hardening joint, a damped spring at an elbow and one between points.
fn hard_chain() -> Assembly {
    let ChainSpec { mut links, .. } = chain_of(&oracles("chains")[3]);
    // The centres of mass of some links are off the line.
    (links[1].centre_of_mass_off_m, links[3].centre_of_mass_off_m) = (0.07, -0.05);
    let elements = vec![
        grounded(Place::Joint(2), Law::Cubic { stiffness3: 3e7, stiffness5: -1e9 }),
        grounded(along("joint3", Axis::X), Law::Tanh { slip: 40.0, velocity: 0.3 }),
        grounded(along("joint4", Axis::Y), Law::Linear { stiffness: 2e4, damping: 60.0 }),
        ElementSpec::Point {
            at: along("tip", Axis::Y),
            to: Some(along("joint2", Axis::X)),
            law: Law::Cubic { stiffness3: 5e7, stiffness5: 0.0 },
        },
        polynomial(
            &[along("tip", Axis::Y), along("joint3", Axis::X), along("tip", Axis::X)],
            // Terms of each degree, over one, two and three displacements.
            &[(&[2, 2, 0], 3e6), (&[0, 1, 3], -2e6), (&[1, 1, 1], 4e5), (&[5, 0, 0], 1e6)],
        ),
        polynomial(&[Place::Joint(1), Place::Joint(4)], &[(&[2, 1], 5e5), (&[0, 4], 8e5)]),
    ];
    assembly(BodySpec::Chain(ChainSpec { links, gravity_m_s2: 9.80665, unstated: vec![] }), elements)
}

const X: [f64; 4] = [0.1, -0.2, 0.3, 0.15];
const V: [f64; 4] = [1.0, -2.0, 3.0, 0.5];

/// The central difference of `of` by each of four arguments, with its error of second order removed.
fn differences(at: [f64; 4], of: impl Fn(&[f64; 4]) -> Vec<f64>) -> Vec<Vec<f64>> {
    let by = |k: usize| {
        let central = |h: f64| {
            let moved = |h: f64| {
                let mut moved = at;
                moved[k] += h;
                of(&moved)
            };
            let (ahead, behind) = (moved(h), moved(-h));
            ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * h)).collect::<Vec<_>>()
        };
        // Differences over twice the step have four times the error of second order: weighed so, it cancels.
        let (wide, narrow) = (central(2e-4), central(1e-4));
        narrow.iter().zip(&wide).map(|(narrow, wide)| (4.0 * narrow - wide) / 3.0).collect()
    };
    (0..4).map(by).collect()
}

/// Compares a matrix by rows with differences by column.
fn check_matrix(matrix: &[f64], columns: &[Vec<f64>]) {
    let largest = matrix.iter().fold(1.0_f64, |largest, entry| largest.max(entry.abs()));
    for (column, seen) in columns.iter().enumerate() {
        for (row, seen) in seen.iter().enumerate() {
            let exact = matrix[row * columns.len() + column];
            assert!((exact - seen).abs() < 1e-6 * largest, "{row} {column}: {exact} {seen}");
        }
    }
}

#[test]
fn derivatives_of_the_unbalance_are_exact() {
    let assembly = hard_chain();
    let (a, force) = ([100.0, -50.0, 20.0, -80.0], [30.0, -40.0, 5.0, 6.0]);
    let mut at = Linearised::new(4);
    assembly.at(&X).linearise(&V, &a, &force, &mut at);
    let unbalance = |x: &[f64; 4], v: &[f64; 4], a: &[f64; 4]| {
        let mut out = vec![0.0; 4];
        assembly.at(x).unbalance(v, a, &force, &mut out);
        out
    };
    assert_eq!(at.unbalance, unbalance(&X, &V, &a));
    check_matrix(&at.by_position, &differences(X, |x| unbalance(x, &V, &a)));
    check_matrix(&at.by_velocity, &differences(V, |v| unbalance(&X, v, &a)));
    check_matrix(&at.by_acceleration, &differences(a, |a| unbalance(&X, &V, a)));
}

/// Two implementations: q̈ of the integrators leaves no unbalance, with the forces of elements and loads; its
/// derivatives are exact.
#[test]
fn integrators_solve_the_unbalance() {
    let assembly = hard_chain();
    let Body::Chain(chain) = &assembly.body else { unreachable!() };
    let links = Links::<4>::new(chain, &assembly, None);
    let load = LinksLoad { torque_nm: [10.0, 0.0, -20.0, 3.0], force_n: [[30.0, -20.0]; 4] };
    let acceleration = |x: &[f64; 4], v: &[f64; 4]| links.rates(&Motion { x: *x, v: *v }, &load).acceleration;
    let mut force = load.torque_nm;
    let mut direction = [0.0; 4];
    for (name, pull) in [("tip.x", 30.0), ("tip.y", -20.0)] {
        assembly.at(&X).direction(assembly.dof(name).unwrap(), &mut direction);
        (0..4).for_each(|i| force[i] += direction[i] * pull);
    }
    for element in assembly.elements() {
        let velocity = assembly.at(&X).element_velocity(element, &V);
        let pull = element.force(assembly.at(&X).element_displacement(element), velocity, 0.0).force;
        assembly.at(&X).element_direction(element, &mut direction);
        (0..4).for_each(|i| force[i] -= direction[i] * pull);
    }
    for of in assembly.polynomials() {
        let x: Vec<f64> = of.at().iter().map(|dof| assembly.displacement(*dof, &X)).collect();
        let mut pulls = vec![0.0; x.len()];
        of.forces(&x, &mut pulls);
        for (dof, pull) in of.at().iter().zip(pulls) {
            assembly.at(&X).direction(*dof, &mut direction);
            (0..4).for_each(|i| force[i] -= direction[i] * pull);
        }
    }
    let mut unbalance = [0.0; 4];
    assembly.at(&X).unbalance(&V, &acceleration(&X, &V), &force, &mut unbalance);
    assert!(unbalance.iter().all(|torque| torque.abs() < 1e-9 * 579_200.0), "{unbalance:?}");

    let jacobian = links.jacobian(&Motion { x: X, v: V }, &load);
    assert_eq!(jacobian.acceleration, acceleration(&X, &V));
    check_matrix(jacobian.by_position.as_flattened(), &differences(X, |x| acceleration(x, &V).to_vec()));
    check_matrix(jacobian.by_velocity.as_flattened(), &differences(V, |v| acceleration(&X, v).to_vec()));
}

/// Position, velocity and acceleration of every degree of freedom belong together along q(t) = x + v t + a t²/2.
#[test]
fn points_move_as_they_say() {
    let assembly = hard_chain();
    let a = [40.0, -30.0, 20.0, 10.0];
    let at = |t: f64| -> [f64; 4] { core::array::from_fn(|i| X[i] + t * (V[i] + 0.5 * t * a[i])) };
    for name in assembly.dof_names() {
        let dof = assembly.dof(&name).unwrap();
        let x = |t: f64| assembly.displacement(dof, &at(t));
        let h = 1e-4;
        // Central differences of fourth order. The second one is divided by h², and loses more digits to rounding.
        let velocity = (8.0 * (x(h) - x(-h)) - (x(2.0 * h) - x(-2.0 * h))) / (12.0 * h);
        assert!((velocity - assembly.at(&X).velocity(dof, &V)).abs() < 1e-8, "{name}");
        let acceleration = (16.0 * (x(h) + x(-h)) - (x(2.0 * h) + x(-2.0 * h)) - 30.0 * x(0.0)) / (12.0 * h * h);
        assert!((acceleration - assembly.at(&X).acceleration(dof, &V, &a)).abs() < 1e-5, "{name}");
        let mut curvature = [0.0; 16];
        assembly.at(&X).add_curvature(dof, 1.0, &mut curvature);
        let direction = |x: &[f64; 4]| {
            let mut direction = vec![0.0; 4];
            assembly.at(x).direction(dof, &mut direction);
            direction
        };
        check_matrix(&curvature, &differences(X, direction));
    }
}

/// The energy that load and weight put in is in motion, springs and elements, or was lost.
#[test]
fn energy_of_a_chain_with_smooth_elements_is_balanced() {
    let assembly = hard_chain();
    let tip = assembly.dof("tip.y").unwrap();
    let mut stepper = Stepper::new(&assembly, &[tip], Scheme::Exponential8, 8000.0).unwrap();
    let energy = |stepper: &Stepper| {
        assembly.energy_j(stepper.position(), stepper.velocity()) + assembly.element_energy_j(stepper.position(), &[])
    };
    stepper.restore(&[0.02, -0.01, 0.01, 0.02, 0.0, 0.0, 0.0, 0.0]).unwrap();
    let (before, mut lost, mut work, h_s) = (energy(&stepper), 0.0, 0.0, stepper.step_s());
    let loss = |stepper: &Stepper| loss_w(&assembly, stepper.position(), stepper.velocity(), &[]);
    for k in 0..800 {
        // Simpson's rule over pairs of steps, with the work of the held force exact.
        let force = 400.0 * libm::sin(0.01 * f64::from(k));
        let (start_m, first_w) = (assembly.displacement(tip, stepper.position()), loss(&stepper));
        stepper.advance(f64::from(2 * k) * h_s, &[force]).unwrap();
        let middle_w = loss(&stepper);
        stepper.advance(f64::from(2 * k + 1) * h_s, &[force]).unwrap();
        lost += h_s / 3.0 * (first_w + 4.0 * middle_w + loss(&stepper));
        work += force * (assembly.displacement(tip, stepper.position()) - start_m);
    }
    // A loss that hardly counts would not test the dampers.
    let (after, scale) = (energy(&stepper), before + work.abs() + lost);
    assert!(
        lost > 0.01 * scale && (after - before - work + lost).abs() < 1e-7 * scale,
        "{before} {after} {work} {lost}"
    );
}

/// Three links with centres of mass off the line.
fn offset_chain(gravity_m_s2: f64) -> Assembly {
    let link = |[length_m, mass_kg, centre_of_mass_m, centre_of_mass_off_m, inertia_kg_m2]: [f64; 5],
                rest: [f64; 3]| Link {
        length_m,
        mass_kg,
        centre_of_mass_m,
        centre_of_mass_off_m,
        inertia_kg_m2,
        angle_deg: rest[0],
        stiffness_nm_rad: rest[1],
        damping_nm_s_rad: rest[2],
    };
    let links = vec![
        link([0.5, 6.0, 0.2, 0.05, 0.09], [30.0, 3e3, 4.0]),
        link([0.4, 4.0, -0.1, -0.12, 0.05], [50.0, 2e3, 3.0]),
        link([0.3, 2.0, 0.18, 0.2, 0.02], [-70.0, 1e3, 2.0]),
    ];
    assembly(BodySpec::Chain(ChainSpec { links, gravity_m_s2, unstated: vec![] }), vec![])
}

/// Numbers of a NumPy script that knows nothing of this form of the equations: positions and velocities of the centres of
/// mass, T = Σ ½ m |ċ|² + ½ I θ̇² and V of springs and weights, and Lagrange's equations d/dt ∂T/∂q̇ − ∂T/∂q + ∂V/∂q = −D q̇ + p
/// with derivatives by the complex step (W. Squire, G. Trapp, "Using Complex Variables to Estimate Derivatives of Real Functions", SIAM
/// Rev. 40 (1998)); of M along q̇ by differences of order 4.
#[test]
fn centres_of_mass_off_the_line_obey_lagranges_equations() {
    let cases = [
        (
            [0.250_190_933_209_333_94, 0.794_427_601_939_151, 0.551_371_380_490_387],
            [-1.648_756_860_056_448_8, -1.199_002_290_532_647_4, 2.241_320_672_377_571_4],
            [-19.789_387_817_377_012, 12.849_136_735_310_651, 11.882_777_150_081_85],
            [833.666_420_089_308_3, -3_848.490_323_184_643, 3_945.751_972_419_899_6],
        ),
        (
            [-0.064_130_094_312_558_45, -0.393_935_146_361_372_95, -0.443_148_775_798_453_35],
            [-1.470_782_474_075_252_4, -0.329_542_164_704_120_57, 0.027_289_553_747_719_797],
            [2.139_894_082_979_699_7, 19.820_011_337_375_703, 11.706_476_768_550_122],
            [-899.002_347_988_110_7, 924.406_377_633_489_9, 4_095.909_154_407_476_8],
        ),
    ];
    let assembly = offset_chain(0.0);
    let Body::Chain(chain) = &assembly.body else { unreachable!() };
    let links = Links::<3>::new(chain, &assembly, None);
    let drive = ["joint1", "joint2", "joint3"].map(|name| assembly.dof(name).unwrap());
    for (q, v, torque, expected) in cases {
        let mut stepper = Stepper::new(&assembly, &drive, Scheme::Dop853, 8000.0).unwrap();
        stepper.restore(&[q, v].concat()).unwrap();
        let mut seen = [0.0; 3];
        stepper.acceleration(&torque, &mut seen).unwrap();
        let load = LinksLoad { torque_nm: torque, force_n: [[0.0; 2]; 3] };
        let stepped = links.rates(&Motion { x: q, v }, &load).acceleration;
        for ((seen, stepped), expected) in seen.iter().zip(stepped).zip(expected) {
            assert!(
                (seen - expected).abs() < 1e-7 * 4e3 && (stepped - expected).abs() < 1e-7 * 4e3,
                "{seen} {stepped} {expected}"
            );
        }
    }
}

/// Under the weight: the equilibrium, the modes about it and the acceleration from beside it, by the same script.
#[test]
fn weight_off_the_line_turns_the_links() {
    let assembly = offset_chain(9.81);
    let Body::Chain(chain) = &assembly.body else { unreachable!() };
    let sag = [-0.014_267_443_989_146_048, -0.004_132_529_569_330_729_5, -0.002_891_245_016_383_156_7];
    for (got, expected) in chain.sag_rad.iter().zip(sag) {
        assert!((got - expected).abs() < 1e-12, "{:?}", chain.sag_rad);
    }
    assert!((assembly.rest_m().unwrap()[3][1] - 0.682_168_018_126_114_5).abs() < 1e-12);
    let hz = [3.731_827_577_591_674, 11.787_487_364_097_414, 29.759_587_129_016_79];
    for (mode, expected) in assembly.modes().iter().zip(hz) {
        assert!((mode.frequency_hz / expected - 1.0).abs() < 1e-9, "{mode:?}");
    }
    let drive = ["joint1", "joint2", "joint3"].map(|name| assembly.dof(name).unwrap());
    let mut stepper = Stepper::new(&assembly, &drive, Scheme::Dop853, 8000.0).unwrap();
    stepper.restore(&[0.3, -0.4, 0.5, 1.0, -2.0, 1.5]).unwrap();
    let mut seen = [0.0; 3];
    stepper.acceleration(&[1.0, -2.0, 3.0], &mut seen).unwrap();
    for (seen, expected) in seen.iter().zip([-629.876_017_246_455_8, 10_877.404_146_062_958, -25_710.747_663_035_432]) {
        assert!((seen - expected).abs() < 1e-7 * 2.5e4, "{seen} {expected}");
    }
}

/// Every scheme, and explicit steps between the switches of a gap that never closes, make the same motion.
#[test]
fn all_schemes_move_centres_off_the_line() {
    let far = Law::Gap { stiffness: 1e3, gap: 10.0, preload: 0.0 };
    let spec =
        StructureSpec { elements: vec![grounded(along("tip", Axis::X), far)], ..offset_chain(9.81).spec().clone() };
    let others = [Scheme::Rk4, Scheme::Gl4, Scheme::Gl6, Scheme::Exponential, Scheme::Exponential8];
    let end = |assembly: &Assembly, scheme: Scheme| {
        let mut stepper = Stepper::new(assembly, &[], scheme, 16_000.0).unwrap();
        stepper.restore(&[0.1, -0.2, 0.15, 0.0, 1.0, -1.0]).unwrap();
        (0..1600).for_each(|k| stepper.advance(f64::from(k) / 16_000.0, &[]).unwrap());
        [stepper.position(), stepper.velocity()].concat()
    };
    let expected = end(&offset_chain(9.81), Scheme::Dop853);
    for scheme in others {
        let error = apart(&end(&offset_chain(9.81), scheme), &expected);
        assert!(error < 1e-6, "{scheme}: {error:e}");
    }
    let error = apart(&end(&Assembly::new(&spec).unwrap(), Scheme::Dop853), &expected);
    assert!(error < 1e-9, "{error:e}");
}
