use super::*;
use crate::memory::{self, MemoryBus};
use resonarm_realtime::VirtualClock;

const MS: u64 = 1_000_000;

#[derive(serde::Deserialize)]
struct Faults {
    faults: Vec<FaultSpec>,
}

fn faults(text: &str) -> Vec<FaultSpec> {
    toml::from_str::<Faults>(text).unwrap().faults
}

struct Bench {
    clock: VirtualClock,
    plant: Faulty<MemoryBus, VirtualClock>,
    other: MemoryBus,
}

impl Bench {
    /// A bus whose plant has these faults, of the seed.
    fn new(text: &str, seed: u64) -> Bench {
        let clock = VirtualClock::default();
        let [near, other] = memory::pair(1024);
        let faults = faults(text);
        check(&faults).unwrap();
        Bench { plant: Faulty::new(near, clock.clone(), &faults, Node::Plant, seed), clock, other }
    }

    fn at(&self, now_ns: u64) {
        self.clock.advance_to_ns(now_ns);
    }

    /// The frames that the plant has received by now.
    fn received(&mut self) -> Vec<Frame> {
        core::iter::from_fn(|| self.plant.receive().unwrap()).map(|received| received.frame).collect()
    }

    /// The frames received from the plant by now.
    fn sent(&mut self) -> Vec<Frame> {
        // Frames that wait leave when the end is called, and receiving is a call that sends nothing by itself.
        let _nothing = self.plant.receive().unwrap();
        core::iter::from_fn(|| self.other.receive().unwrap()).map(|received| received.frame).collect()
    }
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::classic(Id::Standard(id), data).unwrap()
}

fn fault(rest: &str) -> String {
    format!("[[faults]]\nnode = 'plant'\n{rest}\n")
}

fn numbered(k: u16) -> Frame {
    frame(0x100 + k % 2, &k.to_le_bytes())
}

#[test]
fn loss_strikes_its_identifiers_in_its_time_and_direction() {
    let text = fault("kind = 'loss'\nfrom_s = 0.01\nto_s = 0.02\nids = [0x101]\ndirection = 'send'");
    let mut bench = Bench::new(&text, 1);
    // A frame each millisecond, with the two identifiers in turn: the fault is over 10 of them, and concerns every
    // other one.
    for k in 0..30 {
        bench.at(u64::from(k) * MS);
        bench.plant.send(&numbered(k)).unwrap();
        bench.other.send(&numbered(k)).unwrap();
    }
    let whole: Vec<Frame> = (0..30).map(numbered).collect();
    assert_eq!(bench.received(), whole);
    let expected: Vec<Frame> = (0..30).filter(|k| !(10..20).contains(k) || k % 2 == 0).map(numbered).collect();
    assert_eq!(bench.sent(), expected);
    assert_eq!(bench.plant.statistics(), Statistics { received: 30, sent: 30, ..Statistics::default() });
}

#[test]
fn a_count_strikes_the_first_and_a_probability_its_share_by_the_seed() {
    let run = |rest: &str, seed| {
        let mut bench = Bench::new(&fault(&format!("kind = 'loss'\nfrom_s = 0\n{rest}")), seed);
        (0..1000).for_each(|k| _ = bench.other.send(&numbered(k)));
        bench.received()
    };
    assert_eq!(run("count = 3", 1), (3..1000).map(numbered).collect::<Vec<_>>());
    let half = run("probability = 0.5", 1);
    assert_eq!(half, run("probability = 0.5", 1));
    assert_ne!(half, run("probability = 0.5", 2));
    // Four standard errors of a thousand.
    assert!((437..=563).contains(&half.len()), "{}", half.len());
    assert_eq!(run("probability = 0", 1).len(), 1000);
}

#[test]
fn late_frames_hold_up_those_behind_them_unless_they_are_reordered() {
    let late = |kind: &str| {
        let text = fault(&format!("kind = '{kind}'\nfrom_s = 0\ncount = 1\ndelay_s = 0.005\ndirection = 'receive'"));
        let mut bench = Bench::new(&text, 1);
        (0..3).for_each(|k| _ = bench.other.send(&numbered(k)));
        let prompt = bench.received();
        let next_ns = bench.plant.next_event_ns();
        bench.at(5 * MS);
        (prompt, next_ns, bench.received())
    };
    let [first, second, third] = [0, 1, 2].map(numbered);
    assert_eq!(late("delay"), (vec![], Some(5 * MS), vec![first, second, third]));
    assert_eq!(late("reordering"), (vec![second, third], Some(5 * MS), vec![first]));
    let (prompt, next_ns, rest) = late("jitter");
    assert!((prompt.as_slice(), rest.as_slice()) == (&[], &[first, second, third]));
    assert!((1..5 * MS).contains(&next_ns.unwrap()));
}

