//! Cost of a frame, made of a message and read again, with E2E protection and counter, of each message of both
//! profiles: `cargo bench -p resonarm-protocol`.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a benchmark fails by panicking")]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use resonarm_protocol::{Frame, Message, MessageKind, Network, Profile, Receiver, Transmitter};

#[path = "../tests/common/mod.rs"]
mod common;

/// Frames per turn: a multiple of the 15 and of the 256 values of a counter, so that each turn continues where the
/// last one ended.
const FRAMES: usize = 15 * 256;

fn main() {
    divan::main();
}

fn kinds(profile: Profile) -> impl Iterator<Item = MessageKind> {
    MessageKind::ALL.into_iter().filter(move |kind| kind.form(profile).is_some())
}

fn message(kind: MessageKind) -> Message {
    common::samples().into_iter().find(|message| message.kind() == kind).unwrap()
}

fn encode(bencher: Bencher, profile: Profile, kind: MessageKind) {
    let (message, mut transmitter) = (message(kind), Transmitter::new(Network::default().with_profile(profile)));
    bencher.counter(ItemsCount::new(FRAMES)).bench_local(|| {
        for _ in 0..FRAMES {
            assert!(black_box(&transmitter.frame(black_box(&message))).is_ok());
        }
    });
}

fn decode(bencher: Bencher, profile: Profile, kind: MessageKind) {
    let (message, network) = (message(kind), Network::default().with_profile(profile));
    let (mut transmitter, mut receiver) = (Transmitter::new(network), Receiver::new(network));
    let frames: Vec<Frame> = (0..FRAMES).map(|_| transmitter.frame(&message).unwrap()).collect();
    bencher.counter(ItemsCount::new(FRAMES)).bench_local(|| {
        for frame in &frames {
            assert!(matches!(black_box(&receiver.accept(black_box(frame))), Ok(Some(_))));
        }
    });
}

#[divan::bench(args = kinds(Profile::Classic))]
fn classic_encode(bencher: Bencher, kind: MessageKind) {
    encode(bencher, Profile::Classic, kind);
}

#[divan::bench(args = kinds(Profile::Classic))]
fn classic_decode(bencher: Bencher, kind: MessageKind) {
    decode(bencher, Profile::Classic, kind);
}

#[divan::bench(args = kinds(Profile::Fd))]
fn fd_encode(bencher: Bencher, kind: MessageKind) {
    encode(bencher, Profile::Fd, kind);
}

#[divan::bench(args = kinds(Profile::Fd))]
fn fd_decode(bencher: Bencher, kind: MessageKind) {
    decode(bencher, Profile::Fd, kind);
}
