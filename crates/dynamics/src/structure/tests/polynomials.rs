//! Polynomials over several displacements: their values, their motions, and the messages about impossible ones.

use core::f64::consts::TAU;

use super::*;
use insta::assert_snapshot;

/// Two coordinates of modal mass 1 kg, `q1.x` and `q2.x`, with a polynomial over both.
fn over_two(frequencies_hz: [f64; 2], damping_ratios: [f64; 2], terms: &[(&[u8], f64)]) -> StructureSpec {
    let modes = frequencies_hz.iter().zip(damping_ratios);
    let modes = modes.map(|(&frequency_hz, damping_ratio)| ModeSpec { frequency_hz, damping_ratio }).collect();
    let shape =
        |point: &str, by_mode: [f64; 2]| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: by_mode.into() };
    let shapes = vec![shape("q1", [1.0, 0.0]), shape("q2", [0.0, 1.0])];
    let places = [along("q1", Axis::X), along("q2", Axis::X)];
    let body = BodySpec::Modal(ModalSpec { modes, shapes });
    StructureSpec { body, elements: vec![polynomial(&places, terms)] }
}

/// Forces and stiffness of V = 2 x²y − 3 y³ + 0.5 x y⁴ by hand: fx = 4xy + 0.5 y⁴, fy = 2x² − 9y² + 2 x y³.
#[test]
fn forces_are_the_gradient_and_stiffness_the_hessian() {
    let spec = over_two([1.0, 2.0], [0.0; 2], &[(&[2, 1], 2.0), (&[0, 3], -3.0), (&[1, 4], 0.5)]);
    let assembly = Assembly::new(&spec).unwrap();
    let (of, [x, y]) = (&assembly.polynomials()[0], [0.75, -0.5]);
    let (mut forces, mut stiffness) = ([0.0; 2], [0.0; 4]);
    of.forces(&[x, y], &mut forces);
    of.stiffness(&[x, y], &mut stiffness);
    // Sums of few powers of two: exact.
    assert_eq!(of.energy_j(&[x, y]), 2.0 * x * x * y - 3.0 * y * y * y + 0.5 * x * y * y * y * y);
    assert_eq!(forces, [4.0 * x * y + 0.5 * y * y * y * y, 2.0 * x * x - 9.0 * y * y + 2.0 * x * y * y * y]);
    let mixed = 4.0 * x + 2.0 * y * y * y;
    assert_eq!(stiffness, [4.0 * y, mixed, mixed, -18.0 * y + 6.0 * x * y * y]);
    assert_eq!(assembly.element_energy_j(&[x, y], &[]), of.energy_j(&[x, y]));
    assert_eq!((of.number(), of.degree()), (1, 5));
}

/// Example 6 of NLvib (M. Krack, J. Gross, 2019) under a held force, against the classical method in tiny steps.
#[test]
fn coupled_quadratic_and_cubic_springs_move_as_in_tiny_steps() {
    let [a, b] = [1.13 * 1.13, 2.0 * 2.0];
    let c = (a + b) / 8.0;
    let terms: [(&[u8], f64); 7] = [
        (&[3, 0], 0.5 * a),
        (&[1, 2], 0.5 * a),
        (&[0, 3], 0.5 * b),
        (&[2, 1], 0.5 * b),
        (&[4, 0], c),
        (&[2, 2], 2.0 * c),
        (&[0, 4], c),
    ];
    let assembly = Assembly::new(&over_two([1.13 / TAU, 2.0 / TAU], [1e-3, 5e-3], &terms)).unwrap();
    let drive = ["q1.x", "q2.x"].map(|name| assembly.dof(name).unwrap());
    let mut stepper = Stepper::new(&assembly, &drive, Scheme::Exponential8, 4.0).unwrap();
    (0..40).for_each(|k| stepper.advance(f64::from(k) / 4.0, &[0.1, 0.1]).unwrap());

    let acceleration = |[x, y, u, v]: [f64; 4]| {
        let radius = x * x + y * y;
        let fx = 0.5 * a * (3.0 * x * x + y * y) + b * x * y + 0.5 * (a + b) * x * radius;
        let fy = 0.5 * b * (3.0 * y * y + x * x) + a * x * y + 0.5 * (a + b) * y * radius;
        [0.1 - 2e-3 * 1.13 * u - a * x - fx, 0.1 - 1e-2 * 2.0 * v - b * y - fy]
    };
    let rate = |s: [f64; 4]| {
        let [du, dv] = acceleration(s);
        [s[2], s[3], du, dv]
    };
    let moved = |s: [f64; 4], h: f64, by: [f64; 4]| core::array::from_fn(|i| s[i] + h * by[i]);
    let (steps, mut s) = (40_000, [0.0; 4]);
    let h = 10.0 / f64::from(steps);
    for _ in 0..steps {
        let first = rate(s);
        let second = rate(moved(s, 0.5 * h, first));
        let third = rate(moved(s, 0.5 * h, second));
        let fourth = rate(moved(s, h, third));
        s = core::array::from_fn(|i| s[i] + h / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]));
    }
    let got = [stepper.position(), stepper.velocity()].concat();
    assert!(got.iter().zip(s).all(|(got, expected)| (got - expected).abs() < 1e-12), "{got:?} {s:?}");
}

