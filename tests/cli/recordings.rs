//! Recordings that can't be written or read, and reports on those that are incomplete or wrong.

use std::fs::{self, OpenOptions};
use std::path::Path;

use insta::assert_snapshot;
use resonarm::recording::{Event, Options, Record, Recorder, Recording};
use resonarm::structure::States;

use crate::{complaint, document, resonarm};

/// Long enough for more than one chunk: in virtual time there is one every 1000 samples.
const RUN: [&str; 7] = ["run", "--mode", "free", "--duration-s", "2.5", "--record", "run.mcap"];

/// A folder with the recording of a run.
fn recorded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(resonarm(folder.path(), &RUN).code, 0);
    folder
}

#[test]
fn a_folder_that_does_not_exist_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["run", "--mode", "free", "--duration-s", "0.5", "--record", "no/such/folder/run.mcap"];
    assert_snapshot!(complaint(folder.path(), 2, &run), @"resonarm: can't create recording `no/such/folder/run.mcap`: No such file or directory (os error 2); name a file in a directory that exists and is writable");
}

#[test]
fn an_existing_recording_is_kept_without_overwrite() {
    let folder = recorded();
    let path = folder.path().join("run.mcap");
    let before = fs::read(&path).unwrap();
    assert_snapshot!(complaint(folder.path(), 2, &RUN), @"resonarm: recording `run.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
    assert_eq!(fs::read(&path).unwrap(), before);
    fs::write(&path, "something else").unwrap();
    assert_eq!(resonarm(folder.path(), &[RUN.as_slice(), &["--overwrite"]].concat()).code, 0);
    // A run in virtual time makes the same bytes each time.
    assert_eq!(fs::read(&path).unwrap(), before);
}

#[test]
fn a_recording_never_replaces_the_scenario() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), "[simulation]\nduration_s = 0.1\n").unwrap();
    // Another spelling of the same file.
    let run = ["run", "--mode", "free", "--scenario", "s.toml", "--record", "./s.toml", "--overwrite"];
    assert_snapshot!(complaint(folder.path(), 2, &run), @"resonarm: ./s.toml can't be written over itself, since this command reads it: name another file for the result");
    assert!(fs::read_to_string(folder.path().join("s.toml")).unwrap().contains("duration_s"));
}

#[test]
fn a_truncated_recording_is_used_as_far_as_it_goes() {
    let folder = recorded();
    let path = folder.path().join("run.mcap");
    let whole = document(folder.path(), 0, &["inspect", "run.mcap", "--json"]);
    assert_eq!(whole["integrity"]["state"], "complete");
    let length = fs::metadata(&path).unwrap().len();
    OpenOptions::new().write(true).open(&path).unwrap().set_len(length * 3 / 4).unwrap();

    let cut = document(folder.path(), 1, &["inspect", "run.mcap", "--json"]);
    assert_eq!(cut["integrity"]["state"], "truncated");
    let states = cut["topics"]["/plant/steps"]["records"].as_u64().unwrap();
    // At least the first chunk is left, and at least one is lost.
    assert!((1000..2500).contains(&states), "{states}");
    let resim = resonarm(folder.path(), &["resim", "run.mcap"]);
    let note = resim.stdout.lines().next().unwrap_or_default().to_string() + "\n";
    assert_eq!((resim.code, resim.stdout), (1, format!("{note}identical: {states} samples, bit for bit\n")));
    assert!(note.starts_with("the recording is truncated: "), "{note}");

    let recovered = resonarm(folder.path(), &["recover", "run.mcap", "whole.mcap"]);
    assert_eq!((recovered.code, recovered.stderr.as_str()), (0, ""));
    assert!(recovered.stdout.starts_with("the recording is truncated: "), "{}", recovered.stdout);
    let repaired = document(folder.path(), 1, &["inspect", "whole.mcap", "--json"]);
    assert_eq!((&repaired["integrity"]["state"], &repaired["topics"]), (&"unfinished".into(), &cut["topics"]));
    let resim = resonarm(folder.path(), &["resim", "whole.mcap"]);
    let note = "the recording was recovered from a truncated or damaged one\n";
    assert_eq!((resim.code, resim.stdout), (1, format!("{note}identical: {states} samples, bit for bit\n")));
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "run.mcap", "whole.mcap"]), @"resonarm: recording `whole.mcap` already exists: name another file, or allow overwriting it (--overwrite)");
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "whole.mcap", "again.mcap"]), @"resonarm: recording `whole.mcap` is whole: there is nothing to recover");
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "run.mcap", "run.mcap"]), @"resonarm: recording `run.mcap` can't be written over itself: name another file for the result");
    let again = document(folder.path(), 0, &["recover", "run.mcap", "whole.mcap", "--overwrite", "--json"]);
    assert_eq!(again["source"], cut["integrity"]);
}

