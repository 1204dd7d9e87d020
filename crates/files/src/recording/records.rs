//! Iterates over the records of a recording.

use std::collections::VecDeque;
use std::path::Path;

use super::checked_reader::{CheckedReader, TopLevelRecord};
use super::contents::RawMessage;
use super::error::RecordingError;
use super::schema::Topic;

/// Appends the records in a message. The error describes an invalid message.
pub(super) type Decode<T> = fn(RawMessage<'_>, &mut VecDeque<T>) -> Result<(), String>;

/// Records of a recording, read from the file chunk by chunk. Ends after the first error.
pub struct Records<T> {
    walk: CheckedReader,
    readable_bytes: u64,
    topics: &'static [Topic],
    decode: Decode<T>,
    /// Position in the file of the chunk read last.
    chunk: u64,
    /// The first of its messages that has not been decoded. Messages are decoded one at a time: one fits a cache, a
    /// chunk does not.
    next: usize,
    queue: VecDeque<T>,
}

impl<T> Records<T> {
    /// Iterates over the records that `decode` returns for the messages in `topics`, as far as the file is valid.
    pub(super) fn new(
        path: &Path,
        readable_bytes: u64,
        topics: &'static [Topic],
        decode: Decode<T>,
    ) -> Result<Records<T>, RecordingError> {
        let walk = CheckedReader::open(path)?;
        Ok(Records { walk, readable_bytes, topics, decode, chunk: 0, next: 0, queue: VecDeque::new() })
    }

    /// Appends the next records to `to`, at most `most` and fewer only at the end: faster than one by one where a
    /// record is long.
    ///
    /// # Errors
    /// As the iterator, which has ended then.
    pub fn read(&mut self, to: &mut Vec<T>, most: usize) -> Result<(), RecordingError> {
        let end = to.len().saturating_add(most);
        while to.len() < end {
            self.fill()?;
            if self.queue.is_empty() {
                break;
            }
            let taken = self.queue.len().min(end - to.len());
            to.extend(self.queue.drain(..taken));
        }
        Ok(())
    }

    /// Reads until there is a record to return or the valid part ends. After an error it has ended.
    fn fill(&mut self) -> Result<(), RecordingError> {
        while self.queue.is_empty() {
            match self.decode_message().and_then(|is_decoded| Ok(is_decoded || self.read_chunk()?)) {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => {
                    // Neither another message nor another chunk is found from here on.
                    self.readable_bytes = 0;
                    self.next = usize::MAX;
                    self.queue.clear();
                    return Err(error);
                }
            }
        }
        Ok(())
    }

    /// Decodes the next message of the chunk, if there is one.
    fn decode_message(&mut self) -> Result<bool, RecordingError> {
        let is_asked_for = |message: &RawMessage<'_>| self.topics.contains(&message.topic);
        let mut messages = self.walk.contents.messages_from(self.next);
        let Some((place, message)) = messages.find(|(_, message)| is_asked_for(message)) else { return Ok(false) };
        self.next = place + 1;
        (self.decode)(message, &mut self.queue).map_err(|cause| self.walk.damaged(self.chunk, cause))?;
        Ok(true)
    }

    /// Reads the next chunk, if there is one in the valid part.
    fn read_chunk(&mut self) -> Result<bool, RecordingError> {
        while self.walk.offset < self.readable_bytes {
            self.chunk = self.walk.offset;
            match self.walk.next()? {
                Some(TopLevelRecord::Chunk | TopLevelRecord::BareMessage) => {
                    self.next = 0;
                    return Ok(true);
                }
                Some(_) => {}
                None => return Ok(false),
            }
        }
        Ok(false)
    }
}

impl<T> Iterator for Records<T> {
    type Item = Result<T, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.fill() {
            Ok(()) => self.queue.pop_front().map(Ok),
            Err(error) => Some(Err(error)),
        }
    }
}
