//! The arm: orbits against time integration, multipliers against the flow, period doubling, internal resonance.

use core::f64::consts::TAU;

use nalgebra::{Matrix4, Normed as _};

use crate::tests::arm_at;
use crate::*;
use resonarm_dynamics::arm::{Load, Preset, Sine, State};
use resonarm_dynamics::integrate::{Integrator, Scheme};

pub(crate) fn forced(beta2_deg: f64, torque1_nm: f64) -> ForcedArm {
    ForcedArm::new(arm_at(Preset::Irb1600Fitted, 0.0, beta2_deg), Load::torque_nm(1.0, 0.0), torque1_nm)
}

/// The state at t = 0 of a motion of base frequency Ω/ν.
fn start(orbit: &Orbit, subharmonic: f64) -> State {
    let mut state = State::new([orbit.coefficients[0], orbit.coefficients[1]], [0.0; 2]);
    for (k, pair) in orbit.coefficients[2..].chunks_exact(4).enumerate() {
        let rate = (k + 1) as f64 * TAU * orbit.frequency_hz / subharmonic;
        for dof in 0..2 {
            state.alpha_rad[dof] += pair[dof];
            state.alpha_dot_rad_s[dof] += rate * pair[2 + dof];
        }
    }
    state
}

/// The state a number of periods of the excitation later, by Gauss–Legendre of order 6.
fn after(forced: &ForcedArm, frequency_hz: f64, state: State, periods: u32) -> State {
    let steps = 4096;
    let rate_hz = frequency_hz * f64::from(steps);
    let integrator = Integrator::new(Scheme::Gl6, rate_hz, forced.arm()).unwrap();
    let sine = Sine { amplitude: forced.load(), frequency_hz };
    (0..steps * periods).fold(state, |s, k| integrator.step(forced.arm(), f64::from(k) / rate_hz, &s, &sine).unwrap())
}

fn distance(a: &State, b: &State, omega_rad_s: f64) -> f64 {
    (a.alpha_rad - b.alpha_rad).norm() + (a.alpha_dot_rad_s - b.alpha_dot_rad_s).norm() / omega_rad_s
}

fn some(branch: &Branch, count: usize) -> impl Iterator<Item = &Orbit> {
    branch.orbits.iter().step_by(branch.orbits.len() / count)
}

/// Stable or not, small or at the peak: integrated over a period, the motion returns to its start.
#[test]
fn orbits_close() {
    for (beta2_deg, from, to) in [(60.0, 21.0, 23.5), (120.0, 39.0, 42.0), (0.0, 19.5, 21.3)] {
        let forced = forced(beta2_deg, 60.0);
        let branch = trace(forced.clone(), from, Coordinate::FrequencyHz, &BranchOptions::new(from, to)).unwrap();
        for orbit in some(&branch, 12) {
            let state = start(orbit, 1.0);
            let gap = distance(&after(&forced, orbit.frequency_hz, state, 1), &state, TAU * orbit.frequency_hz);
            assert!(gap < 1e-9, "{beta2_deg}° {} Hz: {gap}", orbit.frequency_hz);
        }
    }
}

/// The multipliers are the eigenvalues of the derivative of the flow over one period, here by central differences; and
/// the determinant is that of Liouville's formula.
#[test]
fn multipliers_are_those_of_the_flow() {
    let forced = forced(60.0, 60.0);
    let branch = trace(forced.clone(), 21.0, Coordinate::FrequencyHz, &BranchOptions::new(21.0, 23.5)).unwrap();
    for orbit in some(&branch, 7) {
        let (omega, h) = (TAU * orbit.frequency_hz, 1e-5);
        let state = start(orbit, 1.0);
        let scaled =
            |s: State| [s.alpha_rad.x, s.alpha_rad.y, s.alpha_dot_rad_s.x / omega, s.alpha_dot_rad_s.y / omega];
        let mut flow = Matrix4::zeros();
        for column in 0..4 {
            let [above, below] = [h, -h].map(|h| {
                let mut moved = state;
                match column {
                    0 | 1 => moved.alpha_rad[column] += h,
                    _ => moved.alpha_dot_rad_s[column - 2] += h * omega,
                }
                scaled(after(&forced, orbit.frequency_hz, moved, 1))
            });
            (0..4).for_each(|row| flow[(row, column)] = (above[row] - below[row]) / (2.0 * h));
        }
        let mut seen: Vec<_> = flow.complex_eigenvalues().iter().copied().collect();
        for mu in orbit.multipliers() {
            let nearest =
                (0..seen.len()).min_by(|a, b| (seen[*a] - mu).norm().total_cmp(&(seen[*b] - mu).norm())).unwrap();
            let gap = (seen.swap_remove(nearest) - mu).norm();
            assert!(gap < 1e-8, "{} Hz: {mu} is {gap} off", orbit.frequency_hz);
        }
        assert!(orbit.stability.liouville_defect.abs() < 1e-11);
    }
}

