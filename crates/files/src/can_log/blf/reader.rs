//! Reads BLF logs object by object.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::read::ZlibDecoder;
use jiff::civil::DateTime;
use thiserror::Error;

use super::fault::BlfFault;
use super::object::Object;
use super::{BASE_HEAD, CONTAINER_HEAD, DEFLATE, LOG_CONTAINER, NO_COMPRESSION, OBJECT_SIGNATURE, SIGNATURE};
use crate::can_log::date;
use crate::can_log::error::CanLogError;
use crate::can_log::reader::{Entry, open};

/// Largest accepted length of an object, and of an inflated container: 16 MiB. Vector's tools write containers of
/// 128 KiB.
const LONGEST: usize = 1 << 24;
/// Most bytes between two objects: each is padded to a multiple of 4.
const PADDING: usize = 3;

/// Reads the entries of a log. Keeps one container in memory, and the beginning of an object that continues in the
/// next.
pub(in crate::can_log) struct Reader {
    path: PathBuf,
    file: BufReader<File>,
    /// Number of bytes read from the file.
    position: u64,
    /// Offset in the file of the object read last, bytes.
    offset: u64,
    /// Start of the log, ns of the UNIX epoch; 0 without a date.
    start_ns: u64,
    /// Objects from containers, and how many of their bytes are consumed.
    objects: Vec<u8>,
    taken: usize,
}

/// Reason for which the reading of the log stops.
#[derive(Debug, Error)]
enum Stop {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Fault(#[from] BlfFault),
}

impl Reader {
    /// Opens a log and reads its head.
    pub fn open(path: &Path) -> Result<Reader, CanLogError> {
        let file = open(path)?;
        let path = path.to_path_buf();
        let objects = Vec::new();
        let mut reader = Reader { path, file, position: 0, offset: 0, start_ns: 0, objects, taken: 0 };
        reader.head().map_err(|stop| reader.error(stop))?;
        Ok(reader)
    }

    /// Returns the next entry; `None` at the end of the log.
    pub fn next(&mut self) -> Result<Option<Entry>, CanLogError> {
        self.next_entry().map_err(|stop| self.error(stop))
    }

    fn error(&self, stop: Stop) -> CanLogError {
        let path = self.path.clone();
        let offset = self.offset;
        match stop {
            Stop::Io(source) => CanLogError::Read { path, source },
            Stop::Fault(fault) => CanLogError::Blf { path, offset, fault },
        }
    }

    /// Signature, length of the head, program and version, length of the file, uncompressed length, two counts,
    /// begin, end.
    fn head(&mut self) -> Result<(), Stop> {
        let got = self.read(SIGNATURE.len())?;
        if got != SIGNATURE {
            return Err(BlfFault::Signature { got }.into());
        }
        let length = u32::from_le_bytes(self.array()?);
        self.exactly(8)?;
        let file_bytes = u64::from_le_bytes(self.array()?);
        self.exactly(16)?;
        let mut begin = [0; 8];
        for field in &mut begin {
            *field = u16::from_le_bytes(self.array()?);
        }
        self.start_ns = start_ns(begin)?;
        // Of the head only the fields up to the end date are read. Its stated length says where the objects begin, so
        // longer heads of other versions are skipped.
        let least = self.position as usize;
        let length = within(length, least)?;
        self.exactly(length - least)?;
        let got = self.file.get_ref().metadata()?.len();
        // Checked at once and not at the end, so that a log that was cut short while it was copied is not imported in
        // part.
        if got < file_bytes { Err(BlfFault::Short { expected: file_bytes, got }.into()) } else { Ok(()) }
    }

    fn next_entry(&mut self) -> Result<Option<Entry>, Stop> {
        loop {
            if let Some(entry) = self.entry_of_container()? {
                return Ok(Some(entry));
            }
            let Some(bytes) = self.object()? else { break };
            let object = Object::new(&bytes);
            if object.kind()? != LOG_CONTAINER {
                return Ok(Some(self.entry(&object)));
            }
            // What remains is the beginning of an object that continues in this container.
            self.objects.drain(..core::mem::take(&mut self.taken));
            unpack(&object, &mut self.objects)?;
        }
        let got = self.objects.len() - self.taken;
        // What is left may be the padding of the last object.
        if got > PADDING { Err(BlfFault::Unfinished { got }.into()) } else { Ok(None) }
    }

