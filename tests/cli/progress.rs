//! Lines of progress where standard error is no terminal.

use std::process::{Child, Command, Stdio};

/// A run of 12 s by the clock.
fn started(flags: &[&str], log: &str) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.args(["run", "--mode", "free", "--speed", "1", "--duration-s", "12"]).args(flags).env("RESONARM_LOG", log);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Its standard error.
fn said(child: Child) -> String {
    String::from_utf8(child.wait_with_output().unwrap().stderr).unwrap()
}

/// The first line comes after ten seconds, further ones ten seconds apart; none if standard error has another use.
#[test]
fn long_work_writes_a_line_every_ten_seconds() {
    let wanted = started(&[], "");
    let quiet = [
        started(&[], "error"),
        started(&["--quiet"], ""),
        started(&[], "resonarm::progress=off"),
        started(&["--json-events"], ""),
    ];
    let by_status = started(&["--status-s", "1"], "");
    let lines = said(wanted);
    assert!(!lines.is_empty(), "no line");
    for line in lines.lines() {
        let (percent, seconds) = line.strip_prefix("plant: ").and_then(|rest| rest.split_once(" % after ")).unwrap();
        let seconds: u64 = seconds.strip_suffix(" s").unwrap().parse().unwrap();
        assert!(percent.parse::<u64>().unwrap() <= 100 && seconds >= 10, "{line}");
    }
    // The run may take longer than 12 s on a busy machine.
    for child in quiet {
        let said = said(child);
        assert!(!said.contains("% after"), "{said}");
    }
    let status = said(by_status);
    assert!(status.contains("samples/s") && !status.contains("% after"), "{status}");
}
