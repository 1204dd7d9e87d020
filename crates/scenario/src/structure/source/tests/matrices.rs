//! Tests of modes that are computed from matrices.

use std::fs;
use std::path::Path;

use super::super::npy::square;
use super::{close, examples, read_in};
use crate::Scenario;

/// A matrix as NumPy writes it.
fn npy(shape: &str, numbers: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes
}

/// Numbers of NumPy: frequency, damping ratio, shape of row 8 and row 4.
#[test]
fn the_modes_of_matrices_are_those_of_numpy() {
    let modes = Scenario::read(&examples().join("plate.toml")).unwrap().structure.modes;
    let expected = [
        [36.411_857_299_800_9, 0.001_102_975_387_743_629_3, 0.430_809_909_715_701_2, 0.438_056_492_620_758_8],
        [125.227_628_471_634_9, 0.001_041_013_426_212_099_4, -0.564_196_956_067_023_9, 0.015_758_636_600_378_486],
        [135.716_425_292_355_38, 0.001_087_271_878_398_541, -0.530_326_016_712_937_9, 0.049_145_376_669_844_205],
        [181.881_240_031_220_98, 0.001_317_803_275_508_608_5, 0.575_303_498_753_231, 0.008_359_964_257_294_884],
    ];
    assert_eq!(modes.len(), expected.len());
    for (mode, expected) in modes.iter().zip(expected) {
        let got = [mode.frequency_hz, mode.damping_ratio, mode.shape["tip.z"], mode.shape["middle.z"]];
        got.into_iter().zip(expected).for_each(|(got, expected)| close(got, expected, 1e-10));
    }
}

const SCENARIO: &str = "[structure]\nkind = 'modal'\ndofs = { 'tip.x' = 1 }\n\
    matrices = { mass = 'm.npy', damping = 'c.npy', stiffness = 'k.npy' }\n";
const MASS: [f64; 4] = [2.0, 0.0, 0.0, 1.0];
const DAMPING: [f64; 4] = [2.0, 0.0, 0.0, 1.0];
const STIFFNESS: [f64; 4] = [3e4, -1e4, -1e4, 1e4];

