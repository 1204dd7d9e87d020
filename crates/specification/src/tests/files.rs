//! Specifications as files: presets, what their figures are, and what is refused.

use super::{near, parsed, random, shock, sine, srs};
use crate::{GRAVITY_M_S2, PRESETS, SineLevel, Specification, SpecificationFile, Test};

/// The rms of the presets in g as their standards print them, and one that follows from the formula of the slopes.
#[test]
fn presets_have_sources_and_the_published_figures() {
    const RMS_G: [(&str, f64, f64); 4] = [
        ("navmat-p-9492", 6.064, 0.0005),
        ("nasa-std-7001", 6.789, 0.0005),
        ("mil-std-202-214-i-b", 7.56, 0.02),
        ("mil-std-810-514-minimum", 7.7, 0.05),
    ];
    const KINDS: [&str; 3] = ["normative", "approximate", "indicative"];
    let mut checked = 0;
    for preset in PRESETS {
        let specification = parsed(preset.text).unwrap_or_else(|error| panic!("{}: {error}", preset.name));
        assert!(specification.name.is_some() && !specification.sources.is_empty(), "{}", preset.name);
        for source in &specification.sources {
            assert!(KINDS.iter().any(|kind| source.contains(kind)), "{}: {source}", preset.name);
        }
        if let Test::Random(test) = specification.test {
            let rms_g = test.figures(None).rms_m_s2 / GRAVITY_M_S2;
            if let Some((_, expected, tolerance)) = RMS_G.iter().find(|(name, ..)| *name == preset.name) {
                assert!((rms_g - expected).abs() < *tolerance, "{}: {rms_g}", preset.name);
                checked += 1;
            }
        }
    }
    assert_eq!(checked, RMS_G.len());
    assert!(PRESETS.iter().all(|preset| PRESETS.iter().filter(|other| other.name == preset.name).count() == 1));
}

#[test]
fn a_density_in_g_is_one_of_96_17_times_the_number() {
    let keys = "breakpoints = [[10, 0.02], [100, 0.02]]\ntolerance_db = [-3, 3]";
    let si = random(keys).figures(None).rms_m_s2;
    let text = format!("spec = {{ kind = 'random', sources = [] }}\n[random]\nunit = 'g2/Hz'\n{keys}");
    let Test::Random(test) = parsed(&text).unwrap().test else { panic!("it is random") };
    near(test.figures(None).rms_m_s2 / si, GRAVITY_M_S2, 1e-12);
}

/// The figures of the test that `tests/oracles/README.md` describes as flat with slopes.
#[test]
fn a_random_test_states_what_an_engineer_wants_before_it() {
    let text = "\
[spec]
kind = 'random'
sources = []
[random]
unit = '(m/s2)2/Hz'
breakpoints = [[10, 0.02], [20, 0.2], [100, 0.2], [200, 0.05]]
tolerance_db = [[0, -3, 3], [100, -6, 3]]
abort_db = [-6, 6]
abort_share = 0.1
[schedule]
levels_db = [-12, -6, -3, 0]
seconds = [10, 10, 10, 60]
[limits]
sigma = 4
[[limits.response]]
channel = 'b.x'
breakpoints = [[31, 0.02], [45, 0.02]]
";
    let specification = parsed(text).unwrap();
    assert_eq!(specification.limits.response[0].profile.at(40.0), Some(0.02));
    let Test::Random(test) = specification.test else { panic!("it is random") };
    let figures = test.figures(specification.limits.sigma);
    near(figures.rms_m_s2, 5.1845189950473785, 1e-12);
    near(figures.peak_m_s2, 4.0 * 5.1845189950473785, 1e-12);
    near(figures.velocity_rms_m_s, 0.017455420089316814, 1e-12);
    near(figures.displacement_rms_m, 0.000123670056963591, 1e-12);
    near(figures.zero_crossings_hz, 99.6, 1e-3);
    near(figures.cycles.unwrap(), 60.0 * figures.zero_crossings_hz, 1e-12);
    near(figures.duration_s.unwrap(), 90.0, 1e-12);
    near(figures.degrees_of_freedom.unwrap(), 226.0, 5e-3);
    assert_eq!([test.tolerance.at(50.0), test.tolerance.at(150.0)], [[-3.0, 3.0], [-6.0, 3.0]]);
    near(test.lines_hz, 1.0, 1e-12);
    // With a constant gain the rms is the acceleration's.
    near(test.rms_through(|_| 10.0), 51.845_189_950_473_79, 1e-5);
}

