//! Sweeps whose amplitude is regulated by the reading, on structures with modes: correct controllers, and flaws of the detector and
//! of the loop.

use super::bench::{Audit, specification};
use super::plant::{ModeSpec, STRUCTURES, Structure, Sweep};
use super::sine_loop::{CONTROLLERS, SineFlaw, SineLoop, text};
use super::{ended, failing, judged};
use crate::{Finding, Record, Verdict};

const SWEEP: Sweep = Sweep { band_hz: [15.0, 60.0], rate_oct_min: 4.0, gain_1_s: 4.0, tracking: 0.15 };
/// A structure without modes: its acceleration is in proportion to the force.
const MASS: Structure = Structure { name: "mass", body_1_kg: [1.0, 0.5], modes: &[], sweep: SWEEP };
/// A mode in the middle of the sweep.
const MODE: Structure = Structure {
    name: "mode",
    body_1_kg: [0.0, 0.0],
    modes: &[ModeSpec { frequency_hz: 30.0, damping_ratio: 0.02, gains_1_kg: [1.0, 0.5] }],
    sweep: SWEEP,
};

fn found(structure: &Structure, flaw: SineFlaw, cases: &[&str]) -> Vec<(&'static str, Finding)> {
    let specification = specification(&text(&structure.sweep)).unwrap();
    let controller = |specification: &_| SineLoop::new(specification, structure.sweep.gain_1_s, flaw);
    let audit = Audit { structure, specification: &specification, seed: 5, controller: &controller };
    audit.judge(cases).into_iter().map(|(case, finding)| (case.id, finding)).collect()
}

fn base(structure: &Structure, flaw: SineFlaw) -> Record {
    let specification = specification(&text(&structure.sweep)).unwrap();
    let controller = |specification: &_| SineLoop::new(specification, structure.sweep.gain_1_s, flaw);
    Audit { structure, specification: &specification, seed: 5, controller: &controller }.base()
}

