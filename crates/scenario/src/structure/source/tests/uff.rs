//! Modes in the Universal File Format.

use std::collections::BTreeMap;

use super::super::error::UffError;
use super::super::uff::{ModesRead, read as read_with};
use super::{close, examples};
use crate::Scenario;

/// Without a stated modal mass.
fn read(text: &str, names: &BTreeMap<String, u32>) -> Result<ModesRead, UffError> {
    read_with(text, names, None)
}

/// One mode at two nodes, by hand, with exponents of D and six values at a node.
const MODE: &str = "    -1
    55
a
b
c
d
e
         1         2         3         8         2         6
         2         4         0         7
  1.25000D+01  4.00000D+00  2.00000D-02  0.00000D+00
        12
  2.00000D+00 -1.00000D+00  0.00000D+00  9.00000D+00  9.00000D+00  9.00000D+00
        15
  0.00000D+00  0.00000D+00  5.00000D-01  0.00000D+00  0.00000D+00  0.00000D+00
    -1
";

const NODES: &str = "    -1
  2411
        12         1         1        11
   1.0000000000000000D+00   2.0000000000000000D+00  -3.0000000000000000D+00
    -1
";

/// `bracket.uff` is by pyuff 2.5.8, from the numbers of `make.py`: shapes there are over √(modal mass).
#[test]
fn modes_written_by_pyuff_are_read() {
    let section = Scenario::read(&examples().join("bracket.toml")).unwrap().structure;
    let expected = [
        (63.4, 0.004, 2.5, "y", 1.0, 0.3),
        (212.25, 0.006, 1.75, "y", 1.0, -0.6),
        (388.0, 0.011, 0.9, "x", 0.275, 0.11),
    ];
    assert_eq!(section.modes.len(), expected.len());
    for (mode, (frequency_hz, damping_ratio, mass, axis, tip, mid)) in section.modes.iter().zip(expected) {
        assert_eq!((mode.frequency_hz, mode.damping_ratio), (frequency_hz, damping_ratio));
        close(mode.shape[&format!("tip.{axis}")], tip / f64::sqrt(mass), 1e-12);
        close(mode.shape[&format!("mid.{axis}")], mid / f64::sqrt(mass), 1e-12);
        assert_eq!(mode.shape.len(), 6);
    }
    assert_eq!(section.points, BTreeMap::from([("mid".into(), [0.1, 0.0, 0.005]), ("tip".into(), [0.3, 0.0, 0.015])]));
}

#[test]
fn nodes_without_names_are_called_by_their_numbers_and_rest_where_a_mode_leaves_them_out() {
    let second = MODE
        .replace("1.25000D+01", "3.0E+1")
        .replace("\n        15\n  0.00000D+00  0.00000D+00  5.00000D-01  0.00000D+00  0.00000D+00  0.00000D+00", "");
    let read = read(&format!("{NODES}{MODE}{second}"), &BTreeMap::new()).unwrap();
    assert_eq!(read.points, BTreeMap::from([("node12".into(), [1.0, 2.0, -3.0])]));
    assert_eq!([read.modes[0].frequency_hz, read.modes[1].frequency_hz], [12.5, 30.0]);
    let shape = |mode: usize| read.modes[mode].shape.values().copied().collect::<Vec<_>>();
    assert_eq!(
        read.modes[0].shape.keys().collect::<Vec<_>>(),
        ["node12.x", "node12.y", "node12.z", "node15.x", "node15.y", "node15.z"]
    );
    assert_eq!((shape(0), shape(1)), (vec![1.0, -0.5, 0.0, 0.0, 0.0, 0.25], vec![1.0, -0.5, 0.0, 0.0, 0.0, 0.0]));
}