#[test]
fn corners_of_a_sine_follow_from_its_levels() {
    let test = sine(
        "from_hz = 2\nrate_oct_min = 0.5\nsegments = [{ displacement_mm = 1 }, { to_hz = 100, acceleration_m_s2 = 7 }]\ntolerance = 0.1",
    );
    near(test.segments[0].to_hz, 13.316, 1e-4);
    near(test.acceleration_m_s2(50.0).unwrap(), 7.0, 1e-12);
    near(test.acceleration_m_s2(13.316).unwrap(), 7.0, 1e-3);
    let figures = test.figures();
    near(figures[0].displacement_peak_m, 1e-3, 1e-12);
    near(figures[1].velocity_peak_m_s, 7.0 / (core::f64::consts::TAU * 13.316), 1e-4);
    near(SineLevel::Velocity(0.1).corner_hz(SineLevel::Acceleration(10.0)).unwrap(), 15.915, 1e-4);
    let linear = sine("from_hz = 10\nhz_s = 2\nsegments = [{ to_hz = 20, velocity_m_s = 1 }]\ntolerance = 0.1");
    near(linear.sweep_s(10.0, 20.0), 5.0, 1e-12);
    near(linear.cycles(10.0, 20.0), 75.0, 1e-12);
    let (largest, hz) = linear.largest_through(|_| 2.0);
    near(largest, 2.0 * core::f64::consts::TAU * 20.0, 1e-12);
    near(hz, 20.0, 1e-12);
}

/// The strokes are those of an independent computation (NumPy) with more bells; ends are at rest.
#[test]
fn a_compensated_shock_ends_at_rest() {
    for (time_s, stroke_m, most) in
        [(0.05, 4.05e-3, 0.24), (0.1, 7.23e-3, 0.12), (0.2, 13.58e-3, 0.06), (0.6, 38.99e-3, 0.02)]
    {
        let test = shock(&format!(
            "pulse = 'half-sine'\npeak_m_s2 = 20\nduration_s = 0.02\nband = 0.2\npre_s = {time_s}\npost_s = {time_s}"
        ));
        let (record, start) = test.compensated(1000.0).unwrap();
        assert_eq!(start, (1000.0 * time_s) as usize);
        let (mut velocity, mut place, mut low, mut high) = (0.0, 0.0, 0.0_f64, 0.0_f64);
        for sample in &record {
            velocity += sample / 1000.0;
            place += velocity / 1000.0;
            (low, high) = (low.min(place), high.max(place));
        }
        assert!(velocity.abs() < 1e-12 && place.abs() < 1e-12, "{velocity} {place}");
        near(high - low, stroke_m, 2e-3);
        let figures = test.figures();
        assert!(figures.compensation.unwrap() < most, "{figures:?}");
        near(figures.stroke_m.unwrap(), stroke_m, 0.02);
        near(figures.velocity_change_m_s, 2.0 * 20.0 * 0.02 / core::f64::consts::PI, 1e-12);
    }
    let trapezoid =
        shock("pulse = 'trapezoid'\npeak_g = 10\nduration_s = 0.02\nrise_s = 0.002\nfall_s = 0.002\nband = 0.2");
    near(trapezoid.velocity_change_m_s(), 98.0665 * 0.018, 1e-12);
    near(trapezoid.samples(1000.0).iter().sum::<f64>() / 1000.0, 98.0665 * 0.018, 1e-12);
    assert_eq!(trapezoid.figures().stroke_m, None);
}

