//! Holds `SPEC.md` to the code and to the DBC files: every table and every example.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use can_dbc::{Dbc, Message as DbcMessage, NumericValue, SignalExtendedValueType, ValueType};
use resonarm_protocol::{
    Cycle, DEFAULT_BASE, EmergencyCode, FrameFormat, Hello, MessageKind, Mismatch, Network, Node, NodeState,
    PROTOCOL_VERSION, Profile, Refusal, SamplesPerFrame, StateEvent, Trip, Version,
    bits::{BitRates, IdFormat, Stuffing, bounds},
    dbc, e2e,
    e2e::Protection,
    load::{bits_per_second, share, streams},
    timing,
};

const SPEC: &str = include_str!("../SPEC.md");

/// The text from a heading to the next one.
fn section(heading: &str) -> &'static str {
    let (_, rest) = SPEC.split_once(&format!("\n{heading}\n")).unwrap_or_else(|| panic!("no {heading}"));
    rest.split("\n#").next().unwrap()
}

/// The words of a section, with single spaces between them.
fn words(heading: &str) -> String {
    section(heading).split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The rows of a section's tables, without heads; code marks and spaces taken off.
fn rows(section: &str) -> Vec<Vec<String>> {
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().replace('`', "")).collect();
    let lines: Vec<&str> = section.lines().collect();
    let is_rule = |line: &&str| line.starts_with("| -");
    let heads = lines.windows(2).filter(|pair| is_rule(&pair[1])).map(|pair| pair[0]).collect::<Vec<_>>();
    let is_row = |line: &&&str| line.starts_with('|') && !is_rule(line) && !heads.contains(line);
    lines.iter().filter(is_row).map(|line| cells(line)).collect()
}

fn hex(text: &str) -> u16 {
    u16::from_str_radix(text.trim_start_matches("0x"), 16).unwrap_or_else(|_| panic!("{text}"))
}

fn nanoseconds(text: &str) -> u64 {
    text.strip_suffix(" ms").and_then(|ms| ms.parse::<u64>().ok()).unwrap_or_else(|| panic!("{text}")) * 1_000_000
}

#[test]
fn the_messages_are_those_of_the_code() {
    let rows: Vec<_> = rows(section("## 1. Network")).into_iter().filter(|row| row.len() == 8).collect();
    assert_eq!(rows.len(), MessageKind::COUNT);
    for row in rows {
        let (kind, network) = (common::kind(&row[2]), Network::default());
        let (base, offset) = row[0].split_once(" + ").unwrap();
        let base = if base == "base" { DEFAULT_BASE } else { hex(base) };
        let offset =
            if offset == "id" { network.node_id(kind.sender()).into() } else { offset.parse::<u16>().unwrap() };
        assert_eq!(base + offset, kind.id(network), "{kind}");
        assert_eq!(hex(&row[1]), kind.id(network), "{kind}");
        assert_eq!(row[3], kind.sender().to_string(), "{kind}");
        let bytes = Profile::ALL.map(|profile| match kind.form(profile) {
            None => "–".to_string(),
            Some(form) if form.format == FrameFormat::Classic => form.length.to_string(),
            Some(form) => format!("**{}**", form.length),
        });
        assert_eq!(row[4..6], bytes, "{kind}");
        let cycle = match kind.cycle() {
            Cycle::Sample => "sample".to_string(),
            Cycle::Event => "event".to_string(),
            Cycle::Period { period_ns } => format!("{} ms", period_ns / 1_000_000),
        };
        assert_eq!(row[6], cycle, "{kind}");
        let data_id = kind.data_id(network).map(|id| format!("{id:#06X}").replace("0X", "0x"));
        assert_eq!(row[7], data_id.unwrap_or("none".to_string()));
    }
    let nodes: Vec<_> = rows_of_nodes();
    assert_eq!(nodes, Node::ALL.map(|node| (node.number(), Network::default().node_id(node))));
}

/// Number and default node id of every node.
fn rows_of_nodes() -> Vec<(u8, u8)> {
    let nodes = rows(section("## 1. Network")).into_iter().filter(|row| row.len() == 4);
    nodes.map(|row| (row[1].parse().unwrap(), row[2].parse().unwrap())).collect()
}

