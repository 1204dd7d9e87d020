//! The structures of sections `[structure]`, and the messages about invalid ones.

use crate::Scenario;
use resonarm_bench::rig::Converter;

const CHAIN: &str = r#"
[structure]
kind = "chain"
links = [
  { length_m = 0.5, mass_kg = 10.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.3, angle_deg = 30.0, stiffness_nm_rad = 2e5, damping_nm_s_rad = 5.0 },
  { length_m = 0.4, mass_kg = 6.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.1, angle_deg = -20.0, stiffness_nm_rad = 1e5, damping_nm_s_rad = 3.0 },
  { length_m = 0.3, mass_kg = 3.0, centre_of_mass_m = 0.1, inertia_kg_m2 = 0.05, angle_deg = 40.0, stiffness_nm_rad = 5e4, damping_nm_s_rad = 1.0 },
]
"#;

const MODAL: &str = r#"
[structure]
kind = "modal"
[[structure.modes]]
frequency_hz = 20
damping_ratio = 0.004
shape = { "tip.x" = 0.5, "mid.x" = 0.3 }
[[structure.modes]]
frequency_hz = 57.0
damping_ratio = 0.006
shape = { "tip.x" = -0.4, "mid.x" = 0.35 }
"#;

/// A potential over both points that is bounded below.
const POLYNOMIAL: &str = r#"
[[structure.elements]]
kind = "polynomial"
at = ["tip.x", "mid.x"]
terms = [{ powers = [2, 1], energy = -3e5 }, { powers = [4, 0], energy = 2e9 }, { powers = [0, 4], energy = 1e9 }]
"#;