/// Lines of dataset 82, over two records, interrupted by 0; nodes that are no points, or have no place, are passed over
#[test]
fn lines_from_node_to_node_are_read() {
    let node = |number: u32| format!("{number:>10}         1         1        11\n 1.0 2.0 {number}.0\n");
    let nodes = format!("    -1\n  2411\n{}{}{}    -1\n", node(12), node(14), node(15));
    let lines = "    -1\n    82\n         1        10         7\nNONE\n        12        13        14        15         0\n        15        16         0        15        12\n    -1\n";
    let text = format!("{nodes}{MODE}{lines}");
    let named = |names: &[(&str, u32)]| {
        let names = names.iter().map(|(name, node)| ((*name).to_owned(), *node)).collect();
        read(&text, &names).unwrap().lines
    };
    assert_eq!(named(&[]), [["node12", "node15"], ["node15", "node12"]]);
    assert_eq!(named(&[("tip", 15), ("root", 12)]), [["root", "tip"], ["tip", "root"]]);
    assert!(named(&[("tip", 15)]).is_empty());
    let short = read(&text.replace("        10         7", "        12         7"), &BTreeMap::new());
    insta::assert_snapshot!(short.map(|read| read.modes).unwrap_err(), @"line 30: dataset 82, a line of nodes: expected 1 numbers, got 0");
}

/// The units of a meshers' file: so many make a metre, and a newton.
fn units(length: &str, force: &str) -> String {
    format!(
        "    -1\n   164\n         5  mm (milli-newton)         2\n  {length}  {force}  1.0D+00\n  2.7315D+02\n    -1\n"
    )
}

/// Places in mm become metres. With mN the unit of mass is the kilogram, so that shapes stay; with N it is the tonne.
#[test]
fn units_of_a_file_become_those_of_si() {
    let of = |length: &str, force: &str| {
        let text = format!("{}{NODES}{MODE}", units(length, force));
        let read = read(&text, &BTreeMap::new()).unwrap();
        (read.points["node12"], read.modes[0].shape["node12.x"], read.modes[0].frequency_hz)
    };
    assert_eq!(of("1.0D+00", "1.0D+00"), ([1.0, 2.0, -3.0], 1.0, 12.5));
    assert_eq!(of("1.0D+03", "1.0D+03"), ([0.001, 0.002, -0.003], 1.0, 12.5));
    let (place, shape, _) = of("1.0D+03", "1.0D+00");
    assert_eq!(place, [0.001, 0.002, -0.003]);
    close(shape, 2.0 / f64::sqrt(4.0 * 1000.0), 1e-15);
    // Pounds of force and feet: the slug, 14.5939 kg.
    close(of("3.280839895", "0.2248089431").1, 2.0 / f64::sqrt(4.0 * 14.593_903), 1e-7);
    let none = read(&format!("{}{MODE}", units("1.0D+03", "0.0D+00")), &BTreeMap::new());
    insta::assert_snapshot!(none.map(|read| read.modes).unwrap_err(), @"line 4: the file is in units of which 1000 make a metre and 0 a newton: both must be positive");
}

/// As NX and Simcenter write modes, by the layout of pyuff 2.5.8; before them a stress on elements.
const ANALYSIS: &str = "    -1
  2414
         1
Stress - Mode 3
         2
a
b
c
d
e
         1         2         4         2         2         6
         1         0         1         0         1         3         0         0
         0         0
  0.00000E+00  2.12250E+02  1.77851E+06  1.75000E-03  6.00000E-03  0.00000E+00
  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00
        31         6
  1.00000E+00  1.00000E+00  1.00000E+00  1.00000E+00  1.00000E+00  1.00000E+00
    -1
    -1
  2414
         2
Displacement - Mode 3
         1
a
b
c
d
e
         1         2         3         8         2         6
         1         0         1         0         1         3         0         0
         0         0
  0.00000E+00  2.12250E+02  1.77851E+06  1.75000E-03  6.00000E-03  0.00000E+00
  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00
         4
  0.00000E+00  1.00000E+00  0.00000E+00  9.00000E+00  9.00000E+00  9.00000E+00
         7
 -1.00000E-01 -6.00000E-01  0.00000E+00  9.00000E+00  9.00000E+00  9.00000E+00
    -1
";

