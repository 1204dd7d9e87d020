//! Plans to scenarios, and runs of a small survey.

use super::*;
use resonarm_bench::excitation::Waveform;
use resonarm_bench::rig::{Measured, SensorSpec};
use resonarm_scenario::Scenario;

/// Two modes at three points; the middle moves along y, too. The second mode is at 40 Hz.
const BEAM: &str = r#"
[structure]
kind = "modal"
modes = [
  { frequency_hz = 20.0, damping_ratio = 0.02, shape = { "tip.x" = 1.0, "mid.x" = 0.5, "mid.y" = 0.1 } },
  { frequency_hz = 40.0, damping_ratio = 0.01, shape = { "tip.x" = 0.5, "mid.x" = -1.0, "mid.y" = 0.2 } },
]

[rig.sensors.c]
noise_rms_m_s2 = 0.003

[rig.sensors.laser]
at = "mid.y"
measures = "velocity"

[rig.sensors.own]
at = "mid.y"
noise_rms_m_s2 = 0.5

[limits.sensors]
laser = 1.0

[excitation]
amplitude = { exciter_x = 3.0 }
profile = { waveform = "dwell", frequency_hz = 10.0, duration_s = 1.0, settle_s = 0.5 }
"#;

fn scenario() -> Scenario {
    Scenario::parse(BEAM, "here").unwrap()
}

fn request() -> SurveyRequest {
    SurveyRequest {
        exciters: Vec::new(),
        sensors: Vec::new(),
        levels: vec![1.0],
        force_n: None,
        excitation: SurveyExcitation::Random,
        highest_mode: None,
        from_hz: None,
        to_hz: None,
        duration_s: None,
        seed: 7,
    }
}

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn refusal(request: &SurveyRequest) -> String {
    SurveyPlan::new(&scenario(), request).unwrap_err().to_string()
}

/// The band reaches from half of the first mode to 1.3 times the last; 16 lines are in the bandwidth of the first mode,
/// 2 · 0.02 · 20 Hz = 0.8 Hz, which is also that of the second one.
#[test]
fn a_plan_suits_the_structure() {
    let SurveyPlan { summary, runs } = SurveyPlan::new(&scenario(), &request()).unwrap();
    assert!((summary.from_hz - 10.0).abs() < 1e-9 && (summary.to_hz - 52.0).abs() < 1e-9, "{summary:?}");
    assert!((summary.bandwidth_hz - 0.8).abs() < 1e-9, "{summary:?}");
    assert_eq!((summary.duration_s, summary.force_n, summary.modes), (20.0, 3.0, vec![1, 2]));
    let [run] = &runs[..] else { panic!("{runs:?}") };
    assert_eq!(run.entry.exciter, names(&["tip.x"]));
    assert_eq!(run.entry.sensors, names(&["tip.x", "mid.x", "mid.y"]));
    let rig = &run.scenario.rig;
    let at = |sensor: &SensorSpec| sensor.at.map(|at| at.as_str().to_owned()).unwrap();
    assert_eq!([at(&rig.sensors.c), at(&rig.sensors.b)], ["tip.x", "mid.x"]);
    // The accelerometer that the scenario has at a place is used; the laser, and its limit, play no part.
    let [(name, own)] = rig.sensors.more.iter().collect::<Vec<_>>()[..] else { panic!("{:?}", rig.sensors.more) };
    assert_eq!((name.as_str(), own.measures, own.noise_rms), ("s01", Measured::Acceleration, Some(0.5)));
    assert_eq!((rig.sensors.c.noise_rms, rig.sensors.b.noise_rms), (Some(0.003), Some(0.003)));
    assert!(run.scenario.limits.as_ref().unwrap().sensors.is_empty());
    // The highest mode alone decides on the band, up to between the two.
    let first = SurveyPlan::new(&scenario(), &SurveyRequest { highest_mode: Some(1), ..request() }).unwrap();
    // 1.3 times 20 Hz, which is below the geometric mean of 20 and 40 Hz.
    assert!((first.summary.to_hz - 26.0).abs() < 1e-9);
    assert_eq!(first.summary.left_out, [LeftOut { mode: 2, place: String::from("above") }]);
}

