//! Strict parsing of all numeric flags.

use core::any::TypeId;
use core::fmt::Display;
use core::ops::RangeInclusive;
use core::str::FromStr;

use clap::{Arg, Command};

/// Makes the numeric flags of a command, and its subcommands, strict: values may be negative, also after a blank, and
/// those of type `f64` must be finite. So `--to-hz -1` is a frequency, not an unknown flag, and the error for
/// `--rate-hz nan` names the flag.
pub(crate) fn strict(command: Command) -> Command {
    command.mut_args(strict_flag).mut_subcommands(strict)
}

fn strict_flag(arg: Arg) -> Arg {
    if holds::<f64>(&arg) {
        // To clap `-inf` is no negative number: only with any hyphen allowed does it come to `finite`, which says
        // what is wrong with it.
        arg.allow_hyphen_values(true).value_parser(finite)
    } else if holds_integer(&arg) && arg.get_action().takes_values() {
        arg.allow_negative_numbers(true)
    } else {
        arg
    }
}

/// Whether the values of a flag are of this type: clap has no other mark for numeric flags.
fn holds<T: 'static>(arg: &Arg) -> bool {
    arg.get_value_parser().type_id() == TypeId::of::<T>()
}

fn holds_integer(arg: &Arg) -> bool {
    let is_unsigned = holds::<u8>(arg) || holds::<u16>(arg) || holds::<u32>(arg) || holds::<u64>(arg);
    is_unsigned || holds::<usize>(arg) || holds::<i32>(arg) || holds::<i64>(arg)
}

/// Parses a finite number for an argument.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| String::from("it must be a finite number"))
}

/// Parses an integer within these bounds for an argument.
pub(crate) fn integer<T>(
    bounds: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync + 'static,
{
    move |text| {
        let number = text.parse::<T>().ok().filter(|number| bounds.contains(number));
        number.ok_or_else(|| out_of(&bounds))
    }
}

/// The same where the command itself checks the bounds, with a message that says more: here they are only named.
pub(crate) fn integer_checked_later<T>(
    bounds: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + Display + Clone + Send + Sync + 'static,
{
    move |text| text.parse::<T>().map_err(|_error| out_of(&bounds))
}

fn out_of<T: Display>(bounds: &RangeInclusive<T>) -> String {
    format!("it must be an integer from {} to {}", bounds.start(), bounds.end())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::help::tests::commands_of_the_program;

    /// Every numeric flag says in the same words what its value must be.
    #[test]
    fn words_in_place_of_numbers_are_rejected_in_one_style() {
        let mut flags = 0;
        for (name, command) in commands_of_the_program() {
            let is_numeric = |arg: &&Arg| {
                let is_number = holds::<f64>(arg) || holds_integer(arg);
                arg.get_id() != "seed" && arg.get_action().takes_values() && is_number
            };
            for flag in command.get_arguments().filter(is_numeric).filter_map(Arg::get_long) {
                let words = [name.clone(), format!("--{flag}=many")];
                let said = command.clone().try_get_matches_from(words).unwrap_err().to_string();
                let expected = format!("error: invalid value 'many' for '--{flag} <");
                assert!(said.starts_with(&expected) && said.contains(">': it must be a"), "{name}: {said}");
                flags += 1;
            }
        }
        assert!(flags > 60, "{flags}");
    }
}
