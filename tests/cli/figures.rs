//! Lines of figures can be distinguished without colours.

use std::fs;

use crate::resonarm;

/// The colours of stable and of unstable responses, which no other line has.
const STABLE: &str = "#0077BB";
const UNSTABLE: &str = "#CC3311";

/// Whether each line of this colour in a figure is dashed, those of the legend among them.
pub fn dashed(svg: &str, color: &str) -> Vec<bool> {
    let lines = svg.lines().filter(|line| line.starts_with("<path fill=\"none\""));
    let lines = lines.filter(|line| line.contains(&format!("stroke=\"{color}\"")));
    lines.map(|line| line.contains("stroke-dasharray")).collect()
}

/// Every line of unstable responses is dashed, no line of stable ones is, and both occur.
pub fn unstable_responses_are_dashed(svg: &str) {
    let (stable, unstable) = (dashed(svg, STABLE), dashed(svg, UNSTABLE));
    assert!(!stable.is_empty() && stable.iter().all(|dashed| !dashed), "stable: {stable:?}");
    assert!(!unstable.is_empty() && unstable.iter().all(|dashed| *dashed), "unstable: {unstable:?}");
}

/// Figures of branches; those of `paper` are checked in its test.
#[test]
fn unstable_responses_are_dashed_in_figures_of_branches() {
    let commands = [
        "continue --drive joint1=60 --from-hz 21 --to-hz 23",
        "continue --drive joint1=800 --angles-deg 0,75 --from-hz 46 --to-hz 50 --branches",
        "backbone --drive joint1=60",
    ];
    for command in commands {
        let folder = tempfile::tempdir().unwrap();
        let arguments: Vec<&str> = command.split(' ').chain(["--plot", "figure"]).collect();
        let outcome = resonarm(folder.path(), &arguments);
        assert_eq!(outcome.code, 0, "{command}: {}", outcome.stderr);
        unstable_responses_are_dashed(&fs::read_to_string(folder.path().join("figure.svg")).unwrap());
    }
}

/// Colour, width and dashes of the lines in a figure, except grid and frame.
fn lines(command: &str, figure: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let outcome = resonarm(folder.path(), &command.split(' ').collect::<Vec<_>>());
    assert_eq!(outcome.code, 0, "{command}: {}", outcome.stderr);
    let svg = fs::read_to_string(folder.path().join(figure)).unwrap();
    let mut all: Vec<String> = Vec::new();
    for line in svg.lines().filter(|line| line.starts_with("<path fill=\"none\"")) {
        let value = |name: &str| {
            let (_, rest) = line.split_once(&format!(" {name}=\""))?;
            rest.split_once('"').map(|(value, _)| value)
        };
        let (color, width) = (value("stroke").unwrap(), value("stroke-width").unwrap());
        let line_style = format!("{color}, {width} px, {}", value("stroke-dasharray").unwrap_or("solid"));
        if !["#DDDDDD", "#202020"].contains(&color) && !all.contains(&line_style) {
            all.push(line_style);
        }
    }
    all.join("\n")
}

/// Lines that may cross differ in their dashes, or, as black and orange, in lightness.
#[test]
fn lines_differ_without_colours() {
    insta::assert_snapshot!(lines("frf --angles-deg 30,60 --at joint1,joint2,joint2.x,joint2.y,tip.x,tip.y --plot figure", "figure.svg"), @r"
    #000000, 1.6 px, solid
    #0072B2, 1.6 px, 6.4 4
    #D55E00, 1.6 px, 8 3.2 1.6 3.2
    #E69F00, 1.6 px, solid
    #000000, 1.6 px, 6.4 4
    #0072B2, 1.6 px, 8 3.2 1.6 3.2
    ");
    insta::assert_snapshot!(lines("backbone --drive joint1=60 --plot figure", "figure.svg"), @r"
    #0077BB, 1.6 px, solid
    #CC3311, 1.6 px, 6.4 4
    #000000, 1.2 px, 6 2.4 1.2 2.4
    ");
    let curves =
        "continue --drive joint1=800 --angles-deg 0,75 --from-hz 45 --to-hz 50 --curves-in amplitude --curves-to 600";
    insta::assert_snapshot!(lines(&format!("{curves} --plot figure"), "figure-curves.svg"), @r"
    #000000, 1.6 px, solid
    #D55E00, 1.6 px, 8 3.2 1.6 3.2
    ");
}
