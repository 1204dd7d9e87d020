//! The options of an address: the keyword arguments of `can.Bus`.

use pyo3::IntoPyObjectRef;

use crate::error::PythonCanError;

/// The options, checked as far as they can be without Python.
#[derive(Debug, PartialEq)]
pub(super) struct Options {
    /// The name python-can gives the kind of adapter.
    pub(super) interface: String,
    /// Adapter, or channel of it; always text, as on python-can's own command line.
    pub(super) channel: Option<String>,
    /// Everything else, for the driver.
    pub(super) rest: Vec<(String, Value)>,
}

/// A value as python-can reads it from its configuration files.
#[derive(Clone, Debug, PartialEq, IntoPyObjectRef)]
pub(super) enum Value {
    /// Digits, with a sign or without.
    Integer(i64),
    /// A number with a decimal point.
    Float(f64),
    /// `true` or `false`, in any case.
    Boolean(bool),
    /// Any other text, without a change.
    Text(String),
}

impl Options {
    /// Sorts the pairs of an address.
    pub(super) fn parse(pairs: &[(String, String)]) -> Result<Options, PythonCanError> {
        let refuse =
            |key: &str, reason: &str| PythonCanError::Option { key: key.to_string(), reason: reason.to_string() };
        let mut interface = None;
        let mut channel = None;
        let mut rest: Vec<(String, Value)> = Vec::new();
        for (index, (key, value)) in pairs.iter().enumerate() {
            if pairs[..index].iter().any(|(earlier, _)| earlier == key) {
                return Err(refuse(key, "given twice; give it once"));
            }
            match key.as_str() {
                "interface" => interface = Some(value.clone()),
                "channel" => channel = Some(value.clone()),
                "receive_own_messages" => {
                    return Err(refuse(key, "a node never receives its own frames here; leave the option out"));
                }
                _ => rest.push((key.clone(), Value::parse(value))),
            }
        }
        let interface = interface.filter(|name| !name.is_empty()).ok_or_else(|| {
            refuse("interface", "missing; name the adapter, for example interface=slcan,channel=/dev/ttyACM0")
        })?;
        Ok(Options { interface, channel, rest })
    }
}

impl Value {
    /// Reads `text` by the rules of `can.util.cast_from_string`.
    pub(super) fn parse(text: &str) -> Value {
        let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
        if !unsigned.is_empty()
            && unsigned.bytes().all(|byte| byte.is_ascii_digit())
            && let Ok(integer) = text.parse()
        {
            return Value::Integer(integer);
        }
        // The pattern of python-can needs a point with a digit behind it: `1e3` and `1.` stay texts.
        let point = unsigned.find('.').filter(|&point| unsigned[..point].bytes().all(|byte| byte.is_ascii_digit()));
        if let Some(point) = point
            && unsigned[point + 1..].starts_with(|first: char| first.is_ascii_digit())
            && let Ok(float) = text.parse()
        {
            return Value::Float(float);
        }
        match text.to_ascii_lowercase().as_str() {
            "true" => Value::Boolean(true),
            "false" => Value::Boolean(false),
            _ => Value::Text(text.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect()
    }

    #[test]
    fn reads_values_as_python_can_does() {
        let cases = [
            ("500000", Value::Integer(500_000)),
            ("-7", Value::Integer(-7)),
            ("0.5", Value::Float(0.5)),
            ("-.5", Value::Float(-0.5)),
            ("1.0e-3", Value::Float(1e-3)),
            ("True", Value::Boolean(true)),
            ("false", Value::Boolean(false)),
            ("1e3", Value::Text("1e3".into())),
            ("0x10", Value::Text("0x10".into())),
            ("1.", Value::Text("1.".into())),
            ("1.2.3.4", Value::Text("1.2.3.4".into())),
            ("inf", Value::Text("inf".into())),
            ("", Value::Text("".into())),
            ("-", Value::Text("-".into())),
            ("99999999999999999999", Value::Text("99999999999999999999".into())),
            ("/dev/ttyACM0", Value::Text("/dev/ttyACM0".into())),
        ];
        for (text, value) in cases {
            assert_eq!(Value::parse(text), value, "{text}");
        }
    }

    #[test]
    fn keeps_the_channel_as_text() {
        let options = Options::parse(&pairs(&[("interface", "kvaser"), ("channel", "0"), ("bitrate", "1000000")]));
        let expected = Options {
            interface: "kvaser".into(),
            channel: Some("0".into()),
            rest: vec![("bitrate".into(), Value::Integer(1_000_000))],
        };
        assert_eq!(options.ok(), Some(expected));
    }

    #[test]
    fn refuses_contradictory_options() {
        let message = |given: &[(&str, &str)]| Options::parse(&pairs(given)).unwrap_err().to_string();
        insta::assert_snapshot!(message(&[("channel", "0")]), @"python-can option `interface`: missing; name the adapter, for example interface=slcan,channel=/dev/ttyACM0");
        insta::assert_snapshot!(message(&[("interface", "")]), @"python-can option `interface`: missing; name the adapter, for example interface=slcan,channel=/dev/ttyACM0");
        insta::assert_snapshot!(message(&[("interface", "virtual"), ("fd", "true"), ("fd", "false")]), @"python-can option `fd`: given twice; give it once");
        insta::assert_snapshot!(message(&[("interface", "virtual"), ("receive_own_messages", "true")]), @"python-can option `receive_own_messages`: a node never receives its own frames here; leave the option out");
    }
}