#[test]
fn files_that_are_no_recordings() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("notes.txt"), "no recording").unwrap();
    for command in [["inspect", "notes.txt"].as_slice(), &["resim", "notes.txt"], &["recover", "notes.txt", "new.mcap"]]
    {
        assert_eq!(
            complaint(folder.path(), 2, command),
            "resonarm: `notes.txt` is not an MCAP file: it begins with `no recor`\n"
        );
    }
    assert_snapshot!(complaint(folder.path(), 2, &["resim", "none.mcap"]), @"resonarm: can't read recording `none.mcap`: No such file or directory (os error 2)");
    assert_snapshot!(complaint(folder.path(), 2, &["replay", "none.mcap", "--bus", "vcan0"]), @"resonarm: can't read recording `none.mcap`: No such file or directory (os error 2)");
}

/// A copy of the recording with one state off by one unit in the last place.
fn alter(from: &Path, to: &Path, sample: u64) {
    let recording = Recording::open(from).unwrap();
    let options = Options::virtual_time(recording.origin().dt_s, "none");
    let recorder = Recorder::create(to, recording.configuration(), options).unwrap();
    let mut channel = recorder.channel("plant", 1024).unwrap();
    for record in recording.states().unwrap() {
        let mut record = record.unwrap();
        if record.sample == sample {
            let mut moving = record.states.moving().to_vec();
            // The next number of 64 bits: no smaller difference exists.
            moving[0] = moving[0].next_up();
            record.states = States::new(&moving, &[]).unwrap();
        }
        channel.push_blocking(&Record::State(record)).unwrap();
    }
    recorder.finish(&[]).unwrap();
}

#[test]
fn a_state_that_is_off_by_a_bit_is_found() {
    let folder = recorded();
    alter(&folder.path().join("run.mcap"), &folder.path().join("altered.mcap"), 321);
    let verdict = document(folder.path(), 1, &["resim", "altered.mcap", "--json"]);
    assert_eq!((&verdict["identical"], &verdict["first_divergence"]), (&false.into(), &321.into()));
    let drift_rad = verdict["max_drift_rad"].as_f64().unwrap();
    assert!(drift_rad > 0.0 && drift_rad < 1e-15, "{drift_rad:e}");
    let said = resonarm(folder.path(), &["resim", "altered.mcap"]);
    assert_eq!(said.code, 1);
    assert!(said.stdout.starts_with("differs from sample 321 on; "), "{}", said.stdout);
}

/// Runs the program with files limited to 32 KiB, which acts like a full disk.
fn with_little_space(folder: &Path, arguments: &str) -> std::process::Output {
    // dash counts blocks of 512 bytes, so 64 of them are 32 KiB.
    let script = format!("ulimit -f 64; exec \"$0\" {arguments}");
    let program = env!("CARGO_BIN_EXE_resonarm");
    std::process::Command::new("dash").args(["-c", &script, program]).current_dir(folder).output().unwrap()
}

