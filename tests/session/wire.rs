//! A closed loop over a bus on which frames take their time.

use std::path::Path;

use resonarm::control::ControlSpec;
use resonarm::excitation::Waveform;
use resonarm::node::ExciterOutcome;
use resonarm::protocol::bits::{BitRates, Bits, of};
use resonarm::protocol::{Message, Profile, Receiver, SPEC};
use resonarm::realtime::{Clock, SystemClock};
use resonarm::recording::{Direction, Existing, Recording};
use resonarm::run::{BothReport, Mode, Options, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

const NOMINAL_HZ: u32 = 1_000_000;

/// The shaker's scenario in the FD profile, at a few frequencies.
fn scenario(rate_hz: u32, data_bit_rate_hz: u32, steps: u32, dwell_s: f64) -> Scenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/shaker.toml");
    let mut scenario = Scenario::read(&path).unwrap();
    scenario.simulation.rate_hz = rate_hz.into();
    scenario.network.profile = Profile::Fd;
    scenario.network.bit_rate_hz = Some(NOMINAL_HZ);
    scenario.network.data_bit_rate_hz = Some(data_bit_rate_hz);
    let Some(ControlSpec::ForceControl(control)) = &mut scenario.control else { panic!("{:?}", scenario.control) };
    control.profile = Waveform::SteppedSine { from_hz: 20.0, to_hz: 24.0, steps, dwell_s, settle_s: 0.7 * dwell_s };
    scenario
}

fn both(scenario: &Scenario, mode: Mode, path: &Path) -> BothReport {
    let record = Some(RecordTo { path: path.to_path_buf(), existing: Existing::Overwrite });
    let session = Session::new(scenario.clone(), mode, Options { record, ..Options::default() }).unwrap();
    session.both(&Signals::default(), &mut |_event| {}).unwrap()
}

/// How often a command answered the last sample, the one before …, and the bits of all frames.
fn ages(scenario: &Scenario, path: &Path) -> (Vec<u64>, Bits) {
    let mut receiver = Receiver::new(scenario.network().unwrap());
    let (mut ages, mut bits) = (Vec::new(), Bits::default());
    for record in Recording::open(path).unwrap().frames().unwrap() {
        let record = record.unwrap();
        bits = bits.plus(of(&record.frame));
        if record.direction == Direction::Sent {
            continue;
        }
        if let Some(Message::Force(command)) = receiver.accept(&record.frame).unwrap() {
            // A frame has the low 16 bits of the sample, which wrap.
            let age = usize::from((record.sample as u16).wrapping_sub(command.sample));
            ages.resize(ages.len().max(age + 1), 0);
            ages[age] += 1;
        }
    }
    (ages, bits)
}

/// The figures of section 10 of the specification.
#[test]
fn a_force_is_held_over_the_fd_bus_at_2_khz_with_2_mbit_s_and_at_3_9_khz_with_5() {
    let folder = tempfile::tempdir().unwrap();
    for (rate_hz, mbit_s) in [(2000, 2), (3900, 5)] {
        let data_hz = mbit_s * NOMINAL_HZ;
        let scenario = scenario(rate_hz, data_hz, 3, 1.5);
        let path = folder.path().join("run.mcap");
        let report = both(&scenario, Mode::Free, &path);
        assert_eq!((report.exciter.outcome, report.exciter.missed_samples), (Some(ExciterOutcome::Finished), 0));
        let refused = report.plant.refused;
        assert_eq!(
            [refused.not_armed, refused.late, refused.out_of_order, refused.repeated, refused.out_of_range],
            [0; 5]
        );
        assert_eq!((report.plant.bus.dropped, report.plant.bus.refused), (0, 0));
        assert_eq!(report.exciter.responses.len(), 3);
        for point in &report.exciter.responses {
            // The scenario asks for a force of 2 N.
            assert!(point.settled && (point.load / 2.0 - 1.0).abs() < 3e-3, "{rate_hz} Hz: {point:?}");
        }
        let (ages, bits) = ages(&scenario, &path);
        let [in_time, late] = ages[..] else { panic!("{rate_hz} Hz: {ages:?}") };
        let rates = BitRates { nominal_hz: NOMINAL_HZ, data_hz };
        let load = 100.0 * 1e-9 * bits.time_ns(rates) as f64 * f64::from(rate_hz) / report.plant.samples as f64;
        let late = 100.0 * late as f64 / (in_time + late) as f64;
        let figures = format!(
            "- {rate_hz} Hz at {mbit_s} Mbit/s takes {load:.1} % of the bus; \
             {late:.2} % of the commands are a sample late.\n"
        );
        assert!(SPEC.contains(&figures), "{figures}");
    }
}

#[test]
fn in_lockstep_frames_take_their_time_by_the_clock_and_change_no_reading() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let timed = scenario(2000, 2_000_000, 1, 1.0);
    let mut ideal = timed.clone();
    (ideal.network.bit_rate_hz, ideal.network.data_bit_rate_hz) = (None, None);
    let free = both(&ideal, Mode::Free, &path);
    let begun_ns = SystemClock.now_ns();
    let lockstep = both(&timed, Mode::Lockstep, &path);
    let took_ns = SystemClock.now_ns() - begun_ns;
    assert_eq!(lockstep.exciter.outcome, Some(ExciterOutcome::Finished));
    assert_eq!(lockstep.exciter.responses, free.exciter.responses);
    let (ages, bits) = ages(&timed, &path);
    assert_eq!(ages.len(), 1, "{ages:?}");
    let least_ns = bits.time_ns(BitRates { nominal_hz: NOMINAL_HZ, data_hz: 2_000_000 });
    assert!(took_ns >= least_ns && least_ns > 200_000_000, "{took_ns} ns, on the wire {least_ns} ns");
}

#[test]
fn what_a_bus_can_not_be_made_to_do_is_refused() {
    let mut scenario = scenario(1000, 2_000_000, 1, 1.5);
    let real_time = Session::new(scenario.clone(), Mode::RealTime, Options::default()).unwrap();
    let error = real_time.both(&Signals::default(), &mut |_event| {}).unwrap_err();
    insta::assert_snapshot!(error, @"network.bit_rate_hz is 1000000, but in real time plant and exciter of one process share a bus in memory, on which frames take no time; leave it out, or use the mode free or lockstep");
    scenario.network.bit_error_rate = Some(1e-6);
    let says = |mode| Session::new(scenario.clone(), mode, Options::default()).unwrap_err().to_string();
    insta::assert_snapshot!(says(Mode::RealTime), @"network.bit_error_rate is 1e-6, but the bus of the mode real-time can't simulate bit errors; leave it out, use --mode free, or corrupt frames with [[network.faults]]");
    insta::assert_snapshot!(says(Mode::Lockstep), @"network.bit_error_rate is 1e-6, but the bus of the mode lockstep can't simulate bit errors; leave it out, use --mode free, or corrupt frames with [[network.faults]]");
    scenario.simulation.rate_hz = 3900.0;
    insta::assert_snapshot!(Session::new(scenario, Mode::Free, Options::default()).unwrap_err(), @"simulation.rate_hz is 3900: frames and heartbeats take up to 2408322 bit/s, 133.0 % of network.bit_rate_hz, 1000000, and data_bit_rate_hz, 2000000; lower the rate to 2931, or raise network.data_bit_rate_hz to 2880858");
}
