//! An FMU as the structure: that of `examples/fmu`, which gcc builds.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use resonarm::cut;
use resonarm::plant::Plant;
use resonarm::recording::{Existing, Recording};
use resonarm::replay::{resimulate, resimulate_readings};
use resonarm::rig::Load;
use resonarm::run::{BothReport, Mode, Options, RecordTo, RunError, Session, Signals};
use resonarm::scenario::Scenario;
use resonarm_fmu::content::{Content, Settings};
use resonarm_fmu::export::{Library, export};
use tempfile::TempDir;

use crate::scenarios::SHAKER;

/// The folder with `mass2.fmu` and `mass3.fmu`.
static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    for version in ["2", "3"] {
        let out = folder.path().join(format!("mass{version}.fmu"));
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/fmu/make.py");
        assert!(Command::new("python3").arg(script).arg(out).arg(version).status().unwrap().success());
    }
    folder
});

/// The mass under a sine near its resonance at 20 Hz, with more keys of [structure] and other sections.
fn scenario(version: u8, more: &str) -> Scenario {
    let text = format!(
        r#"
[structure]
kind = "fmu"
file = "mass{version}.fmu"
{more}
[structure.inputs]
"tip.x" = "force"
[structure.outputs]
"tip.x" = {{ displacement = "x", velocity = "v", acceleration = "a" }}
[simulation]
seed = 3
[excitation]
amplitude = {{ exciter_x = 20.0 }}
profile = {{ waveform = "dwell", frequency_hz = 19.0, duration_s = 0.2, settle_s = 0.1 }}
"#
    );
    let mut scenario = Scenario::parse(&text, "test").unwrap();
    scenario.read_files(FOLDER.path()).unwrap();
    scenario
}

fn both(scenario: Scenario, mode: Mode, record: Option<&Path>) -> BothReport {
    let record = record.map(|path| RecordTo { path: path.to_owned(), existing: Existing::Overwrite });
    let session = Session::new(scenario, mode, Options { record, ..Options::default() }).unwrap();
    session.both(&Signals::default(), &mut |_event| {}).unwrap()
}

fn recorded(scenario: Scenario, mode: Mode, name: &str) -> (BothReport, PathBuf) {
    let path = FOLDER.path().join(name);
    (both(scenario, mode, Some(&path)), path)
}

/// The states before each sample and the force from it on, as bits.
fn states(path: &Path) -> Vec<Vec<u64>> {
    let recording = Recording::open(path).unwrap();
    let bits = |record: resonarm::recording::StateRecord| {
        record.states.iter().chain(&record.load.force_n).map(|number| number.to_bits()).collect()
    };
    recording.states().unwrap().map(|record| bits(record.unwrap())).collect()
}

/// A recording of the mass as FMI 3.0, which may be loaded.
fn allowed(path: &Path) -> Recording {
    Recording::open(path).unwrap().allow_fmu(FOLDER.path().join("mass3.fmu"))
}

/// A recording is data: the path in it decides about no code that runs.
#[test]
fn the_fmu_that_a_recording_names_is_not_loaded() {
    let (_, path) = recorded(scenario(3, ""), Mode::Free, "named.mcap");
    let recording = Recording::open(&path).unwrap();
    let structure = recording.scenario().unwrap().structure;
    let hash = structure.sha256.unwrap();
    let said = [resimulate(&recording).unwrap_err(), resimulate_readings(&recording).unwrap_err()];
    for error in said {
        let error = error.to_string().replace(&hash, "HASH").replace(&FOLDER.path().display().to_string(), "FOLDER");
        assert_eq!(
            error,
            "the recording was made with the FMU FOLDER/mass3.fmu, SHA-256 HASH: it is not loaded from the path in the \
             recording, since an FMU is code that runs with your rights; if you trust it, name its file with --fmu FILE (in \
             Python fmu=FILE), whose SHA-256 is compared"
        );
    }
    assert!(recording.scenario().unwrap().plant().is_err());
    let another = recording.allow_fmu(FOLDER.path().join("mass2.fmu"));
    let error = resimulate(&another).unwrap_err().to_string();
    assert!(error.contains("it is another FMU than the one that was meant or recorded"), "{error}");
}

