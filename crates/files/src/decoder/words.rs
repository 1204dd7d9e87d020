//! Describes values of CANopen drives in words (CiA 301 v4.2, CiA 402-2).

use resonarm_wire::canopen::Abort;
use resonarm_wire::canopen::cia402::{Command, DriveState, FOLLOWS, LIMITED, REMOTE, VOLTAGE, halts};
use resonarm_wire::canopen::dictionary::{Address, Dictionary, Kind, at};

/// Bits of the statusword beside the state. Those without a name are the manufacturer's, or depend on the mode.
const STATUS_BITS: [(u16, &str); 7] = [
    (VOLTAGE, "voltage"),
    (1 << 7, "warning"),
    (1 << 8, "bit 8"),
    (REMOTE, "remote"),
    (1 << 10, "target reached"),
    (LIMITED, "target refused"),
    (FOLLOWS, "follows the target"),
];

/// Bits of the error register, object 1001.
const REGISTER_BITS: [&str; 8] =
    ["generic", "current", "voltage", "temperature", "communication", "of the profile", "reserved", "manufacturer's"];

/// Returns the name of an object, and of its entry if it has several.
pub(super) fn object(dictionary: &Dictionary, address: Address) -> String {
    let Some(object) = dictionary.object(address.index) else { return String::from("unknown object") };
    match (object.kind, dictionary.entry(address)) {
        (Kind::Variable, Ok(_)) => object.name.to_string(),
        (_, Ok(entry)) => format!("{}, {}", object.name, entry.name),
        (_, Err(_)) => format!("{}, no such subindex", object.name),
    }
}

/// Returns the unit of an object.
pub(super) const fn unit(address: Address) -> &'static str {
    match (address.index, address.subindex) {
        (0x1017, 0) | (0x1800..=0x1803, 5) => "ms",
        (0x1800..=0x1803, 3) => "0.1 ms",
        (0x6064 | 0x607A, 0) => "counts",
        (0x606C | 0x60FF, 0) => "counts/s",
        (0x6071 | 0x6077, 0) => "‰",
        (0x6076, 0) => "mN·m",
        _ => "",
    }
}

/// Describes a value in words, if it has some; `before` is the controlword before it.
pub(super) fn value(dictionary: &Dictionary, address: Address, number: i64, before: u16) -> Option<String> {
    Some(match (address.index, address.subindex) {
        (0x1001, 0) => error_register(number as u8),
        (0x603F, 0) => format!("{number:#06x}: {}", error(number as u16)),
        (0x6040, 0) => controlword(before, number as u16),
        (0x6041, 0) => statusword(number as u16),
        (0x6060 | 0x6061, 0) => mode(number)?.to_string(),
        (0x1400..=0x1403 | 0x1800..=0x1803, 1) => identifier(number as u32),
        (0x1400..=0x1403, 2) => String::from(match number {
            0..=240 => "acts at the next SYNC",
            254 | 255 => "acts at once",
            _ => return None,
        }),
        (0x1800..=0x1803, 2) => match number {
            0 => String::from("at a SYNC after a sample"),
            1 => String::from("at each SYNC"),
            2..=240 => format!("at every SYNC number {number}"),
            253 => String::from("on a remote frame"),
            254 | 255 => String::from("at each sample, or by the event timer"),
            _ => return None,
        },
        (0x1600..=0x1603 | 0x1A00..=0x1A03, 1..) => mapped(dictionary, number as u32),
        _ => return None,
    })
}

fn controlword(before: u16, word: u16) -> String {
    let halt = if halts(word) { ", halt" } else { "" };
    format!("{word:#06x}: {}{halt}", Command::of(before, word).name())
}

fn statusword(word: u16) -> String {
    let state = DriveState::of(word).map_or("no state", DriveState::name);
    let bits = STATUS_BITS.iter().filter(|(bit, _)| word & bit != 0).map(|(_, name)| format!(", {name}"));
    format!("{word:#06x}: {state}{}", bits.collect::<String>())
}

