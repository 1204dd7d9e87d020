//! The modes of chains, and of matrices in memory.

use std::collections::BTreeMap;

use super::{close, examples};
use crate::structure::{Matrices, StructureSection};
use crate::{Scenario, StructureSectionError};
use resonarm_dynamics::structure::Assembly;

fn assembly(name: &str) -> Assembly {
    let scenario = Scenario::read(&examples().join(name)).unwrap();
    scenario.under_test().unwrap().assembly
}

fn modal(section: &StructureSection) -> Assembly {
    section.assembly().unwrap()
}

#[test]
fn modes_of_a_chain_have_its_frequencies_and_move_its_points() {
    let chain = assembly("chain.toml");
    let section = StructureSection::from_modes(&chain, Some(2)).unwrap();
    assert_eq!((section.modes.len(), section.modes[0].shape.len()), (2, 12));
    for (got, expected) in modal(&section).modes().iter().zip(chain.modes()) {
        close(got.frequency_hz, expected.frequency_hz, 1e-12);
        close(got.damping_ratio, expected.damping_ratio, 1e-3);
    }
    // Its points have the places of the chain, on a line along its links.
    let rest_m = chain.rest_m().unwrap();
    assert_eq!(section.lines, [chain.points()]);
    assert_eq!(section.points["tip"], [rest_m[6][0], rest_m[6][1], 0.0]);
    assert_eq!((section.points["joint1"], section.points.len()), ([0.0; 3], 7));
    // The displacement of the tip in a small motion along the first mode.
    let (mode, tip) = (&chain.modes()[0], chain.dof("tip.y").unwrap());
    let small: Vec<f64> = mode.shape.iter().map(|entry| 1e-6 * entry).collect();
    close(section.modes[0].shape["tip.y"], 1e6 * chain.displacement(tip, &small), 1e-5);
}

#[test]
fn structures_whose_modes_are_not_all_are_refused() {
    let says = |name, modes| StructureSection::from_modes(&assembly(name), modes).unwrap_err().to_string();
    insta::assert_snapshot!(says("hardening.toml", None), @"the structure has elements (1), but only its linear part has modes; leave them out, and add them to the modal structure");
    insta::assert_snapshot!(says("chain.toml", Some(7)), @"7 modes can't be kept: it must be from 1 to 6, the modes of the structure");
    insta::assert_snapshot!(says("chain.toml", Some(0)), @"0 modes can't be kept: it must be from 1 to 6, the modes of the structure");
    insta::assert_snapshot!(says("chain.toml", None), @"its damping couples modes 3 and 4: one moves the other by 0.036 of its motion, but a modal structure may neglect at most 0.01; keep the structure as it is, or use less damping");
}

const MASS: [f64; 4] = [2.0, 0.0, 0.0, 1.0];
const STIFFNESS: [f64; 4] = [3e4, -1e4, -1e4, 1e4];

fn of(matrices: &Matrices<'_>) -> Result<StructureSection, StructureSectionError> {
    StructureSection::from_matrices(matrices, &BTreeMap::from([(String::from("tip.x"), 1)]), &BTreeMap::new(), None)
}

#[test]
fn matrices_in_memory_are_those_of_files() {
    // λ of [[3e4, -1e4], [-1e4, 1e4]] and diag(2, 1): λ² − 25000 λ + 1e8 = 0.
    let matrices = Matrices { mass: &MASS, stiffness: &STIFFNESS, damping: None };
    let modes = of(&matrices).unwrap().modes;
    for (mode, square) in modes.iter().zip([5e3, 2e4]) {
        close(mode.frequency_hz, f64::sqrt(square) / core::f64::consts::TAU, 1e-12);
    }
    insta::assert_snapshot!(of(&Matrices { mass: &MASS[..3], ..matrices }).unwrap_err(), @"mass: its shape is 3 numbers: it must be square, with 1 to 1000 rows");
    insta::assert_snapshot!(of(&Matrices { stiffness: &[1.0], ..matrices }).unwrap_err(), @"stiffness: it has 1 rows: the mass matrix has 2");
    insta::assert_snapshot!(of(&Matrices { damping: Some(&[1.0, 0.5, 0.0, 1.0]), ..matrices }).unwrap_err(), @"damping: it is not symmetric: entry 0, 1 is 0.5, and entry 1, 0 is 0");
}