#[track_caller]
fn only<'a>(found: &'a [(&'static str, Finding)]) -> &'a Finding {
    let [(_, finding)] = found else { panic!("{found:?}") };
    finding
}

#[test]
fn a_correct_loop_fails_no_case() {
    for structure in STRUCTURES.iter().chain([&MASS]) {
        for (case, finding) in found(structure, SineFlaw::None, &[]) {
            assert!(finding.verdict == Verdict::Passed, "{}, {case}: {finding:?}", structure.name);
        }
    }
    for flaw in [SineFlaw::Rms, SineFlaw::Peak] {
        let specification = specification(&text(&SWEEP)).unwrap();
        assert_eq!(failing(&specification, &base(&MASS, flaw)), [""; 0]);
    }
}

#[test]
fn a_flaw_of_the_loop_fails_the_case_for_it() {
    for (flaw, name, meant) in CONTROLLERS.iter().filter(|(_, _, meant)| !meant.is_empty()) {
        // A loop that is too slow or too fast needs a mode.
        let structure = if meant.contains(&"S17") { &STRUCTURES[0] } else { &MASS };
        let found = found(structure, *flaw, meant);
        assert!(found.iter().any(|(_, finding)| finding.verdict == Verdict::Failed), "{name}: {found:?}");
    }
}

/// With a reading y = x + (x² − A²/2)/1.25A and x = aA cos θ, the rms detector holds a² + 0.16 a⁴ + 0.32 (a² − 1)² = 1, so a =
/// 0.9343. The largest reading is a + 0.8 a² − 0.4 = 1, so a = 0.838; the detector decays from it alike in both runs.
#[test]
fn detectors_of_rms_and_peak_fail_by_a_harmonic() {
    for (flaw, lowest, highest) in [(SineFlaw::Rms, -6.7, -6.4), (SineFlaw::Peak, -16.3, -15.5)] {
        let found = found(&MASS, flaw, &["S07"]);
        let moved = only(&found).measured[0].value;
        assert_eq!(only(&found).verdict, Verdict::Failed, "{moved}");
        assert!((lowest..highest).contains(&moved), "{moved}");
    }
    // One that ends its sweep decides nothing.
    let specification = specification(&text(&SWEEP)).unwrap();
    let base = base(&MASS, SineFlaw::None);
    let aborted = ended(&base, base.len() / 2, super::RATE / 10);
    assert!(matches!(judged(&specification, "S07", &base, &aborted).verdict, Verdict::Inconclusive(_)));
}

/// At 30 Hz and a damping ratio of 1 %, 2ζω is 3.8/s: a loop that is much slower does not follow the mode, and one that is much
/// faster is unstable at it.
#[test]
fn compressors_too_slow_or_too_fast_fail_at_a_light_mode() {
    let sweep = |gain_1_s: f64| Structure { sweep: Sweep { gain_1_s, rate_oct_min: 1.0, ..SWEEP }, ..MODE };
    for (gain_1_s, expected) in [(2.0, Verdict::Passed), (0.5, Verdict::Failed), (8.0, Verdict::Failed)] {
        // One that ends its test by itself decides nothing.
        let found = found(&sweep(gain_1_s), SineFlaw::NoAbort, &["S17"]);
        assert_eq!(only(&found).verdict, expected, "{gain_1_s}: {found:?}");
    }
}

/// At 1.75 octaves a minute a loop just follows a mode with a damping ratio of 2 %. The frequency d(f t)/dt = f + t df/dt passes it
/// faster, by up to ln 4, the octaves of the sweep.
#[test]
fn a_naive_phase_fails_the_rate_and_the_amplitude() {
    let structure = Structure { sweep: Sweep { rate_oct_min: 1.75, ..SWEEP }, ..MODE };
    let specification = specification(&text(&structure.sweep)).unwrap();
    assert_eq!(failing(&specification, &base(&structure, SineFlaw::None)), [""; 0]);
    assert_eq!(failing(&specification, &base(&structure, SineFlaw::NaivePhase)), ["S01", "S02"]);
}

/// A controller that ends its sweep early, or gives up at a mode, has not run its test.
#[test]
fn a_sweep_that_is_not_whole_fails_the_amplitude() {
    for (structure, flaw) in
        [(&MASS, SineFlaw::Short), (&STRUCTURES[0], SineFlaw::SlowLoop), (&STRUCTURES[0], SineFlaw::FastLoop)]
    {
        let found = found(structure, flaw, &["S01"]);
        assert_eq!(only(&found).verdict, Verdict::Failed, "{found:?}");
    }
}

/// In the middle of this sweep is a mode, whose flanks a loop follows late: the amplitude is 6 % too high before it, and as much too
/// low behind it, which is 1 dB. The case compares with the base run, which has the same error there.
#[test]
fn a_change_of_level_at_a_mode_is_measured_against_the_base_run() {
    for (flaw, expected) in [
        (SineFlaw::None, Verdict::Passed),
        (SineFlaw::IgnoresLevel, Verdict::Failed),
        (SineFlaw::JumpsAtLevel, Verdict::Failed),
    ] {
        let found = found(&STRUCTURES[0], flaw, &["S14"]);
        assert_eq!(only(&found).verdict, expected, "{found:?}");
    }
}

/// A light mode that vibrates freely in the gap meets the drive in another phase behind it, and beats for a moment.
#[test]
fn a_mode_that_beats_after_a_gap_is_not_the_controller_s() {
    let light = &STRUCTURES[1];
    // The gap is in the middle of the sweep, 3 Hz above the mode.
    let light = Structure { sweep: Sweep { band_hz: [77.0, 90.0], ..light.sweep }, ..*light };
    let [good, raised] = [SineFlaw::None, SineFlaw::RaisesInGap].map(|flaw| found(&light, flaw, &["S15"]));
    assert_eq!(only(&good).verdict, Verdict::Passed, "{good:?}");
    assert!(only(&good).measured[0].value > 1.6, "{good:?}");
    assert_eq!(only(&raised).verdict, Verdict::Failed, "{raised:?}");
}