#[test]
fn the_layouts_are_those_of_the_dbc() {
    for profile in Profile::ALL {
        let dbc = Dbc::try_from(dbc::text(profile)).unwrap();
        for message in &dbc.messages {
            let kind = common::kind(&message.name);
            let is_fd = kind.form(profile).is_some_and(|form| form.format != FrameFormat::Classic);
            let heading = if is_fd { format!("### {kind}, FD") } else { format!("### {kind}") };
            assert_eq!(rows(section(&heading)), layout(&dbc, message), "{heading}");
        }
    }
}

/// The rows that a message's table must have.
fn layout(dbc: &Dbc, message: &DbcMessage) -> Vec<Vec<String>> {
    let number = |value: NumericValue| match value {
        NumericValue::Uint(value) => value.to_string(),
        NumericValue::Int(value) => value.to_string(),
        NumericValue::Double(value) if value.abs() == f64::from(f32::MAX) => format!("{value:.1e}"),
        NumericValue::Double(value) => value.to_string(),
    };
    let mut signals: Vec<_> =
        message.signals.iter().filter(|signal| !matches!(signal.name.as_str(), "crc" | "counter")).collect();
    signals.sort_by_key(|signal| signal.start_bit);
    let row = |signal: &can_dbc::Signal| {
        let extended = dbc.extended_value_type_for_signal(message.id, &signal.name);
        let sign = match (extended, signal.value_type) {
            (Some(SignalExtendedValueType::IEEEfloat32Bit), _) => 'f',
            (_, ValueType::Signed) => 'i',
            (_, ValueType::Unsigned) => 'u',
        };
        let values = dbc.value_descriptions_for_signal(message.id, &signal.name).unwrap_or_default();
        let names: Vec<String> =
            values.iter().filter(|v| v.id >= 0).map(|v| format!("{} {}", v.id, v.description)).collect();
        let names = if names.is_empty() { String::new() } else { format!(" {}.", names.join(", ")) };
        let comment = dbc.signal_comment(message.id, &signal.name).unwrap();
        let of_this = "the profile's DBC as distributed, at the default identifiers";
        let comment = comment.replace("this file", of_this);
        vec![
            signal.start_bit.to_string(),
            signal.size.to_string(),
            signal.name.clone(),
            format!("{sign}{}", signal.size),
            signal.factor.to_string(),
            format!("{} to {}", number(signal.min), number(signal.max)),
            if signal.unit.is_empty() { "–".to_string() } else { signal.unit.clone() },
            format!("{comment}{names}"),
        ]
    };
    signals.into_iter().map(row).collect()
}

#[test]
fn the_transitions_are_those_of_the_code() {
    let mut stated = Vec::new();
    for row in rows(section("## 5. States")) {
        let state = |name: &str| NodeState::ALL.into_iter().find(|state| state.to_string() == name).unwrap();
        let event = StateEvent::ALL.into_iter().find(|event| format!("{event:?}").to_lowercase() == row[1]).unwrap();
        assert_eq!(state(&row[0]).next(event), Some(state(&row[2])), "{row:?}");
        stated.push((state(&row[0]), event));
    }
    for state in NodeState::ALL {
        for event in StateEvent::ALL {
            assert_eq!(state.next(event).is_some(), stated.contains(&(state, event)), "{state:?} {event:?}");
        }
    }
}

