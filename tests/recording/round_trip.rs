//! Every record is read as it was written, bit for bit.

use proptest::prelude::*;
use resonarm::protocol::{Frame, FrameFormat, Id};
use resonarm::realtime::OverrunCause;
use resonarm::recording::channels::Channels;
use resonarm::recording::{
    Clipped, Compression, Direction, Event, FlushPolicy, FrameRecord, Integrity, Options, Record, Recording,
    SampleRecord, StateRecord, TickRecord,
};
use resonarm::rig::{Load, Readings};
use resonarm::structure::{LoadSet, States};

use crate::{TestResult, options, record, run};

/// Any pair of doubles, every NaN among them.
fn pair() -> impl Strategy<Value = [f64; 2]> {
    any::<[u64; 2]>().prop_map(|bits| bits.map(f64::from_bits))
}

fn frame() -> impl Strategy<Value = Frame> {
    let id = prop_oneof![
        (0..=0x7FF_u16).prop_map(Id::Standard),
        (0..=0x1FFF_FFFF_u32).prop_map(Id::Extended), // small ones too: the number must not decide the format
        (0..=0x7FF_u32).prop_map(Id::Extended),
    ];
    let format = prop_oneof![
        Just(FrameFormat::Classic),
        Just(FrameFormat::Remote),
        any::<(bool, bool)>().prop_map(|(bit_rate_switch, error_state_indicator)| FrameFormat::Fd {
            bit_rate_switch,
            error_state_indicator
        }),
    ];
    let data = prop::collection::vec(any::<u8>(), 0..=64);
    (id, format, data).prop_filter_map("length", |(id, format, data)| Frame::new(id, format, &data).ok())
}

fn clipped() -> impl Strategy<Value = Clipped> {
    let pairs = any::<[[bool; 2]; 3]>();
    pairs.prop_map(|[acceleration_b, acceleration_c, head_force]| Clipped {
        acceleration_b,
        acceleration_c,
        head_force,
    })
}

fn any_record(sample: u64, has_coil: bool) -> impl Strategy<Value = Record> {
    let direction = prop_oneof![Just(Direction::Received), Just(Direction::Sent)];
    prop_oneof![
        4 => ([pair(), pair(), pair(), pair()], any::<u64>().prop_map(f64::from_bits)).prop_map(
            move |([x, v, torque_nm, force_n], current_a)| {
                let coil_current_a = has_coil.then_some(current_a);
                let is_end = sample % 7 == 3;
                Record::State(StateRecord {
                    sample,
                    states: States::new(&[x, v].concat(), coil_current_a.as_slice()).unwrap(),
                    load: Load::planar(torque_nm, force_n),
                    taken: LoadSet::NATIVE,
                    is_end,
                })
            }
        ),
        4 => ([pair(), pair(), pair()], clipped()).prop_map(move |([b, c, head_force_n], clipped)| {
            let (acceleration_b_m_s2, acceleration_c_m_s2) = (b, c);
            let more = Readings::NONE;
            Record::Sample(SampleRecord {
                sample,
                acceleration_b_m_s2,
                acceleration_c_m_s2,
                head_force_n,
                clipped,
                more,
            })
        }),
        4 => (frame(), direction, any::<u64>(), any::<Option<u64>>()).prop_map(
            move |(frame, direction, time_ns, bus_timestamp_ns)| {
                Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame })
            }
        ),
        2 => (any::<(u64, u64, u32)>(), prop::option::of(prop::sample::select(OverrunCause::ALL.to_vec()))).prop_map(
            move |((wakeup_ns, exec_ns, overruns), cause)| {
                Record::Tick(TickRecord { sample, wakeup_ns, exec_ns, overruns, cause })
        }),
        1 => any::<(u64, i64)>().prop_map(move |(time_ns, value)| {
            Record::Event(Event { sample, time_ns, name: "state.fault", value })
        }),
    ]
}

/// Samples that mostly follow each other and sometimes jump, of a plant with or without a coil.
fn any_run() -> impl Strategy<Value = (bool, Vec<Record>)> {
    let samples = prop::collection::vec((0..20_u32, any::<u64>()), 0..200).prop_map(|jumps| {
        let samples = jumps.into_iter().scan(0_u64, |sample, (chance, anywhere)| {
            // One record in twenty jumps anywhere, and about half of the others are of the same sample as the one
            // before.
            *sample = if chance == 0 { anywhere } else { sample.wrapping_add(u64::from(chance > 9)) };
            Some(*sample)
        });
        samples.collect::<Vec<_>>()
    });
    (any::<bool>(), samples).prop_flat_map(|(has_coil, samples)| {
        let records = samples.into_iter().map(|sample| any_record(sample, has_coil)).collect::<Vec<_>>();
        (Just(has_coil), records)
    })
}

