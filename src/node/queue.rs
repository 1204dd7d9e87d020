//! A queue of fixed capacity.

use alloc::collections::VecDeque;

/// First in, first out; never grows beyond the capacity it was made with.
#[derive(Clone, Debug)]
pub(super) struct Queue<T> {
    items: VecDeque<T>,
    capacity: usize,
    lost: u64,
}

impl<T> Queue<T> {
    pub fn new(capacity: usize) -> Queue<T> {
        Queue { items: VecDeque::with_capacity(capacity), capacity, lost: 0 }
    }

    /// Queues an item, or counts it as lost if the queue is full.
    pub fn push(&mut self, item: T) {
        if self.items.len() < self.capacity {
            self.items.push_back(item);
        } else {
            self.lost += 1;
        }
    }

    pub fn pop(&mut self) -> Option<T> {
        self.items.pop_front()
    }

    pub fn front(&self) -> Option<&T> {
        self.items.front()
    }

    /// The latest of the items for which this holds.
    pub fn latest(&self, holds: impl Fn(&T) -> bool) -> Option<&T> {
        self.items.iter().rev().find(|item| holds(item))
    }

    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Items that found the queue full.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}
