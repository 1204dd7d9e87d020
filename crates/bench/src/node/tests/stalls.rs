//! Nodes that are stopped, partners that are silent, timeouts of any length.

use super::*;

#[test]
fn a_plant_that_was_stopped_does_not_fault_its_controller() {
    let mut bench = Bench::new(2.0);
    bench.run(300);
    for _ in 0..5 {
        // Fifteen times the timeout of commands: by the clock alone the plant would fault.
        bench.now_ns += 300 * TICK_NS;
        bench.run(50);
        assert!(bench.plant.is_armed());
    }
    assert_eq!((bench.outcome(), bench.emergencies()), (None, alloc::vec![]));
}

#[test]
fn a_controller_that_was_stopped_does_not_take_its_own_silence_for_the_plants() {
    let mut bench = Bench::new(2.0);
    bench.run(300);
    let exciter = bench.exciter.as_mut().unwrap();
    // Longer than the 350 ms for which it waits, but it was the controller that did not listen.
    exciter.handle_deadline(bench.now_ns + 400 * TICK_NS);
    assert_eq!(exciter.outcome(), None);
}

#[test]
fn a_controller_silent_while_the_plant_listens_is_detected_in_time_also_after_a_stall() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    bench.exciter = None;
    bench.run(10);
    bench.now_ns += 300 * TICK_NS;
    // 9 ticks since the last command, and the stall counts as one.
    bench.run(9);
    assert_eq!(bench.emergencies(), []);
    bench.run(2);
    assert_eq!(bench.emergencies(), [EmergencyCode::CommandTimeout]);
}

#[test]
fn a_plant_that_catches_up_counts_the_clock() {
    let mut bench = Bench::new(10.0);
    bench.run(300);
    bench.exciter = None;
    bench.run(5);
    // Overdue ticks, all at the same time on the clock.
    for _ in 0..200 {
        bench.now_ns -= TICK_NS;
        bench.tick();
    }
    assert!(bench.plant.is_armed());
}

#[test]
fn timeouts_of_any_length_never_overflow() {
    let timing = Timing {
        command_timeout_ns: u64::MAX,
        partner_timeout_ns: u64::MAX,
        heartbeat_period_ns: u64::MAX,
        hello_period_ns: u64::MAX,
        command_age_ns: u64::MAX,
        ..Timing::real_time(RATE_HZ)
    };
    let mut bench = Bench::with(timing, 0.5);
    bench.run(300);
    assert!(bench.plant.is_armed());
    bench.run(300);
    assert_eq!((bench.outcome(), bench.emergencies()), (Some(ExciterOutcome::Finished), alloc::vec![]));
}

proptest! {
    /// Called at its deadlines, a plant whose controller has died faults in time, never before.
    #[test]
    fn a_plant_asks_to_be_called_in_time(late_ns in prop::collection::vec(0_u64..400_000_000, 400)) {
        let (mut plant, _) = armed();
        let (mut now_ns, mut listened_ns) = (0_u64, 0_u64);
        for late_ns in late_ns {
            while plant.poll_transmit().is_some() {}
            // Every third call is late.
            let next_ns = plant.next_deadline_ns().max(now_ns) + if late_ns % 3 == 0 { late_ns } else { 0 };
            listened_ns += (next_ns - now_ns).min(TICK_NS);
            now_ns = next_ns;
            plant.handle_deadline(now_ns);
            prop_assert_eq!(plant.is_armed(), listened_ns < 20 * TICK_NS);
            if !plant.is_armed() {
                return Ok(());
            }
        }
        prop_assert!(false, "never faulted: listened for {listened_ns} ns");
    }

    /// Two heartbeats are never more than 100 ms apart, at every rate for real time, though the plant acts only at its
    /// ticks and those are up to 0.9 of a period late.
    #[test]
    fn heartbeats_keep_their_bound(rate_hz in 100_u16..=2000, late in prop::collection::vec(0.0..0.9, 300)) {
        let mut plant = PlantNode::new(Network::default(), rate_hz, Timing::real_time(rate_hz), Exciter::default());
        plant.start(0);
        let period_ns = 1e9 / f64::from(rate_hz);
        let mut last_ns = None;
        for (k, late) in late.into_iter().cycle().take(usize::from(rate_hz)).enumerate() {
            let now_ns = ((k as f64 + late) * period_ns) as u64;
            plant.handle_deadline(now_ns);
            while let Some(frame) = plant.poll_transmit() {
                if frame.id() == resonarm_protocol::Id::Standard(0x701) {
                    let apart_ns = now_ns - last_ns.replace(now_ns).unwrap_or(now_ns);
                    prop_assert!(apart_ns <= 100_000_000, "{apart_ns} ns apart at {rate_hz} Hz");
                }
            }
        }
    }
}