/// A run for each level, each exciter and each group, in this order; the driving point is always read; sensors that the
/// scenario lacks are like C.
#[test]
fn runs_rove_and_have_their_own_seeds() {
    let asked = SurveyRequest {
        exciters: names(&["tip.x", "mid"]),
        sensors: vec![names(&["tip"]), names(&["mid.y", "mid.x", "mid"])],
        levels: vec![1.0, 2.5],
        force_n: Some(2.0),
        ..request()
    };
    let runs = SurveyPlan::new(&scenario(), &asked).unwrap().runs;
    let told: Vec<String> = runs
        .iter()
        .map(|run| {
            format!(
                "{} {} {} <- {}",
                run.entry.file.display(),
                run.entry.level,
                run.entry.exciter[0],
                run.entry.sensors.join(" ")
            )
        })
        .collect();
    insta::assert_snapshot!(told.join("\n"), @r"
    run-01.mcap 1 tip.x <- tip.x
    run-02.mcap 1 tip.x <- tip.x mid.y mid.x
    run-03.mcap 1 mid.x <- mid.x tip.x
    run-04.mcap 1 mid.x <- mid.x mid.y
    run-05.mcap 1 mid.y <- mid.y tip.x
    run-06.mcap 1 mid.y <- mid.y mid.x
    run-07.mcap 2.5 tip.x <- tip.x
    run-08.mcap 2.5 tip.x <- tip.x mid.y mid.x
    run-09.mcap 2.5 mid.x <- mid.x tip.x
    run-10.mcap 2.5 mid.x <- mid.x mid.y
    run-11.mcap 2.5 mid.y <- mid.y tip.x
    run-12.mcap 2.5 mid.y <- mid.y mid.x
    ");
    for run in &runs {
        let excitation = run.scenario.excitation.as_ref().unwrap();
        assert_eq!(excitation.amplitude.force_n.x, 2.0 * run.entry.level);
        let Waveform::Random { seed, duration_s, .. } = &excitation.profile else { panic!("{excitation:?}") };
        assert_eq!((Some(*seed), *duration_s), (run.entry.excitation_seed, run.entry.duration_s));
        assert_eq!(run.entry.seed, Some(run.scenario.simulation.seed));
    }
    let mut seeds: Vec<u64> =
        runs.iter().flat_map(|run| [run.entry.seed.unwrap(), run.entry.excitation_seed.unwrap()]).collect();
    // Another level does not change the seeds of the first runs.
    let fewer = SurveyPlan::new(&scenario(), &SurveyRequest { levels: vec![1.0], ..asked }).unwrap().runs;
    assert_eq!(fewer[..], runs[..6]);
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 2 * runs.len());
    // JSON readers that take numbers for doubles must find the same seed in the index.
    assert!(seeds.iter().all(|seed| *seed < 1 << 53));
    let mid_y = &runs[3].scenario.rig.sensors;
    assert_eq!(mid_y.b.noise_rms, Some(0.5));
}

#[test]
fn every_excitation_fits_the_band_and_the_duration() {
    for excitation in SurveyExcitation::ALL {
        let plan = SurveyPlan::new(&scenario(), &SurveyRequest { excitation, ..request() }).unwrap();
        let [run] = &plan.runs[..] else { panic!("{excitation}") };
        let profile = run.scenario.profile().unwrap();
        // 20 s at 1 kHz, as the bandwidth of 0.8 Hz asks for.
        assert_eq!(profile.samples(), 20_000, "{excitation}");
        assert_eq!(
            run.entry.excitation_seed.is_some(),
            !matches!(excitation, SurveyExcitation::Impact | SurveyExcitation::Sine)
        );
    }
}

#[test]
fn says_what_a_structure_does_not_allow() {
    let of = |change: &dyn Fn(&mut SurveyRequest)| {
        let mut asked = request();
        change(&mut asked);
        refusal(&asked)
    };
    insta::assert_snapshot!(of(&|asked| asked.exciters = names(&["top"])), @"--exciters top: the structure has no such point or degree of freedom; there are mid.x, mid.y, tip.x");
    insta::assert_snapshot!(of(&|asked| asked.sensors = vec![names(&["tip.z"])]), @"--sensors tip.z: the structure has no such point or degree of freedom; there are mid.x, mid.y, tip.x");
    insta::assert_snapshot!(of(&|asked| asked.levels = vec![1.0, 0.0]), @"--levels is 0: it must be a positive number");
    insta::assert_snapshot!(of(&|asked| asked.levels = vec![2.0, 2.0]), @"--levels has 2 twice: give each level once");
    insta::assert_snapshot!(of(&|asked| asked.force_n = Some(-1.0)), @"--force-n is -1: it must be a positive number");
    insta::assert_snapshot!(of(&|asked| asked.force_n = Some(1e4)), @"excitation.amplitude.exciter_x is 10000, beyond rig.exciter.force_limit_n, 600 N: lower it, or raise the limit if the exciter has more");
    insta::assert_snapshot!(of(&|asked| asked.duration_s = Some(0.0)), @"--duration-s is 0: it must be a positive number");
    insta::assert_snapshot!(of(&|asked| asked.highest_mode = Some(3)), @"--highest-mode is 3: it must be the number of a mode that vibrates: 1, 2");
    insta::assert_snapshot!(of(&|asked| asked.from_hz = Some(60.0)), @"--from-hz is 60: it must be positive, and below the highest frequency, 52.00 Hz");
    insta::assert_snapshot!(of(&|asked| asked.to_hz = Some(600.0)), @"--to-hz is 600: it must be positive, and at most 400 Hz, 0.4 times the sample rate");
    let told = |from: &str, to: &str| {
        let scenario = Scenario::parse(&BEAM.replace(from, to), "here").unwrap();
        SurveyPlan::new(&scenario, &request()).unwrap_err().to_string()
    };
    insta::assert_snapshot!(told("damping_ratio = 0.01", "damping_ratio = 0.0"), @"mode 2 has no damping, from which the duration would follow: give --duration-s");
    insta::assert_snapshot!(told("[limits.sensors]", "[simulation]\nrate_hz = 50.0\n[limits.sensors]"), @"the lowest mode is at 20.000 Hz, too high for the sample rate of 50 Hz: raise simulation.rate_hz to 65 or more");
    insta::assert_snapshot!(told("exciter_x = 3.0", "joint1 = 3.0"), @"the scenario has no force at the exciter: give its peak by --force-n");
}