fn says(text: &str) -> String {
    match Scenario::parse(text, "bench.toml").and_then(|scenario| scenario.under_test()) {
        Ok(tested) => format!("{tested:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_chain_and_modes_with_elements_are_structures_and_written_as_they_were_read() {
    let chain = format!(
        "{CHAIN}[[structure.elements]]\nkind = \"friction\"\njoint = 2\nstiffness_nm_rad = 2e4\nslip_torque_nm = 20\n"
    );
    let modal = format!(
        "{MODAL}[[structure.elements]]\nkind = \"contact\"\nat = \"tip.x\"\nstiffness_n_m = 2e5\ngap_m = 1e-3\nside = \"negative\"\n"
    );
    let arm = "[structure]\n[[structure.elements]]\nkind = \"cubic\"\nat = \"tip.y\"\nstiffness3_n_m3 = 1e9\n";
    let coupled = format!("{MODAL}{POLYNOMIAL}");
    for (text, coordinates, states) in [(&*chain, 3, 1), (&modal, 2, 0), (arm, 2, 0), (&coupled, 2, 0)] {
        let scenario = Scenario::parse(text, "bench.toml").unwrap();
        let tested = scenario.under_test().unwrap();
        assert_eq!((tested.assembly.coordinates(), tested.assembly.element_states()), (coordinates, states));
        let written = Scenario::parse(&scenario.to_toml().unwrap(), "written.toml").unwrap();
        assert_eq!(written.structure, scenario.structure);
    }
}

/// A structure that moves along z alone needs no section `[rig]`: its exciter and accelerometers are along z by default,
/// as a user would otherwise have to write.
#[test]
fn the_exciter_of_a_tip_that_moves_along_z_alone_is_along_z() {
    let along_z = MODAL.replace("tip.x", "tip.z").replace("mid.x", "mid.z");
    let places =
        |text: &str| Scenario::parse(text, "bench.toml").and_then(|scenario| scenario.under_test()).unwrap().places;
    assert_eq!(places(&along_z), places(&format!("{along_z}[rig.exciter]\nat = 'tip.z'\n")));
    // Beside another axis the tip stays a point, on which the third part of the load acts along z.
    let along_two = MODAL.replace("mid.x", "tip.z");
    assert_eq!(places(&along_two), places(&format!("{along_two}[rig.exciter]\nat = 'tip'\n")));
}

/// Without a section the structure under test is the preset; with one its parameters can be set by name.
#[test]
fn every_scenario_has_an_assembly_whose_parameters_can_be_set() {
    let of = |text: &str| Scenario::parse(text, "bench.toml").and_then(|scenario| scenario.under_test());
    assert_eq!(of("").unwrap(), of("structure = { preset = 'irb1600-fitted', angles_deg = [0, 60] }").unwrap());
    let arm = "[structure]\nangles_deg = [30, 75]\ninitial = [0.1, 0, 0, 0.2]\n";
    let (plain, set) = (of(arm).unwrap(), of(&format!("{arm}set = {{ 'link2.mass_kg' = 40 }}")).unwrap());
    assert_eq!(plain.initial, [0.1, 0.0, 0.0, 0.2]);
    assert_eq!(set.initial, plain.initial);
    let value = |name: &str| plain.assembly.value(plain.assembly.parameter(name).unwrap()).unwrap();
    assert_eq!([value("link1.angle_deg"), value("link2.angle_deg"), value("link2.mass_kg")], [30.0, 75.0, 50.58]);
    let mass = plain.assembly.parameter("link2.mass_kg").unwrap();
    assert_eq!(set.assembly, plain.assembly.with(mass, 40.0).unwrap());
    let refused = |set: &str| of(&format!("{MODAL}[structure.set]\n{set}")).unwrap_err().to_string();
    insta::assert_snapshot!(refused("'mode1.damping_ratio' = -1"), @"structure: mode 1: `damping_ratio` is -1: it must be a number from 0");
    let unknown = refused("'mode3.damping_ratio' = 0.1");
    assert!(unknown.starts_with("structure.set: `mode3.damping_ratio` is 0.1: there is no parameter"), "{unknown}");
    // Values that are possible together only.
    let weighed = "gravity_m_s2 = 9.81\n[structure.set]\n'link1.mass_kg' = 40\n'link1.centre_of_mass_m' = 0.1\n";
    let whole = of(&format!("[structure]\n{weighed}'link1.inertia_kg_m2' = 0.15")).unwrap();
    assert!(whole.assembly.sag_rad().is_some());
    insta::assert_snapshot!(of(&format!("[structure]\n{weighed}")).unwrap_err(), @"structure: gravity, and a centre of mass of link 1 away from its joint, need values that the source of this chain does not state: give link1.inertia_kg_m2; link1.inertia_kg_m2 is about the centre of mass, and the source states 0.55 kg·m² about the joint, which is mass_kg · centre_of_mass_m² more");
}

#[test]
fn what_makes_no_preset_is_said() {
    insta::assert_snapshot!(says("[structure]\npreset = 'irb'"), @"structure: there is no preset `irb`: expected one of irb1600-table1, irb1600-fitted");
    insta::assert_snapshot!(says("[structure]\nangles_deg = [1, 2, 3]"), @"structure.angles_deg has 3 numbers: give 2, one for each link of irb1600-fitted");
    insta::assert_snapshot!(says("[structure]\nangles_deg = [0, 400]"), @"structure: link 2: `angle_deg` is 400: it must be a number from -360 to 360 degrees");
    insta::assert_snapshot!(says("[structure]\ngravity_m_s2 = 9.81"), @"structure: gravity, and a centre of mass of link 1 away from its joint, need values that the source of this chain does not state: give link1.mass_kg, link1.centre_of_mass_m, link1.inertia_kg_m2; link1.inertia_kg_m2 is about the centre of mass, and the source states 0.55 kg·m² about the joint, which is mass_kg · centre_of_mass_m² more");
    insta::assert_snapshot!(says("[structure]\ninitial = [0.0]"), @"structure.initial has 1 numbers: give 4, the coordinates and their rates");
    insta::assert_snapshot!(says("[structure]\npoints = { tip = [0, 0, 0] }"), @"structure: `points` does not apply to a structure of kind `preset`: leave it out");
    insta::assert_snapshot!(says(&CHAIN.replace("kind = \"chain\"", "preset = 'irb1600-fitted'")), @r#"structure: `links` is given without the kind of structure: add `kind = "chain"`"#);
    insta::assert_snapshot!(says(&CHAIN.replace("kind =", "preset = 'irb1600-fitted'\nkind =")), @"structure: `preset` is irb1600-fitted, a structure of its own, and `kind` is chain: leave one of them out");
    insta::assert_snapshot!(says(&MODAL.replace("kind =", "angles_deg = [0, 0]\nkind =")), @"structure: `angles_deg` does not apply to a structure of kind `modal`: leave it out");
}

#[test]
fn where_the_rig_is_follows_from_the_points_or_is_stated() {
    let places = |text: &str| Scenario::parse(text, "bench.toml").unwrap().under_test().unwrap();
    let chain = places(CHAIN);
    let dof = |name: &str| Some(chain.assembly.dof(name).unwrap());
    assert_eq!(chain.places.exciter.along, [dof("tip.x"), dof("tip.y")]);
    assert_eq!(chain.places.accelerometer_b.along, [dof("joint2.x"), dof("joint2.y")]);
    let moved = places(&format!("{CHAIN}[rig.exciter]\nat = \"joint3\"\n[rig.sensors.b]\nat = \"tip.y\"\n"));
    assert_eq!(moved.places.exciter.along, [dof("joint3.x"), dof("joint3.y")]);
    assert_eq!(moved.places.accelerometer_b.along, [dof("tip.y"), None]);
    assert_eq!(moved.places.accelerometer_c, moved.places.exciter);
    let modal = places(MODAL);
    assert_eq!(modal.places.exciter.along, [Some(modal.assembly.dof("tip.x").unwrap()), None]);
}

/// The load of a steered sine acts where the exciter is.
#[test]
fn what_nothing_takes_is_not_steered() {
    let steered = |load: &str| {
        let profile = "profile = { waveform = \"dwell\", frequency_hz = 15.0, duration_s = 1.0, settle_s = 0.1 }";
        let text = format!("{MODAL}[excitation]\namplitude = {{ {load} = 2.0 }}\n{profile}\n");
        Scenario::parse(&text, "bench.toml").unwrap().steered(Converter::default()).map(|steered| steered.limit())
    };
    assert!(steered("exciter_x").unwrap() > 2.0);
    insta::assert_snapshot!(steered("exciter_y").unwrap_err(), @"the load has `exciter_y` = 2, but the structure accepts only `exciter_x` at tip.x; choose one of these, or place the exciter elsewhere by `rig.exciter.at`");
    insta::assert_snapshot!(steered("joint1").unwrap_err(), @"the load has `joint1` = 2, but the structure accepts only `exciter_x` at tip.x; choose one of these, or place the exciter elsewhere by `rig.exciter.at`");
}

/// An element of the modal structure.
fn element(lines: &str) -> String {
    says(&format!("{MODAL}[[structure.elements]]\n{lines}\n"))
}

#[test]
fn what_makes_no_structure_is_said() {
    insta::assert_snapshot!(says("[structure]\nkind = \"chain\"\n"), @"structure: `links` are missing: add a table [[structure.links]] for every link, from the base out");
    insta::assert_snapshot!(says(&format!("{MODAL}[[structure.links]]\nlength_m = 1\nmass_kg = 1\ncentre_of_mass_m = 1\ninertia_kg_m2 = 1\nangle_deg = 1\nstiffness_nm_rad = 1\ndamping_nm_s_rad = 1\n")), @"structure: `links` does not apply to a structure of kind `modal`: leave it out");
    insta::assert_snapshot!(says(&MODAL.replace(r#", "mid.x" = 0.35"#, "")), @"structure.modes, number 2: `shape` lacks `mid.x`: give it in every mode, 0 where it does not move");
    insta::assert_snapshot!(says(&CHAIN.replace("mass_kg = 6.0", "mass_kg = 0.0")), @"structure: link 2: `mass_kg` is 0: it must be a positive number");
    insta::assert_snapshot!(says(&MODAL.replace("kind =", "lines = [[\"mid\", \"tip\"]]\npoints = { tip = [0, 0, 1] }\nkind =")), @"structure.lines: the position of `mid` is unknown: give it in [structure.points]; there are tip");
    insta::assert_snapshot!(says(&CHAIN.replace("kind =", "lines = [[\"joint1\", \"tip\"]]\nkind =")), @"structure: `lines` does not apply to a structure of kind `chain`: leave it out");
    insta::assert_snapshot!(says(&format!("{CHAIN}initial = [0.0, 0.0]\n")), @"structure.initial has 2 numbers: give 6, the coordinates and their rates");
    insta::assert_snapshot!(says(&format!("{MODAL}[rig.exciter]\nat = \"top\"\n")), @"rig.exciter: `at` is `top`: the points are mid, tip");
    insta::assert_snapshot!(says(&MODAL.replace("tip.", "top.")), @"rig.exciter: `at` is missing: name the point that it acts on; there are mid, top");
}

#[test]
fn what_makes_no_element_is_said() {
    insta::assert_snapshot!(element("kind = \"cubic\"\nat = \"top.x\"\nstiffness3_n_m3 = 1"), @"structure: there is no `top.x` in this structure: expected one of mid.x, tip.x");
    insta::assert_snapshot!(element("kind = \"cubic\"\nat = \"tip\"\nstiffness3_n_m3 = 1"), @r#"structure: `tip` is not a place: write point and axis, as in "tip.x""#);
    insta::assert_snapshot!(element("kind = \"cubic\"\njoint = 1\nstiffness3_nm_rad3 = 1"), @"structure: there is no joint 1: a structure of modes has no joints; name a point and an axis");
    insta::assert_snapshot!(element("kind = \"cubic\"\nat = \"tip.x\"\nstiffness3_nm_rad3 = 1"), @"structure.elements, number 1: `stiffness3_nm_rad3` has the unit of a joint, and the element is at an axis: give `stiffness3_n_m3`");
    insta::assert_snapshot!(element("kind = \"gap\"\nat = \"tip.x\"\nstiffness_n_m = 1\ngap_m = 0\nstiffness_nm_rad = 1"), @"structure.elements, number 1: there is no `stiffness_nm_rad` here, did you mean `stiffness_n_m`?: the keys are stiffness_n_m, gap_m, preload_n");
    insta::assert_snapshot!(element("kind = \"gap\"\nstiffness_n_m = 1\ngap_m = 0"), @"structure.elements, number 1: give one of `at`, `joint` and `between`");
    insta::assert_snapshot!(element("kind = \"linear\"\nat = \"tip.x\""), @"structure.elements, number 1: `stiffness_n_m` is missing");
    insta::assert_snapshot!(element("kind = \"linear\"\nat = \"tip.x\"\ndamping_nm_s_rad = 1"), @"structure.elements, number 1: there is no `damping_nm_s_rad` here, did you mean `damping_n_s_m`?: the keys are stiffness_n_m, damping_n_s_m");
    insta::assert_snapshot!(element("kind = \"linear\"\nat = \"tip.x\"\ndamping_n_s_m = 0"), @"structure: element 1, linear: `stiffness` is 0: it must be a positive number where there is no damping");
    insta::assert_snapshot!(element("kind = \"tanh\"\nat = \"tip.x\"\nside = \"negative\"\nslip_force_n = 1\nvelocity_m_s = 1"), @"structure.elements, number 1: `side` applies only to contacts: leave it out");
}

#[test]
fn what_makes_no_polynomial_is_said() {
    let polynomial = |lines: &str| element(&format!("kind = \"polynomial\"\n{lines}"));
    insta::assert_snapshot!(polynomial("at = [\"tip.x\", \"mid.x\"]"), @"structure: element 1, polynomial, has 0 terms: it must have 1 to 1000");
    insta::assert_snapshot!(polynomial("between = [\"tip.x\", \"mid.x\"]\nterms = [{ powers = [3], energy = 1 }]"), @r#"structure.elements, number 1: a polynomial needs `at` alone, as in at = ["tip.x", "mid.x"]"#);
    insta::assert_snapshot!(polynomial("at = \"tip.x\"\nstiffness_n_m = 3"), @"structure.elements, number 1: there is no `stiffness_n_m` here: the keys are at, terms");
    insta::assert_snapshot!(polynomial("at = \"tip.x\"\nterms = [{ powers = [2], energy = 1 }]"), @"structure: element 1, term 1: the sum of `powers` is 2: it must be 3 to 5 (springs, whose sum is 2, are elements of kind linear)");
    insta::assert_snapshot!(element("kind = \"cubic\"\nat = [\"tip.x\", \"mid.x\"]\nstiffness3_n_m3 = 1"), @"structure.elements, number 1: `at` has 2 places: a cubic has one, a polynomial several");
    insta::assert_snapshot!(element("kind = \"cubic\"\nat = \"tip.x\"\nstiffness3_n_m3 = 1\nterms = [{ powers = [3], energy = 1 }]"), @"structure.elements, number 1: `terms` apply only to polynomials, not to a cubic: leave them out");
    for terms in ["[{ powers = [-1, 4], energy = 1 }]", "[{ powers = [2.5, 1], energy = 1 }]", "[{ powers = [2, 1] }]"]
    {
        let said = polynomial(&format!("at = [\"tip.x\", \"mid.x\"]\nterms = {terms}"));
        assert!(said.contains("powers") || said.contains("u8") || said.contains("energy"), "{said}");
    }
    assert!(polynomial("at = 3\nterms = []").contains("`at` must be a point and an axis"));
}

/// A polynomial whose highest power along a direction is odd is warned of, by the names of its displacements.
#[test]
fn potentials_without_a_bound_are_warned_of() {
    let warnings = |text: &str| Scenario::parse(text, "bench.toml").unwrap().structure.warnings();
    assert_eq!(warnings(&format!("{MODAL}{POLYNOMIAL}")), [""; 0]);
    let joints = "[[structure.elements]]\nkind = \"polynomial\"\nat = [\"joint1\", \"joint3\"]\nterms = [{ powers = [0, 3], energy = 2 }, { powers = [4, 0], energy = 1 }]\n";
    insta::assert_snapshot!(warnings(&format!("{CHAIN}{joints}")).concat(), @"structure.elements, number 1: the potential falls without bound along -joint3: beyond a certain load the structure runs away, unless other elements hold it; terms of even degree bound the potential");
}

#[test]
fn the_programs_own_structure_is_the_programs() {
    let own = |text: &str| match Scenario::parse(text, "bench.toml").and_then(|scenario| scenario.own_plant_spec()) {
        Ok(_) => "taken".to_string(),
        Err(error) => error.to_string(),
    };
    for text in ["", "[structure]\nkind = \"own\"\nname = \"beam\"\n"] {
        assert_eq!(own(text), "taken", "{text}");
    }
    insta::assert_snapshot!(says("[structure]\nkind = \"own\"\n"), @"structure: `kind` is own, but no program provides the structure; run the scenario from a program, as resonarm.run(…, structure=…) in Python");
    insta::assert_snapshot!(own(MODAL), @"structure: `kind` is modal, but the program has its own structure: leave [structure] out, or set `kind` to own");
    insta::assert_snapshot!(own("[structure]\nkind = \"own\"\ninitial = [1.0]\n"), @"structure: `initial` does not apply to a structure of kind `own`: leave it out");
    insta::assert_snapshot!(own("[structure]\nkind = \"own\"\nfile = \"a.uff\"\n"), @"structure: `file` does not apply to a structure of kind `own`: leave it out");
    insta::assert_snapshot!(own("[rig.sensors.b]\nat = \"tip\"\n"), @"rig.sensors.b: `at` is given, and the program that makes the structure says where it is: leave it out");
}