#[test]
fn its_run_is_the_same_free_in_lockstep_and_simulated_again() {
    let (free, path) = recorded(scenario(3, ""), Mode::Free, "free.mcap");
    assert!(free.plant.error.is_none() && free.plant.samples > 200, "{free:?}");
    let recording = allowed(&path);
    let verdict = resimulate(&recording).unwrap();
    assert!(verdict.identical && verdict.samples > 200, "{verdict:?}");
    assert!(resimulate_readings(&recording).unwrap().identical);
    let kept = Scenario::from_configuration(recording.configuration()).unwrap().structure;
    assert_eq!((kept.sha256.unwrap().len(), kept.file.unwrap().is_absolute()), (64, true));
    let (_, of_fmi_2) = recorded(scenario(2, ""), Mode::Free, "free2.mcap");
    let (_, lockstep) = recorded(scenario(3, ""), Mode::Lockstep, "lockstep.mcap");
    assert_eq!(states(&of_fmi_2), states(&path));
    assert_same(&lockstep, &path);
}

/// The states of two runs are the same up to the last command; how many samples follow it is the bus's.
fn assert_same(one: &Path, other: &Path) {
    let [one, other] = [one, other].map(states);
    let common = one.len().min(other.len()) - 1;
    assert!(common > 200 && one[common - 1] != one[0]);
    assert_eq!(one[..common], other[..common]);
}

/// The variables of one of our own FMUs that are those of the arm.
const ARM: &str = r#"
[structure]
kind = "fmu"
file = "arm.fmu"
read = "end"
[structure.inputs]
joint1 = "load.torque1_nm"
joint2 = "load.torque2_nm"
"tip.x" = "load.force_x_n"
"tip.y" = "load.force_y_n"
[structure.outputs]
joint1 = { displacement = "state.alpha1_rad", velocity = "state.alpha1_dot_rad_s" }
joint2 = { displacement = "state.alpha2_rad", velocity = "state.alpha2_dot_rad_s" }
"joint2.x" = { acceleration = "true.acceleration_b_x_m_s2" }
"joint2.y" = { acceleration = "true.acceleration_b_y_m_s2" }
"tip.x" = { acceleration = "true.acceleration_c_x_m_s2", force = "true.head_force_x_n" }
"tip.y" = { acceleration = "true.acceleration_c_y_m_s2", force = "true.head_force_y_n" }
"#;

#[test]
fn one_of_our_own_has_the_bits_of_the_native_run_in_lockstep() {
    let rest = "[simulation]\nseed = 3\n[excitation]\namplitude = { exciter_x = 60.0 }\n\
                profile = { waveform = 'dwell', frequency_hz = 15.0, duration_s = 0.2, settle_s = 0.1 }\n";
    let native = Scenario::parse(rest, "native").unwrap();
    let content = Content { settings: Settings::default(), scenario: native.clone() };
    export(&content, Library::beside_program().unwrap(), &FOLDER.path().join("arm.fmu")).unwrap();
    let mut imported = Scenario::parse(&format!("{ARM}{rest}"), "imported").unwrap();
    imported.read_files(FOLDER.path()).unwrap();
    let (report, imported) = recorded(imported, Mode::Lockstep, "imported.mcap");
    assert!(report.plant.error.is_none(), "{report:?}");
    let (_, native) = recorded(native, Mode::Lockstep, "native.mcap");
    assert_same(&imported, &native);
}

#[test]
fn its_readings_are_those_of_the_same_mass_as_a_mode() {
    let converters = ["instant", "sinc5"];
    for converter in converters {
        let mut fmu = scenario(3, "");
        // φ = 1/√m with m = 2 kg, D = c/(2 m ω) with c = 5 N·s/m.
        let shape = 1.0 / 2.0_f64.sqrt();
        // The stiffness of the FMU, with which its 2 kg have 20 Hz.
        let frequency_hz = (31582.734_f64 / 2.0).sqrt() / core::f64::consts::TAU;
        let damping_ratio = 5.0 / (4.0 * core::f64::consts::TAU * frequency_hz);
        let text = format!(
            "[structure]\nkind = 'modal'\nmodes = [{{ frequency_hz = {frequency_hz}, damping_ratio = {damping_ratio}, \
             shape = {{ 'tip.x' = {shape} }} }}]\n[rig]\nconverter = '{converter}'\nsensors.c = {{ resolution_m_s2 = 1e-9 }}\n\
             sensors.a = {{ at = 'tip', resolution_m_s2 = 1e-9 }}\n\
             sensors.d = {{ at = 'tip.x', measures = 'displacement', resolution_m = 1e-15 }}\n\
             sensors.v = {{ at = 'tip.x', measures = 'velocity', resolution_m_s = 1e-12 }}"
        );
        let mut mode = Scenario::parse(&text, "mode").unwrap();
        mode.simulation.seed = fmu.simulation.seed;
        (mode.rig, fmu.rig) = (mode.rig.clone().without_noise(), mode.rig.without_noise());
        let mut plants = [fmu.plant().unwrap(), mode.plant().unwrap()];
        // Accelerometer C, then the sensors of acceleration, displacement and velocity.
        let (mut largest, mut error) = ([0.0_f64; 4], [0.0_f64; 4]);
        for sample in 0..400_u32 {
            let force_n = 20.0 * libm::sin(core::f64::consts::TAU * 0.019 * f64::from(sample));
            let load = Load::force_n(force_n, 0.0);
            let [one, other] = plants.each_mut().map(|plant: &mut Plant| {
                let measured = plant.measure();
                plant.advance(&load).unwrap();
                let others = measured.more.values();
                [measured.acceleration_c_m_s2[0].value, others[0], others[1], others[2]]
            });
            for reading in 0..4 {
                largest[reading] = largest[reading].max(other[reading].abs());
                error[reading] = error[reading].max((one[reading] - other[reading]).abs());
            }
        }
        // The filter's course over a step is linear at the start of a hold, (ωh)² of it.
        let most = if converter == "instant" { 1e-7 } else { 1e-3 };
        assert!(largest[0] > 10.0 && largest.iter().all(|largest| *largest > 0.0), "{largest:?}");
        let is_near = largest.iter().zip(error).all(|(largest, error)| error < most * largest);
        assert!(is_near, "{converter}: {error:?} of {largest:?}");
    }
}