#[test]
fn a_full_disk_is_reported_and_existing_files_are_kept() {
    let folder = recorded();
    let run = with_little_space(folder.path(), "run --mode free --duration-s 2.5 --record full.mcap");
    let said = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{said}");
    let cause = "can't write recording `full.mcap`: File too large";
    assert!(said.contains(&format!("ERROR the recording failed: {cause}")), "{said}");
    assert!(said.contains(&format!("resonarm: the recording lacks the end of the run: {cause}")), "{said}");
    // The run continued to its end, and the records flushed before can be read.
    let done = String::from_utf8(run.stdout).unwrap();
    assert!(done.starts_with("samples      2501,"), "{done}");
    let kept = document(folder.path(), 1, &["inspect", "full.mcap", "--json"]);
    assert_eq!(kept["integrity"]["state"], "truncated");

    fs::write(folder.path().join("other.mcap"), "something else").unwrap();
    // Payloads that look random: others would be compressed to less than the limit.
    let log = (1..5000_u64).map(|n| format!("({}.5) can0 123#{:016X}\n", n, n.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
    fs::write(folder.path().join("can0.log"), log.collect::<String>()).unwrap();
    for command in ["cut run.mcap", "import can0.log", "recover damaged.mcap"] {
        fs::copy(folder.path().join("run.mcap"), folder.path().join("damaged.mcap")).unwrap();
        damage(&folder.path().join("damaged.mcap"), 1);
        let ended = with_little_space(folder.path(), &format!("{command} other.mcap --overwrite"));
        assert_eq!(ended.status.code(), Some(3), "{command}: {}", String::from_utf8_lossy(&ended.stderr));
        assert_eq!(fs::read(folder.path().join("other.mcap")).unwrap(), b"something else", "{command}");
        let ended = with_little_space(folder.path(), &format!("{command} new.mcap"));
        assert_eq!(ended.status.code(), Some(3), "{command}: {}", String::from_utf8_lossy(&ended.stderr));
        // run.mcap, full.mcap, other.mcap, can0.log and damaged.mcap.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 5, "{command}: a partial file is left");
    }
}

/// The byte ranges of the chunks' records in a recording.
fn chunks(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    const CHUNK: u8 = 0x06; // MCAP specification, "Chunk"
    let (mut chunks, mut offset) = (Vec::new(), mcap::MAGIC.len());
    // A record has a byte for its kind and eight for its length.
    while offset + 9 <= bytes.len() {
        let length = u64::from_le_bytes(bytes[offset + 1..offset + 9].try_into().unwrap());
        let end = offset + 9 + usize::try_from(length).unwrap();
        if bytes[offset] == CHUNK {
            chunks.push(offset..end);
        }
        offset = end;
    }
    chunks
}

/// Changes a byte in the middle of one chunk of the recording.
fn damage(path: &Path, chunk: usize) {
    let mut bytes = fs::read(path).unwrap();
    let place = chunks(&bytes)[chunk].clone();
    bytes[(place.start + place.end) / 2] ^= 0x10;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_hard_link_is_not_overwritten_with_what_is_recovered_from_it() {
    let folder = recorded();
    let (path, link) = (folder.path().join("run.mcap"), folder.path().join("link.mcap"));
    damage(&path, 1);
    fs::hard_link(&path, &link).unwrap();
    let before = fs::read(&path).unwrap();
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "run.mcap", "link.mcap", "--overwrite"]), @"resonarm: recording `run.mcap` can't be written over itself: name another file for the result");
    assert!(fs::read(&path).unwrap() == before && fs::read(&link).unwrap() == before);
}

#[test]
fn recovery_continues_after_a_damaged_chunk_and_lists_the_gap() {
    let folder = recorded();
    let path = folder.path().join("run.mcap");
    damage(&path, 1);
    let recovered = document(folder.path(), 0, &["recover", "run.mcap", "repaired.mcap", "--json"]);
    assert_eq!(recovered["lost_chunks"].as_array().unwrap().len(), 1, "{recovered:#}");
    assert_eq!(recovered["missing_samples"], serde_json::json!([{ "first": 1000, "last": 1999 }]));
    let repaired = document(folder.path(), 1, &["inspect", "repaired.mcap", "--json"]);
    assert_eq!(repaired["integrity"]["state"], "unfinished");
    // The samples still go from the first to the last.
    assert_eq!((&repaired["samples"][0], &repaired["samples"][1]), (&0.into(), &2500.into()));
    assert_eq!(repaired["topics"]["/plant/steps"]["gaps"], 1);
    let said = resonarm(folder.path(), &["recover", "run.mcap", "again.mcap"]);
    assert!(said.stdout.contains("are lost, which states log times from 0.740 to 1.730 s: "), "{}", said.stdout);
    assert!(said.stdout.contains("samples 1000 to 1999 are lost"), "{}", said.stdout);
}

#[test]
fn recovery_of_nothing_is_an_error() {
    let folder = recorded();
    let path = folder.path().join("run.mcap");
    let first = chunks(&fs::read(&path).unwrap())[0].clone();
    // One byte less than the first chunk, so that no chunk can be read.
    OpenOptions::new().write(true).open(&path).unwrap().set_len(first.end as u64 - 1).unwrap();
    let said = complaint(folder.path(), 1, &["recover", "run.mcap", "repaired.mcap"]);
    assert!(said.contains("nothing of recording `run.mcap` could be recovered"), "{said}");
    assert!(!folder.path().join("repaired.mcap").exists());
}