#[test]
fn the_times_are_those_of_the_code() {
    let known = [
        ("HEARTBEAT_PERIOD", timing::HEARTBEAT_PERIOD_NS),
        ("HEARTBEAT_TIMEOUT", timing::HEARTBEAT_TIMEOUT_NS),
        ("HELLO_PERIOD", timing::HELLO_PERIOD_NS),
        ("COMMAND_TIMEOUT", timing::COMMAND_TIMEOUT_NS),
        ("COMMAND_AGE", timing::COMMAND_AGE_NS),
        ("FORCE_RAMP", timing::FORCE_RAMP_NS),
        ("LOCKSTEP_TIMEOUT", timing::LOCKSTEP_TIMEOUT_NS),
        ("LOCKSTEP_LOOK", timing::LOCKSTEP_LOOK_NS),
    ];
    let stated: Vec<(String, u64)> =
        rows(section("## 6. Times")).into_iter().map(|row| (row[0].clone(), nanoseconds(&row[1]))).collect();
    assert_eq!(stated, known.map(|(name, time)| (name.to_string(), time)));
    let total_ms = (timing::COMMAND_TIMEOUT_NS + timing::FORCE_RAMP_NS) / 1_000_000;
    assert!(words("## 8. Running").contains(&format!("zero at most {total_ms} ms and one sample period")));
    assert!(words("## 6. Times").contains(&format!("must be at least {}: two samples", timing::REAL_TIME_RATE_MIN_HZ)));
}

#[test]
fn the_faults_are_those_of_the_code() {
    let rows = rows(section("## 9. Faults"));
    assert_eq!(rows.len(), EmergencyCode::ALL.len());
    for (row, code) in rows.iter().zip(EmergencyCode::ALL) {
        assert_eq!(row[0], (code as u16).to_string());
        assert_eq!(row[1].replace(' ', ""), format!("{code:?}").to_lowercase());
    }
    let details = ["no hello", "major version", "DBC hash", "profile", "rate"];
    let stated: Vec<String> =
        Mismatch::ALL.iter().zip(details).map(|(mismatch, name)| format!("{} {name}", *mismatch as u16)).collect();
    assert_eq!(rows[EmergencyCode::Incompatible as usize - 1][4], stated.join(", "));
    let trips = ["the simulated shaker's stroke, current or voltage", "the travel (section 8)"];
    let stated: Vec<String> =
        Trip::ALL.iter().zip(trips).map(|(trip, name)| format!("{} {name}", *trip as u16)).collect();
    assert_eq!(rows[EmergencyCode::ExciterTripped as usize - 1][4], stated.join(", "));
    for trip in Trip::ALL {
        assert_eq!(Trip::from_detail(trip as u16), Some(trip));
    }
    assert_eq!(Trip::from_detail(2), None);
    for (row, code) in rows.iter().zip(EmergencyCode::ALL) {
        assert_eq!(row[3].starts_with("no fault: "), code.is_notice(), "{code:?}");
    }
}

/// A hello that differs in several things is judged by the first of them.
#[test]
fn the_details_of_a_hello_that_does_not_fit_have_the_order_of_the_code() {
    let own = Hello::new(Profile::Classic, 1000);
    let mut partner = own;
    let mut order = Vec::new();
    for change in [
        (|hello: &mut Hello| hello.rate_hz += 1) as fn(&mut Hello),
        |hello| hello.dbc_hash ^= 1,
        |hello| hello.profile = Profile::Fd,
        |hello| hello.version.major += 1,
    ] {
        change(&mut partner);
        order.insert(0, own.mismatch(&partner).unwrap() as u16);
    }
    order.insert(0, Mismatch::NoHello as u16);
    let order = order.iter().map(u16::to_string).collect::<Vec<_>>().join(", ");
    let text = words("## 9. Faults");
    assert!(text.contains(&format!("the first is reported in the order {order}:")), "{order}");
}

#[test]
fn the_hashes_are_those_of_the_dbc() {
    for (profile, name) in [(Profile::Classic, "resonarm.dbc"), (Profile::Fd, "resonarm-fd.dbc")] {
        let stated = format!("`0x{:06X}` of `{name}`", dbc::hash(profile) & Hello::DBC_HASH_MASK);
        assert!(words("### PlantHello").contains(&stated), "{stated}");
    }
}

