use resonarm_wire::layout::Number;

use super::*;

fn database(text: &str) -> Database {
    Database::parse(text.as_bytes(), "bench.dbc").unwrap()
}

const BENCH: &str = r#"VERSION ""

BU_: Plant Controller_Of_The_Shaker_0001

BO_ 257 Drive: 8 Controller_Of_The_Shaker_0001
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" Plant
 SG_ Alive : 8|4@1+ (1,0) [0|14] "" Plant
 SG_ Force : 23|16@0- (0.02,0) [-600|600] "N" Plant
 SG_ Mode : 12|2@1+ (1,0) [0|0] "" Plant

BO_ 2566852608 Measurement_With_A_Long_Name_001: 64 Plant
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" Controller_Of_The_Shaker_0001,Logger
 SG_ Acceleration_Of_The_Tip_Along_0001 m0 : 8|32@1- (1,0) [0|0] "m/s^2" Controller_Of_The_Shaker_0001
 SG_ Inner m1M : 8|8@1+ (1,0) [0|0] "" Vector__XXX
 SG_ Deep m3 : 16|64@1- (2,1) [0|0] "" Vector__XXX

BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ Lost : 0|8@1+ (1,0) [0|0] "" Vector__XXX

BO_TX_BU_ 257 : Controller_Of_The_Shaker_0001,Plant;
CM_ BO_ 257 "A comment;
BO_ 1 that looks like a message: 8 Plant";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","reserved","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;
BA_DEF_ SG_ "SystemSignalLongSymbol" STRING ;
BA_DEF_ BU_ "SystemNodeLongSymbol" STRING ;
BA_DEF_DEF_ "GenMsgCycleTime" 100;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "GenMsgCycleTime" BO_ 257 5;
BA_ "VFrameFormat" BO_ 2566852608 15;
BA_ "SystemMessageLongSymbol" BO_ 2566852608 "Measurement_With_A_Long_Name_That_Has_No_End";
BA_ "SystemSignalLongSymbol" SG_ 2566852608 Acceleration_Of_The_Tip_Along_0001 "Acceleration_Of_The_Tip_Along_The_Axis_X";
BA_ "SystemNodeLongSymbol" BU_ Controller_Of_The_Shaker_0001 "Controller_Of_The_Shaker_On_The_Bench";
VAL_ 257 Mode 0 "off" 1 "on" ;
SIG_VALTYPE_ 2566852608 Acceleration_Of_The_Tip_Along_0001 : 1;
SIG_VALTYPE_ 2566852608 Deep : 2;
SIG_VALTYPE_ 257 Nothing : 1;
SG_MUL_VAL_ 2566852608 Acceleration_Of_The_Tip_Along_0001 Page 0-0;
SG_MUL_VAL_ 2566852608 Inner Page 1-1, 5-6;
SG_MUL_VAL_ 2566852608 Deep Inner 3-3;
"#;