#[test]
fn a_damaged_recording_is_never_called_identical() {
    let folder = recorded();
    damage(&folder.path().join("run.mcap"), 1);
    let verdict = document(folder.path(), 1, &["resim", "run.mcap", "--json"]);
    assert_eq!((&verdict["identical"], &verdict["integrity"]["state"]), (&false.into(), &"damaged".into()));
    let said = resonarm(folder.path(), &["resim", "run.mcap"]);
    assert_eq!(said.code, 1);
    assert!(said.stdout.contains("the recording is damaged"), "{}", said.stdout);
}

#[test]
fn a_recording_is_judged_by_the_configuration_it_states() {
    let folder = recorded();
    let recording = Recording::open(folder.path().join("run.mcap")).unwrap();
    let scenario = recording.configuration().get("scenario").unwrap();
    let tampered = [
        ("steps_per_sample = 2", "steps_per_sample = 4000000"),
        ("rate_hz = 1000.0", "rate_hz = 500.0"),
        ("force_limit_n = 100.0", "force_limit_n = 1e-3"),
    ];
    let mut said = Vec::new();
    for (stated, other) in tampered {
        assert!(scenario.contains(stated), "{scenario}");
        let configuration = recording.configuration().clone().with("scenario", scenario.replace(stated, other));
        let path = folder.path().join("tampered.mcap");
        let options =
            Options { existing: resonarm::recording::Existing::Overwrite, ..Options::virtual_time(1e-3, "none") };
        let recorder = Recorder::create(path, &configuration, options).unwrap();
        let mut channel = recorder.channel("plant", 1024).unwrap();
        recording.states().unwrap().for_each(|record| channel.push_blocking(&Record::State(record.unwrap())).unwrap());
        recorder.finish(&[]).unwrap();
        said.push(complaint(folder.path(), 2, &["resim", "tampered.mcap", "--json"]));
    }
    assert_snapshot!(said[0], @"resonarm: the recording's scenario describes no valid plant: `steps_per_sample` is 4000000: it must be even, since the instruments sample in the middle, and from 2 to 1000");
    assert_snapshot!(said[1], @"resonarm: the sample period is 0.001 s in the recording, but 0.002 s in its scenario (simulation.rate_hz), so the run can't be re-simulated");
    assert!(
        said[2].contains(" N, beyond the limits of the exciter in the scenario (rig.exciter: 0.001 N, 1600 N·m)"),
        "{said:?}"
    );
}

#[test]
fn an_mcap_file_of_another_program_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = mcap::WriteOptions::new()
        .use_chunks(false)
        .library("somebody's recorder")
        .create(std::io::Cursor::new(Vec::new()))
        .unwrap();
    let channel = writer.add_channel(0, "/chatter", "json", &[].into()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    fs::write(folder.path().join("other.mcap"), writer.into_inner().into_inner()).unwrap();
    for command in
        [["inspect", "other.mcap"].as_slice(), &["resim", "other.mcap"], &["recover", "other.mcap", "a.mcap"]]
    {
        assert_eq!(
            complaint(folder.path(), 2, command),
            "resonarm: `other.mcap` is an MCAP file without metadata `resonarm.recording`: it was not recorded by resonarm, \
             but by `somebody's recorder`\n"
        );
    }
}

#[test]
fn a_fault_is_reported() {
    let folder = recorded();
    let whole = document(folder.path(), 0, &["inspect", "run.mcap", "--json"]);
    assert_eq!(whole["faults"], serde_json::json!([]));
    let recorder = Recorder::create(
        folder.path().join("fault.mcap"),
        Recording::open(folder.path().join("run.mcap")).unwrap().configuration(),
        Options::virtual_time(1e-3, "none"),
    )
    .unwrap();
    let mut channel = recorder.channel("plant", 1024).unwrap();
    for (name, value) in [("emergency", 2), ("state.fault", 0)] {
        channel.push_blocking(&Record::Event(Event { sample: 1234, time_ns: 1_234_000_000, name, value })).unwrap();
    }
    recorder.finish(&[]).unwrap();
    let fault = document(folder.path(), 0, &["inspect", "fault.mcap", "--json"]);
    assert_eq!(fault["faults"][0]["sample"], 1234, "{fault:#}");
    let text = resonarm(folder.path(), &["inspect", "fault.mcap"]).stdout;
    let line = text.lines().find(|line| line.starts_with("fault")).unwrap_or_default();
    assert_snapshot!(line, @"fault        code 2 at sample 1234: no sensor data in time");
}

