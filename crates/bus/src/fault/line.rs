//! One direction of a faulty end: frames go in, and come out later, changed, twice or never. Time is an argument.

use core::cmp::{Ordering, Reverse};
use core::ops::Range;
use std::collections::BinaryHeap;

use resonarm_protocol::{Frame, Id};

use super::spec::{FaultDirection, FaultKind, FaultSpec, nanoseconds};
use crate::Received;
use resonarm_numeric::noise::Noise;

/// The first stream of the network's faults; those before are the instruments' and their faults'.
const FIRST_STREAM: u64 = 1 << 33;
/// Frames that wait at most.
const HELD: usize = 1024;

/// The stream of the fault at `index` of the scenario, in one direction.
pub(super) fn stream(seed: u64, index: usize, direction: FaultDirection) -> Noise {
    // Each fault has a stream for each direction: another fault, or more traffic the other way, leaves its draws as
    // they were.
    Noise::new(seed, FIRST_STREAM + 2 * index as u64 + u64::from(direction == FaultDirection::Receive))
}

/// Frames on their way.
pub(super) struct Line {
    faults: Vec<Fault>,
    held: BinaryHeap<Reverse<Held>>,
    /// Frames put so far: those due at the same time leave in this order.
    put: u64,
    /// Time at which the last frame that keeps its place is due, ns.
    last_due_ns: u64,
    /// Frames lost because too many wait.
    pub dropped: u64,
}

struct Held {
    due_ns: u64,
    place: u64,
    received: Received,
}

impl Held {
    fn key(&self) -> (u64, u64) {
        // A heap is not stable. The place lets frames due at the same time come out in the order in which they
        // went in.
        (self.due_ns, self.place)
    }
}

impl PartialEq for Held {
    fn eq(&self, other: &Held) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Held {}

impl PartialOrd for Held {
    fn partial_cmp(&self, other: &Held) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Held {
    fn cmp(&self, other: &Held) -> Ordering {
        self.key().cmp(&other.key())
    }
}

/// An injected fault, with the frames that it concerns.
struct Fault {
    kind: FaultKind,
    span_ns: Range<u64>,
    /// Identifiers of the frames that the fault concerns; if empty, it concerns all frames.
    ids: Vec<Id>,
    probability: f64,
    /// Number of frames that the fault still strikes.
    left: u64,
    delay_ns: u64,
    chance: Noise,
}

impl Fault {
    fn is_active(&self, now_ns: u64) -> bool {
        self.span_ns.contains(&now_ns)
    }

    /// Whether it strikes this frame.
    fn strikes(&mut self, now_ns: u64, frame: &Frame) -> bool {
        let concerns = self.ids.is_empty() || self.ids.contains(&frame.id());
        if !concerns || !self.is_active(now_ns) || self.left == 0 {
            return false;
        }
        // The draw comes last, so that frames that the fault does not concern take no number from its stream.
        let struck = self.probability >= 1.0 || self.chance.uniform() < self.probability;
        self.left -= u64::from(struck);
        struck
    }
}

impl Line {
    /// The line in one direction of an end with these faults, each with its place in the scenario.
    pub fn new(faults: &[(usize, &FaultSpec)], direction: FaultDirection, seed: u64) -> Line {
        // Babble and bus-off do not act on single frames; the end of the bus makes them itself.
        let of_line = |kind| !matches!(kind, FaultKind::Babble | FaultKind::BusOff);
        let own = faults.iter().filter(|(_, spec)| of_line(spec.kind) && spec.goes(direction));
        let faults = own.map(|(index, spec)| Fault {
            kind: spec.kind,
            span_ns: spec.span_ns(),
            ids: spec.identifiers(),
            probability: spec.probability.unwrap_or(1.0),
            left: spec.count.unwrap_or(u64::MAX),
            delay_ns: nanoseconds(spec.delay_s.unwrap_or(0.0)),
            chance: stream(seed, *index, direction),
        });
        // Neither `put` nor `pop` may allocate in a real-time loop, so the heap gets all its memory here and never
        // grows beyond it.
        Line { faults: faults.collect(), held: BinaryHeap::with_capacity(HELD), put: 0, last_due_ns: 0, dropped: 0 }
    }

