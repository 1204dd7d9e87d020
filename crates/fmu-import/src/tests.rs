//! What is refused, in words, before any code of an FMU runs.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::{ImportError, Numbers, OutputsOf, ReadAt, Source, Spec, sha256};

const LIBRARY: &str =
    if cfg!(target_arch = "aarch64") { "binaries/aarch64-linux/mass.so" } else { "binaries/x86_64-linux/mass.so" };

/// A description with a mass under a force, in units that are not all SI.
const MASS: &str = r#"<fmiModelDescription fmiVersion="3.0" modelName="mass" instantiationToken="{m}">
  <CoSimulation modelIdentifier="mass" canGetAndSetFMUState="true"/>
  <UnitDefinitions>
    <Unit name="kN"><BaseUnit kg="1" m="1" s="-2" factor="1000"/></Unit>
    <Unit name="mm"><BaseUnit m="1" factor="0.001" offset="0.5"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
    <Unit name="m/s2"><BaseUnit m="1" s="-2"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions><Float64Type name="Length" unit="mm"/></TypeDefinitions>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="force" valueReference="1" causality="input" start="0" unit="kN"/>
    <Float64 name="x" valueReference="2" causality="output" declaredType="Length"><Alias name="length"/></Float64>
    <Float64 name="v" valueReference="3" causality="output" unit="m/s"/>
    <Float64 name="a" valueReference="4" causality="output" unit="m/s2"/>
    <Float64 name="mass" valueReference="5" causality="parameter" variability="fixed" start="1"/>
    <Int32 name="count" valueReference="6" causality="output"/>
    <UInt64 name="n" valueReference="7" causality="structuralParameter" start="3"/>
    <Float64 name="y" valueReference="8" causality="output"><Dimension valueReference="7"/><Dimension start="2"/></Float64>
  </ModelVariables>
</fmiModelDescription>"#;

