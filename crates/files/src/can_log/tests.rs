use std::fs;
use std::io::Cursor;

use resonarm_protocol::{FrameFormat, Id};

use super::*;

/// Frames of all formats, a millisecond apart.
fn frames(start_ns: u64) -> Vec<LoggedFrame> {
    let fd = |bit_rate_switch, error_state_indicator| FrameFormat::Fd { bit_rate_switch, error_state_indicator };
    let frames = [
        Frame::classic(Id::Standard(0x201), &[1, 2, 3, 4, 5, 6, 7, 8]),
        Frame::classic(Id::Standard(0), &[]),
        Frame::classic(Id::Extended(0x1FFF_FFFF), &[0xAB]),
        Frame::new(Id::Standard(0x7FF), FrameFormat::Remote, &[0; 5]),
        Frame::new(Id::Standard(0x202), fd(true, false), &[9; 64]),
        Frame::new(Id::Extended(0x123), fd(false, true), &[7; 12]),
        Frame::new(Id::Standard(0x203), fd(false, false), &[1, 2]),
    ];
    let directions = [Some(Direction::Received), Some(Direction::Sent)];
    frames
        .into_iter()
        .zip(directions.into_iter().cycle())
        .enumerate()
        .map(|(index, (frame, direction))| LoggedFrame {
            time_ns: start_ns + 1_234_000 * index as u64,
            interface: None,
            direction,
            frame: frame.unwrap(),
        })
        .collect()
}

fn written(format: LogFormat, frames: &[LoggedFrame]) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut writer = format.writer(&mut out, "vcan0", frames.first().map_or(0, |frame| frame.time_ns));
    frames.iter().for_each(|frame| writer.write(frame).unwrap());
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

/// Returns the frames of a log, and how many lines were no frames.
fn read_text(format: LogFormat, text: &[u8]) -> Result<(Vec<LoggedFrame>, u64), CanLogError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log");
    fs::write(&path, text).unwrap();
    let mut frames = super::read(&path, format)?;
    let found = frames.by_ref().collect::<Result<Vec<_>, _>>();
    match frames.first_unreadable.take() {
        Some(error) => Err(error),
        None => Ok((found?, frames.others)),
    }
}

/// Returns the frames of a log as text, and how many lines or objects can't be read.
fn readable(format: LogFormat, text: &[u8]) -> (Vec<String>, u64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log");
    fs::write(&path, text).unwrap();
    let mut frames = super::read(&path, format).unwrap();
    let found = frames.by_ref().map(|logged| {
        let LoggedFrame { time_ns, interface, frame, .. } = logged.unwrap();
        format!("{} {} {frame}", time_ns % 1_000_000_000_000, interface.unwrap_or_default())
    });
    (found.collect(), frames.unreadable)
}

#[test]
fn written_logs_are_read_back() {
    for start_ns in [0, 1_785_000_000_123_456_000] {
        let frames = frames(start_ns);
        for (format, interface, others) in
            // An ASC log has five lines of head and one at its end that are no frames.
            [(LogFormat::Candump, "vcan0", 0), (LogFormat::Asc, "1", 6), (LogFormat::Blf, "1", 0)]
        {
            let (found, skipped) = read_text(format, &written(format, &frames)).unwrap();
            let interface = Some(String::from(interface));
            let expected: Vec<_> =
                frames.iter().map(|frame| LoggedFrame { interface: interface.clone(), ..frame.clone() }).collect();
            assert_eq!((found, skipped), (expected, others), "{}", format.name());
        }
    }
}

/// A time before the start of the log can't be written.
#[test]
fn a_frame_before_the_start_of_its_log_is_refused() {
    let frames = frames(1_785_000_000_123_456_000);
    for format in [LogFormat::Asc, LogFormat::Blf] {
        let mut out = Cursor::new(Vec::new());
        let mut writer = format.writer(&mut out, "vcan0", frames[1].time_ns);
        let refused = writer.write(&frames[0]).unwrap_err();
        insta::allow_duplicates! {
            insta::assert_snapshot!(refused, @"a frame at 1785000000123456000 ns, earlier than the start of the log, 1785000000124 ms");
        }
    }
}