fn any_options() -> impl Strategy<Value = Options> {
    (any::<bool>(), 1..50_u64, 1..20_u32, 0..20_u64).prop_map(|(zstd, flush, batch_samples, plot_every_samples)| {
        Options {
            compression: if zstd { Compression::Zstd } else { Compression::None },
            flush: FlushPolicy::Samples(flush),
            batch_samples,
            plot_every_samples,
            ..options()
        }
    })
}

/// A record as text, where equal texts mean equal bits.
fn exact<Name: AsRef<str>>(record: &Record<Name>) -> String {
    let bits =
        |pairs: &[[f64; 2]]| pairs.iter().map(|pair| format!("{:x?}", pair.map(f64::to_bits))).collect::<String>();
    match record {
        Record::State(r) => {
            let moving = r.states.moving().iter().map(|number| format!("{:x?}", number.to_bits())).collect::<String>();
            let numbers = format!("{moving}{:x?}", r.load.parts().map(f64::to_bits));
            let current = r.states.internal().first().copied().map(f64::to_bits);
            format!("{} {} {current:x?} {numbers}", r.sample, r.is_end)
        }
        Record::Sample(r) => {
            let numbers = bits(&[r.acceleration_b_m_s2, r.acceleration_c_m_s2, r.head_force_n]);
            format!("{} {:?} {numbers}", r.sample, r.clipped)
        }
        Record::Frame(r) => format!("{r:?} {:?}", r.frame.format()),
        Record::Tick(r) => format!("{r:?}"),
        Record::Event(r) => format!("{} {} {} {}", r.sample, r.time_ns, r.name.as_ref(), r.value),
    }
}

/// The records of each topic in order; batches of different topics may overtake each other.
fn by_topic<Name: AsRef<str>>(records: &[Record<Name>]) -> [Vec<String>; 5] {
    let mut topics = [const { Vec::new() }; 5];
    for record in records {
        let topic = match record {
            Record::State(_) => 0,
            Record::Sample(_) => 1,
            Record::Frame(_) => 2,
            Record::Tick(_) => 3,
            Record::Event(_) => 4,
        };
        topics[topic].push(exact(record));
    }
    topics
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_record_comes_back((has_coil, records) in any_run(), options in any_options()) {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("run.mcap");
        let options = Options { channels: Channels::arm(has_coil), ..options };
        record(&path, options, &records).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let recording = Recording::open(&path)?;
        // Samples come in any order here, which no run has: that is said, and every record is there.
        let is_read_whole = matches!(recording.integrity(), Integrity::Complete | Integrity::Incomplete { .. });
        prop_assert!(is_read_whole, "{}", recording.integrity());
        let back = recording.records()?.collect::<Result<Vec<_>, _>>()?;
        prop_assert_eq!(by_topic(&back), by_topic(&records));
        let summary = recording.summary();
        prop_assert_eq!(summary.topics.values().map(|topic| topic.records).sum::<u64>(), records.len() as u64);
    }
}

#[test]
fn a_recording_says_what_was_said_of_it() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    // The metadata have the period as text: this one needs all its digits there.
    let options = Options { dt_s: 1.0 / 3000.0, ..options() };
    record(&path, options, &run(1001)?)?;
    let recording = Recording::open(&path)?;
    assert_eq!(recording.origin().dt_s.to_bits(), (1.0_f64 / 3000.0).to_bits());
    assert_eq!(recording.origin().interface, "memory");
    assert_eq!(recording.origin().build, resonarm::recording::build_info());
    assert_eq!(recording.configuration(), &crate::configuration());
    assert_eq!(recording.statistics().and_then(|statistics| statistics.get("overruns")).map(String::as_str), Some("0"));
    let summary = recording.summary();
    assert_eq!(summary.samples, Some((0, 1000)));
    assert!((summary.duration_s - 1.0 / 3.0).abs() < 1e-12);
    assert_eq!(summary.file_bytes, std::fs::metadata(&path)?.len());
    assert_eq!(summary.topics["/plant/steps"].records, 1001);
    // Samples 0, 10, and so on to 1000.
    assert_eq!(summary.topics["/plant/state"].messages, 101);
    Ok(())
}
