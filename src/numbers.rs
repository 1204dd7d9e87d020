//! Strict parsing of all numeric flags.

use core::any::TypeId;

use clap::{Arg, Command};

/// Makes the numeric flags of a command, and its subcommands, strict: values may be negative, also after a blank, and
/// those of type `f64` must be finite. So `--to-hz -1` is a frequency, not an unknown flag, and the error for
/// `--rate-hz nan` names the flag.
pub(crate) fn strict(command: Command) -> Command {
    command.mut_args(strict_flag).mut_subcommands(strict)
}

fn strict_flag(arg: Arg) -> Arg {
    // clap has no mark for numeric flags: the type of the parsed value is the only one.
    let holds = arg.get_value_parser().type_id();
    let integers = [
        TypeId::of::<u8>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
        TypeId::of::<i64>(),
    ];
    if holds == TypeId::of::<f64>() {
        arg.allow_hyphen_values(true).value_parser(finite)
    } else if integers.iter().any(|integer| holds == *integer) && arg.get_action().takes_values() {
        arg.allow_negative_numbers(true)
    } else {
        arg
    }
}

/// Parses a finite number for an argument.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().map_err(|error| error.to_string())?;
    if number.is_finite() { Ok(number) } else { Err(String::from("it must be a finite number")) }
}
