//! The loop on a scripted clock, where every instant is known, and on the real one.

use core::cell::{Cell, RefCell};
use std::collections::VecDeque;

use proptest::prelude::*;

use super::super::{Clock, SampleRate, SystemClock};
use super::*;

const MS: u64 = 1_000_000;

/// Time passes only by the script: a sleep ends late by the next entry (0 when used up), and work takes the time
/// given.
#[derive(Default)]
struct ScriptedClock {
    now_ns: Cell<u64>,
    wakeup_ns: RefCell<VecDeque<u64>>,
    sleeps: Cell<u64>,
}

impl ScriptedClock {
    fn with_wakeups(wakeup_ns: &[u64]) -> Self {
        Self {
            // The clock does not begin at 0, so that a loop that mixed up instants and times since its start would be
            // found out.
            now_ns: Cell::new(5_000 * MS),
            wakeup_ns: RefCell::new(wakeup_ns.iter().copied().collect()),
            ..Self::default()
        }
    }

    fn work(&self, duration_ns: u64) {
        self.now_ns.set(self.now_ns.get() + duration_ns);
    }
}

impl Clock for ScriptedClock {
    fn now_ns(&self) -> u64 {
        self.now_ns.get()
    }

    fn sleep_until_ns(&self, deadline_ns: u64) {
        let late_ns = self.wakeup_ns.borrow_mut().pop_front().unwrap_or(0);
        self.now_ns.set(self.now_ns.get().max(deadline_ns) + late_ns);
        self.sleeps.set(self.sleeps.get() + 1);
    }
}

/// One line a tick, for a loop at 1 kHz whose ticks work for `work_ns`.
fn trace(clock: &ScriptedClock, policy: OverrunPolicy, work_ns: &[u64]) -> String {
    let rate = SampleRate::new(1000.0).unwrap();
    let mut periodic = Periodic::start(clock, rate, policy).unwrap();
    let (mut lines, mut slipped) = (Vec::new(), 0);
    for &work_ns in work_ns {
        match periodic.tick() {
            Ok(tick) => {
                clock.work(work_ns);
                let exec_ns = periodic.finish(&tick, 0);
                assert_eq!(exec_ns, work_ns);
                assert_eq!(tick.woke_ns - tick.deadline_ns, tick.wakeup_ns);
                // The tick that slips is itself still due by the old schedule; only those after it move.
                assert_eq!(tick.deadline_ns, periodic.start_ns() + (tick.index + slipped) * MS);
                slipped += u64::from(tick.slipped);
                let slip = if tick.slipped > 0 { format!(", slipped {}", tick.slipped) } else { String::new() };
                let late_us = tick.wakeup_ns / 1000;
                let cause = tick.cause.map_or(String::new(), |cause| format!(" {}", cause.name()));
                let missed = tick.missed;
                lines
                    .push(format!("{} late {late_us} us, missed {missed}{cause}{slip}, {:?}", tick.index, tick.action));
            }
            Err(error) => {
                lines.push(error.to_string());
                break;
            }
        }
    }
    let summary = periodic.summary();
    assert_eq!(summary.slipped, slipped);
    lines.push(format!("samples {}, overruns {}, sleeps {}", summary.samples, summary.overruns, clock.sleeps.get()));
    lines.join("\n")
}

#[test]
fn on_time() {
    let clock = ScriptedClock::with_wakeups(&[50_000, 60_000, 70_000]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Stop, &[MS / 2; 4]), @"
    0 late 50 us, missed 0, Proceed
    1 late 60 us, missed 0, Proceed
    2 late 70 us, missed 0, Proceed
    3 late 0 us, missed 0, Proceed
    samples 4, overruns 0, sleeps 4
    ");
}

/// Sleeps end 50 µs late; a look at the clock takes 1 µs.
#[derive(Default)]
struct LookedAtClock {
    now_ns: Cell<u64>,
    slept_until_ns: RefCell<Vec<u64>>,
}

impl Clock for LookedAtClock {
    fn now_ns(&self) -> u64 {
        self.now_ns.set(self.now_ns.get() + 1_000);
        self.now_ns.get()
    }

    fn sleep_until_ns(&self, deadline_ns: u64) {
        self.slept_until_ns.borrow_mut().push(deadline_ns);
        self.now_ns.set(self.now_ns.get().max(deadline_ns + 50_000));
    }

    fn spin_until_ns(&self, deadline_ns: u64) {
        while self.now_ns() < deadline_ns {}
    }
}

