//! Continuations that end early: results kept, and messages.

use super::arm::{backbone_options, forced};
use crate::*;
use resonarm_dynamics::arm::{Arm, Gravity, Load, Parameters, Pose, Preset};

fn traced(torque1_nm: f64, options: &BranchOptions) -> Result<Branch, EndedEarly<Branch>> {
    trace(forced(60.0, torque1_nm), options.from, Coordinate::FrequencyHz, options)
}

#[test]
fn says_where_why_and_what_to_try() {
    let says = |torque, options: &BranchOptions| {
        trace(forced(60.0, torque), options.from, Coordinate::FrequencyHz, options).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says(60.0, &BranchOptions::new(0.0, 23.5)), @"the interval from 0 to 23.5 Hz can't be walked: both ends must be numbers, different, and inside the positive frequencies");
    insta::assert_snapshot!(says(60.0, &BranchOptions::new(21.0, f64::NAN)), @"the interval from 21 to NaN Hz can't be walked: both ends must be numbers, different, and inside the positive frequencies");
    insta::assert_snapshot!(says(60.0, &BranchOptions { most_harmonics: 4, ..BranchOptions::new(21.0, 23.5) }), @"at 22.062334 Hz the motion needs more than 4 harmonics; try to allow more, or less excitation");
    insta::assert_snapshot!(says(60.0, &BranchOptions { most_points: 10, ..BranchOptions::new(21.0, 23.5) }), @"the branch has more than 10 points and has come to 21.868289 Hz; try to allow more points or larger steps");
    insta::assert_snapshot!(says(1e7, &BranchOptions::new(22.0, 23.5)), @"no solution at 22.000000 Hz: Newton's method did not converge; try to start elsewhere, away from a resonance, or with less excitation");
}

/// The motions and bifurcations up to the early end are those of the whole continuation.
#[test]
fn results_before_the_end_are_kept() {
    let options = BranchOptions::new(21.0, 23.5);
    let whole = traced(60.0, &options).unwrap();
    let fold = whole.bifurcations[1].index;
    for most_points in [1, 10, fold + 2] {
        let early = traced(60.0, &BranchOptions { most_points, ..options }).unwrap_err();
        assert_eq!(early.so_far.orbits, whole.orbits[..most_points]);
        let before = whole.bifurcations.iter().filter(|event| event.index < most_points).count();
        assert_eq!(early.so_far.bifurcations, whole.bifurcations[..before]);
        assert_eq!(early.so_far.work.steps, most_points - 1);
        assert_eq!(AnalysisError::from(early.clone()), early.reason);
    }
    let none = traced(60.0, &BranchOptions::new(-1.0, 23.5)).unwrap_err();
    assert_eq!(*none.so_far, Branch::default());
}

/// Springs of 200 N·m/rad do not hold the arm upright: as β1 goes from hanging (−90°) to hanging (270°) the
/// continuation ends where the arm falls.
#[test]
fn a_continuation_ends_where_the_arm_falls() {
    let gravity = Some(Gravity { gravity_m_s2: 9.806_65, mass1_kg: 0.0, centre1_m: 0.0 });
    let parameters = Parameters { stiffness1_nm_rad: 200.0, gravity, ..Preset::Irb1600Fitted.parameters().unwrap() };
    let arm = Arm::new(parameters, Pose { beta1_deg: -90.0, beta2_deg: 0.0 }).unwrap();
    let forced = ForcedArm::new(arm, Load::torque_nm(1.0, 0.0), 1.0);
    let beta1 = Coordinate::Parameter(ArmParameter::Beta1Deg);
    let early = trace(forced, 5.0, beta1, &BranchOptions::new(-90.0, 270.0)).unwrap_err();
    insta::assert_snapshot!(early.reason, @"the branch could not be followed beyond 13.720259° (arclength 5.762, step 9.3e-10): no such system exists there; try smaller steps, more harmonics, or to start from the other end");
    let last = early.so_far.orbits.last().unwrap();
    assert!(early.so_far.orbits.len() > 3 && last.value > 0.0, "{last:?}");
}

/// Curves of folds and backbones keep their points, too.
#[test]
fn curves_and_backbones_are_kept() {
    let branch = traced(60.0, &BranchOptions::new(21.0, 23.5)).unwrap();
    let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
    let folds = |options: &BranchOptions| {
        trace_singular(forced(60.0, 60.0), &branch.bifurcations[0], Coordinate::FrequencyHz, amplitude, options)
    };
    let options = BranchOptions::new(60.0, 5.0);
    let whole = folds(&options).unwrap();
    let early = folds(&BranchOptions { most_points: 7, ..options }).unwrap_err();
    assert_eq!(early.so_far.points, whole.points[..7]);
    insta::assert_snapshot!(early.reason, @"the branch has more than 7 points and has come to 50.208517 N·m; try to allow more points or larger steps");
    insta::assert_snapshot!(folds(&BranchOptions::new(60.0, f64::INFINITY)).unwrap_err().reason, @"the interval from 60 to inf N·m can't be walked: both ends must be numbers, different, and inside the range of the second coordinate");

    let curve = |options: &BackboneOptions| backbone(forced(60.0, 0.0), 0, ArmParameter::Amplitude, options);
    let mut options = backbone_options();
    let whole = curve(&options).unwrap();
    options.branch.most_points = 7;
    let early = curve(&options).unwrap_err();
    assert_eq!(early.so_far.points, whole.points[..7]);
    insta::assert_snapshot!(early, @"the branch has more than 7 points and has come to 22.157512 Hz; try to allow more points or larger steps");
}

/// A place is given with the unit of the continuation's parameter.
#[test]
fn messages_name_the_unit() {
    let says = |load, parameter, from: f64, to: f64| {
        let mut arm = ForcedArm::new(forced(60.0, 0.0).arm().clone(), load, 1.0);
        assert!(arm.set_parameter(parameter, from));
        let options = BranchOptions { most_points: 2, ..BranchOptions::new(from, to) };
        let error = trace(arm, 20.0, Coordinate::Parameter(parameter), &options).unwrap_err().to_string();
        error.split("; ").next().unwrap().replace("the branch has more than 2 points and has come to ", "")
    };
    let (torque, force) = (Load::torque_nm(1.0, 0.0), Load::force_n(1.0, 0.0));
    insta::assert_snapshot!(says(torque, ArmParameter::Amplitude, 60.0, 900.0), @"60.860193 N·m");
    insta::assert_snapshot!(says(force, ArmParameter::Amplitude, 60.0, 900.0), @"60.860194 N");
    insta::assert_snapshot!(says(torque, ArmParameter::Beta2Deg, 60.0, 90.0), @"60.287094°");
    insta::assert_snapshot!(says(torque, ArmParameter::Stiffness2, 128e3, 100e3), @"127371.134638 N·m/rad");
    insta::assert_snapshot!(says(torque, ArmParameter::Damping1, 0.9, 2.0), @"0.904500 N·m·s/rad");
}
