//! Structures with polynomials over several displacements.

use super::*;

/// Two coordinates of modal mass 1 kg, `q1.x` and `q2.x`, with a polynomial over both.
fn over_two(rates_rad_s: [f64; 2], damping_ratios: [f64; 2], terms: &[([u8; 2], f64)]) -> Assembly {
    let modes = rates_rad_s.iter().zip(damping_ratios);
    let modes = modes.map(|(rate, damping_ratio)| ModeSpec { frequency_hz: rate / TAU, damping_ratio }).collect();
    let shape =
        |point: &str, by_mode: [f64; 2]| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: by_mode.into() };
    let body = BodySpec::Modal(ModalSpec { modes, shapes: vec![shape("q1", [1.0, 0.0]), shape("q2", [0.0, 1.0])] });
    let terms = terms.iter().map(|(powers, energy)| Term { powers: powers.to_vec(), energy: *energy }).collect();
    let polynomial = ElementSpec::Polynomial { at: vec![place("q1.x"), place("q2.x")], terms };
    Assembly::new(&StructureSpec { body, elements: vec![polynomial] }).unwrap()
}

/// Example 6 of NLvib (M. Krack, J. Gross, 2019): quadratic and cubic springs over two modes.
fn nlvib_6() -> Assembly {
    let (a, b) = (1.13 * 1.13, 4.0);
    let c = (a + b) / 8.0;
    let quadratic = [([3, 0], 0.5 * a), ([1, 2], 0.5 * a), ([0, 3], 0.5 * b), ([2, 1], 0.5 * b)];
    let cubic = [([4, 0], c), ([2, 2], 2.0 * c), ([0, 4], c)];
    over_two([1.13, 2.0], [1e-3, 5e-3], &[&quadratic[..], &cubic].concat())
}

fn branch_of(forced: &Forced, from_to_rad_s: [f64; 2], tune: impl Fn(&mut TraceOptions)) -> Branch {
    let [from, to] = from_to_rad_s.map(|rate| rate / TAU);
    let read = forced.assembly().dof("q1.x").unwrap();
    let mut options = TraceOptions::new(forced, Coordinate::FrequencyHz, [from, to], vec![read]);
    tune(&mut options);
    super::super::trace(forced, from, Coordinate::FrequencyHz, &options).unwrap()
}

fn found(branch: &Branch, kind: BifurcationKind) -> Vec<f64> {
    let of_kind = branch.bifurcations.iter().filter(|found| found.kind == kind);
    let mut found: Vec<f64> = of_kind.map(|found| TAU * found.orbit.value).collect();
    found.sort_by(f64::total_cmp);
    found
}

fn check_all(found: &[f64], expected: &[f64], most: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    found
        .iter()
        .zip(expected)
        .for_each(|(found, expected)| assert!((found - expected).abs() < most, "{found} {expected}"));
}

/// Folds and peaks of independent code (NumPy; harmonic balance).
#[test]
fn nlvib_example_6_bends_as_published() {
    let assembly = nlvib_6();
    let [q1, q2] = ["q1.x", "q2.x"].map(|name| assembly.dof(name).unwrap());
    let expected: [(f64, &[f64], f64); 4] = [
        (2e-4, &[], 0.0692),
        (5e-4, &[], 0.1346),
        (1e-3, &[1.127_343, 1.128_547], 0.202),
        (3e-3, &[1.087_927, 1.122_992], 0.328),
    ];
    for (force_n, folds, peak) in expected {
        let forced = Forced::at_several(assembly.clone(), &[(q1, 1.0), (q2, 1.0)], force_n);
        let branch = branch_of(&forced, [1.18, 1.05], |options| options.assess = Assess::Nothing);
        check_all(&found(&branch, BifurcationKind::Fold), folds, 2e-6);
        let amplitude = branch.peaks[0].readings[0].harmonic1.norm();
        assert!((amplitude - peak).abs() < 1e-3, "{force_n}: {amplitude} {peak}");
    }
}

