//! The flags of an interval.

use crate::failure::Failure;

/// The values of a pair of flags, `--from-UNIT a --to-UNIT b`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    /// The suffix of `--from` and `--to`, as `-hz`.
    pub unit: &'static str,
    pub from: Option<f64>,
    pub to: Option<f64>,
}

/// Returns both ends of the interval in the unit wanted; with `None` no interval is allowed. Ends in another unit are
/// an error.
pub(crate) fn interval(parameter: &str, wanted: Option<&str>, given: &[Ends]) -> Result<Option<(f64, f64)>, Failure> {
    let needs = wanted.map_or_else(String::new, |unit| format!("; give its interval by --from{unit} a --to{unit} b"));
    for Ends { unit, from, to } in given.iter().filter(|ends| Some(ends.unit) != wanted) {
        let end = match (from, to) {
            (Some(_), _) => "from",
            (None, Some(_)) => "to",
            (None, None) => continue,
        };
        return Err(Failure::usage(format!("--{end}{unit} is not for {parameter}{needs}")));
    }
    let Some(unit) = wanted else { return Ok(None) };
    let ends = given.iter().find(|ends| ends.unit == unit);
    match ends.map(|ends| (ends.from, ends.to)) {
        Some((Some(from), Some(to))) => Ok(Some((from, to))),
        _ => Err(Failure::usage(format!("{parameter} needs an interval: give it by --from{unit} a --to{unit} b"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_the_ends_in_the_unit_wanted_and_no_others() {
        let ends = |unit, from, to| Ends { unit, from, to };
        let given = [ends("-hz", Some(20.0), Some(23.0)), ends("-nm", None, None)];
        assert_eq!(interval("a sweep", Some("-hz"), &given).unwrap(), Some((20.0, 23.0)));
        assert_eq!(interval("a section", None, &given[1..]).unwrap(), None);
        let says = |wanted, given: &[Ends]| interval("--parameter amplitude", wanted, given).unwrap_err().to_string();
        insta::assert_snapshot!(says(Some("-nm"), &given), @"--from-hz is not for --parameter amplitude; give its interval by --from-nm a --to-nm b");
        insta::assert_snapshot!(says(Some("-nm"), &[ends("-nm", None, Some(1.0))]), @"--parameter amplitude needs an interval: give it by --from-nm a --to-nm b");
        insta::assert_snapshot!(says(Some("-nm"), &[]), @"--parameter amplitude needs an interval: give it by --from-nm a --to-nm b");
        insta::assert_snapshot!(says(None, &[ends("", None, Some(1.0))]), @"--to is not for --parameter amplitude");
    }
}
