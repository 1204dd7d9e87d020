//! An exciter's firmware in Rust: the node of `resonarm-protocol` on the functions of `c/port/port.h`.
//!
//! It plays what the controller in C plays on an STM32F103 (`c/port/stm32f103/main.c`): two sines in open loop, in
//! lockstep with a plant of 1000 Hz. There is no allocator, so it links only if nothing takes memory from a heap.
#![no_std]
#![deny(missing_docs)]

mod port;
mod sines;

use core::panic::PanicInfo;

use resonarm_protocol::node::{ExciterNode, Timing};
use resonarm_protocol::{Capabilities, Network, Node, SamplesPerFrame, timing};

use port::{Port, Received};
use sines::{RATE_HZ, Sines};

/// Longest wait between two looks at the bus, ns.
const LOOK_NS: u64 = 20_000_000;
/// Time to wait before a full transmit queue is tried again, ns.
const RETRY_NS: u64 = 200_000;

/// Runs until the node has left the bus.
#[unsafe(no_mangle)]
pub extern "C" fn main() -> i32 {
    let capabilities = Capabilities {
        node: Node::Exciter,
        samples_per_frame: SamplesPerFrame::One,
        force_limit_n: sines::AMPLITUDE_N,
        torque_limit_nm: 0.0,
    };
    let timing = Timing::lockstep(timing::LOCKSTEP_TIMEOUT_NS);
    let mut node = ExciterNode::new(Network::default(), RATE_HZ, timing, capabilities, Sines::new());
    node.start(Port::now_ns());
    while !node.is_quiet() {
        let now_ns = Port::now_ns();
        loop {
            match Port::receive() {
                Received::Frame(frame) => node.handle_frame(now_ns, &frame),
                Received::Nothing => break,
                Received::BusOff => {
                    node.bus_lost(now_ns);
                    break;
                }
            }
            // An answer must not wait for the frames after the sample.
            transmit(&mut node);
        }
        node.handle_deadline(now_ns);
        if node.outcome().is_some() {
            node.leave(now_ns);
        }
        let longest_ns = if transmit(&mut node) { LOOK_NS } else { RETRY_NS };
        Port::wait(node.next_deadline_ns().min(now_ns + longest_ns));
    }
    0
}

/// Sends the waiting frames; returns whether all are sent.
fn transmit(node: &mut ExciterNode<Sines>) -> bool {
    while let Some(frame) = node.next_frame() {
        if !Port::send(&frame) {
            return false;
        }
        node.frame_sent();
    }
    true
}

/// Silence, and the plant finds the exciter lost.
#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    loop {}
}
