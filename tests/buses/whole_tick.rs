//! The tick of the real-time loop as a user runs it, with everything in it, takes no memory and gives none back, on any
//! bus: bus, end-to-end protection, control law on the other end, instruments, recording, a view that watches.

use std::time::Duration;

use resonarm::bus::{Bus, BusError, Filter, Received, Sent, Statistics, memory};
use resonarm::node::ExciterOutcome;
use resonarm::protocol::Frame;
use resonarm::realtime::Spin;
use resonarm::recording::Existing;
use resonarm::run::{Mode, Options, PlantOutcome, RecordTo, Session, Signals, watch};
use resonarm::scenario::Scenario;

use crate::contract::Pair;
use crate::no_alloc::taken_or_given;

/// Ends a hang, and is an error then; far longer than a machine under load keeps a thread waiting.
const PATIENCE: Duration = Duration::from_secs(60);

/// Timeouts far longer than a busy machine stops either end. The overdue samples of such a stop are ticks as others.
const SCENARIO: &str = "
[simulation]
rate_hz = 500
seed = 7
[network]
profile = '{profile}'
command_timeout_s = 20
partner_timeout_s = 30
[[structure.elements]]
kind = 'polynomial'
at = ['tip.x', 'tip.y']
terms = [{ powers = [2, 1], energy = 1e6 }, { powers = [4, 0], energy = 1e8 }, { powers = [0, 4], energy = 1e8 }]
[rig]
head = { range_n = 200, noise_rms_n = 0.02, gain = 1.02, highpass_hz = 0.5, lowpass_hz = 200, bits = 24 }
sensors.b = { range_m_s2 = 490, noise_rms_m_s2 = 0.03, delay_samples = 3, bits = 16 }
[[rig.faults]]
instrument = 'c'
kind = 'noise'
rms_m_s2 = 1
from_s = 0.1
[excitation]
amplitude = { exciter_x = 40.0 }
ramp_s = 0.2
profile = { waveform = 'stepped-sine', from_hz = 18, to_hz = 20, steps = 3, dwell_s = 0.5, settle_s = 0.1 }
";

/// A bus that looks, each time the loop sends, how often its thread has taken memory or given it back.
struct Looking {
    bus: Box<dyn Bus>,
    sends: u64,
    at_first: u64,
    /// The first send before which memory was taken or given back since the first.
    changed_at: Option<u64>,
}

impl Bus for Looking {
    fn name(&self) -> String {
        self.bus.name()
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.bus.send(frame)
    }

    fn send_all(&mut self, frames: &mut &[Frame]) -> Result<Sent, BusError> {
        let count = taken_or_given();
        if self.sends == 0 {
            // Counted from the first send on: what the run allocates before its loop begins is allowed.
            self.at_first = count;
        } else if count != self.at_first {
            self.changed_at.get_or_insert(self.sends);
        }
        self.sends += 1;
        self.bus.send_all(frames)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        self.bus.receive()
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.bus.wait(timeout)
    }

    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError> {
        self.bus.set_filters(filters)
    }

    fn statistics(&self) -> Statistics {
        self.bus.statistics()
    }

    fn close(&mut self) -> Result<(), BusError> {
        self.bus.close()
    }
}

/// Plays the scenario over the bus, the plant on the calling thread.
pub fn takes_no_memory((plant_end, mut exciter_end): Pair, profile: &str) {
    let folder = tempfile::tempdir().unwrap();
    let scenario = Scenario::parse(&SCENARIO.replace("{profile}", profile), "test").unwrap();
    let session = |record| {
        let options =
            Options { record, spin: Spin::Auto, end_on_disarm: true, patience: Some(PATIENCE), ..Options::default() };
        Session::new(scenario.clone(), Mode::RealTime, options).unwrap()
    };
    let record = RecordTo { path: folder.path().join("run.mcap"), existing: Existing::Refuse };
    let (watch, mut watcher) = watch();
    let plant = session(Some(record)).watched(watch);
    let mut bus = Looking { bus: plant_end, sends: 0, at_first: 0, changed_at: None };
    let (plant, exciter) = std::thread::scope(|scope| {
        let exciter = scope.spawn(|| session(None).exciter(&mut *exciter_end, &Signals::default()).unwrap());
        (plant.plant(&mut bus, &Signals::default(), &mut |_| {}).unwrap(), exciter.join().unwrap())
    });
    assert_eq!((plant.outcome, exciter.outcome), (PlantOutcome::Disarmed, Some(ExciterOutcome::Finished)), "{plant:?}");
    let recording = plant.recording.as_ref().unwrap();
    assert_eq!(recording.lost.values().sum::<u64>(), 0, "{recording:?}");
    let mut noticed = 0;
    watcher.take(usize::MAX, |_, _| noticed += 1);
    // Three dwells of 0.5 s at 500 Hz are 750 samples, without those before arming.
    assert!(noticed > 700 && bus.sends > 750 && plant.samples > 750, "{noticed} {} {plant:?}", bus.sends);
    assert_eq!(bus.changed_at, None, "of {} sends", bus.sends);
}

#[test]
fn on_memory() {
    for profile in ["classic", "fd"] {
        let [near, far] = memory::pair(1024);
        takes_no_memory((Box::new(near), Box::new(far)), profile);
    }
}
