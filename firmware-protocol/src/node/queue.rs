//! A queue of fixed capacity.

/// A first-in-first-out ring buffer of at most `N` items.
#[derive(Clone, Debug)]
pub struct Queue<T, const N: usize> {
    items: [Option<T>; N],
    first: usize,
    len: usize,
    lost: u64,
}

impl<T, const N: usize> Default for Queue<T, N> {
    fn default() -> Queue<T, N> {
        Queue::new()
    }
}

impl<T, const N: usize> Queue<T, N> {
    /// Returns an empty queue.
    pub const fn new() -> Queue<T, N> {
        // A repeated `None` needs `Copy`, which `T` need not have; a repeated constant doesn't.
        Queue { items: [const { None }; N], first: 0, len: 0, lost: 0 }
    }

    /// Queues an item, or counts it as lost if the queue is full.
    pub fn push(&mut self, item: T) {
        if self.len < N {
            self.items[(self.first + self.len) % N] = Some(item);
            self.len += 1;
        } else {
            self.lost += 1;
        }
    }

    /// Removes the first item.
    pub fn pop(&mut self) -> Option<T> {
        if self.is_empty() {
            return None;
        }
        let item = self.items.get_mut(self.first)?.take()?;
        self.first = (self.first + 1) % N;
        self.len -= 1;
        Some(item)
    }

    /// Returns the first item without removing it.
    pub fn front(&self) -> Option<&T> {
        self.items.get(self.first)?.as_ref()
    }

    /// The first item, to change it.
    pub fn front_mut(&mut self) -> Option<&mut T> {
        self.items.get_mut(self.first)?.as_mut()
    }

    /// The last item, to change it.
    pub fn back_mut(&mut self) -> Option<&mut T> {
        // An empty queue ends here, before a capacity of 0 would divide by zero.
        let place = (self.first + self.len.checked_sub(1)?) % N;
        self.items.get_mut(place)?.as_mut()
    }

    /// All items, the first first.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        (0..self.len).filter_map(|k| self.items[(self.first + k) % N].as_ref())
    }

    /// The latest item that matches.
    pub fn latest(&self, holds: impl Fn(&T) -> bool) -> Option<&T> {
        let places = (0..self.len).rev().map(|k| (self.first + k) % N);
        places.filter_map(|place| self.items[place].as_ref()).find(|item| holds(item))
    }

    /// Whether the queue is empty.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the number of items.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Items lost because the queue was full.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    proptest! {
        /// The queue behaves like that of the standard library, as long as that is not longer than the capacity.
        #[test]
        fn it_is_a_queue(steps in proptest::collection::vec(any::<Option<u8>>(), 0..100)) {
            let (mut queue, mut expected, mut lost) = (Queue::<u8, 5>::new(), VecDeque::new(), 0);
            for step in steps {
                match step {
                    None => prop_assert_eq!(queue.pop(), expected.pop_front()),
                    Some(item) if expected.len() == 5 => {
                        queue.push(item);
                        lost += 1;
                    }
                    Some(item) => {
                        queue.push(item);
                        expected.push_back(item);
                    }
                }
                prop_assert_eq!(queue.front(), expected.front());
                prop_assert_eq!(queue.front_mut(), expected.front_mut());
                prop_assert_eq!(queue.back_mut(), expected.back_mut());
                prop_assert_eq!((queue.len(), queue.lost()), (expected.len(), lost));
                let is_even = |item: &u8| item.is_multiple_of(2);
                prop_assert_eq!(queue.latest(is_even), expected.iter().rev().find(|item| is_even(item)));
            }
        }
    }

    #[test]
    fn a_queue_without_capacity_loses_everything() {
        let mut queue = Queue::<u8, 0>::new();
        queue.push(1);
        assert_eq!((queue.front(), queue.latest(|_| true), queue.lost()), (None, None, 1));
        assert_eq!(queue.pop(), None);
    }
}
