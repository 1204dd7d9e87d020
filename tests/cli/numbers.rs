//! Every numeric flag of every command, with values that no flag accepts, and values that few accept.

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::resonarm;

/// Arguments with which each command ends soon if its numbers are valid: without a bus, a folder to write to or a
/// recording, or with little to do.
const COMMANDS: [(&str, &str); 44] = [
    ("demo", "--out /dev/null/none"),
    ("quickstart", "/dev/null/none"),
    ("run", "--mode free --duration-s 0.05"),
    ("exciter", "--bus vcan999"),
    ("experiment fig9", "--plot /dev/null/none"),
    ("experiment walk", "--drive joint1=10 --points 3"),
    ("simulate", "--frequency-hz 10 --duration-s 0.01"),
    ("structure", "--scenario none.toml"),
    ("modes", "--over link2.angle_deg --from 0 --to 90 --points 3"),
    ("frf", "--points 2"),
    ("integrators", "--drift-steps 10"),
    ("continue", "--drive joint1=1 --from-hz 10 --to-hz 10.1"),
    ("backbone", "--to 0.001"),
    ("sweep", "--drive joint1=1 --from-hz 10 --to-hz 10.1 --points 2 --time-constants 0.01"),
    ("poincare", "--drive joint1=1 --frequency-hz 10 --time-constants 0.01"),
    ("basins", "--drive joint1=1 --frequency-hz 10 --points 2,2 --time-constants 0.01"),
    ("paper", ""),
    ("compare", "none.json"),
    ("replay", "none.mcap --bus vcan999"),
    ("resim", "none.mcap"),
    ("plot", "none.mcap --of psd --channels head_force_x_n"),
    ("survey", "--from none.mcap --out /dev/null/none"),
    ("identify", "none.mcap"),
    ("spec", "navmat-p-9492"),
    ("verdict", "navmat-p-9492 none.mcap"),
    ("audit", "--scenario none.toml --specification navmat-p-9492 --controller none.toml"),
    ("inspect", "none.mcap"),
    ("recover", "none.mcap"),
    ("cut", "none.mcap new.mcap"),
    ("merge", "none.mcap none.mcap --out new.mcap"),
    ("diff", "none.mcap none.mcap"),
    ("export", "none.mcap --to csv"),
    ("fmu", "--scenario none.toml --out none.fmu --interface can --role bus"),
    ("import", "none.log none.mcap"),
    ("protocol dbc", ""),
    ("protocol header", ""),
    ("protocol decode", "701#00"),
    ("protocol encode", "PlantHeartbeat state=5"),
    ("conformance", "--bus vcan999 --role plant"),
    ("doctor", ""),
    ("latency", "--turn-s 0.01 --turns 1 --rt off"),
    ("completions", "bash"),
    ("man", "/dev/null/none"),
    ("reference", "/dev/null/none"),
];

/// Value names of numeric flags in the help, and of all others.
const NUMERIC: [&str; 26] = [
    "KG",
    "N",
    "NM",
    "N/S",
    "F",
    "HZ",
    "S",
    "A",
    "DEG",
    "DEG,…",
    "X",
    "X,…",
    "X,Y",
    "NX,NY",
    "RAD",
    "P",
    "Z",
    "α1,α2,α̇1,α̇2",
    "A,B",
    "Q,V",
    "DOF=A",
    "K=A",
    "NAME=X",
    "NAME=X,…",
    "PART",
    "Q",
];
const OTHERS: [&str; 36] = [
    "PID",
    "RT",
    "SPIN",
    "ORIGIN",
    "ID",
    "PROFILE",
    "ROLE",
    "DOMAIN",
    "INPUT",
    "NAME",
    "NAMES",
    "FILE",
    "DIR",
    "STEM",
    "BUS",
    "POLICY",
    "MODE",
    "DOF",
    "DRIVE",
    "QUANTITY",
    "RESPONSE",
    "DIRECTION",
    "PARAMETER",
    "FRAMES",
    "WHICH",
    "SIDE",
    "KIND",
    "ADDRESS",
    "FORMAT",
    "PARTS",
    "ID,…",
    "ID=ID,…",
    "STATE",
    "WINDOW",
    "DETREND",
    "COMMAND",
];