#[test]
fn modes_of_analysis_data_are_read() {
    let read = read(&format!("{}{ANALYSIS}", units("1.0D+03", "1.0D+00")), &BTreeMap::new()).unwrap();
    let [mode] = &read.modes[..] else { panic!("{:?}", read.modes) };
    assert_eq!((mode.frequency_hz, mode.damping_ratio), (212.25, 0.006));
    // 0.00175 t are 1.75 kg.
    close(mode.shape["node4.y"], 1.0 / f64::sqrt(1.75), 1e-14);
    close(mode.shape["node7.x"], -0.1 / f64::sqrt(1.75), 1e-14);
    close(mode.shape["node7.y"], -0.6 / f64::sqrt(1.75), 1e-14);
    let complex =
        ANALYSIS.replace("1         2         3         8         2", "1         7         3         8         5");
    assert!(read_with(&complex, &BTreeMap::new(), None).is_err(), "modes of velocities are another analysis");
}

/// A normal mode of 63.4 Hz, 0.3 % and 4 kg as test software writes it, with a complex eigenvalue and complex values: its
/// shape ψ = (1, −0.5) at one node and 0.25 at another is turned by an angle, which modal A is, too.
fn complex_mode(angle_rad: f64, modal_mass: f64) -> String {
    let (omega, zeta) = (core::f64::consts::TAU * 63.4, 0.003);
    let (sigma, damped) = (-zeta * omega, omega * f64::sqrt(1.0 - zeta * zeta));
    let turned = |psi: f64, angle: f64| format!("{:13.5E}{:13.5E}", psi * libm::cos(angle), psi * libm::sin(angle));
    // a = 2jωμ exp(2jθ): the factor j is a quarter turn.
    let modal_a = turned(2.0 * damped * modal_mass, 2.0 * angle_rad + core::f64::consts::FRAC_PI_2);
    let [one, half, quarter, zero] = [1.0, -0.5, 0.25, 0.0].map(|psi| turned(psi, angle_rad));
    format!(
        "    -1\n    55\na\nb\nc\nd\ne\n\
         {:>10}{:>10}{:>10}{:>10}{:>10}{:>10}\n{:>10}{:>10}{:>10}{:>10}\n\
         {sigma:13.5E}{damped:13.5E}{modal_a}{zero}\n\
         {:>10}\n{one}{half}{zero}\n{:>10}\n{zero}{zero}{quarter}\n    -1\n",
        1, 3, 2, 8, 5, 3, 2, 6, 0, 7, 12, 15
    )
}

#[test]
fn complex_modes_that_are_real_but_for_an_angle_are_read() {
    for angle_rad in [0.0, 0.3, 1.57, -0.7, 3.0] {
        let [mode] = &read(&complex_mode(angle_rad, 4.0), &BTreeMap::new()).unwrap().modes[..] else { panic!() };
        close(mode.frequency_hz, 63.4, 1e-5);
        close(mode.damping_ratio, 0.003, 1e-5);
        // The sign of a shape is of no account.
        let sign = f64::signum(mode.shape["node12.x"]);
        for (dof, expected) in [("node12.x", 0.5), ("node12.y", -0.25), ("node15.z", 0.125)] {
            close(sign * mode.shape[dof], expected, 2e-5);
        }
    }
    let stated = read_with(&complex_mode(0.3, 0.0), &BTreeMap::new(), Some(4.0)).unwrap().modes;
    close(stated[0].shape["node12.x"].abs(), 0.5, 2e-5);
    // The head of dataset 2414 has the same numbers in its second line, and a normal mode may have complex values.
    let of_2414 = ANALYSIS
        .replace("1         2         3         8         2", "1         3         3         8         5")
        .replace("8         5         6", "8         5         3")
        .replace(
            "  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00\n         4",
            "  -1.00000E+01  1.00000E+03  0.00000E+00  8.00000E+03  0.00000E+00  0.00000E+00\n         4",
        )
        .replace(
            "  0.00000E+00  1.00000E+00  0.00000E+00  9.00000E+00  9.00000E+00  9.00000E+00",
            "  0.00000E+00  0.00000E+00  1.00000E+00  0.00000E+00  0.00000E+00  0.00000E+00",
        )
        .replace(
            " -1.00000E-01 -6.00000E-01  0.00000E+00  9.00000E+00  9.00000E+00  9.00000E+00",
            "  0.00000E+00  0.00000E+00 -6.00000E-01  0.00000E+00  0.00000E+00  0.00000E+00",
        );
    let modes = read(&of_2414, &BTreeMap::new()).unwrap().modes;
    let [mode] = &modes[..] else { panic!("{modes:?}") };
    close(mode.frequency_hz, libm::hypot(10.0, 1000.0) / core::f64::consts::TAU, 1e-12);
    close(mode.shape["node4.y"], 0.5, 1e-12);
    close(mode.shape["node7.y"], -0.3, 1e-12);
}