fn found(branch: &Branch) -> Vec<(BifurcationKind, f64)> {
    branch.bifurcations.iter().map(|b| (b.kind, b.orbit.frequency_hz)).collect()
}

fn assert_same(a: &[(BifurcationKind, f64)], b: &[(BifurcationKind, f64)]) {
    assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    for (a, b) in a.iter().zip(b) {
        assert!(a.0 == b.0 && (a.1 / b.1 - 1.0).abs() < 1e-10, "{a:?} {b:?}");
    }
}

/// Near the 1:2 internal resonance the second zone loses its period at strong excitation. The branch of the doubled
/// period leaves at one period doubling and joins at another, folds and a Neimark–Sacker point on its way; it is the
/// same from either end, and its motions close after two periods and not after one.
#[test]
fn doubled_branches_join_period_doublings() {
    use BifurcationKind::*;
    let forced = forced(75.0, 800.0);
    let options = BranchOptions::new(40.0, 50.0);
    let branch = trace(forced.clone(), 40.0, Coordinate::FrequencyHz, &options).unwrap();
    let kinds: Vec<_> = branch.bifurcations.iter().map(|b| b.kind).collect();
    assert_eq!(kinds, [PeriodDoubling, Fold, PeriodDoubling, Fold, PeriodDoubling, PeriodDoubling]);
    let traced = |i: usize| {
        let branch = trace_doubled(forced.clone(), &branch.bifurcations[i], Coordinate::FrequencyHz, &options).unwrap();
        let end = branch.bifurcations.last().unwrap();
        assert_eq!(end.kind, BranchPoint);
        (found(&branch), branch)
    };
    assert_eq!(trace_doublings(&forced, &branch, Coordinate::FrequencyHz, &options).len(), 2);
    for (i, j) in [(0, 2), (4, 5)] {
        let ((mut there, branch_there), (mut back, _)) = (traced(i), traced(j));
        let (first, last) = (branch.bifurcations[i].orbit.frequency_hz, branch.bifurcations[j].orbit.frequency_hz);
        assert!((there.pop().unwrap().1 / last - 1.0).abs() < 1e-10);
        assert!((back.pop().unwrap().1 / first - 1.0).abs() < 1e-10);
        back.reverse();
        assert_same(&there, &back);
        for orbit in some(&branch_there, 4).skip(1) {
            let (state, omega) = (start(orbit, 2.0), TAU * orbit.frequency_hz);
            let gap = |periods| distance(&after(&forced, orbit.frequency_hz, state, periods), &state, omega);
            assert!(gap(2) < 1e-8 && gap(1) > 1e-3, "{} Hz: {} {}", orbit.frequency_hz, gap(1), gap(2));
        }
    }
}

