//! The bus contract, on the bus that every machine has.

use assert_no_alloc::assert_no_alloc;
use resonarm::bus::fault::{FaultDirection, FaultKind, FaultNode, FaultSpec, Faulty};
use resonarm::bus::timed::{self, Spec};
use resonarm::bus::{Bus, memory};
use resonarm::protocol::bits::BitRates;
use resonarm::protocol::{Frame, Id, Node};
use resonarm::realtime::{SystemClock, VirtualClock};

use crate::{Formats, contract};

#[test]
fn memory_keeps_the_contract() {
    let make = || {
        let mut ends = memory::hub(2, 64).into_iter().map(|end| Box::new(end) as Box<dyn Bus>);
        (ends.next().unwrap(), ends.next().unwrap())
    };
    contract(make, Formats::All, || 0);
}

#[test]
fn an_end_without_faults_keeps_the_contract() {
    let make = || {
        let sound = |end| Box::new(Faulty::new(end, SystemClock, &[], Node::Plant, 0)) as Box<dyn Bus>;
        let mut ends = memory::hub(2, 64).into_iter().map(sound);
        (ends.next().unwrap(), ends.next().unwrap())
    };
    contract(make, Formats::All, || 0);
}

/// A fault that changes nothing sends every frame the long way.
#[test]
fn an_end_with_faults_that_never_strike_keeps_the_contract() {
    let make = || {
        let fault = FaultSpec { probability: Some(0.0), ..loss() };
        let faulty = |end| {
            Box::new(Faulty::new(end, SystemClock, core::slice::from_ref(&fault), Node::Plant, 0)) as Box<dyn Bus>
        };
        let mut ends = memory::hub(2, 64).into_iter().map(faulty);
        (ends.next().unwrap(), ends.next().unwrap())
    };
    contract(make, Formats::All, || 0);
}

/// In the time of the machine, at a bit rate at which it takes no long time.
#[test]
fn a_timed_bus_keeps_the_contract() {
    let make = || {
        let spec = Spec::new(BitRates::classical(1_000_000));
        let mut ends = timed::hub(2, &spec, &SystemClock).into_iter().map(|end| Box::new(end) as Box<dyn Bus>);
        (ends.next().unwrap(), ends.next().unwrap())
    };
    contract(make, Formats::All, || 0);
}

fn loss() -> FaultSpec {
    FaultSpec {
        node: FaultNode::Plant,
        kind: FaultKind::Loss,
        direction: Some(FaultDirection::Both),
        from_s: 0.0,
        to_s: None,
        ids: Vec::new(),
        extended_ids: Vec::new(),
        probability: None,
        count: None,
        delay_s: None,
        rate_hz: None,
    }
}

#[test]
fn a_faulty_end_sends_and_receives_without_allocating() {
    let [near, mut far] = memory::pair(2048);
    let clock = VirtualClock::default();
    let late = FaultSpec { kind: FaultKind::Reordering, probability: Some(0.5), delay_s: Some(1e-3), ..loss() };
    let faults = [FaultSpec { probability: Some(0.1), ..loss() }, late];
    let mut near = Faulty::new(near, clock.clone(), &faults, Node::Plant, 0);
    let frame = Frame::classic(Id::Standard(1), &[1, 2, 3]).unwrap();
    let received = assert_no_alloc(|| {
        let mut received = 0;
        for k in 0..500 {
            clock.advance_to_ns(k * 100_000);
            let _queued = near.send(&frame);
            let _sent = far.send(&frame);
            received += u32::from(near.receive().is_ok_and(|next| next.is_some()));
        }
        received
    });
    // A tenth of 500 is lost, with a standard deviation of 7, and the last few still wait for their delay of ten
    // rounds.
    assert!((400..500).contains(&received), "{received}");
}

#[test]
fn memory_sends_and_receives_without_allocating() {
    // Eight frames for queues of four: the way on which frames are dropped must not allocate either.
    let mut ends = memory::hub(3, 4);
    let frame = Frame::classic(Id::Standard(1), &[1, 2, 3]).unwrap();
    let received = assert_no_alloc(|| {
        (0..8).for_each(|_| _ = ends[0].send(&frame));
        core::iter::from_fn(|| ends[1].receive().ok().flatten()).count()
    });
    assert_eq!((received, ends[1].statistics().dropped), (4, 4));
}
