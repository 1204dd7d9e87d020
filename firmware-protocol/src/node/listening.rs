//! The time that a node listened: the clock of its timeouts.
//!
//! A node that was itself stopped has not listened, and must not take its own silence for its partner's. So at most one
//! look period counts between two looks at the clock:
//!
//! ```text
//! listened += min(now − last look, look period)
//! ```
//!
//! The time listened is never more than the time on the clock.

/// Time for which a node has listened.
#[derive(Clone, Copy, Debug)]
pub struct Listening {
    look_period_ns: u64,
    looked_at_ns: u64,
    listened_ns: u64,
}

impl Listening {
    /// No time listened yet; at most `look_period_ns` counts between two looks.
    pub const fn new(look_period_ns: u64) -> Listening {
        Listening { look_period_ns, looked_at_ns: 0, listened_ns: 0 }
    }

    /// Starts at this time on the clock.
    pub fn start(&mut self, now_ns: u64) {
        self.looked_at_ns = now_ns;
    }

    /// The node looks: it has taken all frames received, and checks its deadlines.
    pub fn look(&mut self, now_ns: u64) {
        let elapsed_ns = now_ns.saturating_sub(self.looked_at_ns);
        self.listened_ns = self.listened_ns.saturating_add(elapsed_ns.min(self.look_period_ns));
        // A time before the last look is ignored. Otherwise the time between both would count twice.
        self.looked_at_ns = self.looked_at_ns.max(now_ns);
    }

    /// The time listened up to the last look, ns.
    pub fn listened_ns(&self) -> u64 {
        self.listened_ns
    }

    /// Whether `timeout_ns` of listening have passed since `since_ns` (of the time listened).
    pub fn has_passed(&self, since_ns: u64, timeout_ns: u64) -> bool {
        self.left_ns(since_ns, timeout_ns) == 0
    }

    /// Returns the time to look next, on the clock, for a running timeout: at its earliest end, but within a look
    /// period, as no longer time counts.
    pub fn next_look_ns(&self, since_ns: u64, timeout_ns: u64) -> u64 {
        self.looked_at_ns.saturating_add(self.left_ns(since_ns, timeout_ns).min(self.look_period_ns))
    }

    fn left_ns(&self, since_ns: u64, timeout_ns: u64) -> u64 {
        since_ns.saturating_add(timeout_ns).saturating_sub(self.listened_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_looks_at_most_a_look_period_counts() {
        let mut listening = Listening::new(1_000);
        listening.start(5_000);
        for (now_ns, listened_ns) in
            // A pause of 300 look periods counts as one of them, and a time before the last look as none.
            [(5_400, 400), (6_400, 1_400), (306_400, 2_400), (306_300, 2_400), (306_500, 2_500)]
        {
            listening.look(now_ns);
            assert_eq!(listening.listened_ns(), listened_ns, "{now_ns}");
        }
    }

    #[test]
    fn asks_for_the_next_look_within_a_look_period_and_never_overflows() {
        let mut listening = Listening::new(1_000);
        listening.look(10_000);
        assert_eq!((listening.listened_ns(), listening.next_look_ns(500, 1_200)), (1_000, 10_700));
        assert_eq!(listening.next_look_ns(500, u64::MAX), 11_000);
        assert!(!listening.has_passed(u64::MAX, u64::MAX));
        assert!(listening.has_passed(500, 500) && !listening.has_passed(500, 501));
        assert_eq!(Listening::new(u64::MAX).next_look_ns(0, u64::MAX), u64::MAX);
    }
}
