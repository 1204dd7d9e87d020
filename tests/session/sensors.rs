//! Rigs of many sensors, against the motion that follows from the recorded states.

use std::path::Path;

use resonarm::recording::{Existing, Recording, SampleRecord, StateRecord, Topic};
use resonarm::replay::resimulate_readings;
use resonarm::run::{Mode, Options, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

/// A plate of two modes with twenty accelerometers, and sensors of a velocity and a displacement.
fn plate(noise: f64) -> String {
    let shape = |mode: usize| {
        let at = |n: usize| format!("'p{n}.z' = {}", shape(mode, n));
        let points: Vec<String> = (0..20).map(at).collect();
        format!("{{ 'tip.z' = 0.4, {} }}", points.join(", "))
    };
    let sensor = |n: usize| {
        format!("[rig.sensors.a{n}]\nat = 'p{n}.z'\nnoise_rms_m_s2 = {noise}\nresolution_m_s2 = 0\nrange_m_s2 = 1e5\n")
    };
    let sensors: String = (0..20).map(sensor).collect();
    format!(
        "[structure]\nkind = 'modal'\nmodes = [\n\
         {{ frequency_hz = {F1}, damping_ratio = {ZETA}, shape = {} }},\n\
         {{ frequency_hz = {F2}, damping_ratio = {ZETA}, shape = {} }},\n]\n\
         [rig]\nconverter = 'instant'\n[rig.exciter]\nat = 'tip.z'\n{sensors}\
         [rig.sensors.v]\nat = 'p3.z'\nmeasures = 'velocity'\nnoise_rms_m_s = 0\nresolution_m_s = 0\n\
         [rig.sensors.x]\nat = 'p4.z'\nmeasures = 'displacement'\nnoise_rms_m = 0\nresolution_m = 0\n\
         [excitation]\namplitude = {{ exciter_x = 5.0 }}\n\
         profile = {{ waveform = 'dwell', frequency_hz = 30.0, duration_s = 0.3, settle_s = 0.1 }}\n",
        shape(0),
        shape(1)
    )
}

const F1: f64 = 25.0;
const F2: f64 = 61.0;
const ZETA: f64 = 0.01;

/// The shape of a mode at a point, 1/√kg.
fn shape(mode: usize, point: usize) -> f64 {
    let place = (point as f64 + 1.0) / 21.0;
    0.1 + libm::sin(place * std::f64::consts::PI * (mode as f64 + 1.0))
}

fn run(text: &str, path: &Path) -> (Recording, Vec<SampleRecord>, Vec<StateRecord>) {
    let record = Some(RecordTo { path: path.to_path_buf(), existing: Existing::Overwrite });
    let options = Options { record, ..Options::default() };
    let session = Session::new(Scenario::parse(text, "test").unwrap(), Mode::Free, options).unwrap();
    let report = session.both(&Signals::default(), &mut |_event| {}).unwrap();
    assert!(report.plant.error.is_none(), "{:?}", report.plant.error);
    let recording = Recording::open(path).unwrap();
    let samples = recording.samples().unwrap().map(|sample| sample.unwrap()).collect();
    let states = recording.states().unwrap().map(|state| state.unwrap()).collect();
    (recording, samples, states)
}

/// Half a sample after a recorded state, under the load that is held, the modes move by their closed solution, and every
/// sensor reads its shape times that: q̈ + 2ζω q̇ + ω² q = φ F.
#[test]
fn twenty_accelerometers_read_the_motion_at_their_points() {
    let directory = tempfile::tempdir().unwrap();
    let (recording, samples, states) = run(&plate(0.0), &directory.path().join("run.mcap"));
    let names: Vec<String> =
        // Head, B and C have the first six channels; behind them are twenty accelerometers, a velocity and a
        // displacement.
        recording.channels().of(Topic::Samples).iter().skip(6).map(|channel| channel.name.to_string()).collect();
    assert_eq!((names.len(), names[0].as_str()), (22, "acceleration_a0_z_m_s2"));
    let place = |name: &str| names.iter().position(|of| of == name).unwrap();
    let (velocity, displacement) = (place("velocity_v_z_m_s"), place("displacement_x_z_m"));
    let middle = |state: &StateRecord, mode: usize| {
        let omega = [F1, F2][mode] * std::f64::consts::TAU;
        let (q, v, f) = (state.states[mode], state.states[2 + mode], 0.4 * state.load.force_n[0]);
        let (sigma, damped, t) = (ZETA * omega, omega * (1.0 - ZETA * ZETA).sqrt(), 0.0005);
        let from_rest = q - f / (omega * omega);
        let (sine, cosine, decay) = (libm::sin(damped * t), libm::cos(damped * t), libm::exp(-sigma * t));
        let b = (v + sigma * from_rest) / damped;
        let x = decay * (from_rest * cosine + b * sine);
        let rate = decay * ((b * damped - sigma * from_rest) * cosine - (from_rest * damped + sigma * b) * sine);
        [x + f / (omega * omega), rate, -2.0 * sigma * rate - omega * omega * x]
    };
    let mut checked = 0;
    for (state, sample) in states.iter().zip(samples.iter().skip(1)).take(350) {
        assert_eq!(sample.sample, state.sample + 1);
        let modes = [middle(state, 0), middle(state, 1)];
        let at = |point: usize, order: usize| shape(0, point) * modes[0][order] + shape(1, point) * modes[1][order];
        for point in 0..20 {
            let got = sample.more.values()[place(&format!("acceleration_a{point}_z_m_s2"))];
            assert!((got - at(point, 2)).abs() < 1e-9 * at(point, 2).abs().max(1.0), "{point}: {got} {}", at(point, 2));
            // Only readings that are well above zero count, since agreement on nothing shows nothing.
            checked += usize::from(got.abs() > 0.1);
        }
        let (v, x) = (sample.more.values()[velocity], sample.more.values()[displacement]);
        assert!((v - at(3, 1)).abs() < 1e-9 && (x - at(4, 0)).abs() < 1e-9, "{v} {x}");
    }
    assert!(checked > 3000, "{checked}");
    assert!(resimulate_readings(&recording).unwrap().identical);
}

/// A sensor's noise follows from its name: another sensor changes no reading of the others, nor of head, B and C.
#[test]
fn another_sensor_changes_no_reading_of_the_others() {
    let directory = tempfile::tempdir().unwrap();
    let (few, all) = (plate(0.1), plate(0.1).replace("[excitation]", "[rig.sensors.a00]\nat = 'p1.z'\n[excitation]"));
    let (_, few, _) = run(&few, &directory.path().join("few.mcap"));
    let (recording, all, _) = run(&all, &directory.path().join("all.mcap"));
    let mut sensors = recording.channels().of(Topic::Samples).iter().skip(6);
    let added = sensors.position(|channel| channel.name == "acceleration_a00_z_m_s2").unwrap();
    let mut differ = 0;
    for (few, all) in few.iter().zip(&all) {
        let mut others = all.more.values().to_vec();
        let own = others.remove(added);
        assert_eq!((few.more.values(), few.head_force_n), (&others[..], all.head_force_n));
        assert_eq!(
            (few.acceleration_b_m_s2, few.acceleration_c_m_s2),
            (all.acceleration_b_m_s2, all.acceleration_c_m_s2)
        );
        differ += usize::from(own != others[1]);
    }
    assert!(differ > 300, "{differ}");
}

/// The converters' filter reads velocities and displacements as it does accelerations: at a frequency f all have its gain
/// and its delay, so that a velocity is iΩ of the displacement and an acceleration iΩ of the velocity, with a shaker, too.
#[test]
fn filtered_readings_of_one_point_are_derivatives_of_each_other() {
    let directory = tempfile::tempdir().unwrap();
    for shaker in ["", crate::scenarios::SHAKER] {
        let of = |name: &str, measures: &str, unit: &str| {
            format!(
                "[rig.sensors.{name}]\nat = 'tip.x'\nmeasures = '{measures}'\nnoise_rms_{unit} = 0\nresolution_{unit} = 0\n"
            )
        };
        let sensors =
            [of("a", "acceleration", "m_s2"), of("v", "velocity", "m_s"), of("x", "displacement", "m")].concat();
        let text = format!(
            "{sensors}[rig.sensors.enc1]\nat = 'joint1'\nnoise_rms_rad = 0\nresolution_rad = 0\n{shaker}\n[excitation]\n\
             amplitude = {{ exciter_x = 5.0 }}\n\
             profile = {{ waveform = 'dwell', frequency_hz = 12.0, duration_s = 0.5, settle_s = 0.2 }}\n"
        );
        let (recording, samples, _) = run(&text, &directory.path().join("run.mcap"));
        let names: Vec<String> =
            recording.channels().of(Topic::Samples).iter().skip(6).map(|channel| channel.name.to_string()).collect();
        assert_eq!(names, ["acceleration_a_x_m_s2", "angle_enc1_rad", "velocity_v_x_m_s", "displacement_x_x_m"]);
        let value = |n: usize, place: usize| samples[n].more.values()[place];
        // Simpson's rule over two samples is exact to (Ωh)⁴/90 of what is integrated.
        let gained = |n: usize, of: usize| (value(n, of) + 4.0 * value(n + 1, of) + value(n + 2, of)) / 3000.0;
        let (mut largest_m_s, mut largest_m) = (0.0_f64, 0.0_f64);
        for n in 100..500 {
            let (v, x) = (value(n + 2, 2) - value(n, 2), value(n + 2, 3) - value(n, 3));
            assert!((v - gained(n, 0)).abs() < 1e-6, "{shaker} {n}: {v} {}", gained(n, 0));
            assert!((x - gained(n, 2)).abs() < 1e-9, "{shaker} {n}: {x} {}", gained(n, 2));
            (largest_m_s, largest_m) = (largest_m_s.max(v.abs()), largest_m.max(x.abs()));
        }
        assert!(largest_m_s > 5e-4 && largest_m > 4e-6, "{largest_m_s} {largest_m}");
        assert!(resimulate_readings(&recording).unwrap().identical);
    }
}

#[test]
fn says_what_is_wrong_with_a_sensor() {
    let says = |sensors: &str| match Scenario::parse(sensors, "test") {
        Ok(scenario) => scenario.plant().unwrap_err().to_string(),
        Err(error) => error.to_string().lines().last().unwrap_or_default().to_owned(),
    };
    insta::assert_snapshot!(says("[rig.sensors.m]\nat = 'middle.z'\n"), @"rig.sensors.m: `at` is `middle.z`: there is no `middle.z` in this structure: expected one of joint2.x, joint2.y, tip.x, tip.y, joint1, joint2");
    insta::assert_snapshot!(says("[rig.sensors.m]\nat = 'middle'\n"), @"rig.sensors.m: `at` is `middle`: the points are joint1, joint2, tip");
    insta::assert_snapshot!(says("[rig.sensors.m]\nat = 'tip.x'\nmeasures = 'angle'\n"), @r#"rig.sensors.m: `at` is `tip.x`, where no joint turns: `measures` can't be "angle""#);
    insta::assert_snapshot!(says("[rig.sensors.m]\nat = 'tip.x'\ngravity_m_s2 = 9.81\n"), @"simulation: rig.sensors.m: `gravity_m_s2` is 9.81: it must be left out: gravity is along y, and the sensor has no axis y");
    insta::assert_snapshot!(says("[rig.sensors.m]\nat = 'joint1'\nrange_m_s2 = 3\n"), @"Did you mean `range_rad`?");
    insta::assert_snapshot!(says("[rig.sensors.m]\nrange_m_s2 = 3\n"), @"missing field `at`");
    insta::assert_snapshot!(says("[rig.sensors.head]\nat = 'tip'\n"), @"the impedance head has the section [rig.head]: give the sensor another name");
    insta::assert_snapshot!(says("[rig.sensors.M3]\nat = 'tip'\n"), @r#"invalid value: string "M3", expected a lower-case letter, then at most 14 lower-case letters, digits or underscores"#);
    insta::assert_snapshot!(says("[rig.sensors.b]\nmeasures = 'velocity'\n"), @r#"`measures` can only be "acceleration" here: b and c are the accelerometers that the protocol carries; give another sensor a name of its own"#);
    let many: String = (0..14).map(|n| format!("[rig.sensors.s{n}]\nat = 'tip'\n")).collect();
    insta::assert_snapshot!(says(&many), @r#"[rig.sensors]: head and sensors have 34 channels: a rig has at most 32; leave some out, or read single axes ("tip.z")"#);
    insta::assert_snapshot!(says("[[rig.faults]]\ninstrument = 'm3'\nkind = 'stuck'\nfrom_s = 1\n"), @r#"simulation: rig.faults, number 1: `instrument` is "m3": expected "head", or the name of a sensor in [rig.sensors]"#);
    let fault =
        "[rig.sensors.m3]\nat = 'tip.x'\n[[rig.faults]]\ninstrument = 'm3'\naxis = 'y'\nkind = 'stuck'\nfrom_s = 1\n";
    insta::assert_snapshot!(says(fault), @"simulation: rig.faults, number 1: `axis` does not apply to this kind of fault of this instrument: leave it out");
}
