//! The first points of backbones, for every preset, pose, mode and excitation.

use alloc::vec::Vec;

use crate::tests::arm_at;
use crate::*;
use resonarm_dynamics::arm::{Load, Preset};

/// The unit loads of every drive.
const LOADS: [(&str, [f64; 2], [f64; 2]); 4] = [
    ("torque 1", [1.0, 0.0], [0.0, 0.0]),
    ("torque 2", [0.0, 1.0], [0.0, 0.0]),
    ("force x", [0.0, 0.0], [1.0, 0.0]),
    ("force y", [0.0, 0.0], [0.0, 1.0]),
];

fn options(smallest_rad: f64, natural_hz: f64, part: f64) -> BackboneOptions {
    BackboneOptions {
        smallest_rad,
        largest_rad: 10.0 * smallest_rad,
        largest_drive: f64::INFINITY,
        branch: BranchOptions::new((1.0 - part) * natural_hz, (1.0 + part) * natural_hz),
    }
}

/// The first motion has the amplitude asked for, the frequency of the mode, and the drive of the linear response there,
/// whatever the drive, the mode and the pose, and however narrow the interval.
#[test]
fn begin_everywhere() {
    for preset in Preset::ALL {
        for (beta1_deg, beta2_deg) in [-150.0, -75.0, 0.0, 30.0, 60.0, 75.0, 90.0, 120.0, 150.0].map(|b| (20.0, b)) {
            let arm = arm_at(preset, beta1_deg, beta2_deg);
            let natural = modes(&arm);
            for (name, torque, force) in LOADS {
                let load = Load { torque_nm: torque.into(), force_n: force.into() };
                for (mode, part) in [(0, 0.9), (0, 0.01), (1, 0.9), (1, 0.01)] {
                    let forced = ForcedArm::new(arm.clone(), load, 0.0);
                    for (damped, forced) in [(true, forced.clone()), (false, forced.undamped().unwrap())] {
                        let hz = natural[mode].frequency_hz;
                        let case = || format!("{preset} {beta2_deg}° mode {} {name} {part} {damped}", mode + 1);
                        let curve = backbone(forced, mode, ArmParameter::Amplitude, &options(1e-4, hz, part))
                            .unwrap_or_else(|error| panic!("{}: {error}", case()));
                        let first = &curve.points[0];
                        let size = first.coefficients.iter().fold(0.0, |sum, x| sum + x * x).sqrt();
                        assert!((size / 1e-4 - 1.0).abs() < 1e-3, "{}: {first:?}", case());
                        assert!(
                            (first.frequency_hz / hz - 1.0).abs() < natural[mode].damping_ratio,
                            "{}: {first:?}",
                            case()
                        );
                        assert_eq!(first.drive.abs() > 1e-12, damped, "{}: {first:?}", case());
                    }
                }
            }
        }
    }
}

/// A force of any direction at the tip drives both modes, even if the other mode dominates at the tip: to the same
/// curve, up to what the other mode and the dampers add.
#[test]
fn hardly_driven_modes_begin_too() {
    for preset in Preset::ALL {
        let arm = arm_at(preset, 0.0, 120.0);
        for (mode, linear) in modes(&arm).into_iter().enumerate() {
            for angle_deg in (0..180).step_by(3) {
                let (sine, cosine) = libm::sincos(f64::from(angle_deg).to_radians());
                let forced = ForcedArm::new(arm.clone(), Load::force_n(cosine, sine), 0.0);
                let curve = backbone(forced, mode, ArmParameter::Amplitude, &options(1e-4, linear.frequency_hz, 0.5))
                    .unwrap_or_else(|error| panic!("{preset} mode {} {angle_deg}°: {error}", mode + 1));
                let first = &curve.points[0];
                assert!(
                    (first.frequency_hz / linear.frequency_hz - 1.0).abs() < 0.1 * linear.damping_ratio,
                    "{first:?}"
                );
            }
        }
    }
}

/// A drive too weak for the first amplitude asked for still gives a curve, which ends there.
#[test]
fn weak_drives_have_curves() {
    let forced = ForcedArm::new(arm_at(Preset::Irb1600Fitted, 0.0, 60.0), Load::torque_nm(1.0, 0.0), 0.0);
    let options = BackboneOptions { largest_drive: 0.1, ..options(0.1, 22.0, 0.5) };
    let curve = backbone(forced, 0, ArmParameter::Amplitude, &options).unwrap();
    let drives: Vec<f64> = curve.points.iter().map(|point| point.drive).collect();
    assert!((drives[0] - 0.01).abs() < 1e-5 && (drives[drives.len() - 1] - 0.1).abs() < 1e-10, "{drives:?}");
    assert!(drives.len() > 5 && curve.bending() == Some(Bending::Softening));
}

/// A force along the straight arm bends neither joint, so it drives no mode.
#[test]
fn a_mode_that_is_not_driven_is_an_error() {
    let forced = ForcedArm::new(arm_at(Preset::Irb1600Fitted, 0.0, 0.0), Load::force_n(1.0, 0.0), 0.0);
    let says = |forced: &ForcedArm| {
        backbone(forced.clone(), 0, ArmParameter::Amplitude, &options(1e-3, 20.0, 0.5)).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says(&forced), @"mode 1, 20.429754 Hz, is not driven by this excitation: the mode is nowhere 90° behind it; try another excitation");
    assert_eq!(says(&forced), says(&forced.undamped().unwrap()));
}
