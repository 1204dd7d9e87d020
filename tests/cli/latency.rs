//! `latency`, and runs in real time without privileges.

use std::path::Path;
use std::process::{Command, Stdio};

use insta::assert_snapshot;
use resonarm::realtime::{Clock, SystemClock};

use crate::{complaint, document, names};

fn here() -> &'static Path {
    Path::new(".")
}

#[test]
fn both_loops_are_measured_at_each_rate() {
    let found =
        document(here(), 0, &["latency", "--rate-hz", "1000,2000", "--turn-s", "0.05", "--turns", "2", "--json"]);
    assert_eq!(names(&found), ["findings", "rates", "thread"]);
    let rates = found["rates"].as_array().unwrap();
    assert_eq!(rates.iter().map(|at| at["rate_hz"].as_f64().unwrap()).collect::<Vec<_>>(), [1000.0, 2000.0]);
    for at in rates {
        let p50 = |name: &str| at[name]["p50"].as_f64().unwrap();
        assert!(p50("bare_us") > 0.0 && p50("execution_us") > 0.0, "{at:#}");
        assert_eq!(at["ratio_p50"].as_f64().unwrap(), p50("plant_us") / p50("bare_us"));
    }
}

/// With a recording, which keeps the last turn; an existing file is not overwritten without the flag.
#[test]
fn the_plant_s_turns_are_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let turns = ["latency", "--turn-s", "0.05", "--turns", "2", "--rt", "off", "--record", "turn.mcap", "--json"];
    let found = document(folder.path(), 0, &turns);
    assert_eq!(found["rates"][0]["lost_records"], 0);
    let inspected = document(folder.path(), 0, &["inspect", "turn.mcap", "--json"]);
    assert_eq!(inspected["integrity"]["state"], "complete", "{inspected:#}");
    assert!(inspected["duration_s"].as_f64().unwrap() >= 0.05, "{inspected:#}");
    let said = complaint(folder.path(), 2, &turns);
    assert_snapshot!(said, @"resonarm: recording `turn.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
}

/// The kernel does some work for a thread on the thread's core: the recorder, which writes, moves off the core of the
/// loop. The exciter, which only answers, may run on any.
#[test]
fn the_recorder_leaves_the_loop_s_core_if_it_can() {
    let cores_of = |status: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap();
        line.trim().to_owned()
    };
    let own = cores_of(&std::fs::read_to_string("/proc/self/status").unwrap());
    let first = |list: &str| list.split([',', '-']).next().unwrap().to_owned();
    let core = first(&own);
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("turn.mcap");
    let mut child = Command::new(env!("CARGO_BIN_EXE_resonarm"))
        .args(["latency", "--turns", "1", "--turn-s", "3", "--core", &core, "--record"])
        .arg(&record)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let tasks = format!("/proc/{}/task", child.id());
    let of_thread = |name: &str| {
        std::fs::read_dir(&tasks).ok()?.flatten().find_map(|task| {
            let status = std::fs::read_to_string(task.path().join("status")).ok()?;
            status.starts_with(&format!("Name:\t{name}\n")).then(|| cores_of(&status))
        })
    };
    // The plant's turn, which is recorded, follows the bare loop's, and is long compared with any delay of this
    // process.
    let found = (0..6000).find_map(|_| {
        SystemClock.sleep_until_ns(SystemClock.now_ns() + 10_000_000);
        of_thread("recorder").zip(of_thread("exciter"))
    });
    child.kill().unwrap();
    child.wait().unwrap();
    let (recorder, exciter) = found.unwrap();
    // With a single core there is no other to move to.
    assert_eq!(first(&recorder) == core, own == core, "of {own} the loop has {core}, the recorder {recorder}");
    assert_eq!(exciter, own);
}

#[test]
fn missing_required_privileges_end_the_run() {
    let said =
        complaint(here(), 3, &["latency", "--turn-s", "0.05", "--turns", "1", "--rt", "require", "--core", "1023"]);
    // Cores vary with the machine, privileges with the user.
    let core = said.find("no core 1023: ").unwrap();
    assert!(said.starts_with("resonarm: the run needs a real-time thread, but has "), "{said}");
    assert!(said[core..].contains("to fix: choose a core that this process may use: ["), "{said}");
    assert!(said.trim_end().ends_with("; to run without it, use --rt auto"), "{said}");
}

