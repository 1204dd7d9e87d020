//! The bus contract, on the bus that every machine has.

use assert_no_alloc::assert_no_alloc;
use resonarm::bus::{Bus, memory};
use resonarm::protocol::{Frame, Id};

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
fn memory_sends_and_receives_without_allocating() {
    let mut ends = memory::hub(3, 4);
    let frame = Frame::classic(Id::Standard(1), &[1, 2, 3]).unwrap();
    let received = assert_no_alloc(|| {
        (0..8).for_each(|_| _ = ends[0].send(&frame));
        core::iter::from_fn(|| ends[1].receive().ok().flatten()).count()
    });
    assert_eq!((received, ends[1].statistics().dropped), (4, 4));
}