/// A half-sine as a table is the half-sine, and its figures are those of the straight lines between its points.
#[test]
fn a_pulse_may_be_a_table() {
    let by_name =
        shock("pulse = 'half-sine'\npeak_m_s2 = 20\nduration_s = 0.02\nband = 0.2\npre_s = 0.1\npost_s = 0.1");
    let count = 200_u32;
    // The table begins at 1 s, which is where the pulse begins.
    let rows = (0..=count).map(|k| {
        let share = f64::from(k) / f64::from(count);
        let g = 20.0 / 9.80665 * libm::sin(core::f64::consts::PI * share);
        format!("{},{g}\n", 1000.0 + 20.0 * share)
    });
    let table = format!("time_ms,acceleration_g\n{}", rows.collect::<String>());
    const FILE: &str = "spec = { kind = 'shock', sources = [] }\n[shock]\npulse = 'file'\nfile = 'pulse.csv'\nband = 0.2\npre_s = 0.1\npost_s = 0.1\n";
    let with = |text: &str, table: &str| {
        let file: SpecificationFile = toml::from_str(text).unwrap();
        assert_eq!(file.files().collect::<Vec<_>>(), ["pulse.csv"]);
        Specification::new(
            &file,
            |name| if name == "pulse.csv" { Ok(table.to_owned()) } else { Err(String::from("no")) },
        )
    };
    let Test::Shock(test) = with(FILE, &table).unwrap().test else { panic!() };
    near(test.peak_m_s2, 20.0, 1e-12);
    near(test.duration_s, 0.02, 1e-12);
    // A chord of h = π/200 has h²/12 less area than the sine.
    near(test.velocity_change_m_s(), by_name.velocity_change_m_s(), 3e-5);
    for (sample, expected) in test.samples(1000.0).iter().zip(by_name.samples(1000.0)) {
        assert!((sample - expected).abs() < 1e-9, "{sample} {expected}");
    }
    near(test.figures().stroke_m.unwrap(), by_name.figures().stroke_m.unwrap(), 5e-4);
    for t_s in [-1e-6, 0.020_01] {
        assert_eq!(test.acceleration_m_s2(t_s), 0.0);
    }
    // Between two points it is straight.
    near(test.acceleration_m_s2(0.000_05), 0.5 * test.acceleration_m_s2(0.000_1), 1e-9);
    for (text, table, expected) in [
        (FILE.to_owned(), "time_s,acceleration_g\n0,1\n", "[shock] `file` has 1 elements: it must have at least 2"),
        (
            FILE.to_owned(),
            "time_s,acceleration_g\n0,0\n0,1\n",
            "[shock] `file`, number 2: the time, s, is 0: it must be above the one before",
        ),
        (
            FILE.to_owned(),
            "time_s,acceleration_g\n0,0\n1,inf\n",
            "[shock] `file`, number 2: the acceleration, m/s², is inf: it must be a finite number",
        ),
        (
            FILE.to_owned(),
            "time_s,acceleration_m_s2\n0,1\n1,-1\n",
            "[shock] `file`: the velocity change over peak and duration is 0: it must be at least 0.01 in size; use [srs] for a record without one",
        ),
        (format!("{FILE}duration_s = 1"), "", "[shock] `duration_s` does not apply: the file of the pulse has it"),
        (format!("{FILE}rise_s = 1"), "", "[shock] `rise_s` does not apply: only a trapezoid has it"),
        (
            FILE.replace("'file'", "'half-sine'"),
            "",
            "[shock] `file` does not apply: the pulse is not that of a file: use `pulse = \"file\"`",
        ),
    ] {
        assert_eq!(with(&text, table).unwrap_err().to_string(), expected);
    }
    let none: SpecificationFile = toml::from_str(&FILE.replace("file = 'pulse.csv'", "")).unwrap();
    let error = Specification::new(&none, |_| Err(String::new())).unwrap_err().to_string();
    assert_eq!(error, "[shock] `file` is missing: the pulse is that of a file");
}

