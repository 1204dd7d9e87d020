//! What the program says of itself, and what it writes for a shell.

use std::path::Path;
use std::process::Command;

use crate::{document, resonarm};

#[test]
fn without_arguments_it_says_what_it_can_do() {
    let said = resonarm(Path::new("."), &[]);
    assert_eq!((said.code, said.stderr.as_str()), (0, ""));
    // The commands themselves are checked beside the text.
    assert!(
        said.stdout.starts_with("Resonarm simulates") && said.stdout.ends_with("resonarm COMMAND --help\n"),
        "{}",
        said.stdout
    );
}

#[test]
fn every_command_is_listed_once_in_its_group() {
    let help = resonarm(Path::new("."), &["--help"]).stdout;
    let titles: Vec<&str> =
        help.lines().filter(|line| line.ends_with(':') && line.starts_with(char::is_uppercase)).collect();
    insta::assert_snapshot!(titles.join("\n"), @r"
    Benches, a plant and a controller on a bus:
    Recordings:
    Specifications of tests:
    Structures and their vibration:
    Other tools:
    Common to all commands:
    ");
    for name in ["quickstart", "identify", "continue", "fmu", "man"] {
        let lines = help.lines().filter(|line| line.split_whitespace().next() == Some(name));
        assert_eq!(lines.count(), 1, "{name}: {help}");
    }
}

#[test]
fn a_shell_completes_commands_and_flags() {
    let script = resonarm(Path::new("."), &["completions", "bash"]).stdout;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("resonarm"), script).unwrap();
    let ask = |words: &str, count: usize| {
        let asked = format!(
            ". ./resonarm; COMP_WORDS=({words}); COMP_CWORD={count}; _resonarm resonarm \"${{COMP_WORDS[{count}]}}\" \
             \"${{COMP_WORDS[{}]}}\"; printf '%s ' \"${{COMPREPLY[@]}}\"",
            count - 1
        );
        let shell = Command::new("bash").args(["-c", &asked]).current_dir(folder.path()).output().unwrap();
        String::from_utf8(shell.stdout).unwrap()
    };
    assert_eq!(ask("resonarm ident", 1), "identify ");
    assert_eq!(ask("resonarm frf --quant", 2), "--quantity ");
    assert_eq!(ask("resonarm frf --quantity m", 3), "mobility ");
}

#[test]
fn manual_pages_hold_the_help() {
    let folder = tempfile::tempdir().unwrap();
    let written = document(folder.path(), 0, &["man", "man1", "--json"]);
    let pages = written["pages"].as_array().unwrap();
    assert!(pages.iter().any(|page| page == "man1/resonarm-experiment-walk.1"), "{pages:?}");
    assert_eq!(pages.len(), std::fs::read_dir(folder.path().join("man1")).unwrap().count());
    let page = std::fs::read_to_string(folder.path().join("man1/resonarm-frf.1")).unwrap();
    assert!(page.contains(r"resonarm frf") && page.contains(r"\-\-quantity"), "{page}");
    let all = std::fs::read_to_string(folder.path().join("man1/resonarm.1")).unwrap();
    assert!(all.contains("resonarm\\-frf(1)"), "{all}");
}

#[test]
fn the_tables_are_written_as_documents() {
    let folder = tempfile::tempdir().unwrap();
    let written = document(folder.path(), 0, &["reference", "tables", "--json"]);
    assert_eq!(written["files"].as_array().unwrap().len(), 2);
    for (name, row) in [("channels", "| `force_x_n` | load | N | tip C | x |  |"), ("requirements", "| R-2.1 | ")] {
        let text = std::fs::read_to_string(folder.path().join(format!("tables/{name}.md"))).unwrap();
        assert!(text.starts_with("# ") && text.contains(&format!("\n{row}")), "{text}");
    }
}

/// Before there is a bus or a controller.
#[test]
fn a_quickstart_runs_at_once() {
    let folder = tempfile::tempdir().unwrap();
    document(folder.path(), 0, &["quickstart", "bench", "--json"]);
    let run = document(folder.path(), 0, &["run", "--mode", "free", "--scenario", "bench/scenario.toml", "--json"]);
    let response = &run["responses"][0];
    assert_eq!(response["frequency_hz"].as_f64(), Some(14.0), "{run:#}");
}
