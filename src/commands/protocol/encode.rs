//! `resonarm protocol encode`: the frame of a message.

use clap::Args;

use super::NetworkFlags;
use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::numbers;
use crate::output;
use resonarm::protocol::{Message, MessageKind, Transmitter};

/// Prints the frame of a message, protected, as cansend takes it.
#[derive(Debug, Args)]
pub(super) struct Encode {
    /// Name of the message in the DBC, as ForceCommand.
    #[arg(value_name = "MESSAGE")]
    message: String,
    /// Values of its signals, as force_x_n=10; saturation marks that are left out are 0.
    #[arg(value_name = "SIGNAL=VALUE")]
    signals: Vec<String>,
    /// Counter of the message.
    #[arg(long, help_heading = heading::NETWORK, value_name = "N", default_value_t = 0, value_parser = numbers::integer(0..=u8::MAX))]
    counter: u8,
    #[command(flatten)]
    network: NetworkFlags,
}

impl Encode {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let network = self.network.network()?;
        let kind = self.kind()?;
        let signals = self.signals.iter().map(|text| signal(text)).collect::<Result<Vec<_>, _>>()?;
        once(&signals)?;
        let mut used = Vec::new();
        let message = Message::from_signals(kind, |name| {
            // `from_signals` asks for every signal that the message has. What was given and never asked for is
            // unknown.
            used.push(name);
            signals.iter().find(|(given, _)| *given == name).map(|(_, value)| *value)
        });
        let message = message.map_err(|error| Failure::usage(error.to_string()))?;
        if let Some((unknown, _)) = signals.iter().find(|(given, _)| !used.contains(given)) {
            return Err(Failure::usage(format!("{kind} has no signal {unknown}, expected one of {}", used.join(", "))));
        }
        // Messages without protection have no counter, so only 0 is left.
        let most = kind.form(network.profile()).and_then(|form| form.protection).map_or(0, |p| p.counter_max());
        if self.counter > most {
            let counter = self.counter;
            return Err(Failure::usage(format!("--counter is {counter}: for {kind} it must be from 0 to {most}")));
        }
        let mut transmitter = Transmitter::new(network);
        let mut frame = transmitter.frame(&message);
        // A transmitter counts its frames from 0 by itself, so the wanted counter is reached by sending that many
        // before.
        for _ in 0..self.counter {
            frame = transmitter.frame(&message);
        }
        let frame = frame.map_err(|error| Failure::usage(error.to_string()))?;
        output::print(&format!("{frame}\n"))?;
        Ok(Verdict::Positive)
    }

    fn kind(&self) -> Result<MessageKind, Failure> {
        let known = MessageKind::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(&self.message));
        known.ok_or_else(|| {
            let names = MessageKind::ALL.map(MessageKind::name).join(", ");
            Failure::usage(format!("unknown message {:?}, expected one of {names}", self.message))
        })
    }
}

/// Rejects a signal that is given twice.
fn once(signals: &[(&str, f64)]) -> Result<(), Failure> {
    for (place, (name, again)) in signals.iter().enumerate() {
        if let Some((_, first)) = signals[..place].iter().find(|(before, _)| before == name) {
            return Err(Failure::usage(format!("{name} is given twice, as {first} and as {again}: give it once")));
        }
    }
    Ok(())
}

/// Parses a name and a value; numbers may be hexadecimal.
fn signal(text: &str) -> Result<(&str, f64), Failure> {
    let number = |value: &str| match value.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok().map(f64::from),
        None => value.parse::<f64>().ok(),
    };
    text.split_once('=')
        .and_then(|(name, value)| Some((name, number(value)?)))
        .ok_or_else(|| Failure::usage(format!("{text:?} is not of the form signal=number")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_given_once() {
        let refused = once(&[("force_x_n", 0.05), ("force_y_n", 0.0), ("force_x_n", 2.0)]).unwrap_err();
        insta::assert_snapshot!(refused.to_string(), @"force_x_n is given twice, as 0.05 and as 2: give it once");
        assert!(once(&[("force_x_n", 1.0), ("force_y_n", 1.0)]).is_ok());
    }
}