#[test]
fn reads_a_file() {
    let database = database(BENCH);
    assert_eq!(database.nodes(), ["Plant", "Controller_Of_The_Shaker_On_The_Bench"]);
    let drive = database.message("Drive").unwrap();
    assert_eq!((drive.id(), drive.format(), drive.length()), (Id::Standard(257), FrameFormat::Classic, 8));
    assert_eq!((drive.cycle_time_ms(), drive.line()), (Some(5.0), 5));
    assert_eq!(drive.senders(), ["Controller_Of_The_Shaker_On_The_Bench", "Plant"]);
    let force = drive.signal("Force").unwrap();
    assert_eq!((force.unit(), force.limits(), force.is_switch()), ("N", Some([-600.0, 600.0]), false));
    assert_eq!(force.wire().range(), [-655.36, 655.34]);
    assert_eq!(drive.signal("Mode").unwrap().values(), [(0, "off".to_string()), (1, "on".to_string())]);
    assert_eq!(drive.signal("Mode").unwrap().limits(), None);

    let measurement = database.message("Measurement_With_A_Long_Name_That_Has_No_End").unwrap();
    assert_eq!(measurement.id(), Id::Extended(0x18FF_1000));
    assert!(measurement.is_fd());
    assert_eq!((measurement.length(), measurement.cycle_time_ms()), (64, Some(100.0)));
    assert_eq!(database.message("Measurement_With_A_Long_Name_001").unwrap().line(), measurement.line());
    assert_eq!(database.message_by_id(measurement.id()).unwrap().name(), measurement.name());
    let acceleration = measurement.signal("Acceleration_Of_The_Tip_Along_The_Axis_X").unwrap();
    assert_eq!(acceleration.wire().layout().number(), Number::Float);
    assert_eq!(acceleration.receivers(), ["Controller_Of_The_Shaker_On_The_Bench"]);
    assert!(measurement.signal("Inner").unwrap().is_switch());
    assert!(measurement.signal("Deep").unwrap().receivers().is_empty());

    let problems = database.problems();
    assert_eq!(problems.len(), 1, "{problems:?}");
    let expected = Problem::NoSuchSignal { statement: "SIG_VALTYPE_" };
    assert_eq!((problems[0].line, &problems[0].problem), (38, &expected));
}