#[test]
fn a_loop_that_spins_sleeps_until_shortly_before_and_is_never_early() {
    let rate = SampleRate::new(1000.0).unwrap();
    // Without spinning a tick is late by the 50 µs of the sleep and the look at the clock. With 20 µs the sleep still
    // ends 30 µs after the deadline. With 80 µs it ends 30 µs before, and only the looks at the clock are left.
    for (spin_ns, late_ns) in [(0, 51_000..=51_000), (20_000, 30_000..=33_000), (80_000, 0..=2_000)] {
        let clock = LookedAtClock::default();
        let mut periodic = Periodic::start(&clock, rate, OverrunPolicy::Stop).unwrap().spinning(spin_ns);
        for _ in 0..5 {
            let tick = periodic.tick().unwrap();
            assert!(late_ns.contains(&tick.wakeup_ns), "{spin_ns}: {tick:?}");
            assert_eq!(clock.slept_until_ns.borrow().last(), Some(&(tick.deadline_ns - spin_ns)));
            periodic.finish(&tick, 0);
        }
    }
}

#[test]
fn long_work_is_caught_up_tick_by_tick() {
    let clock = ScriptedClock::with_wakeups(&[]);
    let work_ns = [MS / 10, 5 * MS / 2, 4 * MS / 10, 3 * MS / 10, MS / 10, MS / 10];
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Continue, &work_ns), @"
    0 late 0 us, missed 0, Proceed
    1 late 0 us, missed 0, Proceed
    2 late 1500 us, missed 2 step-long, Proceed
    3 late 900 us, missed 0, Proceed
    4 late 200 us, missed 1 step-long, Proceed
    5 late 0 us, missed 0, Proceed
    samples 6, overruns 3, sleeps 3
    ");
}

#[test]
fn a_late_wake_up_is_caught_up_tick_by_tick() {
    let clock = ScriptedClock::with_wakeups(&[0, 5 * MS / 2]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Continue, &[MS / 10; 6]), @"
    0 late 0 us, missed 0, Proceed
    1 late 2500 us, missed 2 woke-late, Proceed
    2 late 1600 us, missed 0, Proceed
    3 late 700 us, missed 0, Proceed
    4 late 0 us, missed 0, Proceed
    5 late 0 us, missed 0, Proceed
    samples 6, overruns 2, sleeps 4
    ");
}

#[test]
fn the_policy_fault_asks_for_a_fault_at_each_miss() {
    let clock = ScriptedClock::with_wakeups(&[]);
    let work_ns = [MS / 10, 5 * MS / 2, 4 * MS / 10, 3 * MS / 10, MS / 10, MS / 10];
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Fault, &work_ns), @"
    0 late 0 us, missed 0, Proceed
    1 late 0 us, missed 0, Proceed
    2 late 1500 us, missed 2 step-long, Fault
    3 late 900 us, missed 0, Proceed
    4 late 200 us, missed 1 step-long, Fault
    5 late 0 us, missed 0, Proceed
    samples 6, overruns 3, sleeps 3
    ");
}

#[test]
fn the_policy_stop_ends_the_loop_at_the_first_miss() {
    let clock = ScriptedClock::with_wakeups(&[]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Stop, &[MS / 10, 7 * MS / 2, MS / 10]), @"
    0 late 0 us, missed 0, Proceed
    1 late 0 us, missed 0, Proceed
    overrun at sample 2: 3 deadline(s) missed, 2.500 ms late, and the overrun policy is `stop`; lower the rate, give the loop a core of its own, or choose the policy `slip`, `continue` or `fault`
    samples 2, overruns 3, sleeps 2
    ");
}

#[test]
fn a_deadline_met_to_the_nanosecond_is_met_and_a_microsecond_more_is_a_miss() {
    let clock = ScriptedClock::with_wakeups(&[]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Stop, &[MS, MS, MS + 1_000, MS]), @"
    0 late 0 us, missed 0, Proceed
    1 late 0 us, missed 0, Proceed
    2 late 0 us, missed 0, Proceed
    overrun at sample 3: 1 deadline(s) missed, 0.001 ms late, and the overrun policy is `stop`; lower the rate, give the loop a core of its own, or choose the policy `slip`, `continue` or `fault`
    samples 3, overruns 1, sleeps 3
    ");
}

#[test]
fn a_loop_more_than_a_second_behind_ends_under_every_policy_but_slip() {
    let clock = ScriptedClock::with_wakeups(&[MAX_LAG_NS]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Continue, &[1, 0]), @"
    0 late 1000000 us, missed 1000 woke-late, Proceed
    1 late 999000 us, missed 0, Proceed
    samples 2, overruns 1000, sleeps 1
    ");
    let clock = ScriptedClock::with_wakeups(&[MAX_LAG_NS + MS]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Continue, &[1, 0]), @"
    the loop is 1.001 s behind at sample 0, more than the 1 s allowed; the machine can't keep this rate, or the process was paused: lower the rate, choose the policy `slip`, or run in lockstep
    samples 0, overruns 1001, sleeps 1
    ");
}