fn zip(entries: &[(&str, &str)]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in entries {
        archive
            .start_file(*name, SimpleFileOptions::default().compression_method(CompressionMethod::Deflated))
            .unwrap();
        archive.write_all(text.as_bytes()).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

fn spec() -> Spec {
    let of = |displacement: &str, velocity: &str, acceleration: &str| OutputsOf {
        displacement: Some(displacement.to_owned()),
        velocity: Some(velocity.to_owned()),
        acceleration: Some(acceleration.to_owned()),
        force: None,
    };
    Spec {
        inputs: BTreeMap::from([("tip.x".to_owned(), "force".to_owned())]),
        outputs: BTreeMap::from([("tip.x".to_owned(), of("x", "v", "a"))]),
        sample_s: 1e-3,
        steps_per_sample: 2,
        ..Spec::default()
    }
}

fn read(description: &str, spec: &Spec) -> Result<Source, ImportError> {
    Source::read(zip(&[("modelDescription.xml", description), (LIBRARY, "")]), spec)
}

/// The refusal of a description, with a part of [`MASS`] replaced.
fn of(from: &str, to: &str) -> String {
    assert!(MASS.contains(from));
    read(&MASS.replace(from, to), &spec()).unwrap_err().to_string()
}

/// The refusal of a mapping.
fn with(change: impl FnOnce(&mut Spec)) -> String {
    let mut changed = spec();
    change(&mut changed);
    read(MASS, &changed).unwrap_err().to_string()
}

fn outputs(spec: &mut Spec) -> &mut OutputsOf {
    spec.outputs.get_mut("tip.x").unwrap()
}

#[test]
fn variables_are_mapped_with_their_units() {
    let source = read(MASS, &spec()).unwrap();
    let mapping = &source.mapping;
    assert_eq!((mapping.set.references.as_slice(), mapping.read.references.as_slice()), (&[1][..], &[2, 3, 4][..]));
    let force = mapping.inputs[8].unwrap();
    assert_eq!((force.conversion.of_si(2500.0), force.conversion.to_si(2.5)), (2.5, 2500.0));
    let length = mapping.travel[0].unwrap();
    assert_eq!((length.conversion.to_si(7.0), length.conversion.of_si(0.5)), (0.507, 0.0));
    let names: Vec<&str> = mapping.channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!((names.as_slice(), source.step_s), (&["x1_m", "x1_dot_m_s"][..], 5e-4));
}

#[test]
fn an_element_of_an_array_is_named_by_its_number() {
    let mut spec = spec();
    outputs(&mut spec).displacement = Some("y[6]".into());
    let mapping = read(MASS, &spec).unwrap().mapping;
    assert_eq!((mapping.read.references.as_slice(), mapping.read.count), (&[8, 3, 4][..], 8));
    assert_eq!(mapping.travel[0].unwrap().index, 5);
    // An alias of an array was a scalar, of which every element was refused.
    let aliased =
        MASS.replace("<Dimension valueReference=\"7\"/>", "<Dimension valueReference=\"7\"/><Alias name=\"z\"/>");
    outputs(&mut spec).displacement = Some("z[6]".into());
    assert_eq!(read(&aliased, &spec).unwrap().mapping.travel[0].unwrap().index, 5);
    outputs(&mut spec).displacement = Some("y[7]".into());
    insta::assert_snapshot!(read(MASS, &spec).unwrap_err(), @r#"structure.outputs."tip.x".displacement: `y` is an array of 6: name one element, `y[1]` to `y[6]`"#);
}

#[test]
fn archives_that_leave_their_folder_are_refused() {
    let named = |name: &str| Source::read(zip(&[(name, "")]), &spec()).unwrap_err().to_string();
    insta::assert_snapshot!(named("resources/../../a"), @"`resources/../../a` in the archive leads out of its folder: names must stay within the FMU; nothing of it is unpacked");
    insta::assert_snapshot!(named("/etc/a"), @"`/etc/a` in the archive is absolute: names must stay within the FMU; nothing of it is unpacked");
    insta::assert_snapshot!(named("resources\\a"), @r"`resources\a` in the archive has a backslash or NUL: names must stay within the FMU; nothing of it is unpacked");
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    archive.add_symlink("resources/a", "/etc/passwd", SimpleFileOptions::default()).unwrap();
    let link = archive.finish().unwrap().into_inner();
    insta::assert_snapshot!(Source::read(link, &spec()).unwrap_err(), @"`resources/a` in the archive is a link: names must stay within the FMU; nothing of it is unpacked");
    insta::assert_snapshot!(Source::read(b"text".to_vec(), &spec()).unwrap_err(), @"not a ZIP archive, as an FMU is: invalid Zip archive: Could not find EOCD");
    insta::assert_snapshot!(named("a"), @"no `modelDescription.xml` in the archive: it is no FMU");
}

#[test]
fn an_fmu_for_other_machines_is_refused() {
    let of = |entries: &[(&str, &str)]| {
        let all = [&[("modelDescription.xml", MASS)], entries].concat();
        Source::read(zip(&all), &spec()).unwrap_err().to_string().replace("aarch64-linux", "x86_64-linux")
    };
    insta::assert_snapshot!(of(&[("binaries/win64/mass.dll", ""), ("binaries/darwin64/mass.dylib", "")]), @"no `binaries/x86_64-linux/mass.so` in the FMU: it is for darwin64, win64");
    insta::assert_snapshot!(of(&[]), @"no `binaries/x86_64-linux/mass.so` in the FMU: it has no libraries");
}

#[test]
fn descriptions_are_refused_in_words() {
    let bomb =
        r#"<!DOCTYPE a [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]><fmiModelDescription>&b;</fmiModelDescription>"#;
    insta::assert_snapshot!(read(bomb, &spec()).unwrap_err(), @"modelDescription.xml: XML with DTD detected");
    insta::assert_snapshot!(read("<a/>", &spec()).unwrap_err(), @"modelDescription.xml: the element <a> in place of <fmiModelDescription>");
    insta::assert_snapshot!(of("fmiVersion=\"3.0\"", "fmiVersion=\"1.0\""), @"fmiVersion is `1.0`: FMUs of FMI 2.0 and 3.0 are taken");
    insta::assert_snapshot!(of("CoSimulation", "ModelExchange"), @"the FMU has no co-simulation, only ModelExchange: export it for co-simulation");
    insta::assert_snapshot!(of("canGetAndSetFMUState=\"true\"", "needsExecutionTool=\"true\""), @"the FMU needs its tool to run (needsExecutionTool): export one that runs alone");
    insta::assert_snapshot!(of("instantiationToken", "guid"), @"modelDescription.xml: <fmiModelDescription> has no instantiationToken");
    insta::assert_snapshot!(of("modelIdentifier=\"mass\"", "modelIdentifier=\"../mass\""), @"modelDescription.xml: modelIdentifier of `CoSimulation` is `../mass`: it must be a name of letters, digits and _");
    insta::assert_snapshot!(of("valueReference=\"1\"", "valueReference=\"-1\""), @"modelDescription.xml: valueReference of `force` is `-1`: it must be a number from 0 to 4294967295");
    insta::assert_snapshot!(of("start=\"2\"", "start=\"99999999\""), @"modelDescription.xml: Dimension of `y` is `99999999`: it must be a length, or the value reference of one");
    insta::assert_snapshot!(of("modelName=\"mass\"", "generationTool=\"resonarm 0.1.0\""), @r#"structure: `read` is middle, and the FMU, of resonarm 0.1.0, samples its motion itself: take `read = "end"`, and the variables `true.…`"#);
}

#[test]
fn variables_that_do_not_fit_are_refused() {
    insta::assert_snapshot!(with(|spec| { spec.inputs.insert("tip.x".into(), "forces".into()); }), @r#"structure.inputs."tip.x": the FMU has no variable `forces`, did you mean `force`?"#);
    insta::assert_snapshot!(with(|spec| { spec.inputs.insert("tip.x".into(), "a".into()); }), @r#"structure.inputs."tip.x": `a` is of causality output: it must be input"#);
    insta::assert_snapshot!(with(|spec| outputs(spec).acceleration = Some("mass".into())), @r#"structure.outputs."tip.x".acceleration: `mass` is of causality parameter: it must be output or local"#);
    insta::assert_snapshot!(with(|spec| outputs(spec).acceleration = Some("count".into())), @r#"structure.outputs."tip.x".acceleration: `count` is of type Int32: Float64 is taken"#);
    insta::assert_snapshot!(with(|spec| outputs(spec).acceleration = Some("v".into())), @r#"structure.outputs."tip.x".acceleration: the unit `m/s` of `v` is m·s^-1 in base units: m·s^-2 is needed"#);
    insta::assert_snapshot!(with(|spec| outputs(spec).force = Some("a".into())), @r#"structure.outputs."tip.x": `force` is of an FMU that samples it itself: leave it out, or take `read = "end"`"#);
    insta::assert_snapshot!(with(|spec| { spec.outputs.insert("tip".into(), OutputsOf::default()); }), @r#"structure.outputs: `tip` names no degree of freedom: write point and axis, as in "tip.x", or joint1, or mode1"#);
    let mode = |spec: &mut Spec| drop(spec.inputs.insert("mode1".into(), "force".into()));
    insta::assert_snapshot!(with(mode), @"structure.inputs: `mode1` can't be driven: loads are forces at points and torques at joint1 to joint8");
    insta::assert_snapshot!(with(|spec| spec.exciter = Some("top".into())), @"rig.exciter: no variable of structure.inputs is at `top`; there are tip.x");
    insta::assert_snapshot!(with(|spec| spec.accelerometer_b = Some("tip.z".into())), @"rig.sensors.b: no variable of structure.outputs with acceleration is at `tip.z`; there are tip.x");
    let filtered = |spec: &mut Spec| (spec.is_filtered, outputs(spec).velocity) = (true, None);
    insta::assert_snapshot!(with(filtered), @r#"structure.outputs."tip.x": `velocity` is missing: the filter of rig.converter needs it beside the acceleration; or take the converter `instant`"#);
    let limited = |spec: &mut Spec| (spec.limits_travel, outputs(spec).displacement) = (true, None);
    insta::assert_snapshot!(with(limited), @r#"structure.outputs."tip.x": `displacement` is missing: rig.gate.travel_limit_m needs it"#);
    let along_z =
        |spec: &mut Spec| (spec.limits_travel, spec.inputs) = (true, [("tip.z".into(), "force".into())].into());
    insta::assert_snapshot!(with(along_z), @r#"structure.outputs."tip.z": `displacement` is missing: rig.gate.travel_limit_m needs it"#);
    let parameter = |name: &str, numbers: Numbers| {
        with(|spec| {
            spec.parameters.insert(name.to_owned(), numbers);
        })
    };
    insta::assert_snapshot!(parameter("a", Numbers::One(1.0)), @"structure.parameters: `a` is of causality output: it must be parameter, or have a start value (initial = exact)");
    insta::assert_snapshot!(parameter("mass", Numbers::Many(vec![1.0, 2.0])), @"structure.parameters: `mass` has 1 numbers, and 2 are given");
    insta::assert_snapshot!(parameter("mass", Numbers::One(f64::NAN)), @"structure.parameters: `mass` is NaN: it must be finite");
}

#[test]
fn coordinates_are_of_one_kind_and_without_a_gap() {
    let moving = |acceleration: Option<&str>| OutputsOf {
        displacement: Some("y[1]".into()),
        velocity: Some("y[2]".into()),
        acceleration: acceleration.map(str::to_owned),
        force: None,
    };
    insta::assert_snapshot!(with(|spec| { spec.outputs.insert("joint1".into(), moving(None)); }), @"structure.outputs: `tip.x` and `joint1` are coordinates of different kinds: give displacement and velocity of one kind alone");
    let gap = with(|spec| {
        outputs(spec).velocity = None;
        spec.outputs.insert("joint2".into(), moving(None));
    });
    insta::assert_snapshot!(gap, @"structure.outputs: displacement and velocity are given for 1 joints: a recording has at most 8, numbered from 1 without a gap");
    let mut modes = spec();
    outputs(&mut modes).velocity = None;
    modes.outputs.extend((1..=10).map(|mode| (format!("mode{mode}"), moving(None))));
    let mapping = read(MASS, &modes).unwrap().mapping;
    let names: Vec<&str> = mapping.channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!((names.len(), names[0], names[9]), (20, "q1_m_sqrt_kg", "q10_m_sqrt_kg"));
}

#[test]
fn an_fmu_that_samples_itself_makes_one_step_a_sample() {
    let steps = MASS.replace("modelName=\"mass\"", "generationTool=\"resonarm 0.1.0\"");
    assert_eq!(read(&steps, &Spec { read: ReadAt::End, ..spec() }).unwrap().step_s, 1e-3);
}

/// An archive of 20 kB that unpacks to 20 MB many times over: Deflate reaches a ratio of 1000 with zeros.
#[test]
fn an_archive_that_unpacks_to_far_more_than_its_size_is_refused_before_it_is_unpacked() {
    let zeros = "\0".repeat(20_000_000);
    let names: Vec<String> = (0..6).map(|n| format!("resources/{n}")).collect();
    let mut entries = vec![("modelDescription.xml", MASS), (LIBRARY, "")];
    entries.extend(names.iter().map(|name| (&**name, &*zeros)));
    let deflated = zip(&entries);
    let most_mb = 100 + 100 * deflated.len() / 1_000_000;
    let refused = Source::read(deflated, &spec()).unwrap_err();
    assert!(matches!(refused, ImportError::TooLarge { most_mb: got, .. } if got == most_mb as u64), "{refused}");
    assert!(Source::read(zip(&entries[..4]), &spec()).is_ok());
}

/// The sizes that an archive states for its entries need not be true.
#[test]
fn an_archive_that_understates_its_sizes_is_refused_as_it_is_unpacked() {
    let zeros = "\0".repeat(70_000_000);
    let mut packed =
        zip(&[("modelDescription.xml", MASS), (LIBRARY, ""), ("resources/a", &zeros), ("resources/b", &zeros)]);
    let size = (zeros.len() as u32).to_le_bytes();
    let places: Vec<usize> = (0..packed.len() - 4).filter(|at| packed[*at..at + 4] == size).collect();
    assert!(places.len() >= 2);
    places.into_iter().for_each(|at| packed[at..at + 4].copy_from_slice(&1_u32.to_le_bytes()));
    let source = Source::read(packed, &spec()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let refused = source.archive.unpack("x86_64-linux", folder.path()).unwrap_err();
    assert!(matches!(refused, ImportError::TooLarge { .. } | ImportError::Zip { .. }), "{refused}");
    let written = std::fs::read_dir(folder.path().join("resources")).unwrap();
    let written: u64 = written.map(|entry| entry.unwrap().metadata().unwrap().len()).sum();
    assert!(written <= 101_000_000, "{written}");
}

#[test]
fn an_archive_with_more_entries_than_an_fmu_has_is_refused() {
    let names: Vec<String> = (0..20_000).map(|n| format!("resources/{n}")).collect();
    let mut entries = vec![("modelDescription.xml", MASS)];
    entries.extend(names.iter().map(|name| (&**name, "")));
    insta::assert_snapshot!(Source::read(zip(&entries), &spec()).unwrap_err(), @"the archive has 20001 entries: at most 20000 are read; put the files of a large folder into one archive among its resources");
}

#[test]
fn the_hash_is_that_of_the_standard() {
    // FIPS 180-4, the example of one block.
    assert_eq!(sha256(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}