#[test]
fn decodes_and_encodes_whole_messages() {
    let database = database(BENCH);
    let message = database.message("Measurement_With_A_Long_Name_001").unwrap();
    let deep = [("Page", 5.0), ("Inner", 3.0), ("Deep", -7.0)];
    let frame = message.codec().encode(&deep).unwrap();
    assert_eq!(frame.to_string(), format!("18FF1000##1050300000000000010C0{}", "00".repeat(54)));
    assert_eq!(message.codec().decode(frame.data()).collect::<Vec<_>>(), deep);
    assert_eq!(message.codec().decode(&frame.data()[..9]).collect::<Vec<_>>(), deep[..2]);

    let refused = |values: &[(&str, f64)]| message.codec().encode(values).unwrap_err().to_string();
    insta::assert_snapshot!(refused(&[("Page", 5.0), ("Inner", 3.0)]), @"message Measurement_With_A_Long_Name_That_Has_No_End: its signal Deep needs a value");
    insta::assert_snapshot!(refused(&[("Page", 0.0), ("Inner", 3.0)]), @"message Measurement_With_A_Long_Name_That_Has_No_End: its signal Acceleration_Of_The_Tip_Along_The_Axis_X needs a value");
    insta::assert_snapshot!(refused(&[("Page", 2.0), ("Deep", 3.0)]), @"message Measurement_With_A_Long_Name_That_Has_No_End has no signal Deep with these values of its switches: leave its value out");
    insta::assert_snapshot!(refused(&[("Page", 0.0), ("Page", 0.0)]), @"signal Page of Measurement_With_A_Long_Name_That_Has_No_End has two values: give one");
    insta::assert_snapshot!(refused(&[("Page", 256.0)]), @"signal Page of Measurement_With_A_Long_Name_That_Has_No_End: 256 is outside of 0 to 255, the range of its bits");
    insta::assert_snapshot!(refused(&[("Pages", 1.0)]), @r#"
    bench.dbc, line 11: message Measurement_With_A_Long_Name_That_Has_No_End has no signal "Pages"
    Did you mean "Page"?
    "#);
}

/// A file with every problem of a message or a signal.
const WRONG: &str = r#"VERSION ""
BU_: A
BO_ 273874944 TooLarge: 8 A
 SG_ a : 0|8@1+ (1,0) [0|0] "" A
BO_ 4294967295 Beyond29: 8 A
BO_ 1 TwinOne: 8 A
BO_ 1 TwinTwo: 8 A
BO_ 2 Name: 8 A
BO_ 3 Name: 8 A
BO_ 4 NineBytes: 9 A
BO_ 5 NoFdLength: 9 A
BO_ 6 NoFormat: 8 A
BO_ 7 Signals: 8 A
 SG_ fine : 0|8@1+ (1,0) [0|0] "" A
 SG_ past : 60|8@1+ (1,0) [0|0] "" A
 SG_ none : 8|0@1+ (1,0) [0|0] "" A
 SG_ wide : 0|65@1+ (1,0) [0|0] "" A
 SG_ zero : 8|1@1+ (0,0) [0|0] "" A
 SG_ infinite : 9|1@1+ (1e400,0) [0|0] "" A
 SG_ half : 16|16@1- (1,0) [0|0] "" A
 SG_ one : 32|8@1+ (1,0) [0|0] "" A
 SG_ two : 39|2@0+ (1,0) [0|0] "" A
 SG_ twice : 40|1@1+ (1,0) [0|0] "" A
 SG_ twice : 41|1@1+ (1,0) [0|0] "" A
 SG_ selected m1 : 42|1@1+ (1,0) [0|0] "" A
BO_ 8 Wide: 8 A
 SG_ all : 0|64@1+ (1,0) [0|0] "" A
BO_ 9 Switches: 8 A
 SG_ first M : 0|8@1+ (1,0) [0|0] "" A
 SG_ second M : 8|8@1+ (1,0) [0|0] "" A
 SG_ either m1 : 16|8@1+ (1,0) [0|0] "" A
 SG_ named m1 : 24|8@1+ (1,0) [0|0] "" A
 SG_ round m1M : 32|8@1+ (1,0) [0|0] "" A
 SG_ beyond m300 : 40|8@1+ (1,0) [0|0] "" A
 SG_ marked m2 : 48|8@1+ (1,0) [0|0] "" A
 SG_ plain m1 : 56|8@1+ (1,0) [0|0] "" A
BO_ 10 Outside: 1 A
 SG_ switch M : 4|8@1+ (1,0) [0|0] "" A
 SG_ after m1 : 0|4@1+ (1,0) [0|0] "" A
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","StandardCAN_FD","new";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 5 2;
BA_ "VFrameFormat" BO_ 6 "new";
SIG_VALTYPE_ 7 half : 1;
SG_MUL_VAL_ 9 named nothing 1-1;
SG_MUL_VAL_ 9 round round 1-1;
SG_MUL_VAL_ 9 beyond first 300-301;
SG_MUL_VAL_ 9 marked first 3-4;
SG_MUL_VAL_ 9 plain marked 1-1;
"#;

#[test]
fn what_is_wrong_is_an_error_if_it_is_asked_for() {
    let database = database(WRONG);
    assert!(database.message("Signals").unwrap().signal("fine").is_ok());
    let messages: Vec<String> = database
        .problems()
        .iter()
        .map(|found| match &found.signal {
            None => database.message(&found.message).unwrap_err().to_string(),
            Some(signal) => database.message(&found.message).unwrap().signal(signal).unwrap_err().to_string(),
        })
        .collect();
    insta::assert_snapshot!(messages.join("\n"), @r#"
    bench.dbc, line 3: message TooLarge: identifier 273874944 does not fit 11 bits: with 29 bits it is written as 2421358592, with bit 31
    bench.dbc, line 5: message Beyond29: identifier 4294967295 does not fit 29 bits, which are written with bit 31
    bench.dbc, line 6: message TwinOne: its identifier is also that of TwinTwo in line 7
    bench.dbc, line 7: message TwinTwo: its identifier is also that of TwinOne in line 6
    bench.dbc, line 8: message Name: its name is also used in line 9
    bench.dbc, line 8: message Name: its name is also used in line 9
    bench.dbc, line 10: message NineBytes: its length is 9 bytes: a classical frame has 0 to 8; if it is CAN FD, its attribute VFrameFormat has to be StandardCAN_FD or ExtendedCAN_FD
    bench.dbc, line 11: message NoFdLength: its length is 9 bytes: CAN FD has 0 to 8, 12, 16, 20, 24, 32, 48 or 64
    bench.dbc, line 12: message NoFormat: its VFrameFormat is new: it must be StandardCAN (0), ExtendedCAN (1), J1939PG (3), StandardCAN_FD (14) or ExtendedCAN_FD (15)
    bench.dbc, line 15: signal past of Signals: from start bit 60 its 8 bits take 9 bytes, but the payload has only 8
    bench.dbc, line 16: signal none of Signals: it has 0 bits: it must have 1 to 64
    bench.dbc, line 17: signal wide of Signals: it has 65 bits: it must have 1 to 64
    bench.dbc, line 18: signal zero of Signals: its factor is 0: it must be a finite number other than 0
    bench.dbc, line 19: signal infinite of Signals: its factor is inf: it must be a finite number other than 0
    bench.dbc, line 20: signal half of Signals: SIG_VALTYPE_ states 32 bits, but it has 16
    bench.dbc, line 21: signal one of Signals: bit 38 also belongs to two, in line 22
    bench.dbc, line 22: signal two of Signals: bit 38 also belongs to one, in line 21
    bench.dbc, line 23: signal twice of Signals: its name is also used in line 24
    bench.dbc, line 23: signal twice of Signals: its name is also used in line 24
    bench.dbc, line 25: signal selected of Signals: it is multiplexed, but the message has no switch, a signal marked M
    bench.dbc, line 27: signal all of Wide: it is an integer of 64 bits: it must have at most 53, which a floating-point number represents exactly
    bench.dbc, line 31: signal either of Switches: it is multiplexed, but the message has several switches: SG_MUL_VAL_ must say which one selects it
    bench.dbc, line 32: signal named of Switches: its switch "nothing" is not a signal of the message
    bench.dbc, line 33: signal round of Switches: its switches select each other in a circle
    bench.dbc, line 34: signal beyond of Switches: the switch can't be 300: it must be at most 255
    bench.dbc, line 38: signal switch of Outside: from start bit 4 its 8 bits take 2 bytes, but the payload has only 1
    bench.dbc, line 39: signal after of Outside: its switch switch can't be used: from start bit 4 its 8 bits take 2 bytes, but the payload has only 1
    "#);
}

/// A file that breaks rules of the format, but has one value in a payload all the same: foxBMS's file goes on in the
/// next line, opendbc has integers of 64 bits, signals that share bits, long messages without `VFrameFormat` and nodes
/// that only messages name, canmatrix's files quotes inside of texts.
const READABLE: &str = r#"BU_: Listed
BO_ 256 Shared: 8 Sender
 SG_ Byte : 0|8@1+ (1,0) [0|0] "" Listed
 SG_ Flag : 3|1@1+ (1,0) [0|0] "" Listed
 SG_ Other : 8|8@1+ (5.,-.5) [0|0] "" Listed
BO_ 257 Large: 64 Vector__XXX
 SG_ Stamp : 0|64@1+ (1e-6,0) [0|0] "s" Listed
 SG_ Serial : 64|64@1+ (1,0) [0|0] "" Listed
 SG_ Signed : 128|60@1- (-2,1) [0|0] "" Listed
BO_ 258 Page: 3 Vector__XXX
 SG_ Switch : 0|8@1+ (1,0) [0|0] "" Listed
 SG_ Value m1 : 8|8@1+ (1,0) [0|0] "" Listed
 SG_ Value m2 : 16|8@1+ (1,0) [0|0] "" Listed
BO_ 259 Twice: 1 Vector__XXX
 SG_ First : 0|8@1+ (1,0) [0|0] "" Listed
BO_ 260 Twice: 9 Vector__XXX
 SG_ Second : 64|8@1+ (1,0) [0|0] "" Listed
BO_TX_BU_ 259 : Further;
VAL_ 256 Other 0 "zero" 1 "a \"quoted\" one"
2 "two" ;
VAL_ 257 Serial 18446744073709551615 "none" ;
SG_MUL_VAL_ 258 Value Switch 3-4;
"#;

#[test]
fn what_can_be_read_is_read() {
    let database = database(READABLE);
    assert_eq!(database.nodes(), ["Listed", "Sender", "Further"]);
    let decoded = |id: u16, payload: &[u8]| -> Vec<(String, f64)> {
        let message = database.message_by_id(Id::Standard(id)).unwrap();
        message.codec().decode(payload).map(|(name, value)| (name.to_string(), value)).collect()
    };
    let named =
        |values: &[(&str, f64)]| values.iter().map(|(name, value)| (name.to_string(), *value)).collect::<Vec<_>>();
    assert_eq!(decoded(256, &[9, 1]), named(&[("Byte", 9.0), ("Flag", 1.0), ("Other", 4.5)]));
    let shared = database.message("Shared").unwrap();
    let text = |raw| shared.signal("Other").unwrap().text(&[0, raw]).map(str::to_string);
    assert_eq!((text(1), text(2), text(3)), (Some("a \"quoted\" one".to_string()), Some("two".to_string()), None));
    // `SG_MUL_VAL_` decides over the marks.
    assert_eq!(decoded(258, &[1, 5, 6]), named(&[("Switch", 1.0)]));
    assert_eq!(decoded(258, &[3, 5, 6]), named(&[("Switch", 3.0), ("Value", 5.0), ("Value", 6.0)]));
    assert_eq!(decoded(259, &[1]), named(&[("First", 1.0)]));
    assert_eq!(decoded(260, &[0, 0, 0, 0, 0, 0, 0, 0, 7]), named(&[("Second", 7.0)]));

    let large = database.message("Large").unwrap();
    assert!(large.is_fd());
    let payload = [[1, 2, 3, 4, 5, 6, 7, 8], [0xFF; 8], [0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]].concat();
    let of: Vec<_> = large.signals().map(|signal| (signal.raw(&payload), signal.large_integer(&payload))).collect();
    let serial = i128::from(u64::MAX);
    assert_eq!(of, [(Some(578_437_695_752_307_201), None), (Some(serial), Some(serial)), (Some(-2), Some(5))]);
    let stamp = large.signals().next().unwrap().decode(&payload).unwrap();
    assert!((stamp - 578_437_695_752.307_2).abs() < 1e-3, "{stamp}");
    assert_eq!(large.signals().nth(1).unwrap().text(&payload), Some("none"));
}

/// Signals that share bits, are rounded, or have an ambiguous name must not become a load or be written.
#[test]
fn what_can_only_be_read_is_refused_by_its_name() {
    let database = database(READABLE);
    let refused: Vec<String> = database
        .problems()
        .iter()
        .map(|found| {
            let signal = found.signal.as_ref().map_or(String::new(), |signal| format!(".{signal}"));
            format!("{}: {}{signal}: {}", found.line, found.message, found.problem)
        })
        .collect();
    insta::assert_snapshot!(refused.join("\n"), @"
    3: Shared.Byte: bit 3 also belongs to Flag, in line 4
    4: Shared.Flag: bit 3 also belongs to Byte, in line 3
    7: Large.Stamp: it is an integer of 64 bits: it must have at most 53, which a floating-point number represents exactly
    8: Large.Serial: it is an integer of 64 bits: it must have at most 53, which a floating-point number represents exactly
    9: Large.Signed: it is an integer of 60 bits: it must have at most 53, which a floating-point number represents exactly
    12: Page.Value: its name is also used in line 13
    13: Page.Value: its name is also used in line 12
    14: Twice: its name is also used in line 16
    16: Twice: its length is 9 bytes: CAN FD has 0 to 8, 12, 16, 20, 24, 32, 48 or 64
    ");
    let shared = database.message("Shared").unwrap();
    assert!(shared.signal("Byte").is_err() && shared.signal("Flag").is_err() && shared.signal("Other").is_ok());
    assert!(shared.codec().encode(&[("Other", 4.5)]).is_ok() && shared.codec().encode(&[("Byte", 1.0)]).is_err());
    assert!(database.message("Large").unwrap().signal("Serial").is_err());
    assert!(database.message("Twice").is_err());
}

#[test]
fn names_what_is_near() {
    let database = database(BENCH);
    insta::assert_snapshot!(database.message("Drove").unwrap_err(), @r#"
    bench.dbc has no message "Drove"
    Did you mean "Drive"?
    "#);
    insta::assert_snapshot!(database.message("x").unwrap_err(), @r#"bench.dbc has no message "x""#);
    let drive = database.message("Drive").unwrap();
    insta::assert_snapshot!(drive.signal("ForceX").unwrap_err(), @r#"
    bench.dbc, line 5: message Drive has no signal "ForceX"
    Did you mean "Force"?
    "#);
}

#[test]
fn says_where_the_text_is_no_dbc() {
    let refused = |text: &str| Database::parse(text.as_bytes(), "bench.dbc").unwrap_err().to_string();
    insta::assert_snapshot!(refused("VERSION \"\"\nBO_ 1 Drive: 8 A\n SG_ a : 0|8@2+ (1,0) [0|0] \"\" A\n"), @r#"bench.dbc, line 3, column 14: expected the byte order: 1, Intel, or 0, Motorola, got "2+ (1,0) [0|0] \"\" A""#);
    insta::assert_snapshot!(refused("[wire]\nnode = 1\n"), @r#"bench.dbc, line 1, column 1: expected a statement such as BO_, got "[wire]""#);
    insta::assert_snapshot!(refused("VERSION \"\"\nBO_ 1 D: x A\n"), @r#"bench.dbc, line 2, column 10: expected a length in bytes, got "x A""#);
    insta::assert_snapshot!(refused("VAL_ 1 a 0 \"off;\n"), @r#"bench.dbc, line 1, column 12: expected a text that ends with a quote, got "\"off;""#);
    // An empty file explains no frame, which nobody wants.
    for empty in ["", " \n", "// nothing\n"] {
        let said = refused(empty);
        assert!(
            said.ends_with("expected a statement such as BO_: the file is empty, got the end of the line or file"),
            "{said}"
        );
    }
    let missing = Database::read(Path::new("/nowhere/bench.dbc")).unwrap_err().to_string();
    insta::assert_snapshot!(missing, @"can't read the DBC /nowhere/bench.dbc: No such file or directory (os error 2)");
}

#[test]
fn reads_code_page_1252() {
    let text = b"VERSION \"\"\nBO_ 1 Drive: 8 A\n SG_ a : 0|8@1+ (1,0) [0|0] \"\xB0C\" A\n";
    let database = Database::parse(text, "bench.dbc").unwrap();
    assert_eq!(database.message("Drive").unwrap().signal("a").unwrap().unit(), "°C");
}

/// A text with some bytes changed, or cut off, is read or rejected, and never ends the program.
#[test]
fn damaged_texts_are_read_or_refused() {
    let mut state = 1_u64;
    let mut random = |below: usize| {
        // The multiplier of Knuth's MMIX; the upper bits are the random ones.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let tokens =
        ["SG_", "BO_", "\"", "m", "M", "9999999999999999999999", "-", "0", ":", ";", "\n", " ", "64", "//", "\u{FF}"];
    let (mut read, mut refused) = (0, 0);
    for text in [BENCH, WRONG].repeat(300) {
        let mut text = text.as_bytes().to_vec();
        for _ in 0..=random(3) {
            let at = random(text.len());
            let token = tokens[random(tokens.len())].bytes();
            text.splice(at..(at + random(4)).min(text.len()), token);
        }
        if random(4) == 0 {
            text.truncate(random(text.len()));
        }
        match Database::parse(&text, "bench.dbc") {
            Ok(database) => {
                database.problems();
                for message in database.messages() {
                    for length in 0..=64 {
                        let values: Vec<_> = message.codec().decode(&[0xA5; 64][..length]).collect();
                        let _ = message.codec().encode(&values);
                    }
                }
                read += 1;
            }
            Err(error) => {
                assert!(error.to_string().starts_with("bench.dbc"), "{error}");
                refused += 1;
            }
        }
    }
    assert!(read > 50 && refused > 50, "{read} read, {refused} refused");
}