#[test]
fn lines_of_a_shock_response_spectrum_cover_its_band() {
    let test = srs(
        "unit = 'm/s2'\nq = 10\nbreakpoints = [[20, 20], [60, 100], [180, 100]]\ntolerance_db = [-1.5, 3]\nlines_per_octave = 6",
    );
    let lines = test.frequencies_hz();
    assert_eq!([lines[0], lines[lines.len() - 1]], [20.0, 180.0]);
    assert_eq!(lines.len(), 21);
    assert!(lines.windows(2).all(|pair| pair[1] > pair[0] && pair[1] <= pair[0] * 1.1225));
    near(test.figures().pseudo_velocity_m_s, 100.0 / (core::f64::consts::TAU * 60.0), 1e-12);
}

#[test]
fn what_can_not_be_is_refused_with_its_place() {
    const RANDOM: &str = "spec = { kind = 'random', sources = [] }\n";
    const BASE: &str = "[random]\nunit = '(m/s2)2/Hz'\ntolerance_db = [-3, 3]\n";
    let says = |text: &str| parsed(text).unwrap_err().to_string();
    for (text, expected) in [
        (String::from(RANDOM), "[random] is missing: the kind of the test is random"),
        (
            format!("{RANDOM}{BASE}breakpoints = [[10, 1]]"),
            "[random] `breakpoints` has 1 elements: it must have at least 2",
        ),
        (
            format!("{RANDOM}{BASE}breakpoints = [[10, 1], [20, -1]]"),
            "[random] `breakpoints`, number 2: the level is -1: it must be a positive number",
        ),
        (
            format!("{RANDOM}{BASE}breakpoints = [{{ to_hz = 10, db_octave = 3 }}, [20, 1]]"),
            "[random] `breakpoints`, number 1: a slope with to_hz needs a point [Hz, level] before it",
        ),
        (
            format!("{RANDOM}{BASE}breakpoints = [[10, 1], {{ from_hz = 20, db_octave = 3 }}]"),
            "[random] `breakpoints`, number 2: a slope with from_hz needs a point [Hz, level] after it",
        ),
        (format!("{RANDOM}{BASE}"), "[random]: exactly one of breakpoints, file is needed, got 0"),
        (format!("{RANDOM}{BASE}file = 'x.csv'"), "x.csv: there are no files"),
        (
            format!(
                "{RANDOM}{BASE}breakpoints = [[10, 1], [20, 1]]\n[sine]\nfrom_hz = 1\nsegments = []\ntolerance = 0.1"
            ),
            "[sine] does not apply: the test is of another kind",
        ),
        (
            format!("{RANDOM}{BASE}breakpoints = [[10, 1], [20, 1]]\n[schedule]\nlevels_db = [-6, 0]\nseconds = [1]"),
            "[schedule] `levels_db` has 2 elements and `seconds` has 1: they must have the same number",
        ),
        (
            format!("{RANDOM}{BASE}breakpoints = [[10, 1], [20, 1]]\n[schedule]\nlevels_db = [-6]\nseconds = [1]"),
            "[schedule] `levels_db`, number 1: the last level, dB, is -6: it must be 0, the full level",
        ),
        (
            String::from("spec = { kind = 'sine', sources = [] }\n[sine]\nfrom_hz = 1\nsegments = []\ntolerance = 0.1"),
            "[sine]: exactly one of rate_oct_min, hz_s is needed, got 0",
        ),
        (
            String::from(
                "spec = { kind = 'shock', sources = [] }\n[shock]\npulse = 'saw-tooth'\npeak_g = 1\nduration_s = 0.01\nrise_s = 1\nband = 0.2",
            ),
            "[shock] `rise_s` does not apply: only a trapezoid has it",
        ),
        (
            String::from(
                "spec = { kind = 'shock', sources = [] }\n[srs]\nunit = 'g'\nq = 10\nbreakpoints = [[10, 1], [20, 1]]\ntolerance_db = [-3, 3]\nshare = 0.9\nlines_per_octave = 6",
            ),
            "[srs] `rest_tolerance_db` is missing: it holds for the lines beyond `share`",
        ),
    ] {
        assert_eq!(says(&text), expected, "{text}");
    }
}
