//! Structures in place of the two-link arm: words, units and ends of what the commands print.

use std::fs;

use serde_json::Value;

use super::structures::example;
use super::{complaint, document, resonarm};

/// What a branch that ends early, figures of points and joints together, and flags of the arm say.
#[test]
fn what_has_two_units_ends_early_or_has_no_meaning() {
    let folder = tempfile::tempdir().unwrap();
    let chain = example("chain.toml");
    let of_chain = |more: &str| -> Vec<String> {
        let command = ["continue", "--scenario", &chain, "--drive", "joint2=5", "--at", "tip.x,joint3"];
        command.into_iter().chain(more.split_whitespace()).map(String::from).collect()
    };
    let run = |code: i32, command: Vec<String>| {
        document(folder.path(), code, &command.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let found = run(0, of_chain("--from-hz 12 --to-hz 13 --plot both --json --no-stability"));
    let figure = fs::read_to_string(folder.path().join("both.svg")).unwrap();
    for unit in ["largest tip.x (m)", "largest joint3 (rad)"] {
        assert_eq!(figure.matches(unit).count(), 1, "{unit}");
    }
    let [tip, joint] = [0, 1].map(|k| &found["peaks"][k]);
    assert_eq!(
        [&tip["at"], &tip["at_end"], &joint["at"], &joint["at_end"]],
        [&Value::from("tip.x"), &true.into(), &"joint3".into(), &true.into()]
    );
    assert!(found["ended_early"].is_null());
    let early = run(1, of_chain("--from-hz 12 --to-hz 13 --most-points 3 --json"));
    assert_eq!(early["points"].as_array().unwrap().len(), 3);
    assert!(early["ended_early"].to_string().contains("most-points"), "{}", early["ended_early"]);

    let frf = ["frf", "--scenario", &chain, "--drive", "joint2", "--at", "tip.x,joint3", "--plot", "frf"];
    assert_eq!(resonarm(folder.path(), &frf).code, 0);
    let figure = fs::read_to_string(folder.path().join("frf.svg")).unwrap();
    for unit in ["receptance (m per N·m)", "receptance (rad per N·m)"] {
        assert_eq!(figure.matches(unit).count(), 1, "{unit}");
    }
    let says =
        |command: &[&str]| complaint(folder.path(), 2, command).trim().trim_start_matches("resonarm: ").to_owned();
    insta::assert_snapshot!(says(&["modes", "--scenario", &chain, "--angles-deg", "30,20"]), @"--angles-deg has 2 numbers, expected 6, one for each link");
    insta::assert_snapshot!(says(&["frf", "--scenario", &chain, "--preset=irb1600-table1", "--drive=joint2"]), @"--preset irb1600-table1 is a structure of its own, but the scenario's [structure] is of the kind chain: leave --preset out");
    let still = "[structure]\nkind = \"modal\"\nmodes = [{ frequency_hz = 9.0, damping_ratio = 0.01, \
                 shape = { \"tip.x\" = 1.0, \"b.x\" = 0.0 } }]\n";
    fs::write(folder.path().join("still.toml"), still).unwrap();
    let frf = ["frf", "--scenario", "still.toml", "--drive", "b.x", "--plot", "none"];
    insta::assert_snapshot!(says(&frf), @"there is nothing to plot: a load at b.x causes no response at b.x; choose another place by --at");
}
