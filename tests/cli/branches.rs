//! `continue --branches`: branches that leave another one, and sub-harmonic ones, in text and JSON.

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
    branch 1 from the branch point at 0.2122997 Hz, one of two mirror images: 68 responses, 48 of them unstable
      fold at 0.3631021 Hz: m1.x 2.378670e0 m
      fold at 0.2280577 Hz: m1.x 1.242192e0 m
      fold at 0.2762296 Hz: m1.x 1.619188e0 m
      branch-point at 0.2582642 Hz: m1.x 1.396327e0 m
      it ends at the last branch point
    sub-harmonic responses of 2 and 3 periods were sought near free vibrations at 10 values from 0.3264953 to 0.3948718 Hz; others may exist
    ");
}

#[test]
fn json_has_sub_harmonic_branches() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("oscillator.toml"), OSCILLATOR).unwrap();
    let range = "continue --scenario oscillator.toml --drive tip.x=4 --from-hz 0.7 --to-hz 0.73 --branches --json";
    let got = document(folder.path(), 0, &range.split(' ').collect::<Vec<_>>());
    let branches = got["branches"].as_array().unwrap();
    let periods: Vec<u64> = branches.iter().map(|branch| branch["period"].as_u64().unwrap()).collect();
    assert_eq!(periods, [2, 3, 3]);
    for branch in branches {
        assert_eq!((branch["from"]["kind"].as_str(), branch["from"]["branch"].as_u64()), (Some("sub-harmonic"), None));
        assert!((0.7..0.73).contains(&branch["from"]["value"].as_f64().unwrap()));
        assert_eq!((branch["ended"].as_str(), branch["mirrored"].as_bool()), (Some("at-end"), Some(false)));
        assert!(branch["points"].as_array().unwrap().iter().all(|point| point["period"] == branch["period"]));
    }
    assert_eq!(got["sub_harmonics"]["values"].as_array().unwrap().len(), 5);
}
