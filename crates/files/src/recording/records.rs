//! The records of a recording, one after the other.

use std::collections::VecDeque;
use std::path::Path;

use super::checked_reader::{CheckedReader, TopLevelRecord};
use super::decode::decode;
use super::schema::Topic;
use super::{Record, RecordingError};

/// Records of a recording, read from the file chunk by chunk. Ends after the first error.
pub struct Records<T> {
    walk: CheckedReader,
    readable_bytes: u64,
    topics: &'static [Topic],
    pick: fn(Record<String>) -> Option<T>,
    queue: VecDeque<T>,
}

impl<T> Records<T> {
    /// What `pick` makes of the records in `topics`, as far as the file is good.
    pub(super) fn new(
        path: &Path,
        readable_bytes: u64,
        topics: &'static [Topic],
        pick: fn(Record<String>) -> Option<T>,
    ) -> Result<Records<T>, RecordingError> {
        Ok(Records { walk: CheckedReader::open(path)?, readable_bytes, topics, pick, queue: VecDeque::new() })
    }

    /// Reads on until there is a record to hand out or the good part ends.
    fn fill(&mut self) -> Result<(), RecordingError> {
        while self.queue.is_empty() && self.walk.offset() < self.readable_bytes {
            let offset = self.walk.offset();
            match self.walk.next()? {
                Some(TopLevelRecord::Chunk) => {
                    for message in self.walk.contents().messages() {
                        if self.topics.contains(&message.message_type.topic()) {
                            decode(message, &mut |record| self.queue.extend((self.pick)(record)))
                                .map_err(|cause| self.walk.damaged(offset, cause))
                                .map(drop)?;
                        }
                    }
                }
                Some(TopLevelRecord::Header(_) | TopLevelRecord::Metadata(..) | TopLevelRecord::Other) => {}
                None => return Ok(()),
            }
        }
        Ok(())
    }
}

impl<T> Iterator for Records<T> {
    type Item = Result<T, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.fill() {
            Ok(()) => self.queue.pop_front().map(Ok),
            Err(error) => {
                self.readable_bytes = 0;
                self.queue.clear();
                Some(Err(error))
            }
        }
    }
}