/// What ends a run of a mass that misbehaves in the way `fault`, from sample 20 on.
fn fault(version: u8, fault: u32) -> String {
    let parameters = format!("parameters = {{ fault = {fault}, fault_s = 0.0199 }}");
    let report = both(scenario(version, &parameters), Mode::Free, None);
    report.plant.error.map_or(String::from("none"), |error| error.to_string())
}

#[test]
fn what_it_does_in_place_of_a_step_ends_the_run_in_words() {
    insta::assert_snapshot!(fault(3, 1), @"the simulation failed at sample 20: the FMU fails: fmi3DoStep at 0.02 s: it returned Error");
    insta::assert_snapshot!(fault(3, 2), @"the simulation failed at sample 20: the FMU fails: fmi3DoStep at 0.02 s: it returned Discard");
    insta::assert_snapshot!(fault(3, 3), @"the simulation failed at sample 20: the FMU fails: fmi3DoStep at 0.02 s: it requested the end of the simulation");
    insta::assert_snapshot!(fault(3, 4), @"the simulation failed at sample 20: the FMU fails: fmi3DoStep at 0.02 s: it stopped at 0.02025 s, not at the end of the step");
    insta::assert_snapshot!(fault(3, 5), @"the simulation failed at sample 20: the FMU fails: fmi3GetFloat64 at 0.0205 s: it gave NaN");
    insta::assert_snapshot!(fault(2, 1), @"the simulation failed at sample 20: the FMU fails: fmi2DoStep at 0.02 s: it returned Error");
    insta::assert_snapshot!(fault(2, 3), @"the simulation failed at sample 20: the FMU fails: fmi2DoStep at 0.02 s: it requested the end of the simulation");
    insta::assert_snapshot!(fault(2, 4), @"the simulation failed at sample 20: the FMU fails: fmi2DoStep at 0.02 s: it returned Discard");
    insta::assert_snapshot!(fault(3, 10), @"the simulation failed at sample 20: the FMU fails: fmi3DoStep at 0.02 s: it ended its own process with exit code 0, as licence checks and STOP of Fortran do");
    insta::assert_snapshot!(fault(2, 10), @"the simulation failed at sample 20: the FMU fails: fmi2DoStep at 0.02 s: it ended its own process with exit code 0, as licence checks and STOP of Fortran do");
    insta::assert_snapshot!(fault(3, 11), @"the simulation failed at sample 20: the FMU fails: fmi3DoStep at 0.02 s: signal 6 (SIGABRT, abort) ended its process");
}

/// A plant of which a step from 0.02 s on fails in the way `fault`, on this thread.
fn plant_that_fails(fault: u32) -> Plant {
    // In the second half of a hold, so that a part of it has been stepped.
    let parameters = format!("parameters = {{ fault = {fault}, fault_s = 0.0202 }}");
    let mut plant = scenario(3, &parameters).plant().unwrap();
    for _ in 0..20 {
        plant.advance(&Load::force_n(5.0, 0.0)).unwrap();
    }
    plant
}

/// The library of an FMU may be linked with -ffast-math: it rounds otherwise in its own process, and nowhere else.
#[test]
fn nothing_beside_an_fmu_rounds_as_it_does() {
    for fault in [7, 9] {
        let mut plant = plant_that_fails(fault);
        let failed = plant.advance(&Load::force_n(5.0, 0.0));
        assert_eq!(failed.is_err(), fault == 9, "{failed:?}");
        assert!(core::hint::black_box(1e-310_f64) * core::hint::black_box(1.0) > 0.0, "{fault}");
    }
}