#[test]
fn slip_catches_up_three_ticks() {
    let clock = ScriptedClock::with_wakeups(&[0, 7 * MS / 2]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Slip, &[MS / 10; 7]), @"
    0 late 0 us, missed 0, Proceed
    1 late 3500 us, missed 3 woke-late, Proceed
    2 late 2600 us, missed 0, Proceed
    3 late 1700 us, missed 0, Proceed
    4 late 800 us, missed 0, Proceed
    5 late 0 us, missed 0, Proceed
    6 late 0 us, missed 0, Proceed
    samples 7, overruns 3, sleeps 4
    ");
}

#[test]
fn slip_moves_the_schedule_beyond_that_and_leaves_no_tick_out() {
    let clock = ScriptedClock::with_wakeups(&[0, 9 * MS / 2]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Slip, &[MS / 10; 5]), @"
    0 late 0 us, missed 0, Proceed
    1 late 4500 us, missed 4 woke-late, slipped 4, Proceed
    2 late 0 us, missed 0, Proceed
    3 late 0 us, missed 0, Proceed
    4 late 0 us, missed 0, Proceed
    samples 5, overruns 4, sleeps 5
    ");
    let clock = ScriptedClock::with_wakeups(&[]);
    // At 302 ms the tick due at 2 ms has missed 301 deadlines, its own included, and moves by the 300 periods that it
    // is behind. The next, at 307.1 ms, counts from there.
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Slip, &[MS / 10, 301 * MS, 51 * MS / 10, MS / 10]), @"
    0 late 0 us, missed 0, Proceed
    1 late 0 us, missed 0, Proceed
    2 late 300000 us, missed 301 step-long, slipped 300, Proceed
    3 late 4100 us, missed 5 step-long, slipped 4, Proceed
    samples 4, overruns 306, sleeps 2
    ");
}