#[test]
fn duplicates_come_twice_and_bit_errors_change_one_bit() {
    let mut bench = Bench::new(&fault("kind = 'duplication'\nfrom_s = 0\ncount = 1\ndirection = 'send'"), 1);
    (0..2).for_each(|k| _ = bench.plant.send(&numbered(k)));
    assert_eq!(bench.sent(), [numbered(0), numbered(0), numbered(1)]);

    let mut bench = Bench::new(&fault("kind = 'bit_error'\nfrom_s = 0\ndirection = 'send'"), 1);
    let mut places = [0_u32; 64];
    for _ in 0..1000 {
        bench.plant.send(&frame(0x123, &[0x5A; 8])).unwrap();
        let [got] = bench.sent()[..] else { panic!("one frame") };
        let inverted = u64::from_le_bytes(got.data().try_into().unwrap()) ^ u64::from_le_bytes([0x5A; 8]);
        assert_eq!((got.id(), inverted.count_ones()), (Id::Standard(0x123), 1));
        places[inverted.trailing_zeros() as usize] += 1;
    }
    // Each bit 15.6 times, a Poisson number.
    assert!(places.iter().all(|count| (2..40).contains(count)), "{places:?}");
    bench.plant.send(&frame(0x701, &[])).unwrap();
    // A frame without content has no bit to invert, and goes through as it is.
    assert_eq!(bench.sent(), [frame(0x701, &[])]);
}

#[test]
fn a_babbling_node_sends_at_its_rate_beside_its_frames() {
    let mut bench =
        Bench::new(&fault("kind = 'babble'\nfrom_s = 0.001\nto_s = 0.0035\nrate_hz = 1000\nids = [5, 0x201]"), 1);
    bench.plant.send(&numbered(0)).unwrap();
    assert_eq!(bench.plant.next_event_ns(), Some(MS));
    assert_eq!(bench.sent(), [numbered(0)]);
    let mut ids = Vec::new();
    while let Some(next_ns) = bench.plant.next_event_ns() {
        bench.at(next_ns);
        ids.extend(bench.sent().iter().map(|frame| (frame.id().raw(), next_ns / MS)));
    }
    // The fault ends at 3.5 ms, before the fourth frame would be due.
    assert_eq!(ids, [(5, 1), (0x201, 2), (5, 3)]);
    assert_eq!(bench.plant.statistics().sent, 1);
}

#[test]
fn a_controller_that_is_bus_off_says_so_and_loses_incoming_frames() {
    let twice = ["from_s = 0.01\nto_s = 0.02", "from_s = 0.03\nto_s = 0.04"];
    let mut bench = Bench::new(&twice.map(|span| fault(&format!("kind = 'bus_off'\n{span}"))).concat(), 1);
    assert_eq!(bench.plant.statistics().errors.bus_off, 0);
    bench.at(10 * MS);
    bench.other.send(&numbered(1)).unwrap();
    let error = bench.plant.send(&numbered(0)).unwrap_err();
    assert!(error.is_recoverable() && matches!(error, BusError::BusOff { .. }));
    assert!(bench.plant.receive().is_err() && bench.plant.wait(Duration::ZERO).is_err());
    bench.at(20 * MS);
    bench.other.send(&numbered(2)).unwrap();
    assert_eq!(bench.received(), [numbered(2)]);
    bench.plant.send(&numbered(3)).unwrap();
    assert_eq!(bench.sent(), [numbered(3)]);
    assert_eq!(bench.plant.statistics().errors.bus_off, 1);
    bench.at(30 * MS);
    assert!(bench.plant.receive().is_err() && bench.plant.receive().is_err());
    assert_eq!(bench.plant.statistics().errors.bus_off, 2);
}

#[test]
fn on_a_line_that_is_cut_nothing_is_received_and_the_queue_is_full() {
    let both = fault("kind = 'link_down'\nfrom_s = 0\nto_s = 0.01");
    let mut bench = Bench::new(&both, 1);
    bench.other.send(&numbered(0)).unwrap();
    assert_eq!(bench.plant.send(&numbered(1)).unwrap(), Sent::QueueFull);
    assert_eq!((bench.received(), bench.sent()), (vec![], vec![]));
    bench.at(10 * MS);
    assert_eq!(bench.plant.send(&numbered(2)).unwrap(), Sent::Queued);
    assert_eq!((bench.received(), bench.sent()), (vec![], vec![numbered(2)]));

    let mut bench = Bench::new(&format!("{both}direction = 'receive'\n"), 1);
    assert_eq!(bench.plant.send(&numbered(1)).unwrap(), Sent::Queued);
    assert_eq!(bench.sent(), [numbered(1)]);
}