#[test]
fn the_reasons_of_refusal_are_those_of_the_code() {
    let reasons = ["not armed", "too old or still to come", "older than the last taken", "the same as the last taken"];
    let limits = ["more than the exciter can produce", "too fast a change of the load", "beyond the travel"];
    let reasons = reasons.iter().chain(&limits);
    let stated: Vec<String> =
        Refusal::ALL.iter().zip(reasons).map(|(refusal, name)| format!("{} {name}", *refusal as u8)).collect();
    assert!(words("## 8. Running").contains(&stated.join(", ")));
    for refusal in Refusal::ALL {
        assert_eq!(Refusal::from_detail(Refusal::detail(7, Some(refusal))), (7, Some(refusal)));
    }
    assert_eq!(Refusal::from_detail(Refusal::detail(1000, Some(Refusal::Late))), (255, Some(Refusal::Late)));
    assert_eq!(Refusal::from_detail(Refusal::detail(0, None)), (0, None));
}

#[test]
fn the_window_of_a_sample_index_is_that_of_the_code() {
    let text = words("## 8. Running");
    assert!(text.contains(&format!(
        "at least {} ({} at 1000 Hz)",
        timing::SAMPLE_WINDOW_MIN,
        timing::sample_window(1000)
    )));
    assert!(text.contains("The tenth repeated or older sample") && timing::STALE_SAMPLES_LIMIT == 10);
    assert!((1..=u16::MAX).all(|rate_hz| timing::sample_window(rate_hz) < 1 << 15));
}

#[test]
fn the_bus_load_is_that_of_the_code() {
    let rows = rows(section("## 10. Bus load"));
    let per_second =
        |rate_hz, stuffing| bits_per_second(streams(Profile::Classic, rate_hz, SamplesPerFrame::One), stuffing).total();
    let bits = |len| {
        [Stuffing::None, Stuffing::Worst]
            .map(|stuffing| bounds(IdFormat::Standard, FrameFormat::Classic, len, stuffing).nominal.to_string())
    };
    assert_eq!((&rows[0][1..], &rows[1][1..]), (&bits(8)[..], &bits(1)[..]));
    for row in &rows[2..5] {
        let rate_hz = row[0].strip_suffix(" Hz").unwrap().parse().unwrap();
        let loads = [Stuffing::None, Stuffing::Worst].map(|stuffing| per_second(rate_hz, stuffing));
        assert_eq!(row[1..3], loads.map(|load| load.to_string()));
        assert_eq!(row[3..5], loads.map(|load| format!("{:.1} %", load as f64 / 1e4)));
    }
    for (kind, name) in [(MessageKind::Force, "a command of 16"), (MessageKind::Sensors, "Sensors of 32")] {
        let form = kind.form(Profile::Fd).unwrap();
        let bits = |stuffing| bounds(IdFormat::Standard, form.format, form.length, stuffing);
        let (least, most) = (bits(Stuffing::None), bits(Stuffing::Worst));
        let text = words("## 10. Bus load");
        assert!(text.contains(name) && text.contains(&format!("{} and {}", most.nominal, most.data)));
        assert!(text.contains(&format!(" {} ", least.nominal)) && text.contains(&format!(" {}", least.data)));
    }
}

/// The highest sample rate, Hz, at which the worst stuffing takes at most this share of a bus.
fn highest_rate_hz(profile: Profile, samples: SamplesPerFrame, rates: BitRates, most: f64) -> u16 {
    let load = |rate_hz| share(bits_per_second(streams(profile, rate_hz, samples), Stuffing::Worst), rates);
    (1..=u16::MAX).take_while(|&rate_hz| load(rate_hz) <= most).last().unwrap()
}