/// The curve of folds through both folds of a branch has a cusp below which there are none; followed from one fold to
/// weaker excitation it returns at the other. The curve of period doublings agrees with a branch at another excitation.
#[test]
fn curves_in_two_parameters_connect_bifurcations() {
    let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
    let branch = trace(forced(60.0, 60.0), 21.0, Coordinate::FrequencyHz, &BranchOptions::new(21.0, 23.5)).unwrap();
    let [first, second] = [0, 1].map(|i| branch.bifurcations[i].orbit.frequency_hz);
    let curve = trace_singular(
        forced(60.0, 60.0),
        &branch.bifurcations[0],
        Coordinate::FrequencyHz,
        amplitude,
        &BranchOptions::new(60.0, 5.0),
    )
    .unwrap();
    let curve = curve.points;
    let last = curve.last().unwrap();
    assert!((curve[0].lambda / first - 1.0).abs() < 1e-10);
    assert!(last.mu == 60.0 && (last.lambda / second - 1.0).abs() < 1e-10, "{last:?}");
    let cusp = curve.iter().fold(f64::INFINITY, |least, point| least.min(point.mu));
    let beyond = |torque| trace(forced(60.0, torque), 21.0, Coordinate::FrequencyHz, &BranchOptions::new(21.0, 23.5));
    assert_eq!(beyond(0.99 * cusp).unwrap().bifurcations.len(), 0);
    assert_eq!(beyond(1.01 * cusp).unwrap().bifurcations.len(), 2);

    let strong =
        |torque| trace(forced(75.0, torque), 40.0, Coordinate::FrequencyHz, &BranchOptions::new(40.0, 50.0)).unwrap();
    let (at_800, at_1200) = (strong(800.0), strong(1200.0));
    let curve = trace_singular(
        forced(75.0, 800.0),
        &at_800.bifurcations[5],
        Coordinate::FrequencyHz,
        amplitude,
        &BranchOptions::new(800.0, 1200.0),
    )
    .unwrap();
    let end = curve.points.last().unwrap().lambda;
    assert!(found(&at_1200).iter().any(|b| b.0 == BifurcationKind::PeriodDoubling && (b.1 / end - 1.0).abs() < 1e-10));
}

pub(super) fn backbone_options() -> BackboneOptions {
    BackboneOptions {
        smallest_rad: 1e-3,
        largest_rad: 0.35,
        largest_drive: f64::INFINITY,
        branch: BranchOptions::new(10.0, 80.0),
    }
}

/// At β2 = 74° the fitted arm has f2 ≈ 2 f1, and its first nonlinear mode turns from softening to hardening.
#[test]
fn first_mode_changes_its_bending_at_the_internal_resonance() {
    let mode = |beta2_deg| {
        let undamped = forced(beta2_deg, 0.0).undamped().unwrap();
        backbone(undamped, 0, ArmParameter::Amplitude, &backbone_options()).unwrap()
    };
    let bendings = [60.0, 70.0, 73.0, 74.0, 75.0, 78.0].map(|beta2_deg| mode(beta2_deg).bending());
    use Bending::*;
    assert_eq!(bendings, [Softening, Softening, Softening, Hardening, Hardening, Hardening].map(Some));
    assert!(mode(74.0).points.iter().all(|point| point.drive.abs() < 1e-6));
}

/// A damped backbone passes through the peaks: at the excitation of a branch its point is next to the branch's largest
/// motion.
#[test]
fn backbone_passes_through_the_peaks() {
    let curve = backbone(forced(60.0, 0.0), 0, ArmParameter::Amplitude, &backbone_options()).unwrap();
    let at = curve.points.windows(2).find(|pair| pair[0].drive.abs() < 60.0 && pair[1].drive.abs() >= 60.0).unwrap();
    let share = (60.0 - at[0].drive.abs()) / (at[1].drive.abs() - at[0].drive.abs());
    let peak = at[0].harmonic1_rad[0] + share * (at[1].harmonic1_rad[0] - at[0].harmonic1_rad[0]);
    assert!((peak / 0.266_413 - 1.0).abs() < 2e-3, "{peak}");
}

/// In the amplitude of the torque at 22.1 Hz (as in Fig. 5) there are the two folds that a branch in frequency has
/// there.
#[test]
fn amplitude_as_parameter_finds_the_folds() {
    let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
    let branch = trace(forced(60.0, 0.0), 22.1, amplitude, &BranchOptions::new(0.0, 300.0)).unwrap();
    assert_eq!(branch.orbits.last().unwrap().value, 300.0);
    let [low, high] = &branch.bifurcations[..] else { panic!("{:?}", found(&branch)) };
    for fold in [low, high] {
        let torque = fold.orbit.value;
        let across =
            trace(forced(60.0, torque), 21.0, Coordinate::FrequencyHz, &BranchOptions::new(21.0, 23.5)).unwrap();
        assert!(found(&across).iter().any(|(_, frequency_hz)| (frequency_hz / 22.1 - 1.0).abs() < 1e-9));
    }
}