/// A part of 0.005 out of phase is passed, one of 0.3 is not; nor is a mode without a positive modal mass.
#[test]
fn complex_modes_that_are_no_normal_modes_are_refused() {
    let quarter = |imaginary: f64| {
        let values = format!("{:13.5E}{:13.5E}", 0.25, 0.0);
        let changed = complex_mode(0.0, 4.0).replace(&values, &format!("{:13.5E}{imaginary:13.5E}", 0.25));
        read(&changed, &BTreeMap::new()).map(|read| read.modes)
    };
    // The imaginary part of one point is relative to the norm of the whole shape, about 1.15, so 0.005 is within the
    // share of 0.01.
    assert!(quarter(0.005).is_ok());
    insta::assert_snapshot!(quarter(0.3).unwrap_err(), @"line 10: mode 7 is complex: after the best rotation, its shape has an imaginary part of 0.2468 of the shape; normal modes may have at most 0.01. Identify normal modes, or write the structure as matrices, with its dampers as elements of kind `linear`");
    let says = |text: &str| read(text, &BTreeMap::new()).map(|read| read.modes).unwrap_err().to_string();
    let negative = says(&complex_mode(0.3, -4.0));
    assert!(negative.starts_with("line 10: mode 7: ") && negative.contains("gives a modal mass of -"), "{negative}");
    let unknown = says(&complex_mode(0.3, 0.0));
    assert!(unknown.contains("its modal mass is 0: shapes are normalised with it"), "{unknown}");
    let damped = core::f64::consts::TAU * 63.4 * f64::sqrt(1.0 - 0.003 * 0.003);
    let [damped, other] = [damped, -damped].map(|omega| format!("{omega:13.5E}"));
    let conjugate = says(&complex_mode(0.0, 4.0).replacen(&damped, &other, 1));
    assert!(conjugate.ends_with("expected the one of its pair with a positive imaginary part"), "{conjugate}");
}

/// Shapes scaled to 1, which have no modal mass in the file, take the one that is stated.
#[test]
fn an_unknown_modal_mass_is_stated() {
    let unknown = MODE.replace("4.00000D+00", "0.00000D+00");
    let read = |text: &str, mass_kg: f64| read_with(text, &BTreeMap::new(), Some(mass_kg));
    // kg, whatever the units of the file.
    let text = format!("{}{unknown}", units("1.0D+03", "1.0D+00"));
    close(read(&text, 2.25).unwrap().modes[0].shape["node12.x"], 2.0 / 1.5, 1e-15);
    // A mode that has one keeps it.
    let both = read(&format!("{unknown}{MODE}"), 2.25).unwrap().modes;
    assert_eq!([0, 1].map(|mode: usize| both[mode].shape["node12.x"]), [2.0 / 1.5, 1.0]);
    let says = |text: &str, mass_kg: f64| read(text, mass_kg).map(|read| read.modes).unwrap_err().to_string();
    insta::assert_snapshot!(says(&unknown, 0.0), @"structure.modal_mass_kg is 0: it must be a positive number");
    insta::assert_snapshot!(says(MODE, 1.0), @"structure.modal_mass_kg applies only to modes whose modal mass is 0 in the file, and there are none: leave it out");
    insta::assert_snapshot!(says(&MODE.replace("4.00000D+00", "-4.0000D+00"), 1.0), @"line 10: mode 7: its modal mass is -4: shapes are normalised with it, so it must be positive");
}