#[test]
fn a_plant_whose_fmu_fails_stays_at_the_sample_before() {
    let (mut plant, load) = (plant_that_fails(5), Load::force_n(5.0, 0.0));
    let before = *plant.states();
    let mut copy = plant.clone();
    assert!(before[0] > 0.0 && plant.advance(&load).is_err());
    assert_eq!((plant.sample(), plant.states()), (20, &before));
    insta::assert_snapshot!(plant.advance(&load).unwrap_err(), @"sample 20: the FMU fails: the step at 0.02 s: an earlier step failed, so that the FMU can't make another one: make a new plant");
    insta::assert_snapshot!(copy.advance(&load).unwrap_err(), @"sample 20: the FMU fails: the step at 0.02 s: this plant was copied from one whose FMU was running, and the state of a running FMU can't be copied: copy the plant before its first step");
}

#[test]
fn an_fmu_that_does_not_repeat_itself_is_not_simulated_again() {
    let parameters = "parameters = { fault = 6, fault_s = 0.0199 }";
    let (report, path) = recorded(scenario(3, parameters), Mode::Free, "random.mcap");
    assert!(report.plant.error.is_none());
    let error = resimulate(&allowed(&path)).unwrap_err();
    insta::assert_snapshot!(error, @"the FMU is not deterministic: two simulations from its start under the recorded loads differ from each other at sample 21, so the run can't be re-simulated");
}

#[test]
fn a_part_of_its_run_is_not_simulated_again() {
    let (_, path) = recorded(scenario(3, ""), Mode::Free, "whole.mcap");
    let (whole, part) = (Recording::open(&path).unwrap(), FOLDER.path().join("part.mcap"));
    cut::cut(&whole, 100..=200, &part, Existing::Overwrite).unwrap();
    let error = resimulate(&allowed(&part)).unwrap_err();
    insta::assert_snapshot!(error, @"the recording begins at sample 100, but its structure is an FMU, which can be simulated only from its start; use the whole recording");
}

/// Why a session of a scenario can't begin; the folder is left out.
fn refused(scenario: Scenario, mode: Mode) -> String {
    let error: RunError = Session::new(scenario, mode, Options::default()).unwrap_err();
    error.to_string().replace(&format!("{}/", FOLDER.path().display()), "")
}

#[test]
fn what_can_not_be_is_refused_before_the_run() {
    insta::assert_snapshot!(refused(scenario(3, ""), Mode::RealTime), @"structure: `kind` is fmu: an FMU is third-party code whose steps can take any time, so it does not run in real time: use the mode free or lockstep");
    insta::assert_snapshot!(refused(scenario(3, "parameters = { fault = 8 }"), Mode::Free), @"mass3.fmu: fmi3EnterInitializationMode returned Error");
    insta::assert_snapshot!(refused(scenario(3, "parameters = { masse = 8 }"), Mode::Free), @"mass3.fmu: structure.parameters: the FMU has no variable `masse`, did you mean `mass`?");
    let mut other = scenario(3, "");
    other.structure.sha256 = Some("0".repeat(64));
    let text = refused(other, Mode::Free);
    let (_, reason) = text.split_once("structure.sha256").unwrap();
    insta::assert_snapshot!(reason.trim(), @"is 0000000000000000000000000000000000000000000000000000000000000000, so it is another FMU than the one that was meant or recorded");
    let mut shaken = scenario(3, "");
    shaken.rig = Scenario::parse(SHAKER, "rig").unwrap().rig;
    insta::assert_snapshot!(refused(shaken, Mode::Free), @"rig.shaker needs the arm or a structure of the scenario, since its armature moves with it: leave it out; a structure of kind `fmu` is driven by the ideal exciter of `rig.exciter`");
    let missing = Scenario::parse("structure = { kind = 'fmu' }", "test").unwrap();
    insta::assert_snapshot!(refused(missing, Mode::Free), @"structure: `file` is missing: name the FMU's file");
    let idle = Scenario::parse("structure = { kind = 'modal', inputs = { 'tip.x' = 'F' } }", "test").unwrap();
    insta::assert_snapshot!(refused(idle, Mode::Free), @"structure: `inputs` applies only to a structure of kind `fmu`: leave it out");
    insta::assert_snapshot!(scenario(3, "").under_test().unwrap_err(), @"structure: `kind` is fmu: modes, responses and branches need the equations of a structure, which an FMU does not provide; use it in runs in the modes free and lockstep");
}