/// Modes of 1 and 2.02 rad/s: mode 2 takes the energy of mode 1. Folds and Neimark–Sacker points of independent code.
#[test]
fn an_internal_resonance_of_1_to_2_folds_and_beats() {
    let terms = [([2, 1], 0.5), ([0, 3], 0.1), ([4, 0], 0.05)];
    let assembly = over_two([1.0, 2.02], [0.005, 0.01 / 2.02], &terms);
    let q1 = assembly.dof("q1.x").unwrap();
    let branch = branch_of(&Forced::new(assembly, q1, 0.02), [0.8, 1.2], |_| {});
    check_all(&found(&branch, BifurcationKind::Fold), &[0.938_573, 0.958_125, 1.051_325, 1.123_419], 2e-6);
    check_all(&found(&branch, BifurcationKind::NeimarkSacker), &[0.999, 1.023], 1e-3);
}

/// A periodic response returns after a period of integration in time, and its multipliers are those of that flow.
#[test]
fn a_response_under_coupled_springs_returns() {
    let assembly = nlvib_6();
    let [q1, q2] = ["q1.x", "q2.x"].map(|name| assembly.dof(name).unwrap());
    let forced = Forced::at_several(assembly.clone(), &[(q1, 1.0), (q2, 1.0)], 3e-3);
    let branch = branch_of(&forced, [1.0, 1.05], |_| {});
    let orbit = &branch.orbits[branch.orbits.len() / 2];
    // The coordinates are the displacements of the polynomial, in the same order.
    let start = start_of_two(orbit);
    let steps = 400_u32;
    let rate_hz = f64::from(steps) * orbit.frequency_hz;
    let mut stepper = Stepper::new(&assembly, &[q1, q2], Scheme::Exponential8, rate_hz).unwrap();
    let mut period = |state: &[f64]| {
        stepper.restore(state).unwrap();
        for step in 0..steps {
            let load = StepLoad::Sine { amplitude: &[3e-3; 2], omega_rad_s: TAU * orbit.frequency_hz };
            stepper.advance_under(f64::from(step) / rate_hz, &load).unwrap();
        }
        [stepper.position(), stepper.velocity()].concat()
    };
    let end = period(&start);
    let size = start.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    assert!(start.iter().zip(&end).all(|(a, b)| (a - b).abs() < 1e-8 * size), "{start:?} {end:?}");
    let step = 1e-5;
    let column = |k: usize| {
        let mut moved = |by: f64| {
            let mut moved = start.clone();
            moved[k] += by;
            period(&moved)
        };
        let (ahead, behind) = (moved(step), moved(-step));
        ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<f64>>()
    };
    let columns: Vec<Vec<f64>> = (0..4).map(column).collect();
    let flow = nalgebra::DMatrix::from_fn(4, 4, |row, column| columns[column][row]);
    let product: Complex<f64> = orbit.stability.as_ref().unwrap().multipliers.iter().product();
    let sum: Complex<f64> = orbit.stability.as_ref().unwrap().multipliers.iter().sum();
    assert!((product.re / flow.determinant() - 1.0).abs() < 1e-6, "{product} {}", flow.determinant());
    assert!((sum.re - flow.trace()).abs() < 1e-6, "{sum} {}", flow.trace());
}

/// k x⁴/4 in a chain is a cubic spring, with its folds.
#[test]
fn a_polynomial_of_one_displacement_of_a_chain_is_a_spring() {
    let folds = |element: ElementSpec| {
        let chain = Preset::Irb1600Fitted.chain().unwrap();
        let body = BodySpec::Chain(ChainSpec { unstated: vec![], ..chain });
        let assembly = Assembly::new(&StructureSpec { body, elements: vec![element] }).unwrap();
        let tip = assembly.dof("tip.x").unwrap();
        let forced = Forced::new(assembly, tip, 4.0);
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [21.5, 25.0], vec![tip]);
        options.assess = Assess::Nothing;
        super::super::trace(&forced, 21.5, Coordinate::FrequencyHz, &options).unwrap()
    };
    let spring = folds(ElementSpec::Point {
        at: place("tip.x"),
        to: None,
        law: Law::Cubic { stiffness3: 2e9, stiffness5: 0.0 },
    });
    let terms = vec![Term { powers: vec![4], energy: 5e8 }];
    let polynomial = folds(ElementSpec::Polynomial { at: vec![place("tip.x")], terms });
    assert!(!spring.bifurcations.is_empty(), "{:?}", spring.peaks);
    check_all(&found(&polynomial, BifurcationKind::Fold), &found(&spring, BifurcationKind::Fold), 1e-9);
}