/// The message about matrices of two rows, and about a change of the scenario.
fn of([mass, damping, stiffness]: [&[u8]; 3], from: &str, to: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [("m.npy", mass), ("c.npy", damping), ("k.npy", stiffness)] {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    match read_in(folder.path(), &SCENARIO.replacen(from, to, 1)) {
        Ok(scenario) => format!("{:?}", scenario.structure.modes),
        Err(error) => error.to_string().replace(&folder.path().display().to_string(), ""),
    }
}

fn two(numbers: &[f64; 4]) -> Vec<u8> {
    npy("(2, 2)", numbers)
}

#[test]
fn matrices_that_make_no_modes_are_said() {
    let (m, c, k) = (&*two(&MASS), &*two(&DAMPING), &*two(&STIFFNESS));
    let with = |mass: &[u8], damping: &[u8], stiffness: &[u8]| of([mass, damping, stiffness], "", "");
    let three = npy("(3, 3)", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    insta::assert_snapshot!(with(m, c, &three), @"/k.npy: it has 3 rows: the mass matrix has 2");
    insta::assert_snapshot!(with(m, c, &two(&[3e4, -1e4, -2e4, 1e4])), @"/k.npy: it is not symmetric: entry 0, 1 is -10000, and entry 1, 0 is -20000");
    insta::assert_snapshot!(with(m, c, &two(&[1e4, -2e4, -2e4, 1e4])), @"/k.npy: it is not positive definite: with a negative stiffness the structure is at no stable rest");
    insta::assert_snapshot!(with(&two(&[2.0, 1.0, 1.0, 0.5]), c, k), @"/m.npy: it is not positive definite: every degree of freedom needs a mass, or a row of zeros, and is then condensed");
    insta::assert_snapshot!(with(&two(&[0.0; 4]), c, k), @"/m.npy: it is not positive definite: every degree of freedom needs a mass, or a row of zeros, and is then condensed");
    insta::assert_snapshot!(with(&two(&[2.0, 0.0, 0.0, 0.0]), &two(&[2.0, 0.0, 0.0, 1.0]), k), @"/c.npy: row 1 has no mass, and its damping moves it against the stiffness, so it can't be condensed; use Rayleigh damping, C = aM + bK, or give it a mass");
    insta::assert_snapshot!(with(&two(&[2.0, 0.0, 0.0, 0.0]), c, &two(&[3e4, 0.0, 0.0, 0.0])), @"/k.npy: degrees of freedom without mass, from row 1 on, are not held by stiffness, so their displacement does not follow from the others'; give them a stiffness, or leave them out");
    insta::assert_snapshot!(with(m, c, &two(&[1e4, -1e4, -1e4, 1e4])), @"/c.npy: its damping acts on mode 1, which is rigid, at 0 Hz: φᵢᵀCφⱼ with mode 1 is 1 1/s, which no damping ratio can state; remove this part, such as aM of Rayleigh damping, and state dampers of the whole structure as elements of kind linear");
    insta::assert_snapshot!(with(m, &two(&[2.0, f64::NAN, 0.0, 1.0]), k), @"/c.npy: entry 0, 1 is NaN: all must be finite");
    insta::assert_snapshot!(with(m, &two(&[2.0, 0.0, 0.0, 0.0]), k), @"/c.npy: its damping couples modes 1 and 2: φᵢᵀCφⱼ is 1 of √(φᵢᵀCφᵢ φⱼᵀCφⱼ), and modal damping may have at most 0.001; use modal damping, such as Rayleigh's, C = aM + bK, and state single dampers as elements of kind linear");
    insta::assert_snapshot!(of([m, c, k], "k.npy", "q.npy"), @"can't read /q.npy: No such file or directory (os error 2); paths are relative to the scenario's folder");
    insta::assert_snapshot!(of([m, c, k], "k.npy'", "k.npy', modes = 3"), @"structure.matrices: `modes` is 3: it must be from 1 to 2, since the matrices have 2 rows");
    insta::assert_snapshot!(of([m, c, k], "'tip.x' = 1", "'tip.x' = 2"), @"structure: `tip.x` is row 2: the matrices have rows 0 to 1");
    insta::assert_snapshot!(of([m, c, k], "'tip.x' = 1", "'tip' = 1"), @r#"structure: `tip` is not a place: write point and axis, as in "tip.x""#);
    insta::assert_snapshot!(of([m, c, k], "'tip.x' = 1", ""), @r#"structure: `dofs` are missing: name degrees of freedom by their rows, from 0, in a table [structure.dofs], as "tip.x" = 0"#);
    let many: Vec<f64> = (0..33 * 33).map(|k| f64::from(k % 34 == 0)).collect();
    let many = npy("(33, 33)", &many);
    insta::assert_snapshot!(with(&many, c, k), @"structure.matrices: `modes` is missing: it must be from 1 to 32, since the matrices have 33 rows");
}

#[test]
fn files_that_are_no_matrix_are_said() {
    let file = two(&MASS);
    let says = |bytes: &[u8]| square(bytes).unwrap_err().to_string();
    let with = |from: &str, to: &str| {
        let text: String = file.iter().map(|byte| char::from(*byte)).collect();
        let changed = text.replacen(from, to, 1);
        assert_eq!(from.chars().count(), to.chars().count(), "the length of the header stays");
        says(&changed.chars().map(|letter| letter as u8).collect::<Vec<_>>())
    };
    insta::assert_snapshot!(says(b"PK\x03\x04"), @r"it is not a NumPy file: it does not begin with \x93NUMPY");
    insta::assert_snapshot!(with("\u{1}\u{0}", "\u{4}\u{0}"), @"it is not a NumPy file: its version is not 1.0, 2.0 or 3.0");
    insta::assert_snapshot!(says(&file[..30]), @"it is not a NumPy file: it ends inside the header");
    insta::assert_snapshot!(with("descr", "descs"), @"it is not a NumPy file: the header lacks `descr`, `fortran_order` or `shape`");
    insta::assert_snapshot!(with("descr", "des\u{ff}r"), @"it is not a NumPy file: the header is no text");
    insta::assert_snapshot!(with("False", "Never"), @"it is not a NumPy file: `fortran_order` is neither True nor False");
    insta::assert_snapshot!(with("<f8", ">f8"), @r#"its numbers are of type ">f8": save float64, numpy.save(path, matrix.astype("<f8"))"#);
    insta::assert_snapshot!(with("(2, 2)", "(2, 1)"), @"its shape is (2, 1): it must be square, with 1 to 1000 rows");
    insta::assert_snapshot!(with("(2, 2)", "( 4,) "), @"its shape is ( 4,): it must be square, with 1 to 1000 rows");
    insta::assert_snapshot!(with("(2, 2)", "(3, 3)"), @"it has 32 bytes of numbers: its shape needs 72");
    // The order of Fortran is the other one.
    let by_columns = file.iter().map(|byte| char::from(*byte)).collect::<String>().replace("False", "True ");
    let bytes: Vec<u8> = by_columns.chars().map(|letter| letter as u8).collect();
    assert_eq!(square(&bytes).unwrap(), square(&file).unwrap().transpose());
}

/// A file of NumPy itself, in either order.
#[test]
fn both_orders_are_read() {
    let read = |name: &str| square(&fs::read(Path::new(&examples()).join(name)).unwrap()).unwrap();
    let (m, k) = (read("plate-m.npy"), read("plate-k.npy"));
    assert_eq!((m[(0, 0)], m[(8, 8)], m[(0, 1)]), (0.5, 0.66, 0.0));
    assert_eq!((k[(0, 1)], k[(0, 3)], k[(8, 0)]), (-3e5 * 1.1, -3e5 * 1.3, 0.0));
}

/// The same two modes from Matrix Market in every form, and from NumPy.
#[test]
fn matrices_of_matrix_market_are_those_of_numpy() {
    let (m, c, k) = (&*two(&MASS), &*two(&DAMPING), &*two(&STIFFNESS));
    let expected = of([m, c, k], "", "");
    let with = |stiffness: &str| of([m, c, stiffness.as_bytes()], "", "");
    for stiffness in [
        "%%MatrixMarket matrix coordinate real symmetric\n% of a mesh\n\n2 2 3\n1 1 3e4\n2 1 -1e4\n2 2 10000\n",
        "%%MatrixMarket MATRIX Coordinate integer General\r\n2 2 4\r\n1 1 30000\r\n1 2 -10000\r\n2 1 -10000\r\n2 2 10000\r\n",
        "%%MatrixMarket matrix array real symmetric\n2 2\n3e4\n-1e4\n1e4\n",
        "%%MatrixMarket matrix array real general\n2 2\n3e4\n-1e4\n-1e4\n1e4\n",
    ] {
        assert_eq!(with(stiffness), expected, "{stiffness}");
    }
    let says = |text: &str| with(&format!("%%MatrixMarket matrix {text}"));
    insta::assert_snapshot!(says("coordinate complex symmetric\n2 2 0\n"), @"/k.npy: line 1 violates the Matrix Market format: the field must be `real` or `integer`");
    insta::assert_snapshot!(says("coordinate real hermitian\n2 2 0\n"), @"/k.npy: line 1 violates the Matrix Market format: the symmetry must be `general` or `symmetric`");
    insta::assert_snapshot!(says("list real general\n2 2 0\n"), @"/k.npy: line 1 violates the Matrix Market format: the format must be `array` or `coordinate`");
    insta::assert_snapshot!(says("array real\n"), @"/k.npy: line 1 violates the Matrix Market format: it must be `%%MatrixMarket matrix`, format, field and symmetry");
    insta::assert_snapshot!(says("array real general\n"), @"/k.npy: line 1 violates the Matrix Market format: the line of sizes is missing");
    insta::assert_snapshot!(says("array real general\n2 3\n"), @"/k.npy: its shape is (2 3): it must be square, with 1 to 1000 rows");
    insta::assert_snapshot!(says("array real general\n1001 1001\n"), @"/k.npy: its shape is (1001, 1001): it must be square, with 1 to 1000 rows");
    insta::assert_snapshot!(says("array real general\ntwo 2\n"), @"/k.npy: line 2 violates the Matrix Market format: the sizes must be rows and columns, and of `coordinate` the number of entries");
    insta::assert_snapshot!(says("array real symmetric\n2 2\n1\n2\n"), @"/k.npy: it has 2 entries: its sizes require 3");
    insta::assert_snapshot!(says("array real symmetric\n2 2\n1\n2\n3\n4\n"), @"/k.npy: it has 4 entries: its sizes require 3");
    insta::assert_snapshot!(says("coordinate real general\n2 2 1\n1 3 1\n"), @"/k.npy: line 3 violates the Matrix Market format: row and column count from 1, up to the size");
    insta::assert_snapshot!(says("coordinate real general\n2 2 1\n1 1\n"), @"/k.npy: line 3 violates the Matrix Market format: it must be row, column and number");
    insta::assert_snapshot!(says("coordinate real general\n2 2 1\n1 1 one\n"), @"/k.npy: line 3 violates the Matrix Market format: it has no number");
    insta::assert_snapshot!(says("coordinate real symmetric\n2 2 1\n1 2 1\n"), @"/k.npy: line 3 violates the Matrix Market format: only the lower triangle of a symmetric matrix may be given");
    insta::assert_snapshot!(says("coordinate real general\n2 2 2\n1 1 1\n1 1 1\n"), @"/k.npy: line 4 violates the Matrix Market format: this entry is given twice: give their sum once");
}

/// A beam of `n` elements by E. Hermite's cubics, 1 m long; its mass consistent, or lumped at the nodes without rotary
/// inertia. Rows are deflection and rotation of each node from `first` on.
fn beam(n: usize, is_lumped: bool, first: usize) -> ([Vec<f64>; 2], f64) {
    let (length, stiffness, mass_kg_m) = (1.0 / n as f64, 2.1e11 * 0.03 * 1e-6 / 12.0, 7800.0 * 3e-4);
    let l = length;
    let k = [
        [12.0, 6.0 * l, -12.0, 6.0 * l],
        [6.0 * l, 4.0 * l * l, -6.0 * l, 2.0 * l * l],
        [-12.0, -6.0 * l, 12.0, -6.0 * l],
        [6.0 * l, 2.0 * l * l, -6.0 * l, 4.0 * l * l],
    ];
    let m = [
        [156.0, 22.0 * l, 54.0, -13.0 * l],
        [22.0 * l, 4.0 * l * l, 13.0 * l, -3.0 * l * l],
        [54.0, 13.0 * l, 156.0, -22.0 * l],
        [-13.0 * l, -3.0 * l * l, -22.0 * l, 4.0 * l * l],
    ];
    let all = 2 * (n + 1);
    let (mut mass, mut whole) = (vec![0.0; all * all], vec![0.0; all * all]);
    for element in 0..n {
        for i in 0..4 {
            for j in 0..4 {
                let at = (2 * element + i) * all + 2 * element + j;
                whole[at] += stiffness / (l * l * l) * k[i][j];
                let lumped = if i == j && i % 2 == 0 { mass_kg_m * l / 2.0 } else { 0.0 };
                mass[at] += if is_lumped { lumped } else { mass_kg_m * l / 420.0 * m[i][j] };
            }
        }
    }
    let cut = |of: &[f64]| {
        (first..all).flat_map(|i| (first..all).map(move |j| (i, j))).map(|(i, j)| of[i * all + j]).collect()
    };
    ([cut(&mass), cut(&whole)], libm::sqrt(stiffness / mass_kg_m) / std::f64::consts::TAU)
}

fn of_beam(
    [mass, stiffness]: &[Vec<f64>; 2],
    damping: Option<&[f64]>,
    row: usize,
    modes: usize,
) -> Vec<crate::structure::ModeSection> {
    let matrices = crate::structure::Matrices { mass, stiffness, damping };
    let dofs = std::collections::BTreeMap::from([("tip.y".to_owned(), row)]);
    crate::structure::StructureSection::from_matrices(&matrices, &dofs, &std::collections::BTreeMap::new(), Some(modes))
        .unwrap()
        .modes
}

/// A free beam has two rigid modes at 0 Hz, exactly, and elastic ones with all digits of the method: λ² EI/ρA of a free
/// beam, λ = 4.730041, 7.853205, within the error of ten elements.
#[test]
fn a_free_structure_has_rigid_modes() {
    let (matrices, unit_hz) = beam(10, false, 0);
    let damping: Vec<f64> = matrices[1].iter().map(|k| 1e-5 * k).collect();
    let modes = of_beam(&matrices, Some(&damping), 20, 4);
    assert_eq!([modes[0].frequency_hz, modes[1].frequency_hz, modes[0].damping_ratio], [0.0; 3]);
    for (mode, lambda) in modes[2..].iter().zip([4.730_040_744_862_7_f64, 7.853_204_624_095_8]) {
        close(mode.frequency_hz, lambda * lambda * unit_hz, 1e-3);
        close(mode.damping_ratio, 0.5e-5 * std::f64::consts::TAU * mode.frequency_hz, 1e-8);
    }
    // The rigid modes at the end of a beam of mass m have the accelerance 1/m + (l/2)²/I = 4/m.
    let rigid: f64 = modes[..2].iter().map(|mode| mode.shape["tip.y"].powi(2)).sum();
    close(rigid, 4.0 / (7800.0 * 3e-4), 1e-9);
}

/// Lumped masses on a cantilever without rotary inertia: the rotations are condensed, exactly. The same matrices with a
/// rotary inertia of 1e-12 kg·m² at each node, which is all but none, have the same modes without condensation.
#[test]
fn degrees_of_freedom_without_mass_are_condensed() {
    let (matrices, unit_hz) = beam(10, true, 2);
    let damping: Vec<f64> = matrices[1].iter().map(|k| 1e-3 * k).collect();
    let modes = of_beam(&matrices, Some(&damping), 18, 10);
    let nearly =
        matrices[0].iter().enumerate().map(|(at, m)| if at % 21 == 0 && *m == 0.0 { 1e-12 } else { *m }).collect();
    let expected = of_beam(&[nearly, matrices[1].clone()], None, 18, 10);
    for (mode, expected) in modes.iter().zip(&expected) {
        close(mode.frequency_hz, expected.frequency_hz, 1e-6);
        close(mode.shape["tip.y"].abs(), expected.shape["tip.y"].abs(), 1e-6);
        close(mode.damping_ratio, 0.5e-3 * std::f64::consts::TAU * mode.frequency_hz, 1e-8);
    }
    close(modes[0].frequency_hz, 1.875_104_068_711_96_f64.powi(2) * unit_hz, 5e-3);
    // The rotation at the tip, which has no mass, follows: 1.3765 of the deflection in the first mode of a cantilever.
    let rotation = of_beam(&matrices, None, 19, 1)[0].shape["tip.y"] / modes[0].shape["tip.y"];
    close(rotation, 1.3765, 1e-2);
    // High modes of stiffness-proportional damping are overdamped.
    assert!(modes[9].damping_ratio > 1.0, "{}", modes[9].damping_ratio);
}

/// A clamped beam on a base that moves across it: all modes together have the effective mass of what moves, and the first
/// 61.3 % of it, as that of a cantilever has.
#[test]
fn participation_factors_of_matrices_are_effective_masses() {
    let (matrices, _) = beam(10, false, 2);
    let [mass, stiffness] = &matrices;
    let of = crate::structure::Matrices { mass, stiffness, damping: None };
    let dofs = std::collections::BTreeMap::from([("tip.y".to_owned(), 18)]);
    let base = |rows: Vec<usize>| std::collections::BTreeMap::from([("base.y".to_owned(), rows)]);
    let deflections: Vec<usize> = (0..20).step_by(2).collect();
    let section = crate::structure::StructureSection::from_matrices(&of, &dofs, &base(deflections), None).unwrap();
    let effective: Vec<f64> = section.modes.iter().map(|mode| mode.participation["base.y"].powi(2)).collect();
    let all: f64 =
        (0..20).step_by(2).flat_map(|i| (0..20).step_by(2).map(move |j| (i, j))).map(|(i, j)| mass[i * 20 + j]).sum();
    close(effective.iter().sum(), all, 1e-9);
    close(effective[0] / (7800.0 * 3e-4), 0.6131, 2e-3);
    let refused = crate::structure::StructureSection::from_matrices(&of, &dofs, &base(vec![20]), None).unwrap_err();
    insta::assert_snapshot!(refused, @"structure: `base.y` is row 20: the matrices have rows 0 to 19");
    let other = std::collections::BTreeMap::from([("foot.y".to_owned(), vec![0])]);
    let refused = crate::structure::StructureSection::from_matrices(&of, &dofs, &other, None).unwrap_err();
    insta::assert_snapshot!(refused, @r#"structure: `foot.y`: `base` is the base of the structure; state it in `participation`, as "base.z" = 1.2 (√kg), and use another name for a point in `shape`"#);
}
