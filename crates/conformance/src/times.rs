//! Times by the clock, and how reports write them.

/// One millisecond, in ns.
pub(super) const MS: u64 = 1_000_000;

/// Time for which a machine may hold a process up, ns: the margin of everything that is judged on the clock.
pub const MARGIN_NS: u64 = 150 * MS;

/// No machine stops a process for so long, ns: a node that is silent for this time is gone.
pub(super) const GONE_NS: u64 = 1000 * MS;

/// A time in ms, as in reports.
pub(super) fn ms(ns: u64) -> String {
    format!("{:.1} ms", ns as f64 / 1e6).replace(".0 ms", " ms").to_string()
}
