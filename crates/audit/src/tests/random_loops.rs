//! Random tests that are equalised by the reading, on structures with modes: correct controllers and flaws of the loop.

use super::bench::{Audit, specification};
use super::failing;
use super::plant::{STRUCTURES, Structure};
use super::random_loop::{CONTROLLERS, RandomFlaw, RandomLoop, SPECIFICATION};
use crate::{Finding, Verdict};

const MODES: &Structure = &STRUCTURES[0];

fn found(structure: &Structure, flaw: RandomFlaw, seed: u64, cases: &[&str]) -> Vec<(&'static str, Finding)> {
    let specification = specification(SPECIFICATION).unwrap();
    let controller = |specification: &_| RandomLoop::new(specification, flaw, seed);
    let audit = Audit { structure, specification: &specification, seed, controller: &controller };
    audit.judge(cases).into_iter().map(|(case, finding)| (case.id, finding)).collect()
}

#[test]
fn a_correct_loop_fails_no_case() {
    for structure in &STRUCTURES {
        for (case, finding) in found(structure, RandomFlaw::None, 5, &[]) {
            assert_eq!(finding.verdict, Verdict::Passed, "{}, {case}: {finding:?}", structure.name);
        }
    }
    let specification = specification(SPECIFICATION).unwrap();
    for seed in [6, 7] {
        let controller = |specification: &_| RandomLoop::new(specification, RandomFlaw::ConstantLines, seed);
        let audit = Audit { structure: MODES, specification: &specification, seed, controller: &controller };
        assert_eq!(failing(&specification, &audit.base()), [""; 0], "{seed}");
    }
}

/// The ten lines 3 dB too high are at the tolerance, and the sign is not seen in the level.
#[test]
fn a_flaw_of_the_loop_fails_the_case_for_it() {
    let hidden = [RandomFlaw::None, RandomFlaw::ConstantLines, RandomFlaw::NoSignCheck];
    for (flaw, name, meant) in CONTROLLERS.iter().filter(|(flaw, ..)| !hidden.contains(flaw)) {
        let found = found(MODES, *flaw, 5, meant);
        assert!(found.iter().any(|(_, finding)| finding.verdict == Verdict::Failed), "{name}: {found:?}");
    }
    let [(_, sign)] = &found(MODES, RandomFlaw::NoSignCheck, 5, &["R22"])[..] else { panic!("R22 was not judged") };
    assert!(matches!(sign.verdict, Verdict::Inconclusive(_)), "{sign:?}");
}

/// The largest drive after the gap is as likely the largest one of the whole as any other.
#[test]
fn peaks_of_a_steady_drive_are_no_rise() {
    for seed in [8, 11] {
        let flaw = if seed == 8 { RandomFlaw::None } else { RandomFlaw::ConstantLines };
        for flaw in [flaw, RandomFlaw::None] {
            let found = found(MODES, flaw, seed, &["R12", "R13", "R20"]);
            assert!(found.iter().all(|(_, finding)| finding.verdict == Verdict::Passed), "{flaw:?}, {seed}: {found:?}");
        }
    }
}