#[test]
fn the_highest_sample_rates_are_those_of_the_code() {
    const KBIT: u32 = 1000;
    let classical = [500, 1000].map(|kbit| (Profile::Classic, BitRates::classical(kbit * KBIT)));
    let fd = [500, 1000].into_iter().flat_map(|nominal| [1000, 2000, 5000, 8000].map(|data| (nominal, data)));
    let fd = fd.map(|(nominal, data)| (Profile::Fd, BitRates { nominal_hz: nominal * KBIT, data_hz: data * KBIT }));
    let kbit = |rate_hz: u32| (rate_hz / KBIT).to_string();
    let expected: Vec<Vec<String>> = classical
        .into_iter()
        .chain(fd)
        .map(|(profile, rates)| {
            let data = if profile == Profile::Fd { kbit(rates.data_hz) } else { "–".to_string() };
            let cells = [SamplesPerFrame::One, SamplesPerFrame::Two].into_iter().flat_map(|samples| {
                let is_there = profile == Profile::Fd || samples == SamplesPerFrame::One;
                [0.8, 1.0].map(|most| match is_there {
                    true => highest_rate_hz(profile, samples, rates, most).to_string(),
                    false => "–".to_string(),
                })
            });
            [profile.name().to_string(), kbit(rates.nominal_hz), data].into_iter().chain(cells).collect()
        })
        .collect();
    let rows = rows(section("## 10. Bus load"));
    let table = expected.iter().map(|row| format!("| {} |", row.join(" | "))).collect::<Vec<_>>().join("\n");
    assert_eq!(rows[5..], expected, "\n{table}\n");
}

#[test]
fn the_protection_is_that_of_the_code() {
    let text = words("## 2. Protection");
    assert!(
        text.contains("data id `0x0123` and a frame of eight zero bytes") && text.contains("give `0xCC` for byte 0")
    );
    assert_eq!(e2e::profile11::crc(0x0123, &[0; 8]), 0xCC);
    assert!(text.contains("data id `0x1234` and eight zero bytes give `0xCA1C`, bytes `1C CA`"));
    assert_eq!(e2e::profile5::crc(0x1234, &[0; 8]).to_le_bytes(), [0x1C, 0xCA]);
    let counters = [Protection::Profile11, Protection::Profile5].map(|p| u16::from(p.counter_max()) + 1);
    let [eleven, five] = counters;
    assert!(text.contains(&format!("n = {eleven} values in Profile 11 and n = {five} in Profile 5")));
    let lost = format!("| 2 to {} | δ − 1 frames were lost |", e2e::MAX_DELTA_COUNTER);
    let wrong = format!("| {} to n − 1 | wrong sequence |", e2e::MAX_DELTA_COUNTER + 1);
    assert!(text.contains(&lost) && text.contains(&wrong));
    let title = format!("# The Resonarm protocol, version {}\n", Version::from_byte(PROTOCOL_VERSION));
    assert!(SPEC.starts_with(&title));
}

#[test]
fn the_examples_are_frames_of_the_code() {
    for (profile, block) in Profile::ALL.into_iter().zip([1, 3]) {
        let mut seen = Vec::new();
        let block = section("## 11. Examples").split("```").nth(block).unwrap();
        for line in block.trim().lines() {
            let mut words = line.split_whitespace();
            let (frame, kind) = (common::frame(words.next().unwrap()), common::kind(words.next().unwrap()));
            let value = |text: &str| text.parse::<f64>().ok().or(text.strip_prefix("0x").map(|_| hex24(text))).unwrap();
            let stated: common::Signals = words
                .filter_map(|word| word.split_once('='))
                .map(|(name, text)| (name.to_string(), value(text)))
                .collect();
            let received = common::accept(profile, &frame).unwrap().unwrap();
            let signals: common::Signals =
                common::signals(&received).into_iter().filter(|(name, _)| stated.contains_key(name)).collect();
            assert_eq!((received.kind(), &signals), (kind, &stated), "{line}");
            assert_eq!(common::first_frame(profile, &received), frame, "{line}");
            seen.push(kind);
        }
        seen.sort();
        seen.dedup();
        let is_hello = |kind| matches!(kind, MessageKind::PlantHello | MessageKind::ExciterHello);
        let own = |kind: &MessageKind| match profile {
            Profile::Classic => kind.form(profile).is_some(),
            Profile::Fd => is_hello(*kind) || kind.form(profile).is_some_and(|form| form.length > 8),
        };
        assert_eq!(seen, MessageKind::ALL.into_iter().filter(own).collect::<Vec<_>>(), "an example of every message");
    }
}

fn hex24(text: &str) -> f64 {
    u32::from_str_radix(text.trim_start_matches("0x"), 16).unwrap_or_else(|_| panic!("{text}")).into()
}
