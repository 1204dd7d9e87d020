//! Branches beside the first one of `continue`: isolas, those that leave another one, and sub-harmonic ones, in text and
//! JSON.

use std::fs;

use crate::{document, resonarm};

/// Two equal masses of 1 kg on springs that harden, as modes: they move alike or against each other.
const PAIR: &str = r#"
[rig.exciter]
at = "both.x"
[structure]
kind = "modal"
modes = [
  { frequency_hz = 0.15915494309189535, damping_ratio = 0.025, shape = { "m1.x" = -0.7071067811865475, "m2.x" = -0.7071067811865475, "both.x" = -1.414213562373095 } },
  { frequency_hz = 0.1743455049397642, damping_ratio = 0.0273861278752583, shape = { "m1.x" = -0.7071067811865475, "m2.x" = 0.7071067811865475, "both.x" = 0.0 } },
]
[[structure.elements]]
kind = "cubic"
at = "m1.x"
stiffness3_n_m3 = 1.0
[[structure.elements]]
kind = "cubic"
at = "m2.x"
stiffness3_n_m3 = 1.0
"#;

/// A mass of 1 kg on a spring that hardens.
const OSCILLATOR: &str = r#"
[rig.exciter]
at = "tip.x"
[structure]
kind = "modal"
modes = [{ frequency_hz = 0.15915494309189535, damping_ratio = 0.005, shape = { "tip.x" = 1.0 } }]
[[structure.elements]]
kind = "cubic"
at = "tip.x"
stiffness3_n_m3 = 1.0
"#;

/// The first line, with the time that the computation took, is left out.
#[test]
fn text_says_where_branches_begin_and_end() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("pair.toml"), PAIR).unwrap();
    let range = "continue --scenario pair.toml --drive both.x=0.3 --at m1.x --from-hz 0.4 --to-hz 0.21 --branches";
    let outcome = resonarm(folder.path(), &range.split(' ').collect::<Vec<_>>());
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    insta::assert_snapshot!(outcome.stdout.split_once('\n').unwrap().1, @"
    branch-point at 0.2122997 Hz: m1.x 5.150799e-1 m
    fold at 0.2115447 Hz: m1.x 5.875578e-1 m
    branch-point at 0.2582642 Hz: m1.x 1.396327e0 m
    fold at 0.3819160 Hz: m1.x 2.564149e0 m
    largest response of m1.x at 0.3818658 Hz: m1.x 2.564560e0 m
    responses were searched at 5 frequencies with 10 starts each, up to 1.03e1 m at m1.x, and along folds for loads from 0.150 to 0.600 N: found none; others may exist
    sub-harmonic responses of 2 and 3 periods were sought near free vibrations at 10 values from 0.3264953 to 0.3948718 Hz; others may exist
    branch 1 from the branch point at 0.2122997 Hz, one of two mirror images: 68 responses, 48 of them unstable
      fold at 0.3631021 Hz: m1.x 2.378670e0 m
      fold at 0.2280577 Hz: m1.x 1.242192e0 m
      fold at 0.2762296 Hz: m1.x 1.619188e0 m
      branch-point at 0.2582642 Hz: m1.x 1.396327e0 m
      it ends at the last branch point
    ");
}