#[test]
fn a_candump_log_is_one_of_can_utils() {
    let text = String::from_utf8(written(LogFormat::Candump, &frames(12_000_000_000)[3..5])).unwrap();
    let data = "09".repeat(64);
    assert_eq!(text, format!("(12.003702) vcan0 7FF#R5 T\n(12.004936) vcan0 202##1{data} R\n"));
}

#[test]
fn logs_of_other_programs_are_read() {
    let candump = b"(1436509052.249713) vcan0 044#2A366C2BBA\n\n(1436509052.5) can0 20000080#0000000000000000\n";
    let (found, others) = read_text(LogFormat::Candump, candump).unwrap();
    assert_eq!((found.len(), others, found[0].time_ns, found[0].direction), (1, 1, 1_436_509_052_249_713_000, None));
    // From Vector's CANalyzer: times from line to line, decimal numbers, a classical frame on a CAN FD channel.
    let asc = b"date Sat Sep 30 03:06:13 pm 2017\nbase dec  timestamps relative\n// version 9.0.0\n\
        0.100000 1  291             Rx   d 2 17 255  Length = 0 BitCount = 64 ID = 291\n\
        0.200000 CANFD   2 Tx        512x  Name_of_it  0 0 1 1 7   0  0  1000 0 0 0 0 0\n\
        0.000001 CANFD   1 Rx        3   0 0 1 1 7   0  0  0 0 0 0 0 0\n\
        0.5 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n\
        0.5 1  ErrorFrame\n0.5 CANFD 1 Rx ErrorFrame Not Acknowledge error\n";
    let (found, others) = read_text(LogFormat::Asc, asc).unwrap();
    let frames: Vec<_> = found.iter().map(|logged| (logged.time_ns, logged.frame.to_string())).collect();
    let start_ns = 1_506_783_973_000_000_000;
    let expected = [(100_000_000, "123#11FF"), (300_000_000, "00000200##007"), (300_001_000, "003#07")];
    assert_eq!(frames, expected.map(|(time_ns, frame)| (start_ns + time_ns, String::from(frame))));
    assert_eq!(others, 6);
}

/// CANoe writes the names of months in the language of Windows, in its code page, and a trigger block need not state
/// a date.
#[test]
fn dates_of_vectors_tools_are_read_in_german_and_left_out() {
    let times = |head: &[u8]| {
        let has_block = head.to_ascii_lowercase().windows(7).any(|word| word == b"trigger");
        let end: &[u8] = if has_block { b"End TriggerBlock\n" } else { b"" };
        let (found, _) = read_text(LogFormat::Asc, &[head, b"0.5 1 123 Rx d 1 00\n", end].concat()).unwrap();
        found.iter().map(|logged| logged.time_ns / 1_000_000).collect::<Vec<_>>()
    };
    let begun_ms = 1_506_783_973_191;
    assert_eq!(times(b"date Sam Sep 30 15:06:13.191 2017\nBegin Triggerblock\n"), [begun_ms + 500]);
    assert_eq!(times(b"date Sam Sep 30 15:06:13.191 2017\nBegin TriggerBlock \r\n"), [begun_ms + 500]);
    assert_eq!(times(b"begin triggerblock Sat Sep 30 15:06:13.191 2017\n"), [begun_ms + 500]);
    assert_eq!(times(b"Begin Triggerblock\n"), [500]);
    // `date -u -d 'YYYY-MM-DD 01:02:03' +%s`.
    for (text, begun_s) in [
        ("Don M\u{e4}r 5 01:02:03 2020", 1_583_370_123),
        ("Don Mrz 5 01:02:03 2020", 1_583_370_123),
        ("Die Mai 5 01:02:03 2020", 1_588_640_523),
        ("Mon Okt 5 01:02:03 2020", 1_601_859_723),
        ("Sam Dez 5 01:02:03 2020", 1_607_130_123),
    ] {
        let line = format!("date {text}\n");
        assert_eq!(times(line.as_bytes()), [1000 * begun_s + 500], "{text}");
        // In Windows-1252 ä is one byte.
        let line: Vec<u8> = line.chars().map(|letter| letter as u8).collect();
        assert_eq!(times(&line), [1000 * begun_s + 500], "{text}");
    }
    let (found, others) = read_text(LogFormat::Asc, b"// Pr\xfcfstand\n0.5 1 123 Rx d 1 00\n").unwrap();
    assert_eq!((found.len(), others), (1, 1));
}

