//! Structures on the boundary of stability, and the ends of branches.

use super::*;

/// Modes of these frequencies and damping ratios, whose shapes at tip.x and mid.x are given.
fn modes(of: &[(f64, f64, [f64; 2])], law: Option<Law>) -> Assembly {
    let modes = of.iter().map(|&(frequency_hz, damping_ratio, _)| ModeSpec { frequency_hz, damping_ratio }).collect();
    let shape = |(i, point): (usize, &str)| ShapeSpec {
        point: point.into(),
        axis: Axis::X,
        by_mode: of.iter().map(|mode| mode.2[i]).collect(),
    };
    let shapes = ["tip", "mid"].into_iter().enumerate().map(shape).collect();
    let elements = law.into_iter().map(|law| ElementSpec::Point { at: place("tip.x"), to: None, law }).collect();
    Assembly::new(&StructureSpec { body: BodySpec::Modal(ModalSpec { modes, shapes }), elements }).unwrap()
}

fn traced(assembly: Assembly, force_n: f64, ends: [f64; 2]) -> Branch {
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, force_n);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![tip]);
    super::super::trace(&forced, ends[0], Coordinate::FrequencyHz, &options).map_err(|early| early.reason).unwrap()
}

const HARDENS: Law = Law::Cubic { stiffness3: 3e7, stiffness5: 0.0 };

/// Without damping |μ| is 1 and its distance from 1 is rounding: no response is called stable or unstable, and nothing
/// bifurcates, beside a damped mode either.
#[test]
fn undamped_responses_are_marginal() {
    let (low, high) = ((20.0, 0.0, [0.5, 0.2]), (47.0, 0.0, [-0.4, 0.7]));
    let apart = [(20.0, 0.01, [0.5, 0.2]), (47.0, 0.0, [0.0, 0.7])];
    for (assembly, ends) in [
        (modes(&[low], None), [11.3, 19.9]),
        (modes(&[low], None), [40.0, 41.0]),
        (modes(&[low, high], None), [11.3, 19.0]),
        (modes(&[low], Some(HARDENS)), [11.3, 25.0]),
        (modes(&[low, high], Some(Law::Gap { stiffness: 2e4, gap: 1e-4, preload: 0.0 })), [11.3, 15.0]),
        (modes(&apart, None), [15.0, 25.0]),
    ] {
        let branch = traced(assembly, 1.0, ends);
        assert_eq!((&branch.bifurcations[..], &branch.unlocated[..]), (&[][..], &[][..]));
        let stable: Vec<_> = branch.orbits.iter().map(Orbit::is_stable).collect();
        assert!(stable.iter().all(Option::is_none), "{ends:?}: {stable:?}");
        let verdict = |orbit: &Orbit| orbit.stability.as_ref().unwrap().verdict();
        let expected = if branch.orbits[0].stability.as_ref().unwrap().conservative {
            Verdict::Conservative
        } else {
            Verdict::Undecided
        };
        assert!(branch.orbits.iter().all(|orbit| verdict(orbit) == expected), "{ends:?}");
    }
    // The damped mode's folds are found beside the undamped one, and what is between them is unstable.
    let branch = traced(modes(&apart, Some(HARDENS)), 5.0, [15.0, 25.0]);
    let kinds: Vec<_> = branch.bifurcations.iter().map(|found| found.kind).collect();
    assert!(kinds.iter().all(|kind| *kind == BifurcationKind::Fold), "{kinds:?}");
}

/// The least damping that structures have is seen, far above the resonance, too.
#[test]
fn little_damping_is_stable() {
    for ends in [[11.3, 24.0], [2000.0, 2010.0]] {
        let branch = traced(modes(&[(20.0, 1e-5, [0.5, 0.2])], None), 1.0, ends);
        assert!(branch.orbits.iter().all(|orbit| orbit.is_stable() == Some(true)), "{ends:?}");
    }
}

