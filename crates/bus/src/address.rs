//! Bus addresses, as the command line takes them.

use core::fmt;
use core::str::FromStr;

use crate::error::BusError;

/// Address of a bus to open.
///
/// | text                                           | bus                                                             |
/// |------------------------------------------------|-----------------------------------------------------------------|
/// | `can0`, `vcan0`, `socketcan:NAME`              | a CAN interface of this Linux                                   |
/// | `memory`                                       | a bus inside one process ([`memory::hub`](super::memory::hub))  |
/// | `python-can:interface=I,channel=C[,key=value]` | an adapter that python-can knows                                |
///
/// A value of python-can may hold anything but a comma.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusAddress {
    /// The Linux network interface of this name, through SocketCAN.
    SocketCan(String),
    /// A bus inside this process.
    Memory,
    /// The arguments of python-can's `can.Bus(…)`, in the order given, each key once; `interface` is among them.
    PythonCan(Vec<(String, String)>),
}

/// The words before the colon.
const SOCKETCAN: &str = "socketcan";
const MEMORY: &str = "memory";
const PYTHON_CAN: &str = "python-can";

impl FromStr for BusAddress {
    type Err = BusError;

    /// # Errors
    /// [`BusError::Address`], which says what is wrong and suggests what was probably meant.
    fn from_str(text: &str) -> Result<BusAddress, BusError> {
        parse(text).map_err(|reason| BusError::Address { address: text.to_owned(), reason })
    }
}

/// Writes the text that [`BusAddress::from_str`] reads as the same address.
impl fmt::Display for BusAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BusAddress::SocketCan(name) if name == MEMORY || name == PYTHON_CAN || name == SOCKETCAN => {
                write!(f, "{SOCKETCAN}:{name}")
            }
            BusAddress::SocketCan(name) => f.write_str(name),
            BusAddress::Memory => f.write_str(MEMORY),
            BusAddress::PythonCan(options) => {
                for (k, (key, value)) in options.iter().enumerate() {
                    let before = if k == 0 { "python-can:" } else { "," };
                    write!(f, "{before}{key}={value}")?;
                }
                Ok(())
            }
        }
    }
}

fn parse(text: &str) -> Result<BusAddress, String> {
    match text.split_once(':') {
        None if text == MEMORY => Ok(BusAddress::Memory),
        None if text == SOCKETCAN => Err(format!("the interface name is missing; write {SOCKETCAN}:NAME")),
        None if text == PYTHON_CAN => python_can_options(""),
        None => interface(text),
        Some((SOCKETCAN, name)) => interface(name),
        Some((MEMORY, _)) => Err(format!("{MEMORY} takes no parameters")),
        Some((PYTHON_CAN, options)) => python_can_options(options),
        Some((backend, _)) => Err(format!("unknown backend {backend:?}{}", did_you_mean(backend))),
    }
}

/// Parses the name of a network interface as Linux accepts it: 1 to 15 bytes (`IFNAMSIZ` less the closing zero), no
/// slash, no colon, no white space, and not a directory.
fn interface(name: &str) -> Result<BusAddress, String> {
    let reason = if name.is_empty() {
        "the interface name is empty".to_owned()
    } else if name.len() > 15 {
        format!("the interface name has {} bytes; at most 15 are allowed", name.len())
    } else if let Some(bad) = name.chars().find(|c| c.is_whitespace() || c.is_control() || matches!(c, '/' | ':')) {
        format!("the interface name contains {bad:?}, which is not allowed")
    } else if name == "." || name == ".." {
        "this is not a valid interface name".to_owned()
    } else {
        return Ok(BusAddress::SocketCan(name.to_owned()));
    };
    Err(reason)
}

fn python_can_options(text: &str) -> Result<BusAddress, String> {
    let mut options: Vec<(String, String)> = Vec::new();
    for pair in text.split(',').filter(|_| !text.is_empty()) {
        let Some((key, value)) = pair.split_once('=') else {
            return Err(format!("{pair:?} is not of the form key=value"));
        };
        if !key.starts_with(|c: char| c.is_ascii_alphabetic())
            || !key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        {
            return Err(format!("{key:?} is not a valid name of a python-can argument"));
        }
        if value.is_empty() {
            return Err(format!("{key:?} has no value"));
        }
        if options.iter().any(|(seen, _)| seen == key) {
            return Err(format!("{key:?} is given twice; give it once"));
        }
        options.push((key.to_owned(), value.to_owned()));
    }
    if !options.iter().any(|(key, _)| key == "interface") {
        return Err("python-can needs interface=NAME, the name of one of its interfaces".to_owned());
    }
    Ok(BusAddress::PythonCan(options))
}