#[test]
fn errors_name_their_line() {
    let said = |format, text: &[u8]| {
        let error = read_text(format, text).unwrap_err().to_string();
        error.rsplit_once("/log").map(|(_, said)| said.to_owned()).unwrap_or(error)
    };
    let good = "(1.0) can0 123#00\n";
    insta::assert_snapshot!(said(LogFormat::Candump, format!("{good}  can0  123  [1]  00\n{good}").as_bytes()), @", line 2: the line has no time stamp: log with `candump -L`, or with `candump -t a` instead of `candump`");
    insta::assert_snapshot!(said(LogFormat::Candump, b"(-1.0) can0 123#00"), @r#", line 1: "(-1.0)" is not a time in brackets such as (12.345678)"#);
    insta::assert_snapshot!(said(LogFormat::Candump, b"(1.0) can0 123#0"), @", line 1: the data must be pairs of hexadecimal digits");
    insta::assert_snapshot!(said(LogFormat::Asc, b"0.1 1 123 Rx d 3 00 11"), @", line 1: the line is not a frame of an ASC log such as 0.001000 1 201 Rx d 2 11 22");
    insta::assert_snapshot!(said(LogFormat::Asc, b"date today"), @r#", line 1: "today" is not a date such as Sat Sep 30 15:06:13.191 2017"#);
    let head = "0.1 1 201 Rx d 1 00\n   0.2 1  203             ";
    for cut in ["   0.2", "   0.2 1", "   0.2 1  20", "   0.2 1  203             T"] {
        let said = said(LogFormat::Asc, format!("0.1 1 201 Rx d 1 00\n{cut}").as_bytes());
        assert!(said.starts_with(", line 2: the log is cut short: it ends inside this line"), "{cut}: {said}");
    }
    insta::assert_snapshot!(said(LogFormat::Asc, format!("{head}Tx").as_bytes()), @", line 2: the line is not a frame of an ASC log such as 0.001000 1 201 Rx d 2 11 22");
    insta::assert_snapshot!(said(LogFormat::Asc, format!("{head}Tx\n").as_bytes()), @", line 2: the line is not a frame of an ASC log such as 0.001000 1 201 Rx d 2 11 22");
    insta::assert_snapshot!(said(LogFormat::Asc, format!("{head}Tx  d 1 0\n0.3").as_bytes()), @", line 3: the log is cut short: it ends inside this line");
    let whole = "Begin Triggerblock\n0.1 1 201 Rx d 2 11 22\n";
    insta::assert_snapshot!(said(LogFormat::Asc, whole.as_bytes()), @", line 2: the log is cut short: it ends inside a trigger block");
    insta::assert_snapshot!(said(LogFormat::Asc, &whole.as_bytes()[..whole.len() - 2]), @", line 2: the log is cut short: it ends inside a trigger block");
    assert_eq!(read_text(LogFormat::Asc, format!("{whole}End Triggerblock").as_bytes()).unwrap().0.len(), 1);
    insta::assert_snapshot!(said(LogFormat::Candump, &[b'1'; (1 << 20) + 1]), @", line 1: the line is longer than 1048576 bytes");
    insta::assert_snapshot!(said(LogFormat::Asc, b"0.1 1 FFF Rx d 0"), @", line 1: identifier 0xFFF does not fit 11 bits (at most 0x7FF)");
}

/// Only a line that can't be read is lost: in a log that was cut off, and with a raw DLC as `candump -8` writes it.
#[test]
fn odd_lines_are_counted_and_left_out() {
    let log =
        b"(1.0) can0 123#1122334455667788_9\n(1.1) can0 123#R8_C\nhello\n(1.2) can0 20000080#00\n(1.3) can0 101#0";
    let (frames, unreadable) = readable(LogFormat::Candump, log);
    assert_eq!(frames, ["1000000000 can0 123#1122334455667788", "1100000000 can0 123#R8"]);
    assert_eq!(unreadable, 2);
    let asc = b"Begin Triggerblock\n0.1 1 123 Rx d 3 00\n0.2 1 124 Rx d 1 00\n0.3 1 12";
    let (frames, unreadable) = readable(LogFormat::Asc, asc);
    assert_eq!((frames, unreadable), (vec!["200000000 1 124#00".to_string()], 3));
}

/// From the tests of python-can: a time before the start of the log, a frame of 64 bytes whose flags are left out, and a
/// remote frame on a CAN FD channel, which has no bytes.
#[test]
fn frames_of_asc_logs_are_read_that_other_tools_write() {
    let head = "date Thu May 16 06:16:50.884 pm 2024\nbase hex  timestamps absolute\n";
    let long = "A1".to_owned() + &" 00".repeat(63);
    let text = format!(
        "{head}  -0.000105 1  101             Rx   d 2 01 02\n   0.506898 CANFD   4 Rx        4EE      0 1 f 64 {long} \
         1331984 11 0 46500250 460a0250 20011736 20010205\n   0.600000 CANFD   3 Tx     50005x     0 1 5 0 140000 73 \
         200050 7a60 46500250 460a0250 20011736 20010205\n"
    );
    let (frames, unreadable) = readable(LogFormat::Asc, text.as_bytes());
    let data = "A1".to_owned() + &"00".repeat(63);
    // The second in which the log begins, modulo a thousand.
    let expected = [
        "410883895000 1 101#0102".to_string(),
        format!("411390898000 4 4EE##2{data}"),
        "411484000000 3 00050005#R5".to_string(),
    ];
    assert_eq!((frames, unreadable), (expected.to_vec(), 0));
    let (frames, unreadable) = readable(LogFormat::Asc, b"  -0.000105 1  101             Rx   d 2 01 02\n");
    assert_eq!((frames.len(), unreadable), (0, 1));
}

/// Written by python-can's issue 1586: an object of 64 bytes by its DLC, of which 8 are valid.
#[test]
fn the_dlc_of_a_blf_object_says_its_length() {
    let (frames, unreadable) = readable(LogFormat::Blf, include_bytes!("blf/valid-bytes.blf"));
    let frames: Vec<&str> = frames.iter().filter_map(|frame| frame.split_once(' ').map(|(_, frame)| frame)).collect();
    let data = "0001020304050607".to_string() + &"00".repeat(56);
    let expected = [
        format!("1 123##0{data}"),
        "1 00000123##1000102030405060708090A0B".to_string(),
        "2 124##0".to_string(),
        "1 00000111#R8".to_string(),
    ];
    assert_eq!((frames, unreadable), (expected.iter().map(String::as_str).collect(), 0));
}

#[test]
fn a_blf_file_states_its_length_and_count() {
    let bytes = written(LogFormat::Blf, &frames(1_785_000_000_123_456_000));
    let number = |at: usize, length: usize| {
        bytes[at..at + length].iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte))
    };
    assert_eq!((&bytes[..4], number(16, 8), number(24, 8), number(32, 4)), (&b"LOGG"[..], bytes.len(), bytes.len(), 7));
}

