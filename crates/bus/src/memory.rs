//! A bus inside one process: every end hears every other end.
//!
//! One single-producer single-consumer ring joins each ordered pair of ends, so that neither sending nor receiving
//! takes a lock. Each frame carries a number drawn from one counter of the hub, and an end hands out the lowest number
//! it holds: the order on the bus, as far as the ends send one after the other. Ends that send at the same instant from
//! different threads race as nodes on a wire do, and two listeners may then see the two frames in different order; the
//! frames of one sender never change places.
//!
//! There is no bus time: a frame can be received as soon as it was sent, and has no timestamp. On the bus of
//! [`timed`](super::timed) frames take their time.

use core::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
use core::time::Duration;
use std::sync::Arc;

use resonarm_protocol::Frame;
use rtrb::{Consumer, Producer, RingBuffer};
use rustix::thread::futex;

use super::deadline::Deadline;
use super::{Bus, Filter, Received, Sent, Statistics, VirtualBus, accepts};
use crate::error::BusError;

/// A bus with `nodes` ends. Each end keeps up to `capacity` frames not yet received from each other end; what comes in
/// beyond that is lost to this end and counted in its [`Statistics::dropped`], whether or not its filters want it.
pub fn hub(nodes: usize, capacity: usize) -> Vec<MemoryBus> {
    let sequence = Arc::default();
    let mut ends: Vec<MemoryBus> = (0..nodes).map(|_| MemoryBus::new(Arc::clone(&sequence))).collect();
    join(&mut ends, capacity);
    ends
}

/// A bus with two ends, as [`hub`] makes it.
pub fn pair(capacity: usize) -> [MemoryBus; 2] {
    let sequence = Arc::default();
    let mut ends = [(); 2].map(|()| MemoryBus::new(Arc::clone(&sequence)));
    join(&mut ends, capacity);
    ends
}

/// Joins each end with each other one.
fn join(ends: &mut [MemoryBus], capacity: usize) {
    for sender in 0..ends.len() {
        for receiver in (0..ends.len()).filter(|&receiver| receiver != sender) {
            // One ring for each ordered pair of ends: with a single producer and a single consumer it needs no lock.
            let (ring, incoming) = RingBuffer::new(capacity);
            let mailbox = Arc::clone(&ends[receiver].receiver.mailbox);
            ends[sender].sender.outgoing.push(Outgoing { ring, mailbox });
            ends[receiver].receiver.incoming.push(incoming);
        }
    }
}

/// One end of the bus that [`hub`] makes.
pub struct MemoryBus {
    sender: MemorySender,
    receiver: MemoryReceiver,
    open: bool,
}

/// The sending side of an end.
pub struct MemorySender {
    sequence: Arc<AtomicU64>,
    outgoing: Vec<Outgoing>,
    sent: u64,
}

/// The receiving side of an end.
pub struct MemoryReceiver {
    incoming: Vec<Consumer<Numbered>>,
    mailbox: Arc<Mailbox>,
    filters: Vec<Filter>,
    received: u64,
}

/// The way to one other end.
struct Outgoing {
    ring: Producer<Numbered>,
    mailbox: Arc<Mailbox>,
}

/// A frame and its place in the order on the bus.
struct Numbered {
    sequence: u64,
    frame: Frame,
}

/// State that the senders share with one receiver beside the frames.
#[derive(Default)]
struct Mailbox {
    /// Frames that found the ring full.
    dropped: AtomicU64,
    /// The futex word: [`AWAKE`] or [`WAITING`].
    state: AtomicU32,
}

const AWAKE: u32 = 0;
const WAITING: u32 = 1;

impl Mailbox {
    /// Wakes the receiver if it waits. A system call only in that case.
    ///
    /// The frame is pushed before the state is read here, and the state is written before the rings are read in
    /// [`MemoryBus::wait`]; with a sequentially consistent fence between each two, at least one side sees the other's
    /// write, so no wake-up is lost.
    fn wake(&self) {
        fence(Ordering::SeqCst);
        if self.state.load(Ordering::Relaxed) == WAITING && self.state.swap(AWAKE, Ordering::Relaxed) == WAITING {
            // Fails only for an address that is no futex, which a live atomic always is.
            let _ = futex::wake(&self.state, futex::Flags::PRIVATE, 1);
        }
    }
}

