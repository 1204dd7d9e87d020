//! Frames explained, one by one.

use super::*;
use resonarm_protocol::FrameFormat;
use resonarm_scenario::WireSection;

const DBC: &str = r#"VERSION ""

BU_: Plant Controller

BO_ 256 Torque: 4 Controller
 SG_ Current : 0|16@1- (1,0) [0|0] "mA" Plant
 SG_ Mode : 16|8@1- (1,0) [0|0] "" Plant
 SG_ Alive : 24|2@1+ (1,0) [0|0] "" Plant

BO_ 128 Halt: 0 Controller

BO_ 512 Angles: 6 Plant
 SG_ Which M : 0|8@1+ (1,0) [0|0] "" Controller
 SG_ Alpha1 m1 : 8|32@1- (1,0) [0|0] "mrad" Controller
 SG_ Other m2 : 8|16@1- (1,0) [0|0] "" Controller
 SG_ Fault : 40|8@1+ (1,0) [0|0] "" Controller

SIG_VALTYPE_ 512 Alpha1 : 1;
VAL_ 256 Mode 1 "on" -1 "off" ;
"#;

const SCENARIO: &str = r#"
[wire]
dbc = "a.dbc"
commands = [{ message = "Torque", torque1_nm = { signal = "Current", constant_per_a = 0.5, gear_ratio = 100 },
              counter = { signal = "Alive" } }]
events = [{ message = "Torque", signal = "Mode", arm = [1], disarm = [-1], require = [1] },
          { message = "Halt", on_frame = "stop" }]

[[wire.readings]]
message = "Angles"
every = 1
on_request = true
signals.Which = { constant = 1 }
signals.Alpha1 = { quantity = "alpha1_rad" }
signals.Fault = { reason = { command-timeout = 3 } }
"#;

fn decoder() -> Decoder {
    let mut scenario = Scenario::parse(SCENARIO, "test").unwrap();
    scenario.wire = scenario.wire.map(|wire| WireSection { text: Some(DBC.to_string()), ..wire });
    Decoder::of_scenario(&scenario).unwrap().unwrap()
}

fn message(decoder: &mut Decoder, frame: &str) -> DecodedMessage {
    match decoder.decode(&frame.parse().unwrap()) {
        Decoded::Message(message) => message,
        other => panic!("{other:?}"),
    }
}

