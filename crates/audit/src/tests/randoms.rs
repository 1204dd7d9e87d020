//! Cases of random tests, on a structure whose acceleration is the force over 1 kg.

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;
use resonarm_specification::{RandomTest, Test};

use super::random_loop::SPECIFICATION;
use super::{RATE, ended, failing, fails, judged, passes, restarted, scaled, specification};
use crate::random::most_rms_db;
use crate::record::{db, running_rms};
use crate::{Base, Record, Stimulus, Verdict};

/// A controller of known kind.
struct Controller<'a> {
    /// Levels in turn, dB, with their times, s.
    levels: &'a [(f64, usize)],
    /// Whether all frames have the phases of the first.
    repeats: bool,
    /// Factor on the density of a line.
    factor: &'a dyn Fn(usize) -> f64,
    /// Whether the overlapping frames have a window.
    is_windowed: bool,
    /// Peaks of the drive beyond which it is clipped, in its rms.
    clip: f64,
    seed: u64,
}

/// Silence, a check at a low level, and the schedule.
const LEVELS: &[(f64, usize)] = &[(-300.0, 3), (-30.0, 6), (-12.0, 5), (-6.0, 5), (-3.0, 5), (0.0, 60)];
/// Silence at the end, samples.
const QUIET: usize = 3 * RATE;

const HONEST: Controller<'static> =
    Controller { levels: LEVELS, repeats: false, factor: &|_| 1.0, is_windowed: true, clip: f64::INFINITY, seed: 5 };

fn test() -> RandomTest {
    match specification(SPECIFICATION).test {
        Test::Random(test) => test,
        other => panic!("{other:?}"),
    }
}

/// Runs a controller whose frames of 1 s overlap by half under the root of Hann's window, so that the power of the sum is
/// constant, and whose drive ends by a ramp of 0.1 s.
fn run(controller: &Controller<'_>) -> Record {
    let test = test();
    let mut noise = Noise::new(controller.seed, 3);
    let transform = Fft::at_least(RATE);
    let frames: Vec<f64> = controller
        .levels
        .iter()
        .flat_map(|(level_db, seconds)| vec![libm::pow(10.0, level_db / 20.0); 2 * seconds])
        .collect();
    let mut drive = vec![0.0; (frames.len() + 1) * RATE / 2];
    let mut first: Option<Vec<f64>> = None;
    for (frame, level) in frames.iter().enumerate() {
        let mut phases: Vec<f64> = (0..201).map(|_| noise.uniform()).collect();
        if controller.repeats {
            phases = first.get_or_insert(phases).clone();
        }
        let mut values = vec![Complex::new(0.0, 0.0); RATE];
        for (line, value) in values.iter_mut().enumerate().take(201).skip(10) {
            let density = test.profile.at(line as f64).unwrap() * (controller.factor)(line);
            // Lines X of N samples have the density 2|X|²/(fs N).
            let size = (density * (RATE * RATE) as f64 / 2.0).sqrt();
            let (sine, cosine) = libm::sincos(core::f64::consts::TAU * phases[line]);
            *value = Complex::new(size * cosine, size * sine);
        }
        transform.backward(&mut values);
        for (k, value) in values.iter().enumerate() {
            let hann = 0.5 - 0.5 * libm::cos(core::f64::consts::TAU * k as f64 / RATE as f64);
            let window = if controller.is_windowed { hann } else { 1.0 };
            // The real part of a one-sided spectrum is half of the two-sided one's.
            drive[frame * RATE / 2 + k] += level * 2.0 * value.re / RATE as f64 * window.sqrt();
        }
    }
    let most = controller.clip * libm::sqrt(test.profile.moment(0));
    drive.iter_mut().for_each(|drive| *drive = drive.clamp(-most, most));
    let end = drive.len() - RATE / 2;
    drive.resize(end + QUIET, 0.0);
    let reading: Vec<f64> = drive.iter().map(|drive| drive + 0.01 * noise.normal()).collect();
    let responses = vec![reading.iter().map(|reading| 0.5 * reading).collect()];
    let record = Record { rate_hz: RATE as f64, drive, reading, responses, is_disarmed: false };
    let ramp = RATE / 10;
    let mut ended = ended(&record, end - ramp, ramp);
    // The silence before the test is exactly that.
    ended.drive[..2 * RATE].fill(0.0);
    ended
}

