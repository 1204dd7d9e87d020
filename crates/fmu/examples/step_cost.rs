//! Measures the cost of a sample through the functions of FMI, beside the plant's own: the same scenario and loads, in
//! turns.
//!
//! `step_cost FOLDER`: the folder of an FMU by signals that is unpacked. Prints the fastest of several rounds, ns a
//! sample, and their ratio.
#![allow(unsafe_code, reason = "the functions of FMI are those of C")]

use core::ffi::{c_char, c_int, c_void};
use core::hint::black_box;
use std::error::Error;
use std::ffi::CString;
use std::io::Write;
use std::path::Path;
use std::ptr::null;

use resonarm_bench::rig::Load;
use resonarm_fmu as _;
use resonarm_realtime::{Clock, SystemClock};
use resonarm_scenario::Scenario;
use resonarm_session::run::{Mode, Options, Session};

const SAMPLES: u32 = 20_000;
const ROUNDS: u32 = 15;
/// Value references: the force along x, and what a tool reads each sample: six readings and four states.
const FORCE_X: [u32; 1] = [3];
const OUTPUTS: [u32; 10] = [5, 6, 7, 8, 9, 10, 23, 24, 25, 26];

unsafe extern "C" {
    fn fmi3InstantiateCoSimulation(
        name: *const c_char,
        token: *const c_char,
        resource_path: *const c_char,
        visible: bool,
        logging_on: bool,
        event_mode_used: bool,
        early_return_allowed: bool,
        required_intermediate: *const u32,
        required_intermediate_count: usize,
        environment: *mut c_void,
        log_message: *const c_void,
        intermediate_update: *const c_void,
    ) -> *mut c_void;
    fn fmi3EnterInitializationMode(
        instance: *mut c_void,
        tol: bool,
        tolerance: f64,
        start_s: f64,
        stop: bool,
        end_s: f64,
    ) -> c_int;
    fn fmi3ExitInitializationMode(instance: *mut c_void) -> c_int;
    fn fmi3SetFloat64(
        instance: *mut c_void,
        references: *const u32,
        n: usize,
        values: *const f64,
        count: usize,
    ) -> c_int;
    fn fmi3GetFloat64(instance: *mut c_void, references: *const u32, n: usize, values: *mut f64, count: usize)
    -> c_int;
    fn fmi3DoStep(
        instance: *mut c_void,
        from_s: f64,
        length_s: f64,
        no_state_before: bool,
        event: *mut bool,
        terminate: *mut bool,
        early: *mut bool,
        last_s: *mut f64,
    ) -> c_int;
    fn fmi3FreeInstance(instance: *mut c_void);
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("step_cost FOLDER")?;
    let folder = Path::new(&folder);
    let description = std::fs::read_to_string(folder.join("modelDescription.xml"))?;
    let token = description.split("instantiationToken=\"").nth(1).and_then(|rest| rest.split('"').next());
    let token = CString::new(token.ok_or("no token")?)?;
    let resources = CString::new(format!("{}/", folder.join("resources").display()))?;
    let scenario = Scenario::read(&folder.join("resources/scenario.toml"))?;
    let session = Session::new(scenario, Mode::Free, Options::default())?;
    let (mut native_ns, mut fmi_ns) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..ROUNDS {
        // In turns, so that both are measured under the same load of the machine.
        native_ns = native_ns.min(native(&session)?);
        fmi_ns = fmi_ns.min(through_fmi(&token, &resources)?);
    }
    writeln!(std::io::stdout(), "native {native_ns:.0} ns, FMI {fmi_ns:.0} ns, ratio {:.3}", fmi_ns / native_ns)?;
    Ok(())
}

fn force_n(sample: u32) -> f64 {
    f64::from(sample % 64) - 31.5
}

fn native(session: &Session) -> Result<f64, Box<dyn Error>> {
    let (clock, mut plant) = (SystemClock, session.plant_at_start());
    black_box(plant.measure());
    let start_ns = clock.now_ns();
    for sample in 0..SAMPLES {
        let load = Load::force_n(force_n(sample), 0.0);
        plant.advance(black_box(&load))?;
        black_box((plant.measure(), plant.states()));
    }
    Ok((clock.now_ns() - start_ns) as f64 / f64::from(SAMPLES))
}

fn through_fmi(token: &CString, resources: &CString) -> Result<f64, Box<dyn Error>> {
    let done = |status: c_int| if status == 0 { Ok(()) } else { Err(format!("status {status}")) };
    let clock = SystemClock;
    let mut values = [0.0; OUTPUTS.len()];
    let (mut flags, mut last_s) = ([false; 3], 0.0);
    // SAFETY: called in the order and with the lengths that the standard states; the instance lives until it is freed.
    unsafe {
        let (token, resources) = (token.as_ptr(), resources.as_ptr());
        let instance = fmi3InstantiateCoSimulation(
            c"cost".as_ptr(),
            token,
            resources,
            false,
            false,
            false,
            false,
            null(),
            0,
            std::ptr::null_mut(),
            null(),
            null(),
        );
        if instance.is_null() {
            return Err("not instantiated".into());
        }
        done(fmi3EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0))?;
        done(fmi3ExitInitializationMode(instance))?;
        let start_ns = clock.now_ns();
        for sample in 0..SAMPLES {
            let force = [force_n(sample)];
            done(fmi3SetFloat64(instance, FORCE_X.as_ptr(), 1, force.as_ptr(), 1))?;
            let [event, terminate, early] = &mut flags;
            done(fmi3DoStep(instance, f64::from(sample) * 1e-3, 1e-3, true, event, terminate, early, &mut last_s))?;
            done(fmi3GetFloat64(instance, OUTPUTS.as_ptr(), OUTPUTS.len(), values.as_mut_ptr(), values.len()))?;
            black_box(values);
        }
        let ns = (clock.now_ns() - start_ns) as f64 / f64::from(SAMPLES);
        fmi3FreeInstance(instance);
        Ok(ns)
    }
}