/// k x⁴/4 is a cubic spring: in a chain that a scheme steps, and beside elements that switch.
#[test]
fn a_polynomial_of_one_displacement_is_a_spring() {
    let end = |elements: Vec<ElementSpec>| {
        let assembly = assembly(BodySpec::Chain(chain_of(&oracles("chains")[2])), elements);
        let tip = assembly.dof("tip.y").unwrap();
        let mut stepper = Stepper::new(&assembly, &[tip], Scheme::Exponential8, 4000.0).unwrap();
        (0..400).for_each(|k| stepper.advance(f64::from(k) / 4000.0, &[-900.0]).unwrap());
        [stepper.position(), stepper.velocity()].concat()
    };
    let spring = grounded(along("tip", Axis::Y), Law::Cubic { stiffness3: 4e7, stiffness5: 6e9 });
    let polynomial = polynomial(&[along("tip", Axis::Y)], &[(&[4], 1e7)]);
    let fifth = grounded(along("tip", Axis::Y), Law::Cubic { stiffness3: 0.0, stiffness5: 6e9 });
    // A gap that never closes, with which the chain is stepped as one that switches.
    let far = grounded(Place::Joint(1), Law::Gap { stiffness: 1e3, gap: 1.0, preload: 0.0 });
    for others in [vec![], vec![far]] {
        let [one, two] = [vec![spring.clone()], vec![fifth.clone(), polynomial.clone()]];
        let [one, two] = [one, two].map(|own| end([own, others.clone()].concat()));
        let apart = one.iter().zip(&two).map(|(one, two)| (one - two).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-11 && one[0].abs() > 1e-3, "{apart:e} {one:?}");
    }
}

#[test]
fn energies_of_terms_are_parameters() {
    let spec = over_two([1.0, 2.0], [0.0; 2], &[(&[2, 1], 0.5), (&[0, 4], 0.1)]);
    let assembly = Assembly::new(&spec).unwrap();
    let energy = assembly.parameter("element1.energy2").unwrap();
    assert_eq!((energy.unit(), assembly.value(energy)), ("J/m⁴", Ok(0.1)));
    let changed = assembly.with(energy, 0.3).unwrap();
    assert_eq!(changed.polynomials()[0].energy_j(&[0.0, 1.0]), 0.3);
    assert!(assembly.parameter("element1.energy3").is_err());
    // The same number is a parameter of another unit in a structure with other powers.
    let other = Assembly::new(&over_two([1.0, 2.0], [0.0; 2], &[(&[2, 1], 0.5), (&[0, 3], 0.1)])).unwrap();
    assert!(other.value(energy).is_err());
}

/// Odd degrees fall on one side; even ones if a direction of the sum is negative.
#[test]
fn potentials_that_fall_without_bound_are_found() {
    let falls = |terms: &[(&[u8], f64)]| {
        let term = |&(powers, energy): &(&[u8], f64)| Term { powers: powers.to_vec(), energy };
        falls_along(&terms.iter().map(term).collect::<Vec<_>>())
    };
    assert_eq!(falls(&[(&[2, 1], 0.5), (&[0, 3], 0.1), (&[4, 0], 0.05)]), Some(vec![0, -1]));
    assert_eq!(falls(&[(&[3, 0], -7.0), (&[4, 0], 1.0), (&[2, 2], 2.0), (&[0, 4], 1.0)]), None);
    assert_eq!(falls(&[(&[4, 0], 1.0), (&[2, 2], -3.0), (&[0, 4], 1.0)]), Some(vec![1, 1]));
    assert_eq!(falls(&[(&[5, 0], 1.0), (&[0, 4], 1.0)]), Some(vec![-1, 0]));
}

#[test]
fn impossible_polynomials_are_refused() {
    let refused = |at: &[Place], terms: &[(&[u8], f64)]| {
        let body = over_two([1.0, 2.0], [0.0; 2], &[(&[3, 0], 1.0)]).body;
        Assembly::new(&StructureSpec { body, elements: vec![polynomial(at, terms)] }).unwrap_err().to_string()
    };
    let [q1, q2] = ["q1", "q2"].map(|point| along(point, Axis::X));
    let both = [q1.clone(), q2.clone()];
    assert_snapshot!(refused(&[], &[(&[3], 1.0)]), @"element 1, polynomial, has 0 displacements: it must have 1 to 8");
    assert_snapshot!(refused(&both, &[]), @"element 1, polynomial, has 0 terms: it must have 1 to 1000");
    assert_snapshot!(refused(&[q1.clone(), q1], &[(&[2, 1], 1.0)]), @"element 1, polynomial, has the displacement `q1.x` twice: give each once");
    assert_snapshot!(refused(&both, &[(&[2, 1], 1.0), (&[3], 1.0)]), @"element 1, term 2: `powers` has 1 numbers: it must have one for each of the 2 displacements");
    assert_snapshot!(refused(&both, &[(&[1, 1], 1.0)]), @"element 1, term 1: the sum of `powers` is 2: it must be 3 to 5 (springs, whose sum is 2, are elements of kind linear)");
    assert_snapshot!(refused(&both, &[(&[3, 3], 1.0)]), @"element 1, term 1: the sum of `powers` is 6: it must be 3 to 5 (springs, whose sum is 2, are elements of kind linear)");
    assert_snapshot!(refused(&both, &[(&[2, 1], f64::NAN)]), @"element 1, term 1: `energy` is NaN: it must be a finite number");
    assert_snapshot!(refused(&[q2, along("tip", Axis::X)], &[(&[2, 1], 1.0)]), @"there is no `tip.x` in this structure: expected one of q1.x, q2.x");
    let chain = BodySpec::Chain(chain_of(&oracles("chains")[2]));
    let mixed = polynomial(&[along("tip", Axis::X), Place::Joint(2)], &[(&[2, 1], 1.0)]);
    let mixed = Assembly::new(&StructureSpec { body: chain, elements: vec![mixed] }).unwrap_err().to_string();
    assert_snapshot!(mixed, @"element 1, polynomial, is over `tip.x` and `joint 2`: its displacements must be those of points, or those of joints");
}