#[test]
fn a_loop_that_slips_outlives_any_stall() {
    let clock = ScriptedClock::with_wakeups(&[MS, 3_600_000 * MS + MS / 2]);
    insta::assert_snapshot!(trace(&clock, OverrunPolicy::Slip, &[MS / 10; 4]), @"
    0 late 1000 us, missed 1 woke-late, Proceed
    1 late 100 us, missed 0, Proceed
    2 late 3600000500 us, missed 3600000 woke-late, slipped 3600000, Proceed
    3 late 0 us, missed 0, Proceed
    samples 4, overruns 3600001, sleeps 3
    ");
}

#[test]
fn policies_are_read_and_written_as_text() {
    for policy in OverrunPolicy::ALL {
        let name = policy.to_string();
        assert_eq!(name.parse(), Ok(policy));
        assert_eq!(serde_json::to_value(policy).unwrap(), *name);
    }
    let error = "skip".parse::<OverrunPolicy>().unwrap_err();
    insta::assert_snapshot!(error, @"unknown overrun policy `skip`; it must be one of slip, continue, fault, stop");
}

#[test]
fn the_summary_has_the_keys_of_the_program_s_json() {
    let clock = ScriptedClock::with_wakeups(&[2_000]);
    let rate = SampleRate::new(500.0).unwrap();
    let mut periodic = Periodic::start(&clock, rate, OverrunPolicy::Continue).unwrap();
    let nothing = LoopSummary {
        samples: 0,
        overruns: 0,
        overrun_causes: OverrunCauses::default(),
        slipped: 0,
        wakeup_us: None,
        exec_us: None,
    };
    assert_eq!(periodic.summary(), nothing);
    let tick = periodic.tick().unwrap();
    clock.work(1_000);
    periodic.finish(&tick, 0);
    insta::assert_snapshot!(serde_json::to_string(&periodic.summary()).unwrap(), @r#"{"samples":1,"overruns":0,"overrun_causes":{"woke_late":0,"step_long":0,"bus_long":0,"stolen":0,"preempted":0},"slipped":0,"wakeup_us":{"p50":2.0,"p99":2.0,"p99_9":2.0,"p99_99":2.0,"max":2.0},"exec_us":{"p50":1.0,"p99":1.0,"p99_9":1.0,"p99_99":1.0,"max":1.0}}"#);
}

proptest! {
    /// Whatever the delays: every index once and in order, no tick early, and as many misses reported as deadlines
    /// passed without the loop asleep for them, each with its cause. The oracle counts these one deadline at a time.
    #[test]
    fn every_miss_is_reported_once_with_its_cause(
        rate_hz in 10.0..20_000.0_f64,
        delays_periods in prop::collection::vec((0.0..6.0_f64, 0.0..3.0_f64, 0.0..1.0_f64), 1..60),
        policy in prop::sample::select(OverrunPolicy::ALL.to_vec()),
    ) {
        let rate = SampleRate::new(rate_hz).unwrap();
        let period_ns = 1e9 / rate_hz;
        let clock = ScriptedClock::with_wakeups(&[]);
        let mut periodic = Periodic::start(&clock, rate, policy).unwrap();
        let start_ns = periodic.start_ns();
        let (mut missed, mut waited) = (OverrunCauses::default(), 0);
        let (mut woke_ns, mut of_work) = (0, OverrunCause::StepLong);
        for (index, (wakeup, work, bus)) in delays_periods.iter().enumerate() {
            clock.wakeup_ns.borrow_mut().clear();
            clock.wakeup_ns.borrow_mut().push_back((wakeup * period_ns) as u64);
            let slept_before = clock.sleeps.get();
            let Ok(tick) = periodic.tick() else { break };
            let slept = clock.sleeps.get() > slept_before;
            waited += u64::from(slept);
            let cause = if slept { OverrunCause::WokeLate } else { of_work };
            prop_assert_eq!(tick.cause, (tick.missed > 0).then_some(cause));
            prop_assert_eq!(tick.held_up_since_ns, if slept || index == 0 { tick.deadline_ns } else { woke_ns });
            missed.count(cause, u64::from(tick.missed));
            woke_ns = tick.woke_ns;
            prop_assert_eq!(tick.index, index as u64);
            prop_assert!(tick.woke_ns >= tick.deadline_ns);
            let (work_ns, bus_ns) = ((work * period_ns) as u64, (work * period_ns * bus) as u64);
            of_work = if bus_ns > work_ns / 2 { OverrunCause::BusLong } else { OverrunCause::StepLong };
            clock.work(work_ns);
            periodic.finish(&tick, bus_ns);
            let mut due = 0;
            // The deadlines are counted by their instants alone: the loop uses the inverse, `last_due`, whose faults would
            // show here.
            while start_ns + rate.offset_ns(due) <= woke_ns {
                due += 1;
            }
            prop_assert_eq!(missed.total() + waited, due);
            prop_assert_eq!(periodic.summary().overrun_causes, missed);
        }
        // The misses of the tick at which a loop ended itself are counted, too.
        let summary = periodic.summary();
        prop_assert_eq!(summary.overruns, summary.overrun_causes.total());
        prop_assert!(summary.overruns >= missed.total());
    }
}

#[test]
fn work_is_long_on_the_bus_or_beside_it() {
    let clock = ScriptedClock::with_wakeups(&[]);
    let rate = SampleRate::new(1000.0).unwrap();
    let mut periodic = Periodic::start(&clock, rate, OverrunPolicy::Continue).unwrap();
    let mut causes = Vec::new();
    for bus_ns in [0, 2 * MS, MS, MS / 2, 0] {
        let tick = periodic.tick().unwrap();
        causes.push(tick.cause);
        clock.work(5 * MS / 2);
        periodic.finish(&tick, bus_ns);
    }
    let (step, bus) = (Some(OverrunCause::StepLong), Some(OverrunCause::BusLong));
    assert_eq!(causes, [None, step, bus, step, step]);
    let expected = OverrunCauses { step_long: 7, bus_long: 3, ..OverrunCauses::default() };
    assert_eq!(periodic.summary().overrun_causes, expected);
}

#[test]
fn a_second_on_the_real_clock() {
    let rate = SampleRate::new(1000.0).unwrap();
    let mut periodic = Periodic::start(&SystemClock, rate, OverrunPolicy::Continue).unwrap();
    let start_ns = periodic.start_ns();
    let (mut missed, mut last_woke_ns) = (0, 0);
    for index in 0..1000 {
        // On a machine stalled for over a second the loop must say so; nothing else may end it.
        let tick = match periodic.tick() {
            Ok(tick) => tick,
            Err(PeriodicError::TooFarBehind { late_ns, .. }) if late_ns > MAX_LAG_NS => return,
            Err(error) => panic!("{error}"),
        };
        assert_eq!(tick.index, index);
        assert_eq!(tick.deadline_ns, start_ns + index * MS);
        assert!(tick.woke_ns >= tick.deadline_ns && tick.woke_ns >= last_woke_ns);
        missed += u64::from(tick.missed);
        last_woke_ns = tick.woke_ns;
        // A deadline before this tick was either waited for, by a tick up to this one, or reported as missed.
        assert!((tick.woke_ns - start_ns) / MS < index + 1 + missed);
        periodic.finish(&tick, 0);
    }
    let summary = periodic.summary();
    assert_eq!((summary.samples, summary.overruns, summary.overrun_causes.total()), (1000, missed, missed));
    assert!(last_woke_ns - start_ns >= 999 * MS);
}