impl MemorySender {
    /// Sends a frame to every other end.
    pub fn send(&mut self, frame: &Frame) {
        // One counter for all ends gives the frames a total order, as arbitration does on a wire. Relaxed suffices,
        // since the ring publishes the number together with the frame.
        let sequence = self.sequence.fetch_add(1, Ordering::Relaxed);
        for Outgoing { ring, mailbox } in &mut self.outgoing {
            match ring.push(Numbered { sequence, frame: *frame }) {
                Ok(()) => mailbox.wake(),
                // An end that is full loses the frame alone: a slow receiver neither holds up the sender nor the
                // other ends.
                Err(_) => _ = mailbox.dropped.fetch_add(1, Ordering::Relaxed),
            }
        }
        self.sent += 1;
    }
}

impl MemoryReceiver {
    /// The ring that holds the next frame the filters accept, once the rejected frames before it are thrown away. Looks
    /// at no more frames than there were at the call, so that a fast sender can't hold it.
    fn next_ring(&mut self) -> Option<usize> {
        let queued: usize = self.incoming.iter().map(Consumer::slots).sum();
        for _ in 0..queued {
            // Each ring is in order by itself, so that the lowest number among their heads is the next frame of the
            // bus.
            let heads = self.incoming.iter().enumerate().filter_map(|(ring, frames)| Some((ring, frames.peek().ok()?)));
            let (ring, head) = heads.min_by_key(|(_, head)| head.sequence)?;
            if accepts(&self.filters, &head.frame) {
                return Some(ring);
            }
            self.incoming[ring].pop().ok()?;
        }
        None
    }

    /// The next frame that has come in, if any.
    pub fn receive(&mut self) -> Option<Frame> {
        let next = self.next_ring().and_then(|ring| self.incoming[ring].pop().ok());
        self.received += u64::from(next.is_some());
        next.map(|Numbered { frame, .. }| frame)
    }

    /// Sleeps until a frame can be received (`true`) or `timeout` has passed (`false`).
    pub fn wait(&mut self, timeout: Duration) -> bool {
        let deadline = Deadline::after(timeout);
        loop {
            self.mailbox.state.store(WAITING, Ordering::Relaxed);
            fence(Ordering::SeqCst);
            let ready = self.next_ring().is_some();
            let remaining = deadline.remaining();
            if ready || remaining.is_zero() {
                self.mailbox.state.store(AWAKE, Ordering::Relaxed);
                return ready;
            }
            // A timeout too long for the system call is endless. Whatever the reason it returns for (woken, time out,
            // signal, state changed before it slept), the next turn looks again.
            let relative = remaining.try_into().ok();
            let _ = futex::wait(&self.mailbox.state, futex::Flags::PRIVATE, WAITING, relative.as_ref());
        }
    }

    /// Receives from now on only frames that match one of `filters`; an empty list receives everything.
    pub fn set_filters(&mut self, filters: &[Filter]) {
        self.filters = filters.to_vec();
    }

    /// Frames lost because this end did not receive them in time.
    pub fn dropped(&self) -> u64 {
        self.mailbox.dropped.load(Ordering::Relaxed)
    }
}

impl MemoryBus {
    fn new(sequence: Arc<AtomicU64>) -> MemoryBus {
        let sender = MemorySender { sequence, outgoing: Vec::new(), sent: 0 };
        let receiver =
            MemoryReceiver { incoming: Vec::new(), mailbox: Arc::default(), filters: Vec::new(), received: 0 };
        MemoryBus { sender, receiver, open: true }
    }

    /// Both directions apart, so that one thread may send while another waits for a frame.
    pub fn split(self) -> (MemorySender, MemoryReceiver) {
        (self.sender, self.receiver)
    }

    fn check_open(&self) -> Result<(), BusError> {
        if self.open { Ok(()) } else { Err(BusError::Closed) }
    }
}

impl Bus for MemoryBus {
    fn name(&self) -> String {
        String::from("memory")
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.check_open()?;
        self.sender.send(frame);
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        self.check_open()?;
        Ok(self.receiver.receive().map(|frame| Received { frame, timestamp_ns: None }))
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.check_open()?;
        Ok(self.receiver.wait(timeout))
    }

    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError> {
        self.check_open()?;
        self.receiver.set_filters(filters);
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        let MemoryBus { sender, receiver, .. } = self;
        let received = receiver.received;
        let sent = sender.sent;
        let dropped = receiver.dropped();
        Statistics { received, sent, dropped, ..Statistics::default() }
    }