/// The error of a BLF log, after the name of its file.
fn blf_error(bytes: &[u8]) -> String {
    let error = read_text(LogFormat::Blf, bytes).unwrap_err().to_string();
    error.rsplit_once("/log, ").map(|(_, said)| said.to_owned()).unwrap_or(error)
}

#[test]
fn damage_in_a_blf_log_is_reported() {
    let good = written(LogFormat::Blf, &frames(1_785_000_000_123_456_000)[..2]);
    // The file's head has 144 bytes, the container's 32; two objects of 48 follow.
    let said = |at: usize, bytes: &[u8]| {
        let mut changed = good.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        blf_error(&changed)
    };
    insta::assert_snapshot!(said(0, b"LOGO"), @r#"byte 0: the file is not a BLF log: it begins with "LOGO", expected LOGG"#);
    insta::assert_snapshot!(said(4, &[40]), @"byte 0: an object states a length of 40 bytes, expected 56 to 16777216");
    insta::assert_snapshot!(said(42, &[13]), @"byte 0: the head of the file has the invalid date [2026, 13, 6, 25, 17, 20, 0, 123] (year, month, weekday, day, hour, minute, second, millisecond)");
    insta::assert_snapshot!(said(144, b"LOGG"), @"byte 144: expected an object, which begins with LOBJ");
    insta::assert_snapshot!(said(152, &[15]), @"byte 144: an object states a length of 15 bytes, expected 16 to 16777216");
    insta::assert_snapshot!(said(160, &[1]), @"byte 144: a container has compression method 1, expected 0 (none) or 2 (deflate)");
    insta::assert_snapshot!(said(160, &[2]), @"byte 144: a container can't be inflated: corrupt deflate stream");
    insta::assert_snapshot!(said(168, &[95]), @"byte 144: a container holds 96 bytes, expected 95 as its head states");
    insta::assert_snapshot!(said(176, b"LOB?"), @"byte 144: expected an object, which begins with LOBJ");
    insta::assert_snapshot!(said(180, &[16]), @"byte 144: the head of a frame states a length of 16 bytes, expected at least 32");
    insta::assert_snapshot!(said(182, &[3]), @"byte 144: the head of a frame has version 3, expected 1 or 2");
    insta::assert_snapshot!(said(184, &[40]), @"byte 144: an object of kind 1 has 40 bytes, expected at least 48");
    insta::assert_snapshot!(said(184 + 48, &[49]), @"byte 272: the log ends inside an object, of which the last container has 48 bytes");
    insta::assert_snapshot!(said(192, &[3]), @"byte 144: the time of a frame has unit 3, expected 1 (10 µs) or 2 (1 ns)");
    insta::assert_snapshot!(said(200, &[0xFF; 8]), @"byte 144: a frame is 18446744073709551615 time units after the start of the log, so its time in ns does not fit 64 bits");
    insta::assert_snapshot!(said(212, &[0, 8]), @"byte 144: identifier 0x800 does not fit 11 bits (at most 0x7FF)");
    insta::assert_snapshot!(said(212, &[0, 0, 1]), @"byte 144: identifier 0x10000 does not fit 11 bits, and is not marked as extended");
}

#[test]
fn a_truncated_blf_log_is_reported() {
    let good = written(LogFormat::Blf, &frames(0));
    (0..good.len()).for_each(|length| drop(blf_error(&good[..length])));
    insta::assert_snapshot!(blf_error(&good[..200]), @"byte 0: the log is cut short: it has 200 bytes, expected 716 as its head states");
    // A log that was not finished does not state its length.
    let mut unfinished = good.clone();
    unfinished[16..24].fill(0);
    insta::assert_snapshot!(blf_error(&unfinished[..200]), @"byte 144: the log is cut short: expected 556 more bytes, got 40");
    assert_eq!(read_text(LogFormat::Blf, &unfinished).unwrap().0.len(), 7);
}

proptest::proptest! {
    /// A log with changed bytes yields frames or an error.
    #[test]
    fn no_damage_is_a_panic(changes in proptest::collection::vec((0.0..1.0, proptest::num::u8::ANY), 1..8)) {
        for format in LogFormat::ALL {
            let mut bytes = written(format, &frames(1_785_000_000_123_456_000));
            for (place, byte) in &changes {
                let at = (place * bytes.len() as f64) as usize;
                bytes[at] = *byte;
            }
            let _ = read_text(format, &bytes);
        }
    }
}