    /// Returns the next object of the containers read so far, if it is complete.
    fn entry_of_container(&mut self) -> Result<Option<Entry>, BlfFault> {
        let rest = &self.objects[self.taken..];
        // The length of an object does not include its padding, so the next signature is looked for in the few bytes
        // behind it.
        for padding in 0..=PADDING {
            let Some(base) = rest.get(padding..padding + BASE_HEAD) else { return Ok(None) };
            if base.starts_with(OBJECT_SIGNATURE) {
                let end = padding + object_length(base)?;
                // The object may continue in the next container.
                let Some(object) = rest.get(padding..end) else { return Ok(None) };
                let entry = self.entry(&Object::new(object));
                // The bytes are dropped only when the next container is read: dropping moves all that follow, and a
                // container has thousands of objects.
                self.taken += end;
                return Ok(Some(entry));
            }
        }
        Err(BlfFault::NoObject)
    }

    /// Returns the entry of a whole object. The position of the next object is known, even if this one is damaged.
    fn entry(&self, object: &Object<'_>) -> Entry {
        object.entry(self.start_ns).unwrap_or_else(|fault| Entry::Unreadable(self.error(Stop::Fault(fault))))
    }

    /// Returns the next object of the file.
    fn object(&mut self) -> Result<Option<Vec<u8>>, Stop> {
        self.offset = self.position;
        let mut object = self.read(BASE_HEAD)?;
        if object.is_empty() {
            return Ok(None);
        }
        complete(&object, BASE_HEAD)?;
        let length = object_length(&object)?;
        object.append(&mut self.exactly(length - BASE_HEAD)?);
        // The last object may lack its padding.
        self.read(length % (PADDING + 1))?;
        Ok(Some(object))
    }

    /// Reads `length` bytes, or as many as the file still has.
    fn read(&mut self, length: usize) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.position += self.file.by_ref().take(length as u64).read_to_end(&mut bytes)? as u64;
        Ok(bytes)
    }

    fn exactly(&mut self, length: usize) -> Result<Vec<u8>, Stop> {
        let bytes = self.read(length)?;
        complete(&bytes, length)?;
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Stop> {
        let mut array = [0; N];
        array.copy_from_slice(&self.exactly(N)?);
        Ok(array)
    }
}

fn complete(bytes: &[u8], expected: usize) -> Result<(), BlfFault> {
    let got = bytes.len();
    if got < expected { Err(BlfFault::Truncated { expected, got }) } else { Ok(()) }
}

/// Returns the length that the base of an object states.
fn object_length(base: &[u8]) -> Result<usize, BlfFault> {
    if !base.starts_with(OBJECT_SIGNATURE) {
        return Err(BlfFault::NoObject);
    }
    within(u32::from_le_bytes(Object::new(base).number(8)?), BASE_HEAD)
}

/// Checks a length against its limits.
fn within(length: u32, least: usize) -> Result<usize, BlfFault> {
    // The length comes from the file. Without a bound, a damaged one could ask for 4 GiB.
    let found = usize::try_from(length).ok().filter(|length| (least..=LONGEST).contains(length));
    found.ok_or(BlfFault::Length { got: length, least, most: LONGEST })
}

/// Appends the objects in a container.
fn unpack(container: &Object<'_>, objects: &mut Vec<u8>) -> Result<(), BlfFault> {
    let method = u16::from_le_bytes(container.number(BASE_HEAD)?);
    let expected = within(u32::from_le_bytes(container.number(BASE_HEAD + 8)?), 0)?;
    let content = container.from(CONTAINER_HEAD)?;
    let before = objects.len();
    match method {
        NO_COMPRESSION => objects.extend_from_slice(content),
        // One extra byte shows whether the container holds more than it states.
        DEFLATE => ZlibDecoder::new(content)
            .take(expected as u64 + 1)
            .read_to_end(objects)
            .map(drop)
            .map_err(|error| BlfFault::Inflate { cause: error.to_string() })?,
        got => {
            let what = "a container has compression method";
            let expected = "0 (none) or 2 (deflate)";
            return Err(BlfFault::Number { what, got: got.into(), expected });
        }
    }
    let got = objects.len() - before;
    if got == expected { Ok(()) } else { Err(BlfFault::Container { expected, got }) }
}

/// Returns the start of a log, ns of the UNIX epoch: a Windows SYSTEMTIME, taken as UTC; all 0 means no date.
fn start_ns(got: [u16; 8]) -> Result<u64, BlfFault> {
    if got == [0; 8] {
        return Ok(0);
    }
    // The weekday, the third field, follows from the date and is not compared.
    let [year, month, _, day, hour, minute, second, millisecond] = got;
    let narrow = |field: u16| i8::try_from(field).ok();
    let date = || {
        let nanosecond = i32::from(millisecond).checked_mul(1_000_000)?;
        let month = narrow(month)?;
        let day = narrow(day)?;
        let hour = narrow(hour)?;
        let minute = narrow(minute)?;
        let second = narrow(second)?;
        DateTime::new(year.try_into().ok()?, month, day, hour, minute, second, nanosecond).ok()
    };
    date().and_then(date::unix_ns).ok_or(BlfFault::Date { got })
}