    /// The other ends keep what they have not yet received.
    fn close(&mut self) -> Result<(), BusError> {
        self.check_open()?;
        self.open = false;
        self.sender.outgoing.clear();
        self.receiver.incoming.clear();
        Ok(())
    }
}

impl VirtualBus for MemoryBus {
    /// Never: what is sent is there.
    fn next_event_ns(&mut self) -> Option<u64> {
        None
    }
}

#[cfg(test)]
mod tests {
    use resonarm_protocol::Id;

    use super::*;

    fn frame(id: u16) -> Frame {
        Frame::classic(Id::Standard(id), &[]).unwrap()
    }

    fn ids(end: &mut MemoryBus) -> Vec<u32> {
        core::iter::from_fn(|| end.receive().unwrap()).map(|received| received.frame.id().raw()).collect()
    }

    #[test]
    fn three_ends_hear_one_order() {
        let mut ends = hub(3, 8);
        for id in [1, 2, 3, 4] {
            ends[usize::from(id % 2)].send(&frame(id)).unwrap();
        }
        assert_eq!(ids(&mut ends[2]), [1, 2, 3, 4]);
        assert_eq!(ids(&mut ends[1]), [2, 4]);
        assert_eq!(ids(&mut ends[0]), [1, 3]);
    }

    #[test]
    fn the_newest_frames_are_lost_to_the_full_end_alone() {
        let mut ends = hub(3, 2);
        for id in 0..5 {
            ends[0].send(&frame(id)).unwrap();
            if id < 4 {
                ends[2].receive().unwrap();
            }
        }
        assert_eq!(ids(&mut ends[1]), [0, 1]);
        // The ring keeps the two frames that came first. A ring that overwrote the oldest would show 3 and 4 instead.
        assert_eq!(ends[1].statistics().dropped, 3);
        assert_eq!(ids(&mut ends[2]), [4]);
        assert_eq!(ends[2].statistics(), Statistics { received: 5, ..Statistics::default() });
    }

    #[test]
    fn refused_frames_wake_nobody_up_for_good() {
        let mut ends = hub(2, 4);
        ends[1].set_filters(&[Filter { id: Id::Standard(7), mask: 0x7FF }]).unwrap();
        ends[0].send(&frame(6)).unwrap();
        assert!(!ends[1].wait(Duration::ZERO).unwrap());
        ends[0].send(&frame(7)).unwrap();
        assert!(ends[1].wait(Duration::ZERO).unwrap());
        assert_eq!(ids(&mut ends[1]), [7]);
    }

    /// The answer is sent while another thread waits for the next frame of the same end.
    #[test]
    fn a_split_end_sends_while_it_waits() {
        let [near, mut far] = pair(8);
        let (mut sender, mut receiver) = near.split();
        let waits = std::thread::spawn(move || {
            assert!(receiver.wait(Duration::from_secs(10)));
            receiver.receive()
        });
        sender.send(&frame(5));
        assert!(far.wait(Duration::from_secs(10)).unwrap());
        assert_eq!(ids(&mut far), [5]);
        far.send(&frame(6)).unwrap();
        assert_eq!(waits.join().unwrap(), Some(frame(6)));
    }

    #[test]
    fn no_wake_up_is_lost_between_two_threads() {
        let mut ends = hub(2, 1);
        let mut far = ends.pop().unwrap();
        let mut near = ends.pop().unwrap();
        // In each turn both threads wait for the other's frame, so that a wake-up that is lost shows as a wait that
        // ends without one.
        const TURNS: u16 = 2000;
        let echo = std::thread::spawn(move || {
            for _ in 0..TURNS {
                assert!(far.wait(Duration::from_secs(10)).unwrap());
                let received = far.receive().unwrap().unwrap();
                far.send(&received.frame).unwrap();
            }
        });
        for id in 0..TURNS {
            near.send(&frame(id)).unwrap();
            assert!(near.wait(Duration::from_secs(10)).unwrap(), "turn {id}");
            assert_eq!(ids(&mut near), [u32::from(id)]);
        }
        echo.join().unwrap();
    }
}