/// Returns the name of a mode of operation (object 6060).
const fn mode(number: i64) -> Option<&'static str> {
    Some(match number {
        0 => "none",
        1 => "profile position",
        2 => "velocity",
        3 => "profile velocity",
        4 => "profile torque",
        6 => "homing",
        7 => "interpolated position",
        8 => "cyclic synchronous position",
        9 => "cyclic synchronous velocity",
        10 => "cyclic synchronous torque",
        _ => return None,
    })
}

fn identifier(word: u32) -> String {
    let disabled = if word >> 31 == 1 { ", disabled" } else { "" };
    let remote = if word >> 30 & 1 == 1 { ", no remote frames" } else { "" };
    format!("{:#05x}{disabled}{remote}", word & 0x1FFF_FFFF)
}

fn mapped(dictionary: &Dictionary, word: u32) -> String {
    let address = at((word >> 16) as u16, (word >> 8) as u8);
    match word {
        0 => String::from("nothing"),
        _ => format!("{:04X} {}, {} bits", address.index, object(dictionary, address), word & 0xFF),
    }
}

pub(super) fn error_register(register: u8) -> String {
    let set = REGISTER_BITS.iter().enumerate().filter(|(bit, _)| register >> bit & 1 == 1).map(|(_, name)| *name);
    let set: Vec<&str> = set.collect();
    if set.is_empty() { String::from("no error") } else { set.join(", ") }
}

/// The error codes that the drives of this program send.
const ERRORS: [(u16, &str); 9] = [
    (0x6100, "internal software: the simulation failed"),
    (0x8100, "communication: the bus was lost, or accepted no frames"),
    (0x8130, "heartbeat error: a heartbeat that the drive watches was lost"),
    (0x8200, "protocol error: a second SYNC for one sample"),
    (0x8210, "protocol error: a PDO is shorter than its mapping, and not processed"),
    (0x8220, "protocol error: a PDO is longer than its mapping"),
    (0x8250, "RPDO timeout: no target was accepted in time"),
    (0xFF01, "the exciter tripped, by travel"),
    (0xFF02, "ticks were missed"),
];

/// Describes an error code in words, or its class (CiA 301, table 26).
pub(super) fn error(code: u16) -> &'static str {
    // The drive's own codes first: they say more than their class.
    if let Some((_, words)) = ERRORS.iter().find(|(own, _)| *own == code) {
        return words;
    }
    match code >> 8 {
        0x00 => "no error, or it is over",
        0x10..=0x1F => "generic error",
        0x20..=0x2F => "current",
        0x30..=0x3F => "voltage",
        0x40..=0x4F => "temperature",
        0x50..=0x5F => "hardware of the device",
        0x60..=0x6F => "software of the device",
        0x70..=0x7F => "additional modules",
        0x81 => "communication",
        0x82 => "protocol error",
        0x80 | 0x83..=0x8F => "monitoring",
        0x90..=0x9F => "external error",
        0xF0 => "additional functions",
        0xFF => "specific to the device",
        _ => "no code of CiA 301",
    }
}

/// Returns the reason for which a transfer is aborted (CiA 301, table 22).
pub(super) fn abort(code: u32) -> String {
    if let Some(abort) = Abort::of(code) {
        return abort.to_string();
    }
    String::from(match code {
        0x0504_0000 => "the transfer has timed out",
        0x0504_0002 => "the block size is invalid",
        0x0504_0003 => "the sequence number is invalid",
        0x0504_0004 => "the checksum is wrong",
        0x0504_0005 => "there is no memory left",
        0x0601_0000 => "the access is not supported",
        0x0604_0043 => "the parameters are incompatible",
        0x0604_0047 => "the device is incompatible with itself",
        0x0606_0000 => "the hardware has failed",
        0x0609_0036 => "the greatest value is less than the least",
        0x060A_0023 => "a resource is not available",
        0x0800_0000 => "general error",
        0x0800_0020 => "the value can't be stored",
        0x0800_0021 => "the value can't be stored, as the device is controlled locally",
        0x0800_0023 => "there is no object dictionary",
        0x0800_0024 => "there is no value",
        _ => "no code of CiA 301",
    })
}
