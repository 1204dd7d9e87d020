//! Bad input: the exact message and the exit code.

use std::fs;
use std::path::Path;
use std::process::Command;

use insta::assert_snapshot;

use crate::{complaint, resonarm};

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The message of `run --mode free` about a scenario.
fn scenario(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scenario.toml"), text).unwrap();
    complaint(folder.path(), 2, &["run", "--mode", "free", "--scenario", "scenario.toml", "--json"])
}

#[test]
fn arms_that_cannot_be() {
    assert_snapshot!(complaint(here(), 2, &["modes", "--preset", "irb140"]), @"
    error: invalid value 'irb140' for '--preset <NAME>': there is no preset `irb140`: expected one of irb1600-table1, irb1600-fitted

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["modes", "--angles-deg", "0,nan"]), @r"
    error: invalid value 'nan' for '--angles-deg <A,B>': it must be a finite number

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--angles-deg", "inf,0", "--duration-s", "1"]), @r"
    error: invalid value 'inf' for '--angles-deg <A,B>': it must be a finite number

    For more information, try '--help'.
    ");
    assert_snapshot!(scenario("[structure.set]\n'link2.mass_kg' = -1.0"), @"resonarm: structure: link 2: `mass_kg` is -1: it must be a positive number");
}

#[test]
fn faults_that_a_bus_cannot_simulate() {
    let folder = tempfile::tempdir().unwrap();
    let say = |text: &str, command: &[&str]| {
        fs::write(folder.path().join("scenario.toml"), text).unwrap();
        complaint(folder.path(), 2, &[command, &["--scenario", "scenario.toml"]].concat())
    };
    let errors = "network = { bit_rate_hz = 1_000_000, bit_error_rate = 1e-6 }";
    assert_snapshot!(say(errors, &["run", "--bus", "vcan0", "--mode", "lockstep"]), @"resonarm: network.bit_error_rate is 1e-6, but the bus of the mode lockstep can't simulate bit errors; leave it out, use --mode free, or corrupt frames with [[network.faults]]");
    assert_snapshot!(say(errors, &["run", "--bus", "vcan0"]), @"resonarm: network.bit_error_rate is 1e-6, but the bus of the mode real-time can't simulate bit errors; leave it out, use --mode free, or corrupt frames with [[network.faults]]");
    let timed = "network = { bit_rate_hz = 1_000_000 }\n\
                 control = { law = 'phase-walk', amplitude = { exciter_x = 14.0 } }";
    assert_snapshot!(say(timed, &["demo", "--mode", "real-time", "--json"]), @"resonarm: network.bit_rate_hz is 1000000, but in real time plant and exciter of one process share a bus in memory, on which frames take no time; leave it out, or use the mode free or lockstep");
}

#[test]
fn rates_and_times_that_cannot_be() {
    assert_snapshot!(complaint(here(), 2, &["simulate", "--rate-hz", "0", "--duration-s", "1"]), @"resonarm: --rate-hz: the integration rate is 0 Hz: it must be a positive number");
    assert_snapshot!(complaint(here(), 2, &["run", "--mode", "free", "--rate-hz", "0"]), @"resonarm: simulation.rate_hz is 0: it must be an integer from 1 to 65535 Hz");
    assert_snapshot!(complaint(here(), 2, &["run", "--bus", "vcan0", "--rate-hz", "nan"]), @r"
    error: invalid value 'nan' for '--rate-hz <HZ>': it must be a finite number

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["exciter", "--bus", "vcan0", "--duration-s", "5"]), @"resonarm: --duration-s is 5: the exciter ends with what it plays, leave it out");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--duration-s", "-1"]), @"resonarm: --duration-s is -1: it must be a positive number");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--rate-hz", "1000", "--duration-s", "0.0015"]), @"resonarm: --duration-s 0.0015 is 1.5 steps at 1000 Hz, not a whole number: choose 0.002, or another rate");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--initial", "nan,0,0,0", "--duration-s", "1"]), @r"
    error: invalid value 'nan' for '--initial <Q,V>': it must be a finite number

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--drive", "tip.x=1", "--duration-s", "1"]), @"resonarm: --frequency-hz is 0: an excitation A·sin(2πft) needs a positive frequency");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--scheme", "euler", "--duration-s", "1"]), @"
    error: invalid value 'euler' for '--scheme <NAME>': there is no integration scheme `euler`: expected one of rk4, dop853, gl4, gl6, exponential, exponential8

    For more information, try '--help'.
    ");
}

