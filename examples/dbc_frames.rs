//! Frames by a DBC, for tools that speak lines: `cargo run --example dbc_frames -- firmware-protocol/resonarm.dbc`.
//!
//! Each line on standard input gets one on standard output, JSON:
//!
//! | line | answer |
//! | --- | --- |
//! | `decode 201#1122334455667788` | `{"message":"ForceCommand","signals":{"crc":17,…}}` |
//! | `encode ForceCommand {"crc":17,…}` | `{"frame":"201#11…"}`: the values rounded to the nearest counts |
//! | `checksum autosar-p11 0 8 291 123#00…` | `{"frame":"123#CC…"}`: with the checksum of this name |
//! | `problems` | `{"problems":["line 3, a of Drive: …"]}`, what is wrong with the DBC |
//!
//! A checksum has its start bit, its bits and its data id before the frame: 16 data ids, separated by commas, for
//! profile 2, `-` for none. A number that is not finite is `"nan"`, `"inf"` or `"-inf"`. What can't be done gets
//! `{"error":"…"}`.

use std::error::Error;
use std::io::{BufRead, Write};
use std::path::Path;

use resonarm::dbc::{Database, Signal};
use resonarm::protocol::Frame;
use resonarm::wire::checksum::{DataId, Preset};
use resonarm::wire::layout::{ByteOrder, Layout, Number};
use serde_json::{Map, Value, json};

type Answer = Result<Value, Box<dyn Error>>;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: dbc_frames DBC")?;
    let database = Database::read(Path::new(&path))?;
    let mut output = std::io::BufWriter::new(std::io::stdout().lock());
    for line in std::io::stdin().lock().lines() {
        let answer = answer(&database, &line?).unwrap_or_else(|error| json!({ "error": error.to_string() }));
        writeln!(output, "{answer}")?;
    }
    Ok(output.flush()?)
}

fn answer(database: &Database, line: &str) -> Answer {
    match line.split_once(' ').unwrap_or((line, "")) {
        ("decode", frame) => decode(database, &frame.parse()?),
        ("encode", of) => {
            let (name, values) = of.split_once(' ').ok_or("encode MESSAGE {JSON}")?;
            encode(database, name, &serde_json::from_str(values)?)
        }
        ("checksum", of) => checksum(&of.split(' ').collect::<Vec<_>>()),
        ("problems", _) => {
            let found = database.problems();
            let text = found.iter().map(|found| {
                let signal = found.signal.as_ref().map_or(String::new(), |signal| format!("{signal} of "));
                format!("line {}, {signal}{}: {}", found.line, found.message, found.problem)
            });
            Ok(json!({ "problems": text.collect::<Vec<_>>() }))
        }
        _ => Err("a line begins with decode, encode, checksum or problems".into()),
    }
}

fn decode(database: &Database, frame: &Frame) -> Answer {
    let message = database.message_by_id(frame.id()).ok_or("the DBC has no such identifier")?;
    let number = |value: f64| match value {
        value if value.is_nan() => json!("nan"),
        value if value.is_infinite() => json!(if value > 0.0 { "inf" } else { "-inf" }),
        value => json!(value),
    };
    let of = |signal: &Signal| {
        let value = signal.decode(frame.data())?;
        // More digits than a floating-point number keeps; beyond 64 bits JSON has no integer.
        let exact = signal.large_integer(frame.data());
        let exact = exact
            .and_then(|exact| i64::try_from(exact).map(|i| json!(i)).or(u64::try_from(exact).map(|u| json!(u))).ok());
        let text = signal.text(frame.data()).map(str::to_string);
        Some((signal.name().to_string(), exact.unwrap_or_else(|| number(value)), text))
    };
    let (mut signals, mut texts) = (Map::new(), Map::new());
    for (name, value, text) in message.signals().filter_map(of) {
        texts.extend(text.map(|text| (name.clone(), json!(text))));
        signals.insert(name, value);
    }
    Ok(json!({ "message": message.name(), "signals": signals, "texts": texts }))
}

fn encode(database: &Database, name: &str, values: &Map<String, Value>) -> Answer {
    let message = database.message(name)?;
    let values: Option<Vec<(&str, f64)>> =
        values.iter().map(|(name, value)| Some((name.as_str(), value.as_f64()?))).collect();
    let frame = message.codec().encode(&values.ok_or("the values have to be numbers")?)?;
    Ok(json!({ "frame": frame.to_string() }))
}

/// Writes a checksum by its preset. The byte order, and the place of a counter, are those of AUTOSAR: profiles 4, 6 and
/// 7 are in Motorola's; the four bits of profiles 1, 2 and 11 are the low half of the byte behind the checksum.
fn checksum(words: &[&str]) -> Answer {
    let [preset, start, bits, data_id, frame] = words else {
        return Err("checksum PRESET START_BIT BITS DATA_ID FRAME".into());
    };
    let (preset, frame): (Preset, Frame) = (preset.parse()?, frame.parse()?);
    let order = match preset {
        Preset::AutosarP4 | Preset::AutosarP6 | Preset::AutosarP7 => ByteOrder::Motorola,
        _ => ByteOrder::Intel,
    };
    let (mut payload, length) = (frame.data().to_vec(), frame.len());
    let place = Layout::new(start.parse()?, bits.parse()?, order, Number::Unsigned, length)?;
    let behind = 8 * (place.first_byte() as u64 + 1);
    let counter = match preset.counter_values() {
        Some(15 | 16) => Some(Layout::new(behind, 4, ByteOrder::Intel, Number::Unsigned, length)?),
        _ => None,
    };
    let ids = data_id.split(',').filter(|id| *id != "-").map(str::parse).collect::<Result<Vec<u32>, _>>()?;
    let data_id = match ids[..] {
        [] => DataId::None,
        [id] => DataId::One(id),
        _ => {
            let ids = ids.iter().map(|id| u8::try_from(*id)).collect::<Result<Vec<u8>, _>>()?;
            DataId::ByCounter(ids.try_into().map_err(|_| "profile 2 has 16 data ids")?)
        }
    };
    let checksum = preset.checksum(place, counter, &data_id, length)?;
    checksum.write(frame.id(), &mut payload)?;
    // What was written must be what a receiver accepts.
    checksum.check(frame.id(), &payload)?;
    Ok(json!({ "frame": Frame::new(frame.id(), frame.format(), &payload)?.to_string() }))
}