fn meanings(message: &DecodedMessage) -> String {
    let means = message.signals.iter().flat_map(|signal| &signal.means).chain(&message.means);
    means.map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

#[test]
fn loads_and_requests_have_their_meaning() {
    let mut decoder = decoder();
    assert!(decoder.is_mapped());
    let first = message(&mut decoder, "100#E8030100");
    assert_eq!(first.outcome, Outcome::Taken { lost: 0 });
    // 0x03E8 mA are 1 A, times 0.5 N·m/A and a gear of 100.
    assert_eq!(meanings(&first), "load torque1_nm=50; arm; loads count; counter");
    assert_eq!((first.signals[0].unit.as_str(), first.signals[1].text.as_deref()), ("mA", Some("on")));
    assert_eq!(
        meanings(&message(&mut decoder, "100#E8030101")),
        "load torque1_nm=50; arm, unchanged; loads count; counter"
    );
    let off = message(&mut decoder, "100#18FCFF03");
    // The counter goes from 1 to 3, so a frame between them is missing.
    assert_eq!((off.outcome, decoder.lost()), (Outcome::Taken { lost: 1 }, 1));
    assert_eq!(off.signals[1].text.as_deref(), Some("off"));
    assert_eq!(meanings(&message(&mut decoder, "080#")), "stop");
}

/// A rejected frame changes nothing: its value is not the last one.
#[test]
fn what_is_wrong_is_named() {
    let mut decoder = decoder();
    message(&mut decoder, "100#00000100");
    let repeated = message(&mut decoder, "100#0000FF00");
    let Outcome::Refused(fault) = repeated.outcome else { panic!("{:?}", repeated.outcome) };
    assert_eq!((fault.to_string().as_str(), fault.kind()), ("counter 0 was repeated", "counter"));
    assert_eq!(
        meanings(&message(&mut decoder, "100#00000101")),
        "load torque1_nm=0; arm, unchanged; loads count; counter"
    );
    let short = message(&mut decoder, "200#0100");
    assert_eq!(short.outcome.to_owned(), Outcome::Refused(Fault::Short { got: 2, signal: "Alpha1".into() }));
    assert_eq!(short.beyond().map(|signal| signal.name.as_str()).collect::<Vec<_>>(), ["Alpha1", "Fault"]);
    let nan = message(&mut decoder, "200#010000C07F00");
    assert!(matches!(nan.outcome, Outcome::Refused(Fault::NotFinite { .. })), "{:?}", nan.outcome);
}

#[test]
fn readings_are_in_their_si_unit() {
    let mut decoder = decoder();
    // 2 mrad as a floating-point number.
    let angle = message(&mut decoder, "200#010000004003");
    assert_eq!(
        angle.signals.iter().map(|signal| signal.name.as_str()).collect::<Vec<_>>(),
        ["Which", "Alpha1", "Fault"]
    );
    assert_eq!(meanings(&angle), "alpha1_rad=0.002; command-timeout");
    assert_eq!(meanings(&message(&mut decoder, "200#010000000007")), "alpha1_rad=0; no reason");
    // Multiplexed to a signal that is not mapped.
    let other = message(&mut decoder, "200#020500000001");
    assert_eq!((other.outcome.clone(), meanings(&other)), (Outcome::Taken { lost: 0 }, "other".to_string()));
}

#[test]
fn requests_and_other_frames_are_no_messages() {
    let mut decoder = decoder();
    for asks in ["200#R6", "200#"] {
        let expected = Decoded::Request { message: "Angles".into(), is_answered: true };
        assert_eq!(decoder.decode(&asks.parse().unwrap()), expected);
    }
    let remote = decoder.decode(&"100#R4".parse().unwrap());
    assert_eq!(remote, Decoded::Request { message: "Torque".into(), is_answered: false });
    assert_eq!(decoder.decode(&"123#00".parse().unwrap()), Decoded::Foreign);
    let frame: Frame = "100#E8030100".parse().unwrap();
    assert_eq!(frame.format(), FrameFormat::Classic);
    let mut plain = Decoder::new(Database::parse(DBC.as_bytes(), "a.dbc").unwrap());
    let Decoded::Message(found) = plain.decode(&frame) else { panic!() };
    assert_eq!((found.outcome.clone(), meanings(&found), plain.is_mapped()), (Outcome::Unmapped, String::new(), false));
}

/// A CAN FD frame, or one that is longer than its message, is refused by its receiver.
#[test]
fn a_frame_of_another_form_is_refused() {
    let why = |decoder: &mut Decoder, frame| match message(decoder, frame).outcome {
        Outcome::Refused(fault) => fault.to_string(),
        other => panic!("{frame}: {other:?}"),
    };
    let mut mapped = decoder();
    let fd = "it is a CAN FD frame, but the message is a classic CAN frame";
    assert_eq!(why(&mut mapped, "100##1E8030100"), fd);
    assert_eq!(why(&mut mapped, "200##1010000803F00"), fd);
    assert_eq!(why(&mut mapped, "100#E803010000"), "it has 5 bytes, but the message has 4");
    let text = "wire = { preset = 'cia402', drives = [{ node_id = 1, joint = 1, rated_torque_nm = 1.0, \
        encoder_counts_per_turn = 4096 }] }";
    let mut drives = Decoder::of_scenario(&Scenario::parse(text, "test").unwrap()).unwrap().unwrap();
    for frame in ["201##10F00C800", "080##1", "000##10100", "601##14041600000000000"] {
        assert_eq!(why(&mut drives, frame), "expected a classic frame, as CANopen has, got a CAN FD frame");
    }
    assert_eq!(why(&mut drives, "080#0102"), "it has 2 bytes: expected 1");
}
