//! Real time: samples at absolute deadlines.
//!
//! Tick k, due at k/rate: process the frames that arrived since tick k − 1, hold the command, advance from sample k − 1
//! to k, measure and send sample k. A command that answers sample k − 1 before tick k thus acts from k − 1 on, exactly
//! as in lockstep. Nothing in the tick allocates, locks, logs or blocks; the bus and the recording guarantee the same.

use super::bench::Bench;
use super::core_watch::Overrun;
use super::ending::Ending;
use super::error::RunError;
use super::finish::{EndedBy, finish};
use super::pace::{Pace, Speed};
use super::report::{Histograms, PlantReport};
use super::round_trip::RoundTrips;
use super::signals::Signals;
use resonarm_bus::Bus;
use resonarm_files::recording::{Record, TickRecord};
use resonarm_protocol::EmergencyCode;
use resonarm_realtime::{Action, Clock, OverrunPolicy, Periodic, SampleRate, Spin, Tick};

/// Runs the plant in real time on the calling thread, until its end or a requested stop. Missed deadlines are reported
/// to `overruns`.
pub(super) fn real_time<C: Clock>(
    bench: &mut Bench,
    bus: &mut dyn Bus,
    clock: &C,
    (rate, overrun, spin): (SampleRate, OverrunPolicy, Spin),
    ending: Ending,
    (signals, overruns): (&Signals, &mut dyn FnMut(Overrun)),
) -> Result<PlantReport, RunError> {
    let spin = spin.choose(clock, rate)?;
    let spin_ns = spin.map_or(0, |choice| choice.spin_ns());
    let mut periodic = Periodic::start(clock, rate, overrun)?.spinning(spin_ns);
    let mut pace = Pace::start_at(clock, periodic.start_ns(), rate, Speed::ACTUAL)?;
    bench.round_trips = Some(RoundTrips::new()?);
    let ended = ticks(bench, bus, &mut periodic, &pace, ending, (signals, overruns));
    let (outcome, error) = finish(bench, bus, &mut pace, ended);
    let timing = periodic.summary();
    let [wakeup, exec] = periodic.into_histograms();
    Ok(PlantReport {
        overruns: timing.overruns,
        overrun_causes: timing.overrun_causes,
        slipped: timing.slipped,
        spin,
        histograms: Histograms { wakeup: Some(wakeup), exec: Some(exec) },
        wakeup_us: timing.wakeup_us,
        exec_us: timing.exec_us,
        ..PlantReport::new(bench, bench.counts(bus.statistics()), outcome, error)
    })
}

fn ticks<C: Clock>(
    bench: &mut Bench,
    bus: &mut dyn Bus,
    periodic: &mut Periodic<'_, C>,
    pace: &Pace<'_, C>,
    ending: Ending,
    (signals, overruns): (&Signals, &mut dyn FnMut(Overrun)),
) -> Result<EndedBy, RunError> {
    bench.start(pace.start_ns, pace.now_ns());
    loop {
        let tick = periodic.tick()?;
        let now_ns = pace.now_ns();
        let bus_ns = work(bench, bus, &tick, now_ns, pace)?;
        let exec_ns = periodic.finish(&tick, bus_ns);
        let Tick { index: sample, wakeup_ns, missed, cause, .. } = tick;
        // Behind `finish`, which takes the execution time: a tick can't contain the time of its own record.
        bench.record(&Record::Tick(TickRecord { sample, wakeup_ns, exec_ns, overruns: missed, cause }));
        if let Some(overrun) = Overrun::of(&tick, pace.start_ns) {
            overruns(overrun);
        }
        bench.show(signals.gauges(), wakeup_ns, exec_ns, missed);
        signals.set_done(tick.index);
        if let Some(end) = ending.reached(bench, signals, || now_ns) {
            return Ok(end);
        }
    }
}

/// Does the work of a tick. Returns how much of it was spent on the bus, ns.
fn work<C: Clock>(
    bench: &mut Bench,
    bus: &mut dyn Bus,
    tick: &Tick,
    now_ns: u64,
    pace: &Pace<'_, C>,
) -> Result<u64, RunError> {
    bench.receive(now_ns, bus)?;
    let received_ns = pace.now_ns();
    if tick.action == Action::Fault {
        bench.fault(now_ns, EmergencyCode::Overrun, u64::from(tick.missed));
    }
    if tick.slipped > 0 {
        bench.slipped(tick.slipped);
    }
    bench.handle_deadline(now_ns);
    // Tick 0 measures the initial state: there is no sample before it from which to advance.
    if tick.index > 0 {
        bench.advance(now_ns)?;
    }
    bench.measure()?;
    let measured_ns = pace.now_ns();
    bench.transmit_timed(now_ns, pace.clock.unix_ns(), bus)?;
    // Receiving and sending are separate, since a long bus call has another remedy than a long integration step.
    Ok((received_ns - now_ns) + (pace.now_ns() - measured_ns))
}
