//! The tick path of the real-time loop takes no memory. The guard aborts the process at the first allocation.

use assert_no_alloc::assert_no_alloc;
use resonarm::realtime::{Clock, OverrunPolicy, Periodic, SampleRate, SystemClock, ThreadSetup, unix_time_ns};

#[test]
fn ticks_on_time_late_and_failed_allocate_nothing() {
    ThreadSetup::default().apply();
    let rate = SampleRate::new(1999.5).unwrap();
    let mut periodic = Periodic::start(&SystemClock, rate, OverrunPolicy::Fault).unwrap();
    let overruns = assert_no_alloc(|| {
        for index in 0..400 {
            let Ok(tick) = periodic.tick() else { break };
            if index % 50 == 25 {
                SystemClock.sleep_until_ns(tick.woke_ns + 1_200_000); // work of more than two periods
            }
            assert!(unix_time_ns() > 0);
            periodic.finish(&tick);
        }
        periodic.summary().overruns
    });
    assert!(overruns >= 8, "the slow ticks were not counted: {overruns}");
    let mut periodic = Periodic::start(&SystemClock, rate, OverrunPolicy::Stop).unwrap();
    let start_ns = periodic.start_ns();
    let error = assert_no_alloc(|| {
        SystemClock.sleep_until_ns(start_ns + 1_000_000);
        periodic.tick()
    });
    assert!(error.is_err());
}