#[test]
fn an_honest_controller_passes() {
    let specification = specification(SPECIFICATION);
    for seed in [5, 6, 7] {
        let record = run(&Controller { seed, ..HONEST });
        for id in ["R01", "R02", "R03", "R04", "R05", "R06", "R07", "R08", "R09", "R23"] {
            passes(&specification, id, &record, &record);
        }
        let base = Base::new(&specification, &record);
        // The full level is from 24 to 84 s, less the ramp at the end.
        let level = base.level.clone().unwrap();
        assert!(level.start.abs_diff(24 * RATE) < 3 * RATE / 2 && level.end.abs_diff(84 * RATE) < RATE, "{level:?}");
        assert_eq!(base.stimulus(&specification.test, Stimulus::Dead), Some(level.start + 6 * RATE));
    }
}

/// What was not measured is not stated: the ramp of a drive that goes on, and the level of a controller that has ended its test.
#[test]
fn a_drive_that_goes_on_has_no_ramp_and_one_that_ended_no_level() {
    let specification = specification(SPECIFICATION);
    let base = run(&HONEST);
    let at = Base::new(&specification, &base).stimulus(&specification.test, Stimulus::Dead).unwrap();
    let cut = |mut record: Record, to: usize| {
        record.drive.truncate(to);
        record.reading.truncate(to);
        record
    };
    let found = judged(&specification, "R12", &base, &cut(base.clone(), at + 5 * RATE));
    assert_eq!(found.verdict, Verdict::Failed);
    let names: Vec<&str> = found.measured.iter().map(|measure| measure.name).collect();
    assert_eq!(names, ["time to no drive", "drive over that before"]);
    let stopped = cut(ended(&base, at + 9 * RATE, RATE / 10), at + 12 * RATE);
    let found = judged(&specification, "R15", &base, &stopped);
    let expected = "the controller ended the test less than 25 s after the stimulus";
    assert_eq!(found.verdict, Verdict::Inconclusive(expected.into()));
}

#[test]
fn a_flaw_of_the_signal_fails_the_case_for_it() {
    let specification = specification(SPECIFICATION);
    let ten = |factor: f64| move |line: usize| if (60..70).contains(&line) { factor } else { 1.0 };
    let short: Vec<(f64, usize)> = LEVELS.iter().map(|(db, s)| (*db, if *s == 60 { 55 } else { *s })).collect();
    for (id, controller) in [
        ("R01", Controller { factor: &|_| 0.5, ..HONEST }),
        // Two frames at a time have twice the power.
        ("R01", Controller { is_windowed: false, ..HONEST }),
        ("R02", Controller { factor: &ten(5.0), ..HONEST }),
        // 1.44 times the density is 1.2 times the rms, within 2 dB, where 10 % are allowed.
        ("R03", Controller { factor: &|_| 1.44, ..HONEST }),
        // Clipped at 1.8 times its rms, a drive has a crest factor far below 2.5.
        ("R04", Controller { clip: 1.8, ..HONEST }),
        ("R05", Controller { repeats: true, ..HONEST }),
        ("R06", Controller { levels: &[(-300.0, 3), (-30.0, 6), (0.0, 60)], ..HONEST }),
        ("R07", Controller { levels: &short, ..HONEST }),
        ("R23", Controller { factor: &ten(2.0), ..HONEST }),
    ] {
        let found = failing(&specification, &run(&controller));
        assert!(found.contains(&id), "{id}: {found:?}");
    }
    let mut beyond = run(&HONEST);
    let level = Base::new(&specification, &beyond).level.unwrap();
    // A fifth of the drive's rms as a sine at 300 Hz has 4 % of its power.
    for (k, drive) in beyond.drive.iter_mut().enumerate().take(level.end) {
        *drive +=
            if *drive == 0.0 { 0.0 } else { 1.5 * libm::sin(core::f64::consts::TAU * 300.0 * k as f64 / RATE as f64) };
    }
    assert_eq!(failing(&specification, &beyond), ["R08"]);
    let mut on = run(&HONEST);
    let end = on.drive.len() - QUIET;
    for (k, drive) in on.drive.iter_mut().enumerate().skip(end) {
        *drive = 5.0 * libm::sin(0.1 * k as f64);
    }
    // What it plays after the end is no part of its level.
    assert_eq!(failing(&specification, &on), ["R09"]);
}