    /// Whether it never changes anything.
    pub fn is_sound(&self) -> bool {
        self.faults.is_empty()
    }

    /// Whether the line is cut.
    pub fn is_down(&self, now_ns: u64) -> bool {
        self.faults.iter().any(|fault| fault.kind == FaultKind::LinkDown && fault.is_active(now_ns))
    }

    /// Whether there is room for a frame, and its double for each fault that makes one.
    pub fn has_room(&self) -> bool {
        // Each fault adds at most one copy of the next frame.
        self.held.len() + self.faults.len() < HELD
    }

    /// A frame goes in. The faults act in their order.
    pub fn put(&mut self, now_ns: u64, mut received: Received) {
        let mut copies = 1;
        let mut delay_ns = 0;
        let mut keeps_place = true;
        for fault in &mut self.faults {
            if !fault.strikes(now_ns, &received.frame) {
                continue;
            }
            match fault.kind {
                // Faults after this one don't see a frame that is lost, so they neither count it nor draw for it.
                FaultKind::Loss | FaultKind::LinkDown => return,
                FaultKind::Delay => delay_ns += fault.delay_ns,
                FaultKind::Jitter => delay_ns += (fault.chance.uniform() * fault.delay_ns as f64) as u64,
                FaultKind::Reordering => (delay_ns, keeps_place) = (delay_ns + fault.delay_ns, false),
                FaultKind::Duplication => copies += 1,
                FaultKind::BitError => received.frame = with_bit_error(&received.frame, &mut fault.chance),
                FaultKind::Babble | FaultKind::BusOff => {}
            }
        }
        let mut due_ns = now_ns.saturating_add(delay_ns);
        // A delayed frame holds up those behind it, as in a queue. Only with the fault `reordering` can it be
        // overtaken.
        if keeps_place {
            due_ns = due_ns.max(self.last_due_ns);
            self.last_due_ns = due_ns;
        }
        for _ in 0..copies {
            if self.held.len() == HELD {
                self.dropped += 1;
                continue;
            }
            self.held.push(Reverse(Held { due_ns, place: self.put, received }));
            self.put += 1;
        }
    }

    /// Returns the time at which the next frame comes out, ns.
    pub fn next_due_ns(&self) -> Option<u64> {
        self.held.peek().map(|Reverse(held)| held.due_ns)
    }

    /// The next frame that is due.
    pub fn peek(&self, now_ns: u64) -> Option<&Received> {
        self.held.peek().filter(|Reverse(held)| held.due_ns <= now_ns).map(|Reverse(held)| &held.received)
    }

    /// Takes the next frame that is due.
    pub fn pop(&mut self, now_ns: u64) -> Option<Received> {
        self.peek(now_ns)?;
        self.held.pop().map(|Reverse(held)| held.received)
    }

    /// Discards the waiting frames.
    pub fn clear(&mut self) {
        self.held.clear();
    }
}

/// The frame with one bit of its content inverted; a frame without content stays as it is.
fn with_bit_error(frame: &Frame, chance: &mut Noise) -> Frame {
    let mut data = [0; 64];
    let len = frame.data().len();
    if len == 0 {
        return *frame;
    }
    data[..len].copy_from_slice(frame.data());
    // `uniform` is below 1, so that the bit is one of the content.
    let bit = (chance.uniform() * (8 * len) as f64) as usize;
    data[bit / 8] ^= 1 << (bit % 8);
    // Identifier, format and length are those of a frame.
    Frame::new(frame.id(), frame.format(), &data[..len]).unwrap_or(*frame)
}