#[test]
fn clipped_readings_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    // Without a resolution a clipped reading is the range itself, in all digits.
    let scenario = "
        rig = { sensors.b = { range_m_s2 = 0.5, resolution_m_s2 = 0.0 } }
        [excitation]
        amplitude = { exciter_x = 300.0 }
        profile = { waveform = 'dwell', frequency_hz = 22.0, duration_s = 0.15, settle_s = 0.05 }
    ";
    fs::write(folder.path().join("small.toml"), scenario).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "small.toml", "--record", "run.mcap"];
    assert_eq!(resonarm(folder.path(), &run).code, 0);
    let summary = document(folder.path(), 0, &["inspect", "run.mcap", "--json"]);
    let (mut clipped, mut samples) = (0, 0);
    for sample in Recording::open(folder.path().join("run.mcap")).unwrap().samples().unwrap() {
        let sample = sample.unwrap();
        let marked = sample.clipped;
        assert_eq!(marked.acceleration_b, sample.acceleration_b_m_s2.map(|value| value.abs() == 0.5), "{sample:?}");
        assert_eq!((marked.acceleration_c, marked.head_force), ([false; 2], [false; 2]));
        clipped += u64::from(marked.any());
        samples += 1;
    }
    assert!((10..samples).contains(&clipped), "{clipped} of {samples}");
    assert_eq!(summary["clipped_samples"], clipped);
    let text = resonarm(folder.path(), &["inspect", "run.mcap"]).stdout;
    assert!(text.contains(&format!("{clipped} samples with a reading beyond the range of its sensor")), "{text}");
}

#[test]
fn the_topics_for_plotting_follow_the_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["run", "--mode", "free", "--scenario", "plot.toml", "--record", "run.mcap", "--overwrite"];
    // 0.3 s, and 50 ms of ramp in addition.
    let scenario = |every: u64| {
        let excitation = "amplitude = { exciter_x = 30.0 }
            profile = { waveform = 'dwell', frequency_hz = 22.0, duration_s = 0.3, settle_s = 0.05 }";
        let text = format!("recording = {{ plot_every_samples = {every} }}\n[excitation]\n{excitation}");
        fs::write(folder.path().join("plot.toml"), text).unwrap();
    };
    // Of 351 samples every seventh, with the first and the last, is 51.
    for (every, messages) in [(0, 0), (1, 351), (7, 51)] {
        scenario(every);
        assert_eq!(resonarm(folder.path(), &run).code, 0);
        let summary = document(folder.path(), 0, &["inspect", "run.mcap", "--json"]);
        assert_eq!(summary["origin"]["plot_every_samples"], every);
        for topic in ["/plant/state", "/plant/command", "/plant/sensors"] {
            assert_eq!(summary["topics"][topic]["messages"], messages, "{topic}, every {every}");
        }
        assert_eq!(summary["topics"]["/plant/samples"]["records"], 351);
    }
    scenario(1001);
    assert_snapshot!(complaint(folder.path(), 2, &run), @"resonarm: recording option `plot_every_samples` is 1001, expected at most 1000");
}

#[test]
fn special_files_are_refused() {
    let folder = recorded();
    assert!(std::process::Command::new("mkfifo").arg(folder.path().join("pipe")).status().unwrap().success());
    fs::create_dir(folder.path().join("folder")).unwrap();
    for (file, kind) in [("pipe", "a named pipe"), ("/dev/zero", "a character device"), ("folder", "a folder")] {
        for command in [["inspect", file].as_slice(), &["resim", file], &["recover", file, "a.mcap"]] {
            let expected = format!("resonarm: can't read recording `{file}`: it is {kind}, expected a regular file\n");
            assert_eq!(complaint(folder.path(), 2, command), expected);
        }
        assert!(complaint(folder.path(), 2, &["replay", file, "--bus", "vcan0"]).contains(kind));
    }
    damage(&folder.path().join("run.mcap"), 1);
    assert_snapshot!(complaint(folder.path(), 2, &["recover", "run.mcap", "/dev/null", "--overwrite"]), @"resonarm: can't create recording `/dev/null`: it is a character device, expected a regular file or none; name a file in a directory that exists and is writable");
}