/// The numeric flags in the help of a command.
fn numeric_flags(command: &str) -> Vec<String> {
    let help = resonarm(Path::new("/"), &command.split(' ').chain(["--help"]).collect::<Vec<_>>()).stdout;
    let mut flags = Vec::new();
    for line in help.lines().map(str::trim) {
        let Some((flag, rest)) = line.find("--").map(|at| line[at..].split_once(' ').unwrap_or((line, ""))) else {
            continue;
        };
        let Some(name) = rest.trim_start().strip_prefix('<').and_then(|rest| rest.split_once('>')) else { continue };
        // A flag in the middle of a line is mentioned in a description.
        if !line.starts_with('-') {
            continue;
        }
        let is_numeric = NUMERIC.contains(&name.0);
        assert!(is_numeric || OTHERS.contains(&name.0), "{command} {flag} <{}>: numeric or not?", name.0);
        if is_numeric {
            flags.push(String::from(flag));
        }
    }
    flags
}

/// The command's arguments with `flag` set to `value`.
fn with(command: &str, usual: &str, flag: &str, value: &str) -> Vec<String> {
    let mut arguments: Vec<String> = command.split(' ').map(String::from).collect();
    // A flag that is given twice is an error of its own.
    let mut words = usual.split_whitespace().peekable();
    while let Some(word) = words.next() {
        if word == flag {
            let _value = words.next();
        } else {
            arguments.push(String::from(word));
        }
    }
    arguments.extend([flag, value].map(String::from));
    arguments
}

/// Ends a command that takes too long: none of these has more than a second's work.
#[allow(clippy::disallowed_methods, reason = "a test waits for another process")]
fn wait(mut child: Child) -> (Option<i32>, String) {
    let (mut stderr, deadline) = (child.stderr.take().unwrap(), Instant::now() + Duration::from_secs(120));
    while child.try_wait().unwrap().is_none() {
        if Instant::now() > deadline {
            // A process that is killed has no exit code, which is told below.
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    (child.wait().unwrap().code(), said)
}

/// What is wrong with a command's reaction to a value, if anything.
fn wrong(folder: &Path, arguments: &[String], flag: &str, value: &str) -> Option<String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.args(arguments).current_dir(folder).env_remove("RESONARM_LOG");
    let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let (code, said) = wait(child);
    let key = flag.trim_start_matches('-').replace('-', "_");
    // A message that describes the quantity in words includes its value; one of the usual arguments may be refused
    // next.
    let named = [flag, &key, value, "/dev/null/none", "none.mcap"].iter().any(|name| said.contains(name));
    // Some flags take -1 or 1e300; what is no finite number is right nowhere.
    let must_fail = !matches!(value, "-1" | "1e300");
    let problem = match code {
        None => "it did not end",
        _ if said.contains("panicked") => "it panicked",
        _ if said.contains("unexpected argument") => "the value is taken for a flag",
        _ if said.len() > 1000 => "the message is long",
        Some(2) if !named => "the message does not name the flag",
        Some(0..=3) if must_fail && code != Some(2) => "it is accepted",
        Some(0..=3) => return None,
        Some(_) => "an unexpected exit code",
    };
    let said: String = said.chars().take(400).collect();
    Some(format!("{}: {problem} ({code:?}): {said}", arguments.join(" ")))
}

#[test]
fn every_numeric_flag_accepts_its_value_or_says_why_not() {
    let folder = tempfile::tempdir().unwrap();
    let help = resonarm(folder.path(), &["--help"]).stdout;
    let listed = help
        .lines()
        .skip_while(|line| !line.starts_with("Usage:"))
        .take_while(|line| *line != "Common to all commands:");
    // Further lines of a description are indented more.
    let listed = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let listed: Vec<&str> =
        listed.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert_eq!(
        listed.iter().filter(|name| !COMMANDS.iter().any(|(known, _)| known.split(' ').next() == Some(name))).count(),
        0,
        "{listed:?}"
    );
    let mut cases = Vec::new();
    for (command, usual) in COMMANDS {
        for flag in numeric_flags(command) {
            for value in ["-1", "NaN", "inf", "1e300", "garbage"] {
                cases.push((with(command, usual, &flag, value), flag.clone(), value));
            }
        }
    }
    // A help in another layout must not leave this without flags to try.
    assert!(cases.len() > 300, "{}", cases.len());
    let problems: Vec<String> =
        cases.iter().filter_map(|(arguments, flag, value)| wrong(folder.path(), arguments, flag, value)).collect();
    assert!(problems.is_empty(), "{} of {}:\n{}", problems.len(), cases.len(), problems.join("\n"));
}
