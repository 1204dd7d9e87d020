//! Frames received with one call and not yet handed out.

use std::io;
use std::os::fd::BorrowedFd;

use super::batch::{self, FRAMES, IfNone, Slot};

/// Result of a receiving call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Came {
    /// At least one frame was received.
    Frames,
    /// There is none; a call that sleeps has slept for its time.
    Nothing,
    /// A signal came first.
    Signal,
}

/// The frames that the last call received.
pub(super) struct Incoming {
    slots: Box<[Slot; FRAMES]>,
    next: usize,
    len: usize,
    /// Whether the kernel had no more, which the caller does not know yet.
    is_last: bool,
}

impl Incoming {
    /// Returns a buffer without frames.
    pub fn new() -> Incoming {
        Incoming { slots: Box::new([Slot::EMPTY; FRAMES]), next: 0, len: 0, is_last: false }
    }

    /// The next, without taking it.
    pub fn peek(&self) -> Option<&Slot> {
        self.slots[..self.len].get(self.next)
    }

    /// Removes the next frame and returns it.
    pub fn pop(&mut self) -> Option<Slot> {
        let slot = self.peek().copied()?;
        self.next += 1;
        Some(slot)
    }

    /// Whether the last call received fewer frames than it could, so that the kernel has no more. `true` only once.
    pub fn take_last(&mut self) -> bool {
        core::mem::take(&mut self.is_last)
    }

    /// Receives from the kernel.
    pub fn fill(&mut self, socket: BorrowedFd<'_>, if_none: IfNone) -> io::Result<Came> {
        self.next = 0;
        self.len = 0;
        self.is_last = false;
        match batch::receive(socket, &mut self.slots, if_none) {
            Ok(count) => {
                // A call that fills all slots says nothing about what is left, so only a partial one is known to be
                // the last.
                self.len = count;
                self.is_last = count < FRAMES;
                Ok(Came::Frames)
            }
            Err(error) => match error.kind() {
                io::ErrorKind::WouldBlock => Ok(Came::Nothing),
                io::ErrorKind::Interrupted => Ok(Came::Signal),
                _ => Err(error),
            },
        }
    }
}
