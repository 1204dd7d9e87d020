//! Cases of classical shocks.

use resonarm_numeric::noise::Noise;
use resonarm_specification::{ShockTest, Test};

use super::plant::STRUCTURES;
use super::shock_loop::{self, ShockFlaw};
use super::{RATE, failing, judged, mode, noise, passes, specification};
use crate::{Base, Record, Verdict};

const RATE_HZ: f64 = 1000.0;

/// The specification of the loops, with three shots in place of six.
fn three_shots() -> String {
    let (before, _) = shock_loop::SPECIFICATION.split_once("shots = ").unwrap();
    format!("{before}shots = [{{ level_db = -12, count = 1 }}, {{ level_db = 0, count = 2 }}]\n")
}

fn shock(text: &str) -> ShockTest {
    match specification(text).test {
        Test::Shock(test) => test,
        other => panic!("{other:?}"),
    }
}

/// A record with a shot every second, each with these factors, and noise.
fn run(shot: &[f64], factors: &[f64]) -> Record {
    let mut noise = Noise::new(4, 1);
    let mut reading: Vec<f64> = (0..1000 * (factors.len() + 2)).map(|_| 0.02 * noise.normal()).collect();
    for (factor, number) in factors.iter().zip(1..) {
        for (sample, value) in reading[1000 * number..].iter_mut().zip(shot) {
            *sample += factor * value;
        }
    }
    Record { rate_hz: RATE_HZ, drive: reading.clone(), reading, ..Record::default() }
}

#[test]
fn good_shots_pass_and_flawed_ones_fail_the_case_for_it() {
    let text = three_shots();
    let specification = specification(&text);
    let (good, start) = shock(&text).compensated(RATE_HZ).unwrap();
    let record = run(&good, &[0.25, 1.0, 1.0]);
    for id in ["K01", "K02", "K03", "K04", "K05"] {
        passes(&specification, id, &record, &record);
    }
    let (short, _) = shock(&text.replace("duration_s = 0.02", "duration_s = 0.014")).compensated(RATE_HZ).unwrap();
    let mut alone = good.clone();
    alone[..start].fill(0.0);
    // A pulse of 20 ms has 21 samples at 1 kHz, its start and its end included.
    alone[start + 21..].fill(0.0);
    let mut bump = good.clone();
    // Two pieces of opposite sign behind the pulse: the velocity at the end stays, so that K04 has nothing to find.
    bump[start + 60..start + 70].iter_mut().for_each(|sample| *sample += 6.0);
    bump[start + 70..start + 80].iter_mut().for_each(|sample| *sample -= 6.0);
    for (expected, record) in [
        (&["K01", "K02"][..], run(&good, &[0.25, 1.3, 1.3])),
        (&["K01", "K02"], run(&short, &[0.25, 1.0, 1.0])),
        (&["K03"], run(&bump, &[0.25, 1.0, 1.0])),
        (&["K04"], run(&alone, &[0.25, 1.0, 1.0])),
        (&["K05"], run(&good, &[1.0, 1.0, 1.0])),
        (&["K01"], run(&good, &[0.25, 1.0])),
    ] {
        let found = failing(&specification, &record);
        assert!(expected.iter().all(|id| found.contains(id)), "{expected:?}: {found:?}");
    }
    // Shots in the other direction are none.
    assert_eq!(failing(&specification, &run(&good, &[-0.25, -1.0, -1.0])), ["K01"]);
    let none = run(&good, &[]);
    let verdict = judged(&specification, "K01", &none, &none).verdict;
    assert!(matches!(verdict, Verdict::Inconclusive(_)), "{verdict:?}");
}

/// Noise at low level before the shots, whose pulses are no shots.
#[test]
fn a_controller_may_identify_the_structure_before_its_shots() {
    let text = three_shots();
    let specification = specification(&text);
    let (good, start) = shock(&text).compensated(RATE_HZ).unwrap();
    let shots = run(&good, &[0.25, 1.0, 1.0]);
    for seed in 1..=3 {
        let before = [noise(seed, 10 * RATE, 2.0), mode(seed, 25.0, 10 * RATE, 2.0)].concat();
        let before_s = before.len() as f64 / RATE_HZ;
        let joined = |values: &[f64]| [&before[..], values].concat();
        let record = Record { drive: joined(&shots.drive), reading: joined(&shots.reading), ..shots.clone() };
        for id in ["K01", "K02", "K03", "K04", "K05"] {
            passes(&specification, id, &record, &record);
        }
        let begins_s = Base::new(&specification, &record).begins_s.unwrap();
        // The first shot begins 1 s into its record, and a compensation of 0.1 s belongs to it.
        assert!((begins_s - (before_s + 1.0 + (start as f64 - 100.0) / RATE_HZ)).abs() < 2e-3, "{begins_s}");
        let none = Record { drive: before.clone(), reading: before.clone(), ..shots.clone() };
        for id in ["K01", "K02", "K03", "K04", "K05"] {
            let verdict = judged(&specification, id, &none, &none).verdict;
            assert!(matches!(verdict, Verdict::Inconclusive(_)), "{id}: {verdict:?}");
        }
    }
}

#[test]
fn a_flaw_of_a_loop_fails_the_case_for_it() {
    let specification = specification(shock_loop::SPECIFICATION);
    for structure in &STRUCTURES {
        for (flaw, name, meant) in shock_loop::CONTROLLERS {
            let found = failing(&specification, &shock_loop::run(structure, &specification, *flaw, 5));
            // Where the modes are light in mass, the structure is nearly a mass.
            if *flaw == ShockFlaw::None || *flaw == ShockFlaw::Rigid && structure.name != STRUCTURES[0].name {
                assert_eq!(found, [""; 0], "{}, {name}", structure.name);
            } else {
                assert!(meant.iter().any(|case| found.contains(case)), "{}, {name}: {found:?}", structure.name);
            }
        }
    }
}
