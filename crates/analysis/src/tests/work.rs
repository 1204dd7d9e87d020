//! The work of analyses, by its counts.

use super::arm::{backbone_options, forced};
use crate::continuation::Work;
use crate::*;

fn traced(beta2_deg: f64, torque1_nm: f64, from: f64, to: f64) -> Branch {
    let options = BranchOptions::new(from, to);
    trace(forced(beta2_deg, torque1_nm), from, Coordinate::FrequencyHz, &options).unwrap()
}

/// Motions, evaluations of the equations, factorizations, steps, steps undone.
fn counts(motions: usize, work: Work) -> String {
    let Work { evaluations, factorizations, steps, rejections } = work;
    format!(
        "{motions} motions: {evaluations} evaluations, {factorizations} factorizations, {steps} steps, {rejections} back"
    )
}

fn of_branch(branch: &Branch) -> String {
    let StabilityWork { motions, steps } = branch.stability_work;
    let located = counts(branch.bifurcations.len(), branch.location_work).replace("motions", "bifurcations");
    format!("{}\n{located}\nstability of {motions} motions: {steps} steps", counts(branch.orbits.len(), branch.work))
}

#[test]
fn branches() {
    insta::assert_snapshot!(of_branch(&traced(60.0, 60.0, 21.0, 23.5)), @r"
    70 motions: 191 evaluations, 191 factorizations, 69 steps, 0 back
    2 bifurcations: 6 evaluations, 6 factorizations, 0 steps, 0 back
    stability of 78 motions: 3668 steps
    ");
    insta::assert_snapshot!(of_branch(&traced(60.0, 60.0, 80.0, 0.5)), @r"
    283 motions: 668 evaluations, 668 factorizations, 282 steps, 3 back
    2 bifurcations: 6 evaluations, 6 factorizations, 0 steps, 0 back
    stability of 368 motions: 32894 steps
    ");
}

#[test]
fn doubled_branches() {
    let branch = traced(75.0, 800.0, 40.0, 50.0);
    insta::assert_snapshot!(of_branch(&branch), @r"
    59 motions: 173 evaluations, 173 factorizations, 58 steps, 0 back
    6 bifurcations: 19 evaluations, 19 factorizations, 0 steps, 0 back
    stability of 76 motions: 1955 steps
    ");
    let options = BranchOptions::new(40.0, 50.0);
    let doubled = trace_doubled(forced(75.0, 800.0), &branch.bifurcations[4], Coordinate::FrequencyHz, &options);
    insta::assert_snapshot!(of_branch(&doubled.unwrap()), @r"
    48 motions: 142 evaluations, 142 factorizations, 48 steps, 0 back
    2 bifurcations: 3 evaluations, 3 factorizations, 0 steps, 0 back
    stability of 56 motions: 3012 steps
    ");
}

#[test]
fn curves_in_two_parameters() {
    let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
    let curve = |beta2_deg, from_nm, to_nm, bifurcation: &Bifurcation| {
        let options = BranchOptions::new(from_nm, to_nm);
        let forced = forced(beta2_deg, from_nm);
        let curve = trace_singular(forced, bifurcation, Coordinate::FrequencyHz, amplitude, &options).unwrap();
        counts(curve.points.len(), curve.work)
    };
    let folds = traced(60.0, 60.0, 21.0, 23.5).bifurcations;
    insta::assert_snapshot!(curve(60.0, 60.0, 5.0, &folds[0]), @"81 motions: 183 evaluations, 183 factorizations, 80 steps, 2 back");
    let doublings = traced(75.0, 800.0, 40.0, 50.0).bifurcations;
    insta::assert_snapshot!(curve(75.0, 800.0, 1200.0, &doublings[5]), @"12 motions: 24 evaluations, 24 factorizations, 11 steps, 0 back");
}

#[test]
fn backbones() {
    let curve = |forced, mode| {
        let curve = backbone(forced, mode, ArmParameter::Amplitude, &backbone_options()).unwrap();
        counts(curve.points.len(), curve.work)
    };
    insta::assert_snapshot!(curve(forced(60.0, 0.0), 0), @"29 motions: 74 evaluations, 74 factorizations, 29 steps, 0 back");
    insta::assert_snapshot!(curve(forced(60.0, 0.0).undamped().unwrap(), 1), @"28 motions: 68 evaluations, 68 factorizations, 28 steps, 0 back");
}