#[test]
fn says_what_is_wrong_with_a_fault() {
    let says = |rest: &str| {
        let good = fault("kind = 'loss'\nfrom_s = 1");
        check(&faults(&format!("{good}{}", fault(rest)))).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says("kind = 'loss'\nfrom_s = -1"), @"network.faults, number 2: `from_s` is -1: it must be zero or a positive number");
    insta::assert_snapshot!(says("kind = 'loss'\nfrom_s = 1\nto_s = 1"), @"network.faults, number 2: `to_s` is 1: it must be later than `from_s`");
    insta::assert_snapshot!(says("kind = 'loss'\nfrom_s = 1\nprobability = 1.5"), @"network.faults, number 2: `probability` is 1.5: it must be from 0 to 1");
    insta::assert_snapshot!(says("kind = 'loss'\nfrom_s = 1\nprobability = 0.5\ncount = 2"), @"network.faults, number 2: `probability` and `count` are both given, and each selects the frames that have the fault: leave one out");
    insta::assert_snapshot!(says("kind = 'loss'\nfrom_s = 1\nids = [2048]"), @"network.faults, number 2: `ids` is 2048: it must be an identifier of 11 bits, at most 2047; put identifiers of 29 bits in `extended_ids`");
    insta::assert_snapshot!(says("kind = 'loss'\nfrom_s = 1\nextended_ids = [0x2000_0000]"), @"network.faults, number 2: `extended_ids` is 536870912: it must be an identifier of 29 bits, at most 536870911");
    insta::assert_snapshot!(says("kind = 'delay'\nfrom_s = 1"), @"network.faults, number 2: `delay_s` is missing: add it, or change `kind`");
    insta::assert_snapshot!(says("kind = 'jitter'\nfrom_s = 1\ndelay_s = 0"), @"network.faults, number 2: `delay_s` is 0: it must be a positive number of seconds, at most 10");
    insta::assert_snapshot!(says("kind = 'babble'\nfrom_s = 1"), @"network.faults, number 2: `rate_hz` is missing: add it, or change `kind`");
    insta::assert_snapshot!(says("kind = 'babble'\nfrom_s = 1\nrate_hz = 1e6"), @"network.faults, number 2: `rate_hz` is 1000000: it must be a positive number, at most 100000");
    insta::assert_snapshot!(says("kind = 'bus_off'\nfrom_s = 1\ndirection = 'send'"), @"network.faults, number 2: `direction` does not apply to this kind of fault: leave it out");
    insta::assert_snapshot!(says("kind = 'link_down'\nfrom_s = 1\ncount = 1"), @"network.faults, number 2: `count` does not apply to this kind of fault: leave it out");
    let many = fault("kind = 'loss'\nfrom_s = 1").repeat(MOST_FAULTS + 1);
    insta::assert_snapshot!(check(&faults(&many)).unwrap_err(), @"network.faults has 65 entries: it must have at most 64");
}

/// A user protocol with identifiers of 29 bits could not be disturbed message by message.
#[test]
fn a_fault_may_be_of_identifiers_of_29_bits() {
    let extended = |id: u32| Frame::classic(Id::Extended(id), &[1]).unwrap();
    let mut bench = Bench::new(&fault("kind = 'loss'\nfrom_s = 0\nids = [0x101]\nextended_ids = [0x0D000121]"), 1);
    for sent in [extended(0x0D00_0121), extended(0x101), frame(0x101, &[1]), frame(0x121, &[1])] {
        bench.plant.send(&sent).unwrap();
    }
    assert_eq!(bench.sent(), [extended(0x101), frame(0x121, &[1])]);
    let babble = fault("kind = 'babble'\nfrom_s = 0.001\nto_s = 0.0025\nrate_hz = 1000\nextended_ids = [0x0D000121]");
    let mut bench = Bench::new(&babble, 1);
    bench.at(MS);
    assert_eq!(bench.sent().iter().map(Frame::id).collect::<Vec<Id>>(), [Id::Extended(0x0D00_0121)]);
}

/// A bus with a frame whenever it is asked; reading one takes a microsecond.
struct Flood(VirtualClock);

impl Bus for Flood {
    fn name(&self) -> String {
        String::from("flood")
    }

    fn send(&mut self, _frame: &Frame) -> Result<Sent, BusError> {
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        assert!(self.0.now_ns() < 100 * MS, "the wait of 1 ms goes on");
        self.0.advance_to_ns(self.0.now_ns() + 1000);
        Ok(Some(Received { frame: frame(5, &[]), timestamp_ns: None }))
    }

    fn wait(&mut self, _timeout: Duration) -> Result<bool, BusError> {
        Ok(true)
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// As long as frames came, all of which the fault loses, the wait went on.
#[test]
fn a_wait_ends_in_time_although_frames_come_that_are_lost() {
    let clock = VirtualClock::default();
    let faults = faults(&fault("kind = 'loss'\nfrom_s = 0\nprobability = 1.0"));
    let mut bus = Faulty::new(Flood(clock.clone()), clock, &faults, Node::Plant, 1);
    assert!(!bus.wait(Duration::from_millis(1)).unwrap());
}