/// Other parameters: the motion at the end of a continuation in β2 or in a stiffness is that of an arm built with this
/// value.
#[test]
fn any_parameter_can_be_continued_in() {
    for (parameter, from, to) in [(ArmParameter::Beta2Deg, 40.0, 80.0), (ArmParameter::Stiffness2, 128e3, 100e3)] {
        let coordinate = Coordinate::Parameter(parameter);
        let mut arm = forced(40.0, 30.0);
        let traced = trace(arm.clone(), 24.0, coordinate, &BranchOptions::new(from, to)).unwrap();
        assert!(arm.set_parameter(parameter, to));
        let direct = trace(arm, 24.0, Coordinate::FrequencyHz, &BranchOptions::new(24.0, 24.1)).unwrap();
        let (a, b) = (traced.orbits.last().unwrap().amplitude_rad[0], direct.orbits[0].amplitude_rad[0]);
        assert!((a / b - 1.0).abs() < 1e-8, "{parameter:?}: {a} {b}");
    }
}

/// A continuation that starts inside a resonance, where Newton's method from rest may find nothing, and whose points
/// are elsewhere, finds the same bifurcations, including the two close pairs of period doublings, which leave the signs
/// of test functions unchanged.
#[test]
fn bifurcations_do_not_depend_on_where_the_points_lie() {
    use BifurcationKind::*;
    let traced =
        |from| trace(forced(60.0, 200.0), from, Coordinate::FrequencyHz, &BranchOptions::new(from, 21.0)).unwrap();
    let expected = found(&traced(22.6));
    let kinds: Vec<_> = expected.iter().map(|b| b.0).collect();
    assert_eq!(kinds, [PeriodDoubling, PeriodDoubling, Fold, PeriodDoubling, PeriodDoubling, Fold]);
    for from in [22.12, 22.13, 22.14, 22.15, 22.16, 22.3, 24.0] {
        assert_same(&found(&traced(from)), &expected);
    }
}

/// The two folds at β2 = 60° meet in a cusp as the excitation falls. It is the same point by curves of both
/// coordinates, and with more harmonics.
#[test]
fn folds_meet_in_a_cusp() {
    let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
    let cusp = |least_harmonics: usize, in_amplitude: bool| {
        let forced = ForcedArm::new(arm_at(Preset::Irb1600Fitted, 0.0, 60.0), Load::torque_nm(1.0, 0.0), 60.0);
        let (first, second) =
            if in_amplitude { (Coordinate::FrequencyHz, amplitude) } else { (amplitude, Coordinate::FrequencyHz) };
        let (hz, mut options, to) = if in_amplitude {
            (21.0, BranchOptions::new(21.0, 23.0), 5.0)
        } else {
            (22.12, BranchOptions::new(1.0, 400.0), 22.2)
        };
        options.least_harmonics = least_harmonics;
        let branch = trace(forced.clone(), hz, first, &options).unwrap();
        let (kind, curve) = trace_singular_curves(&forced, &branch, first, second, &options.between(0.0, to)).remove(0);
        let curve = curve.unwrap();
        assert_eq!((kind, curve.turns.len(), curve.turns[0].is_cusp), (BifurcationKind::Fold, 1, true));
        let point = &curve.turns[0].point;
        if in_amplitude { [point.lambda, point.mu] } else { [point.mu, point.lambda] }
    };
    let [hz, nm] = cusp(3, true);
    assert!((hz - 22.1513).abs() < 1e-4 && (nm - 11.77).abs() < 1e-2, "{hz} {nm}");
    for [other_hz, other_nm] in [cusp(9, true), cusp(9, false), cusp(3, false)] {
        assert!((hz - other_hz).abs() < 1e-8 && (nm - other_nm).abs() < 1e-6, "{hz} {nm}, {other_hz} {other_nm}");
    }
}
