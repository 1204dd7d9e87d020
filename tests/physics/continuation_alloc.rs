//! The inner loop of the continuation doesn't allocate: the steps with all their Newton iterations, along a
//! branch and along a curve of folds, and the stability of each motion. The guard aborts the process at the first
//! allocation.

use assert_no_alloc::assert_no_alloc;
use resonarm::analysis::continuation::{Continuation, ContinuationSettings};
use resonarm::analysis::{
    ArmParameter, BranchOptions, Coordinate, Floquet, ForcedArm, ForcedResponse, HarmonicBalance, SingularResponse,
    Singularity, trace,
};
use resonarm::arm::{Arm, Load, Pose, Preset};

const HARMONICS: usize = 9;

/// 60 N·m at joint 1, β2 = 60°.
fn forced() -> ForcedArm {
    let parameters = Preset::Irb1600Fitted.parameters().unwrap();
    let arm = Arm::new(parameters, Pose { beta1_deg: 0.0, beta2_deg: 60.0 }).unwrap();
    ForcedArm::new(arm, Load::torque_nm(1.0, 0.0), 60.0)
}

/// From 21.5 Hz up, around both folds, where steps are undone, too.
#[test]
fn a_continuation_around_two_folds_allocates_nothing() {
    let balance = HarmonicBalance::new(forced(), 21.5, 1, HARMONICS);
    let mut response = ForcedResponse::new(balance, Coordinate::FrequencyHz);
    let settings = ContinuationSettings {
        largest_step: 2.0,
        largest_turn_rad: 0.5,
        predictor_error: 0.1,
        ..ContinuationSettings::default()
    };
    let unknowns = response.balance().dimension();
    let mut continuation = Continuation::start(&mut response, settings, &vec![0.0; unknowns], 21.5, 1.0).unwrap();
    let mut floquet = Floquet::default();
    // The first step and the first stability allocate the storage for all later ones: tables of fewer steps fit in,
    // too.
    continuation.advance(&mut response).unwrap();
    floquet.stability(response.balance(), &continuation.point().x);
    let (mut turns, mut unstable) = (0, 0);
    assert_no_alloc(|| {
        let mut rising = true;
        while continuation.point().lambda < 22.5 {
            let before = continuation.point().lambda;
            if continuation.advance(&mut response).is_err() {
                return;
            }
            turns += usize::from((continuation.point().lambda > before) != rising);
            rising = continuation.point().lambda > before;
            unstable += usize::from(!floquet.stability(response.balance(), &continuation.point().x).is_stable());
        }
    });
    assert!(turns == 2 && unstable > 2 && continuation.point().lambda >= 22.5, "{turns} turns, {unstable} unstable");
    assert!(continuation.work().evaluations > 100 && continuation.work().rejections > 0, "{:?}", continuation.work());
}

/// From the first fold at 60 N·m to weaker excitation, around the cusp, and back at the other fold.
#[test]
fn a_curve_of_folds_allocates_nothing() {
    let branch = trace(forced(), 21.0, Coordinate::FrequencyHz, &BranchOptions::new(21.0, 23.5)).unwrap();
    let fold = &branch.bifurcations[0].orbit;
    let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
    let balance = HarmonicBalance::new(forced(), fold.frequency_hz, 1, fold.harmonics());
    let settings = BranchOptions::new(60.0, 5.0).continuation;
    let x = &fold.coefficients;
    let mut folds =
        SingularResponse::near(balance, Singularity::Fold, Coordinate::FrequencyHz, Some(amplitude), 1.0, x).unwrap();
    let start = folds.join(fold.frequency_hz, x);
    let mut continuation = Continuation::start(&mut folds, settings, &start, 60.0, -1.0).unwrap();
    continuation.advance(&mut folds).unwrap();
    let mut least_nm = f64::INFINITY;
    assert_no_alloc(|| {
        while continuation.point().lambda < 60.0 {
            if continuation.advance(&mut folds).is_err() {
                return;
            }
            least_nm = continuation.point().lambda.min(least_nm);
        }
    });
    assert!(least_nm > 5.0 && least_nm < 50.0 && continuation.point().lambda >= 60.0, "{least_nm} N·m");
}