/// Ends the message for an unknown backend: the one that was probably meant, or the list of them.
fn did_you_mean(backend: &str) -> String {
    let backends = [SOCKETCAN, MEMORY, PYTHON_CAN];
    let near = |name: &&str| strsim::normalized_damerau_levenshtein(&backend.to_ascii_lowercase(), name) > 0.6;
    match backends.into_iter().find(near) {
        Some(name) => format!(", perhaps you meant {name}"),
        None => format!(": expected {SOCKETCAN}, {MEMORY} or {PYTHON_CAN}"),
    }
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> BusAddress {
        text.parse().unwrap()
    }

    fn refusal(text: &str) -> String {
        text.parse::<BusAddress>().unwrap_err().to_string()
    }

    #[test]
    fn reads_every_kind() {
        assert_eq!(read("vcan0"), BusAddress::SocketCan("vcan0".into()));
        assert_eq!(read("socketcan:memory"), BusAddress::SocketCan("memory".into()));
        assert_eq!(read("memory"), BusAddress::Memory);
        let options = [("interface", "slcan"), ("channel", "socket://[::1]:29536"), ("bitrate", "1000000")];
        assert_eq!(
            read("python-can:interface=slcan,channel=socket://[::1]:29536,bitrate=1000000"),
            BusAddress::PythonCan(options.map(|(key, value)| (key.into(), value.into())).to_vec())
        );
    }

    #[test]
    fn says_what_is_wrong() {
        assert_snapshot!(refusal(""), @"`` is not a bus: the interface name is empty. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0");
        assert_snapshot!(refusal("socketcan"), @"`socketcan` is not a bus: the interface name is missing; write socketcan:NAME. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0");
        assert_snapshot!(refusal("socketcna:vcan0"), @r#"`socketcna:vcan0` is not a bus: unknown backend "socketcna", perhaps you meant socketcan. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"#);
        assert_snapshot!(refusal("pcan:PCAN_USBBUS1"), @r#"`pcan:PCAN_USBBUS1` is not a bus: unknown backend "pcan": expected socketcan, memory or python-can. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"#);
        assert_snapshot!(refusal("memory:a"), @"`memory:a` is not a bus: memory takes no parameters. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0");
        assert_snapshot!(refusal("/dev/ttyACM0"), @"`/dev/ttyACM0` is not a bus: the interface name contains '/', which is not allowed. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0");
        assert_snapshot!(refusal("a-very-long-interface"), @"`a-very-long-interface` is not a bus: the interface name has 21 bytes; at most 15 are allowed. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0");
        assert_snapshot!(refusal("python-can"), @"`python-can` is not a bus: python-can needs interface=NAME, the name of one of its interfaces. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0");
        assert_snapshot!(refusal("python-can:slcan"), @r#"`python-can:slcan` is not a bus: "slcan" is not of the form key=value. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"#);
        assert_snapshot!(refusal("python-can:interface=slcan,interface=slcan"), @r#"`python-can:interface=slcan,interface=slcan` is not a bus: "interface" is given twice; give it once. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"#);
        assert_snapshot!(refusal("python-can:interface="), @r#"`python-can:interface=` is not a bus: "interface" has no value. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"#);
        assert_snapshot!(refusal("python-can:=slcan"), @r#"`python-can:=slcan` is not a bus: "" is not a valid name of a python-can argument. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"#);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in ".{0,40}") {
            if let Ok(address) = text.parse::<BusAddress>() {
                prop_assert_eq!(address.to_string().parse::<BusAddress>().unwrap(), address);
            }
        }

        #[test]
        fn near_misses_are_read_or_refused(
            text in "(python-can|socketcan|memory|vcan0|can\\.)?:?((interface|channel|k)?[=,:/]?[a-z0-9=]{0,4},?){0,4}",
        ) {
            if let Ok(address) = text.parse::<BusAddress>() {
                prop_assert_eq!(address.to_string().parse::<BusAddress>().unwrap(), address);
            }
        }
    }
}