#[test]
fn a_drive_that_must_end_is_timed() {
    let specification = specification(SPECIFICATION);
    let base = run(&HONEST);
    let at = Base::new(&specification, &base).stimulus(&specification.test, Stimulus::Dead).unwrap();
    let soft = ended(&base, at + RATE / 5, RATE / 10);
    // As soon as `soft`, but without a ramp: a structure rings when its drive is cut.
    let hard = ended(&base, at + RATE / 5, 0);
    let late = ended(&base, at + 2 * RATE, RATE / 10);
    for id in ["R12", "R13", "R18"] {
        passes(&specification, id, &base, &soft);
        fails(&specification, id, &base, &hard);
        fails(&specification, id, &base, &late);
        // The controller goes on driving.
        fails(&specification, id, &base, &base);
    }
    passes(&specification, "R14", &base, &soft);
    fails(&specification, "R14", &base, &late);
    // A controller that drives harder while it looks for its signal.
    let mut louder = soft.clone();
    louder.drive[at..].iter_mut().for_each(|drive| *drive *= 3.0);
    fails(&specification, "R12", &base, &louder);
    // One that had ended before never saw the stimulus.
    let before = ended(&base, at - 4 * RATE, RATE / 10);
    for id in ["R12", "R14", "R15", "R18", "R20"] {
        assert!(matches!(judged(&specification, id, &base, &before).verdict, Verdict::Inconclusive(_)), "{id}");
    }
}

#[test]
fn a_test_that_must_not_begin_is_weighed() {
    let specification = specification(SPECIFICATION);
    let base = run(&HONEST);
    let level = Base::new(&specification, &base).level.unwrap();
    // It gives up after the check, at −30 dB.
    let refused = ended(&base, 9 * RATE, RATE / 10);
    for id in ["R10", "R11", "R22"] {
        passes(&specification, id, &base, &refused);
    }
    for id in ["R10", "R11"] {
        fails(&specification, id, &base, &base);
    }
    // Without a check of the sign the level is kept all the same.
    assert!(matches!(judged(&specification, "R22", &base, &base).verdict, Verdict::Inconclusive(_)));
    let stopped = ended(&base, level.start + RATE, RATE / 10);
    passes(&specification, "R16", &base, &stopped);
    fails(&specification, "R16", &base, &base);
    let most_m_s2 = 1.8 * libm::sqrt(test().profile.moment(0));
    let small = base.reading.iter().map(|reading| reading.clamp(-most_m_s2, most_m_s2)).collect();
    let unclipped = Record { reading: small, ..base.clone() };
    assert_eq!(
        judged(&specification, "R16", &base, &unclipped).verdict,
        Verdict::Inconclusive("no reading is clipped".into())
    );
    // The limit of the drive is 0.43 times the largest one.
    let limit_n = 0.43 * base.peak(0, base.len());
    let text = format!("{SPECIFICATION}drive_peak_n = {limit_n}\n");
    let limited = super::specification(&text);
    let low =
        Record { drive: stopped.drive.iter().map(|drive| drive.clamp(-limit_n, limit_n)).collect(), ..stopped.clone() };
    passes(&limited, "R21", &base, &low);
    fails(&limited, "R21", &base, &stopped);
    let goes_on =
        Record { drive: base.drive.iter().map(|drive| drive.clamp(-limit_n, limit_n)).collect(), ..base.clone() };
    fails(&limited, "R21", &base, &goes_on);
}

#[test]
fn a_test_that_must_go_on_is_judged_by_its_level() {
    let specification = specification(SPECIFICATION);
    let base = run(&HONEST);
    let at = Base::new(&specification, &base).stimulus(&specification.test, Stimulus::Dead).unwrap();
    passes(&specification, "R15", &base, &base);
    let mut low = base.clone();
    low.reading[at..].iter_mut().for_each(|reading| *reading *= 0.708);
    fails(&specification, "R15", &base, &low);
    passes(&specification, "R20", &base, &base);
    let mut loud = base.clone();
    loud.drive[at..at + RATE].iter_mut().for_each(|drive| *drive *= 2.0);
    fails(&specification, "R20", &base, &loud);
    // The structure rings for a moment; a level that stays too high is the controller's.
    let mut ringing = base.clone();
    ringing.reading[at..at + RATE].iter_mut().for_each(|reading| *reading *= 1.5);
    passes(&specification, "R20", &base, &ringing);
    ringing.reading[at + RATE..at + 4 * RATE].iter_mut().for_each(|reading| *reading *= 1.5);
    fails(&specification, "R20", &base, &ringing);
    fails(&specification, "R20", &base, &ended(&base, at + RATE, RATE / 10));
    // After an abort a test begins again with its silence, check and lowest level, or flawed with its full level.
    let level = Base::new(&specification, &base).level.unwrap().start;
    passes(&specification, "R19", &base, &restarted(&base, at, &base, 0));
    fails(&specification, "R19", &base, &restarted(&base, at, &base, level));
    // It never stopped, or does not begin again.
    for record in [&base, &ended(&base, at, RATE / 10)] {
        assert!(matches!(judged(&specification, "R19", &base, record).verdict, Verdict::Inconclusive(_)));
    }
}