/// The message about a change of the mode.
fn of(from: &str, to: &str) -> String {
    let text = MODE.replacen(from, to, 1);
    assert_ne!(text, MODE, "{from}");
    read(&text, &BTreeMap::new()).map(|read| read.modes).unwrap_err().to_string()
}

fn named(names: &[(&str, u32)]) -> String {
    let names = names.iter().map(|(name, node)| ((*name).to_owned(), *node)).collect();
    read(MODE, &names).map(|read| read.modes).unwrap_err().to_string()
}

#[test]
fn what_gives_no_modes_is_said() {
    insta::assert_snapshot!(of("    -1", "text\n    -1"), @r#"line 1: "text" is outside the datasets, which begin and end with a line -1"#);
    insta::assert_snapshot!(of("    55", "    5x"), @r#"line 2: "5x" is not the number of a dataset"#);
    insta::assert_snapshot!(of("    55", "    55b     1     2"), @"line 2: dataset 55b is binary: export the modes as ASCII");
    insta::assert_snapshot!(of("    55", "    58b     1     2"), @"the file has no modes: it needs a dataset 55 or 2414 of normal modes, and it has 58b");
    insta::assert_snapshot!(of("    -1\n    55", "    -1\n    57"), @"the file has no modes: it needs a dataset 55 or 2414 of normal modes, and it has 57");
    insta::assert_snapshot!(of("0.00000D+00  0.00000D+00  0.00000D+00\n    -1\n", "0.00000D+00  0.00000D+00  0.00000D+00\n"), @"dataset 55, which begins in line 2, lacks its end, a line -1");
    insta::assert_snapshot!(read("", &BTreeMap::new()).map(|read| read.modes).unwrap_err(), @"the file has no modes: it needs a dataset 55 or 2414 of normal modes, and it has none");
    insta::assert_snapshot!(of("1         2         3         8", "1         5         3         8"), @"line 8: dataset 55 has analysis type 5: it must be 2 (normal mode) or 3 (complex eigenvalue of first order)");
    insta::assert_snapshot!(of("1         2         3         8", "1         7         3         8"), @"line 8: dataset 55 has analysis type 7: it must be 2 (normal mode) or 3 (complex eigenvalue of first order)");
    insta::assert_snapshot!(of("3         8         2", "3        12         2"), @"line 8: dataset 55 has specific data type 12: it must be 8 (displacement)");
    insta::assert_snapshot!(of("2         6\n", "2         1\n"), @"line 8: dataset 55 has 1 values at a node: it must have 3, or 6 with rotations");
    insta::assert_snapshot!(of("4.00000D+00", "0.00000D+00"), @"line 10: mode 7: its modal mass is 0: shapes are normalised with it, so it must be positive; state it in structure.modal_mass_kg");
    insta::assert_snapshot!(of("2.00000D-02  0.00000D+00", "0.00000D+00  1.00000D-02"), @"line 10: mode 7 has hysteretic damping, 0.01, but no viscous damping; state it as viscous damping, half the loss factor");
    insta::assert_snapshot!(of("  0.00000D+00\n        12", "\n        12"), @"line 10: dataset 55, frequency, modal mass and damping ratios: expected 4 numbers, got 3");
    insta::assert_snapshot!(of("-1.00000D+00", "-1.0000D+400"), @r#"line 12: dataset 55, the values at a node: "-1.0000D+400" is not a finite number"#);
    insta::assert_snapshot!(of("        15", "      1.5"), @r#"line 13: dataset 55, a node: "1.5" is not a finite number"#);
    insta::assert_snapshot!(of("        15", "        12"), @"line 14: node 12 occurs for the second time");
    insta::assert_snapshot!(named(&[("tip", 13)]), @"structure.nodes: `tip` is node 13, where no mode has values; nodes with values are 12, 15");
    insta::assert_snapshot!(named(&[("tip", 12), ("top", 12)]), @"structure.nodes: `tip` and `top` are both node 12");
}