/// If the first response needs more harmonics than the search starts with, the branch still begins at the requested
/// value.
#[test]
fn a_branch_begins_where_it_is_asked_to() {
    let two = [(20.0, 0.01, [0.5, 0.2]), (47.3, 0.008, [-0.4, 0.7])];
    let tanh = Law::Tanh { slip: 1.0, velocity: 0.01 };
    for (law, force_n, ends) in [(tanh, 5.0, [17.0, 18.0]), (tanh, 5.0, [24.0, 23.0]), (HARDENS, 50.0, [19.3, 19.0])] {
        let branch = traced(modes(&two, Some(law)), force_n, ends);
        let [first, last] = [branch.orbits.first(), branch.orbits.last()].map(|orbit| orbit.unwrap());
        assert_eq!([first.value, last.value], ends);
        assert!(first.harmonics > branch_least(), "{}", first.harmonics);
    }
    for (ends, torque_nm) in [([22.0, 22.2], 1000.0), ([22.3, 22.5], 300.0)] {
        let forced = chain_under(60.0, torque_nm);
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![forced.drives()[0].0]);
        let traced = super::super::trace(&forced, ends[0], Coordinate::FrequencyHz, &options);
        // Under 1000 N·m the branch turns back to its start.
        let (branch, end) = match traced {
            Ok(branch) => (branch, BranchEnd::AtEnd),
            Err(EndedEarly { reason: AnalysisError::CameBack { missed, .. }, so_far }) => {
                assert_eq!(missed.value, ends[1]);
                (*so_far, BranchEnd::AtStart)
            }
            Err(other) => panic!("{other}"),
        };
        assert_eq!((branch.end, end == BranchEnd::AtStart), (end, torque_nm == 1000.0));
        let [first, last] = [branch.orbits.first(), branch.orbits.last()].map(|orbit| orbit.unwrap().value);
        assert_eq!([first, last], [ends[0], if end == BranchEnd::AtStart { ends[0] } else { ends[1] }]);
    }
}

/// The harmonics with which the first response of a smooth structure is sought.
fn branch_least() -> usize {
    BranchOptions::new(1.0, 2.0).least_harmonics
}

/// Two undamped masses with a cubic spring, example 4 of NLvib (M. Krack, J. Gross, 2019): load, N, and angular frequency,
/// rad/s; the largest displacement, and a multiplier of each pair, from the flow by an explicit method of order 8 at the
/// tolerance 1e-13 (SciPy) along the response of independent harmonic balance.
const UNDAMPED: [UndampedCase; 4] = [
    UndampedCase {
        load: 1.0,
        rate: 0.86573,
        largest: 1.1368130483,
        pairs: [[0.5496196287, 0.8354150248], [-0.4918364342, 0.8706876145]],
    },
    UndampedCase {
        load: 0.3,
        rate: 0.7,
        largest: 0.3393569850,
        pairs: [[-0.9649679038, 0.2623679564], [-0.9987338298, 0.0503064322]],
    },
    UndampedCase {
        load: 0.1,
        rate: 0.32,
        largest: 0.0725432198,
        pairs: [[0.6932044313, 0.7207410189], [-0.8590114809, 0.5119563220]],
    },
    UndampedCase {
        load: 0.1,
        rate: 2.2,
        largest: 0.0402047375,
        pairs: [[0.2326839415, 0.9725524065], [-0.9597363770, 0.2809022723]],
    },
];

struct UndampedCase {
    load: f64,
    rate: f64,
    largest: f64,
    pairs: [[f64; 2]; 2],
}

/// All |μ| of a conservative structure are 1 but for rounding, whatever the step; the angles are those of the flow.
#[test]
fn multipliers_of_a_conservative_structure_stay_on_the_circle() {
    let (low, high) = (1.0 / TAU, libm::sqrt(3.0) / TAU);
    let half = core::f64::consts::FRAC_1_SQRT_2;
    for case in &UNDAMPED {
        let law = Law::Cubic { stiffness3: 0.5, stiffness5: 0.0 };
        let masses = modes(&[(low, 0.0, [half, half]), (high, 0.0, [half, -half])], Some(law));
        let hz = case.rate / TAU;
        let branch = traced(masses, case.load, [hz, 1.001 * hz]);
        let first = &branch.orbits[0];
        near(first.readings[0].largest, case.largest, 1e-8);
        let stability = first.stability.as_ref().unwrap();
        for mu in &stability.multipliers {
            assert!((mu.norm() - 1.0).abs() < 1e-12, "{} rad/s: {:e}", case.rate, mu.norm() - 1.0);
            let off = |[re, im]: &[f64; 2]| (mu - Complex::new(*re, im.copysign(mu.im))).norm();
            let nearest = case.pairs.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-5, "{} rad/s: {nearest:e}", case.rate);
        }
        assert_eq!((stability.verdict(), first.is_stable()), (Verdict::Conservative, None));
        assert!(stability.accuracy < 1e-12, "{:e}", stability.accuracy);
    }
}