#[test]
fn a_response_with_a_limit_is_judged() {
    let plain = specification(SPECIFICATION);
    let base = run(&HONEST);
    let [[from_hz, limit], [to_hz, _]] =
        Base::new(&plain, &base).response_limit(&plain.test, &base.responses[0], 6.0).unwrap();
    assert_eq!([from_hz, to_hz], [10.0, 200.0]);
    // The response has a quarter of the density, at most 0.05, with the scatter of an estimate.
    assert!((0.9..1.6).contains(&(limit / (0.05 * libm::pow(10.0, -0.6)))), "{limit}");
    let text = format!(
        "{SPECIFICATION}[[limits.response]]\nchannel = 'b.x'\nbreakpoints = [[{from_hz}, {limit}], [{to_hz}, {limit}]]\n"
    );
    let limited = specification(&text);
    fails(&limited, "R17", &base, &base);
    let test = test();
    let factor = |line: usize| (0.85 * limit / (0.25 * test.profile.at(line as f64).unwrap())).min(1.0);
    let notched = run(&Controller { factor: &factor, ..HONEST });
    passes(&limited, "R17", &base, &notched);
    // Lower elsewhere, too: the limit is no excuse.
    let all = |line: usize| 0.3 * factor(line);
    fails(&limited, "R17", &base, &run(&Controller { factor: &all, ..HONEST }));
}

#[test]
fn a_controller_without_a_level_decides_nothing_more() {
    let specification = specification(SPECIFICATION);
    let weak = scaled(&run(&HONEST), 0.5);
    assert_eq!(failing(&specification, &weak), ["R01"]);
    for case in crate::cases(&specification.test).iter().skip(1) {
        let verdict = judged(&specification, case.id, &weak, &weak).verdict;
        assert!(matches!(verdict, Verdict::Inconclusive(_)), "{}: {verdict:?}", case.id);
    }
}

/// The envelope of Gaussian noise has a Rayleigh distribution: u = σ√(−2 ln p) of uniform numbers p.
#[test]
fn a_steady_drive_rises_as_often_as_stated() {
    const TRIALS: u32 = 20_000;
    let mut noise = Noise::new(1, 2);
    for (counts, ratio) in [([60, 60], 1.5), ([100, 20], 1.2), ([500, 750], 1.25)] {
        let mut largest = |count: u32| {
            let least = (0..count).map(|_| 1.0 - noise.uniform()).fold(1.0, f64::min);
            libm::sqrt(-2.0 * libm::log(least))
        };
        let rises = (0..TRIALS).filter(|_| ratio * largest(counts[0]) < largest(counts[1])).count();
        let expected = crate::random::rise_probability(ratio, counts.map(f64::from));
        let found = rises as f64 / f64::from(TRIALS);
        assert!((found / expected - 1.0).abs() < 0.15, "{counts:?}, {ratio}: {found}, {expected}");
    }
}

/// Noise of a narrow band has an rms over 2 s of more than 1.5 dB too much in most records, and of more than is allowed in
/// hardly any.
#[test]
fn the_largest_rms_that_is_allowed_follows_from_the_bandwidth() {
    const SECONDS: usize = 60;
    let points = "[[10, 0.02], [20, 0.2], [100, 0.2], [200, 0.05]]";
    let narrow = specification(&SPECIFICATION.replace(points, "[[30, 0.1], [40, 0.1]]"));
    let Test::Random(test) = narrow.test else { panic!("the kind is random") };
    assert_eq!(test.profile.band_hz(), [30.0, 40.0]);
    let demand = libm::sqrt(test.profile.moment(0));
    let transform = Fft::at_least(SECONDS * RATE);
    let spacing_hz = RATE as f64 / transform.length() as f64;
    let most_db = most_rms_db(&test, SECONDS as f64);
    let mut beyond = [0; 2];
    for seed in 0..200 {
        let mut noise = Noise::new(seed, 7);
        let mut lines = vec![Complex::new(0.0, 0.0); transform.length()];
        for (line, value) in lines.iter_mut().enumerate() {
            if (30.0..40.0).contains(&(line as f64 * spacing_hz)) {
                *value = Complex::new(noise.normal(), noise.normal()) * libm::sqrt(0.1 * spacing_hz);
            }
        }
        transform.backward(&mut lines);
        let samples: Vec<f64> = lines[..SECONDS * RATE].iter().map(|value| value.re).collect();
        let largest = running_rms(&samples, 2 * RATE).into_iter().fold(0.0, f64::max);
        let largest_db = db(largest / demand);
        [1.5, most_db].iter().zip(&mut beyond).for_each(|(most, count)| *count += u32::from(largest_db > *most));
    }
    assert!(beyond[0] > 150 && beyond[1] <= 2, "{beyond:?} beyond {most_db} dB");
}
