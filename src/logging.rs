//! Log levels, from `-v`, `-q` and the environment variable `RESONARM_LOG`.

use std::io::IsTerminal;

use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::debug_fn;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use crate::failure::Failure;
use crate::output::printable;

/// The environment variable that states level and targets: `debug`, `resonarm_bus=trace`, or several with commas
/// between them.
const VARIABLE: &str = "RESONARM_LOG";

/// Logs to standard error: warnings, more with `-v`, only errors with `-q`, and the levels of `RESONARM_LOG`.
pub(crate) fn log_to_stderr(verbose: u8, quiet: bool) -> Result<(), Failure> {
    let level = match verbose {
        _ if quiet => LevelFilter::ERROR,
        0 => LevelFilter::WARN,
        1 => LevelFilter::INFO,
        2 => LevelFilter::DEBUG,
        _ => LevelFilter::TRACE,
    };
    let filter = filter(level, &std::env::var(VARIABLE).unwrap_or_default())?;
    // No colours in a file or a pipe, nor with NO_COLOR (no-color.org).
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let lines = tracing_subscriber::fmt::layer()
        // Messages quote names from foreign files, whose control characters must not reach a terminal.
        .fmt_fields(debug_fn(|writer, field, value| match field.name() {
            "message" => write!(writer, "{}", printable(&format!("{value:?}"))),
            name => write!(writer, " {name}={}", printable(&format!("{value:?}"))),
        }))
        .with_writer(std::io::stderr)
        .with_ansi(colours)
        .with_target(false);
    tracing_subscriber::registry().with(lines).with(filter).init();
    Ok(())
}

/// Returns the levels in `directives`, and `level` where they name none.
fn filter(level: LevelFilter, directives: &str) -> Result<Targets, Failure> {
    let mut filter = Targets::new().with_default(level);
    for directive in directives.split(',').map(str::trim).filter(|directive| !directive.is_empty()) {
        let asked: Targets = directive.parse().map_err(|error| {
            Failure::usage(format!(
                "{VARIABLE}: `{directive}`: {error}; expected a level (off, error, warn, info, debug, trace) or target=level, \
                 as `debug` or `resonarm_bus=trace`"
            ))
        })?;
        // A bare level is the default of `asked`, which `with_targets` does not take over.
        filter = match asked.default_level() {
            Some(level) => filter.with_default(level),
            None => filter.with_targets(asked),
        };
    }
    Ok(filter)
}

#[cfg(test)]
mod tests {
    use tracing::Level;

    use super::*;

    /// The most verbose level that is logged for a target.
    fn logged(directives: &str, target: &str) -> Option<Level> {
        let filter = filter(LevelFilter::WARN, directives).unwrap();
        [Level::TRACE, Level::DEBUG, Level::INFO, Level::WARN, Level::ERROR]
            .into_iter()
            .find(|level| filter.would_enable(target, level))
    }

    #[test]
    fn a_level_applies_to_all_targets_and_a_directive_to_its_target() {
        assert_eq!(logged("", "resonarm::run"), Some(Level::WARN));
        assert_eq!(logged("debug", "resonarm::run"), Some(Level::DEBUG));
        assert_eq!(logged("OFF", "resonarm::run"), None);
        assert_eq!(logged("resonarm_bus=trace", "resonarm_bus::socketcan"), Some(Level::TRACE));
        assert_eq!(logged("resonarm_bus=trace", "resonarm::run"), Some(Level::WARN));
        assert_eq!(logged("resonarm_bus", "resonarm_bus"), Some(Level::TRACE));
        let several = "info, resonarm_bus=error,resonarm_bus::socketcan=debug,";
        let targets = ["resonarm_session::run", "resonarm_bus", "resonarm_bus::socketcan"];
        assert_eq!(targets.map(|target| logged(several, target)), [Level::INFO, Level::ERROR, Level::DEBUG].map(Some));
    }

    #[test]
    fn an_invalid_directive_is_reported() {
        let complaint = filter(LevelFilter::WARN, "info,resonarm_bus=loud").unwrap_err();
        insta::assert_snapshot!(complaint, @r#"RESONARM_LOG: `resonarm_bus=loud`: error parsing level filter: expected one of "off", "error", "warn", "info", "debug", "trace", or a number 0-5; expected a level (off, error, warn, info, debug, trace) or target=level, as `debug` or `resonarm_bus=trace`"#);
    }
}