/// The isola of the absorber is a branch of its own in text, JSON, CSV and picture. Independent code has its folds at
/// 1.574492 and 2.281309 rad/s, and 2.3782 m.
#[test]
fn an_isola_is_listed_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/structures/absorber.toml");
    let range = ["continue", "--scenario", scenario, "--drive", "mass.x=0.15", "--from-hz", "0.11", "--to-hz", "0.41"];
    let outcome = resonarm(folder.path(), &[&range[..], &["--plot", "isola"]].concat());
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    let (_, text) = outcome.stdout.split_once('\n').unwrap();
    let (text, _) = text.split_once("written to").unwrap();
    insta::assert_snapshot!(text, @"
    fold at 0.1766640 Hz: mass.x 7.491715e-1 m
    fold at 0.1754057 Hz: mass.x 6.117185e-1 m
    neimark-sacker at 0.1791000 Hz: mass.x 5.304112e-1 m; beyond it the response beats at 0.014436 Hz (rotation number 0.080603)
    fold at 0.2067620 Hz: mass.x 7.622351e-1 m
    fold at 0.1983937 Hz: mass.x 4.650364e-1 m
    largest response of mass.x at 0.1749469 Hz: mass.x 7.796253e-1 m
    responses were searched at 5 frequencies with 10 starts each, up to 3.12e0 m at mass.x, and along folds for loads from 0.0932 to 0.300 N: found 1; others may exist
    isola 1 between 0.2505883 and 0.3630816 Hz: 43 responses, 32 of them unstable
      neimark-sacker at 0.2753434 Hz: mass.x 1.620086e0 m; beyond it the response beats at 0.017180 Hz (rotation number 0.062394)
      fold at 0.3630816 Hz: mass.x 2.378169e0 m
      fold at 0.2505883 Hz: mass.x 1.330841e0 m
      largest response of mass.x at 0.3630729 Hz: mass.x 2.378242e0 m
      it is closed
    ");
    let got = document(folder.path(), 0, &[&range[..], &["--json"]].concat());
    let [isola] = &got["isolas"].as_array().unwrap()[..] else { panic!("{}", got["isolas"]) };
    assert_eq!((isola["number"].as_u64(), isola["period"].as_u64()), (Some(1), Some(1)));
    assert_eq!((isola["ended"].as_str(), isola["from"]["kind"].as_str()), (Some("closed"), Some("detached")));
    let folds = isola["bifurcations"].as_array().unwrap().iter().filter(|found| found["kind"] == "fold");
    let mut folds: Vec<f64> = folds.map(|fold| fold["value"].as_f64().unwrap()).collect();
    folds.sort_by(f64::total_cmp);
    for (fold, rad_s) in folds.iter().zip([1.574_492, 2.281_309]) {
        assert!((fold * core::f64::consts::TAU - rad_s).abs() < 1e-6, "{folds:?}");
    }
    let points = isola["points"].as_array().unwrap().len();
    let csv = fs::read_to_string(folder.path().join("isola.csv")).unwrap();
    let of_isola = csv.lines().filter(|line| line.starts_with("1,")).count();
    assert_eq!(of_isola, points + isola["bifurcations"].as_array().unwrap().len());
    assert_eq!(got["searched"]["starts"].as_u64(), Some(10));
}

/// What can't be searched is said, with the reason.
#[test]
fn text_says_why_nothing_was_searched() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("oscillator.toml"), OSCILLATOR).unwrap();
    let says = |more: &str| {
        let words = format!("continue --scenario oscillator.toml {more}");
        let outcome = resonarm(folder.path(), &words.split(' ').collect::<Vec<_>>());
        let lines = outcome.stdout.lines().filter(|line| line.contains("search") || line.contains("linear"));
        lines.map(str::to_owned).collect::<Vec<_>>().join("\n")
    };
    let amplitude = says("--drive tip.x --frequency-hz 0.2 --parameter amplitude --from 0 --to 0.1");
    insta::assert_snapshot!(amplitude, @"responses beside the branch were not searched: they are searched only where the frequency varies");
    let early = says("--drive tip.x=4 --from-hz 0.1 --to-hz 0.6 --most-points 20");
    insta::assert_snapshot!(early, @"responses beside the branch were not searched, since the branch ended early");
}

#[test]
fn json_has_sub_harmonic_branches() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("oscillator.toml"), OSCILLATOR).unwrap();
    let range = "continue --scenario oscillator.toml --drive tip.x=4 --from-hz 0.7 --to-hz 0.73 --branches --json";
    let got = document(folder.path(), 0, &range.split(' ').collect::<Vec<_>>());
    assert_eq!(got.get("branches"), None);
    let branches = got["isolas"].as_array().unwrap();
    let periods: Vec<u64> = branches.iter().map(|branch| branch["period"].as_u64().unwrap()).collect();
    assert_eq!(periods, [2, 3, 3]);
    for branch in branches {
        assert_eq!((branch["from"]["kind"].as_str(), branch["from"]["branch"].as_u64()), (Some("sub-harmonic"), None));
        assert!((0.7..0.73).contains(&branch["from"]["value"].as_f64().unwrap()));
        assert_eq!((branch["ended"].as_str(), branch["mirrored"].as_bool()), (Some("at-end"), Some(false)));
        assert!(branch["points"].as_array().unwrap().iter().all(|point| point["period"] == branch["period"]));
    }
    let searched = &got["searched"];
    assert_eq!(searched["sub_harmonics"]["values"].as_array().unwrap().len(), 5);
    assert_eq!((searched["frequencies_hz"].as_array().unwrap().len(), searched["starts"].as_u64()), (5, Some(10)));
}