#[test]
fn a_core_is_refused_with_rt_off() {
    let said = complaint(here(), 2, &["latency", "--rt", "off", "--core", "0"]);
    assert_snapshot!(said, @"resonarm: --core 0 and --rt off exclude each other: give one of them");
    let said = complaint(here(), 2, &["latency", "--rt", "off", "--cores-awake"]);
    assert_snapshot!(said, @"resonarm: --cores-awake and --rt off exclude each other: give one of them");
    let said = complaint(here(), 2, &["latency", "--turn-s", "0.0001"]);
    assert_snapshot!(said, @"resonarm: --turn-s is 0.0001: it must contain at least one sample at 1000 Hz");
    let said = complaint(here(), 2, &["latency", "--turn-s", "-1"]);
    assert_snapshot!(said, @"resonarm: --turn-s is -1: cannot convert float seconds to Duration: value is negative; expected a time in seconds, 0 or more");
}

#[test]
fn the_loops_spin_with_the_flag_and_their_latencies_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let common = ["latency", "--turn-s", "0.05", "--turns", "2", "--plot", "late"];
    let given = document(folder.path(), 0, &[&common[..], &["--spin", "100", "--json"]].concat());
    let spin = serde_json::json!({ "spin_us": 100.0, "slept_p99_us": null, "most_us": 250.0 });
    assert_eq!(given["rates"][0]["spin"], spin);
    let drawn = std::fs::read_to_string(folder.path().join("late.svg")).unwrap();
    for name in ["1000 Hz", "late, bare loop", "late, plant", "work, plant", "latency (µs)"] {
        assert!(drawn.contains(name), "{name}");
    }
    let said = complaint(folder.path(), 2, &common);
    assert_snapshot!(said, @"resonarm: late.svg already exists: choose another place, or allow overwriting it (--overwrite)");
    let measured = document(folder.path(), 0, &[&common[..], &["--overwrite", "--spin", "auto", "--json"]].concat());
    let found = &measured["rates"][0]["spin"];
    let [spin_us, p99_us] = ["spin_us", "slept_p99_us"].map(|name| found[name].as_f64().unwrap());
    // It depends on the machine: at most a quarter of the period, or no spinning.
    assert!(p99_us > 0.0 && if p99_us > 250.0 { spin_us == 0.0 } else { spin_us <= p99_us }, "{found}");
    // A quarter of 250 µs is 62.5 µs.
    let said = complaint(folder.path(), 2, &["latency", "--rate-hz", "4000", "--turn-s", "0.05", "--spin", "63"]);
    assert_snapshot!(said, @"resonarm: spinning for 63 µs before each deadline: at 4000 Hz at most 62.5 µs are possible, a quarter of the period, so that other threads get the core; give a shorter time, or auto");
    let said = complaint(folder.path(), 2, &["run", "--mode", "free", "--plot", "run"]);
    assert_snapshot!(said, @"resonarm: --plot run draws how late samples were, but a run in the mode free has no schedule: use --mode real-time or lockstep");
}

/// The flags of the command in the unit are valid: the program gets as far as the missing interface.
#[test]
fn the_unit_for_systemd_starts_the_program_as_it_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let unit = std::fs::read_to_string(root.join("docs/systemd/resonarm@.service")).unwrap();
    let command = unit.lines().find_map(|line| line.strip_prefix("ExecStart=/usr/local/bin/resonarm ")).unwrap();
    let command = command.replace("/etc/resonarm/%i.toml", "scenarios/bench.toml").replace("%i", "vcan999");
    let said = complaint(root, 3, &command.split(' ').collect::<Vec<_>>());
    assert!(
        said.contains("the CAN interface vcan999 does not exist") || said.contains("does not provide SocketCAN"),
        "{said}"
    );
}