#[test]
fn scenarios_that_cannot_be_read() {
    assert_snapshot!(complaint(here(), 2, &["modes", "--scenario", "no-such.toml"]), @"resonarm: can't read the scenario no-such.toml: No such file or directory (os error 2)");
    assert_snapshot!(scenario("[simulation]\nrate_hz = 1000\nduraton_s = 3\n"), @r"
    resonarm: scenario.toml: TOML parse error at line 3, column 1
      |
    3 | duraton_s = 3
      | ^^^^^^^^^
    unknown field `duraton_s`, expected one of `rate_hz`, `steps_per_sample`, `scheme`, `seed`, `duration_s`
    Did you mean `duration_s`?
    ");
    assert_snapshot!(scenario("[excitation]\nprofile = { waveform = 'chirp' }"), @r"
    resonarm: scenario.toml: TOML parse error at line 2, column 24
      |
    2 | profile = { waveform = 'chirp' }
      |                        ^^^^^^^
    unknown variant `chirp`, expected one of `dwell`, `stepped-sine`, `sine-list`, `swept-sine`, `impulse`, `random`, `burst-random`, `multisine`, `file`
    ");
    assert_snapshot!(scenario("[structure]\nangles_deg = ['up', 0]"), @r#"
    resonarm: scenario.toml: TOML parse error at line 2, column 15
      |
    2 | angles_deg = ['up', 0]
      |               ^^^^
    invalid type: string "up", expected f64
    "#);
    assert_snapshot!(scenario("[structure]\nangles_deg = [3, 60]"), @"resonarm: the scenario has neither [excitation] nor [control]: add one, as scenarios/bench.toml and scenarios/demo.toml show");
}

#[test]
fn scenarios_beyond_the_limits() {
    assert_snapshot!(complaint(here(), 2, &["modes", "--scenario", "/dev/zero"]), @"resonarm: can't read the scenario /dev/zero: it is larger than 1 MiB");
    // A line of the file is not repeated in the message.
    for text in
        [format!("a = {}", "[".repeat(200_000)), format!("{} = 1", ["a"; 100_000].join(".")), "{".repeat(100_000)]
    {
        let said = scenario(&text);
        assert!(said.starts_with("resonarm: scenario.toml: ") && said.len() < 1000, "{} bytes", said.len());
    }
    assert_snapshot!(scenario("structure.angles_deg = [1e300, 60]\nexcitation = { amplitude = { exciter_x = 1 }, profile = { waveform = 'swept-sine', from_hz = 1, to_hz = 2, duration_s = 1 } }"), @"resonarm: structure: link 1: `angle_deg` is 1e300: it must be a number from -360 to 360 degrees");
    let run = ["run", "--mode", "free", "--duration-s", "1e300"];
    assert_snapshot!(complaint(here(), 2, &run), @"resonarm: simulation.duration_s is 1e300, which is 1e303 samples: at most 1000000000000 can be simulated; leave it out for a run without end");
    let run = ["run", "--mode", "free", "--speed", "-1e300"];
    assert_snapshot!(complaint(here(), 2, &run), @"resonarm: the speed is -1e300: it must be a positive number of simulated seconds a second, or 0 for as fast as possible");
    let run = ["run", "--mode", "free", "--speed", "1e-300"];
    assert_snapshot!(complaint(here(), 2, &run), @"resonarm: the speed is 1e-300: a sample would take 1.000e297 s, but may take at most half of `network.lockstep_timeout_s` (1 s), or each end considers the other lost; the speed must be at least 2.0e-3");
    let run = ["run", "--bus", "memory", "--patience-s", "-1e300"];
    assert_snapshot!(complaint(here(), 2, &run), @"resonarm: --patience-s is -1e300: cannot convert float seconds to Duration: value is negative; expected a time in seconds, 0 or more");
    assert_snapshot!(complaint(here(), 2, &["backbone", "--to=-1e300"]), @"resonarm: --to is -1e300: it must be a positive number");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--duration-s", "1e15"]), @"resonarm: --duration-s 1e15 is 2e18 steps at 2000 Hz: at most 10000000000 are possible; choose a shorter time or a lower rate");
}

/// A seed of 64 bits survives in a recording.
#[test]
fn seeds_are_exact_up_to_the_largest() {
    let folder = tempfile::tempdir().unwrap();
    for (seed, key) in [("18446744073709551615", "seed = \"18446744073709551615\""), ("0x10", "seed = 16")] {
        let run =
            ["run", "--mode", "free", "--duration-s", "0.01", "--seed", seed, "--record", "a.mcap", "--overwrite"];
        assert_eq!(resonarm(folder.path(), &run).code, 0);
        let recording = fs::read(folder.path().join("a.mcap")).unwrap();
        let recording = String::from_utf8_lossy(&recording);
        assert!(recording.contains(key), "{key}");
        assert_eq!(resonarm(folder.path(), &["resim", "a.mcap"]).code, 0);
    }
    assert_snapshot!(complaint(here(), 2, &["run", "--seed", "-1"]), @r"
    error: invalid value '-1' for '--seed <N>': a seed is a whole number from 0 to 18446744073709551615, or hexadecimal as 0x1F

    For more information, try '--help'.
    ");
    assert_snapshot!(scenario("simulation.seed = -1"), @r"
    resonarm: scenario.toml: TOML parse error at line 1, column 19
      |
    1 | simulation.seed = -1
      |                   ^^
    invalid value: integer `-1`, expected a whole number from 0 to 9223372036854775807, or up to 18446744073709551615 in quotes
    ");
}

#[test]
fn invalid_buses() {
    assert_snapshot!(complaint(here(), 2, &["run"]), @"resonarm: --bus is missing: the mode real-time needs a bus; give one, as --bus vcan0, or use --mode free");
    assert_snapshot!(complaint(here(), 2, &["run", "--bus", "socketcna:vcan0"]), @r#"resonarm: `socketcna:vcan0` is not a bus: unknown backend "socketcna", perhaps you meant socketcan. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"#);
    assert_snapshot!(complaint(here(), 2, &["exciter", "--bus", "memory"]), @"resonarm: a memory bus exists only inside one process, and no other program can be reached on it: expected a bus that several processes share. Use vcan0 or another CAN interface; `resonarm demo` runs plant and exciter together on a memory bus");
    assert_snapshot!(complaint(here(), 2, &["run", "--mode", "free", "--bus", "vcan0"]), @"resonarm: the mode free has no bus, since plant and exciter run in one loop; use the mode lockstep");
    assert_snapshot!(complaint(here(), 2, &["exciter", "--mode", "free", "--bus", "vcan0"]), @"
    error: invalid value 'free' for '--mode <MODE>'
      [possible values: real-time, lockstep]

    For more information, try '--help'.
    ");
}

/// Machines differ: either the interface is missing, or CAN itself.
#[test]
fn a_missing_interface_is_reported_with_the_command_that_makes_it() {
    let missing = ["--bus", "vcan999"];
    for command in ["run", "exciter"] {
        let says = complaint(here(), 3, &[&[command], missing.as_slice()].concat());
        let interface = says.starts_with("resonarm: the CAN interface vcan999 does not exist (")
            && says
                .contains("Create it with `sudo ip link add vcan999 type vcan && sudo ip link set vcan999 mtu 72 up`");
        let kernel = says.starts_with("resonarm: this kernel does not provide SocketCAN (")
            && says.contains("`sudo modprobe -a can");
        assert!(interface || kernel, "{says}");
    }
}

#[test]
fn invalid_words() {
    assert_snapshot!(complaint(here(), 2, &["modes", "--presett", "irb1600-fitted"]), @r"
    error: unexpected argument '--presett' found

      tip: a similar argument exists: '--preset'

    Usage: resonarm modes --preset <NAME>

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["run", "--bus", "vcan0", "--overrun", "ignore"]), @r"
    error: invalid value 'ignore' for '--overrun <POLICY>': unknown overrun policy `ignore`; it must be one of slip, continue, fault, stop

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["run", "--bus", "vcan0", "--priority", "0"]), @"resonarm: the real-time priority is 0; it must be from 1 to 99");
    assert_snapshot!(complaint(here(), 2, &["simulate", "--initial", "1,2", "--duration-s", "1"]), @"resonarm: --initial has 2 numbers, expected 4: alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s");
}

#[test]
fn invalid_ranges_of_a_parameter() {
    let over = |more: &str| {
        let all: Vec<&str> = ["modes", "--over", "link2.angle_deg"].into_iter().chain(more.split(' ')).collect();
        complaint(here(), 2, &all)
    };
    assert_snapshot!(over("--from 30 --to 30"), @"resonarm: --from 30 --to 30: the ends must be different");
    assert_snapshot!(over("--from 0 --to 400"), @"resonarm: --over link2.angle_deg: link 2: `angle_deg` is 362.22222222222223: it must be a number from -360 to 360 degrees");
    assert_snapshot!(over("--from 0 --to 90 --points 1"), @r"
    error: invalid value '1' for '--points <N>': it must be an integer from 2 to 1000000

    For more information, try '--help'.
    ");
    assert_snapshot!(over("--from 0 --to inf"), @r"
    error: invalid value 'inf' for '--to <X>': it must be a finite number

    For more information, try '--help'.
    ");
    assert_snapshot!(over("--from 0"), @r"
    error: the following required arguments were not provided:
      --to <X>

    Usage: resonarm modes --over <NAME> --from <X> --to <X>

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["modes", "--over", "beta2", "--from", "0", "--to", "9"]), @"resonarm: --over: there is no parameter `beta2` in this structure: expected one of link1.length_m, link1.mass_kg, link1.centre_of_mass_m, link1.centre_of_mass_off_m, link1.inertia_kg_m2, link1.angle_deg, link1.stiffness_nm_rad, link1.damping_nm_s_rad, link2.length_m, link2.mass_kg, link2.centre_of_mass_m, link2.centre_of_mass_off_m, link2.inertia_kg_m2, link2.angle_deg, link2.stiffness_nm_rad, link2.damping_nm_s_rad, gravity_m_s2");
    assert_snapshot!(complaint(here(), 2, &["modes", "--plot", "modes"]), @r"
    error: the following required arguments were not provided:
      --from <X>
      --to <X>
      --over <NAME>

    Usage: resonarm modes --from <X> --to <X> --over <NAME> --plot <STEM>

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["modes", "--set", "link2.mass_kg"]), @r"
    error: invalid value 'link2.mass_kg' for '--set <NAME=X>': it must be a name with a number, NAME=X

    For more information, try '--help'.
    ");
}

#[test]
fn invalid_responses() {
    assert_snapshot!(complaint(here(), 2, &["frf", "--from-hz", "-1"]), @"resonarm: --from-hz -1 --to-hz 80: the frequencies must rise, and be from 0 to 1e9");
    assert_snapshot!(complaint(here(), 2, &["frf", "--from-hz", "nan"]), @r"
    error: invalid value 'nan' for '--from-hz <F>': it must be a finite number

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["frf", "--points", "4000000000"]), @r"
    error: invalid value '4000000000' for '--points <N>': it must be an integer from 2 to 1000000

    For more information, try '--help'.
    ");
    assert_snapshot!(complaint(here(), 2, &["frf", "--at", "elbow"]), @"resonarm: --at elbow: there is no `elbow` in this structure: expected one of joint2.x, joint2.y, tip.x, tip.y, joint1, joint2");
}

#[test]
fn curves_that_cannot_be() {
    let with = |name| {
        [
            "continue",
            "--drive",
            "joint1=60",
            "--from-hz",
            "21",
            "--to-hz",
            "23",
            "--curves-in",
            name,
            "--curves-to",
            "90",
        ]
    };
    assert_snapshot!(complaint(here(), 2, &with("frequency")), @"resonarm: --curves-in frequency is the quantity in which the branch is followed already: choose another");
    assert_snapshot!(complaint(here(), 2, &with("beta2")), @"resonarm: --curves-in beta2: there is no parameter `beta2` in this structure: expected one of link1.length_m, link1.mass_kg, link1.centre_of_mass_m, link1.centre_of_mass_off_m, link1.inertia_kg_m2, link1.angle_deg, link1.stiffness_nm_rad, link1.damping_nm_s_rad, link2.length_m, link2.mass_kg, link2.centre_of_mass_m, link2.centre_of_mass_off_m, link2.inertia_kg_m2, link2.angle_deg, link2.stiffness_nm_rad, link2.damping_nm_s_rad, gravity_m_s2; or frequency, or amplitude");
}

/// A disk that is full, here a limit of the size of files: nothing is left under a name that promises a whole file.
#[test]
fn a_full_disk_leaves_no_half_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["run", "--mode", "free", "--duration-s", "1", "--record", "run.mcap"];
    assert_eq!(resonarm(folder.path(), &run).code, 0);
    let commands: [&[&str]; 5] = [
        &["export", "run.mcap", "--to", "csv", "--out", "out"],
        &["inspect", "run.mcap", "--plot", "seen"],
        &["continue", "--drive", "joint1=60", "--from-hz", "21", "--to-hz", "23", "--plot", "branch"],
        &["cut", "run.mcap", "part.mcap", "--to-s", "0.9"],
        &["quickstart", "bench"],
    ];
    for command in commands {
        // Blocks of 512 bytes.
        let limited = "trap '' XFSZ; ulimit -f 16; exec \"$0\" \"$@\"";
        let mut shell = Command::new("sh");
        shell.args(["-c", limited, env!("CARGO_BIN_EXE_resonarm")]).args(command).current_dir(folder.path());
        let output = shell.output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{command:?}: {said}");
        assert!(said.contains("can't write") && said.contains("File too large"), "{command:?}: {said}");
        for entry in fs::read_dir(folder.path()).unwrap() {
            let entry = entry.unwrap();
            let (name, length) = (entry.file_name().into_string().unwrap(), entry.metadata().unwrap().len());
            assert!(name == "run.mcap" || length < 8192, "{command:?}: {name} has {length} bytes");
            assert!(!name.ends_with(".part"), "{command:?}: {name}");
        }
    }
    assert!(fs::read_dir(folder.path().join("bench")).map_or(true, |mut left| left.next().is_none()));
}
