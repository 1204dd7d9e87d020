//! Writes BLF logs, uncompressed.
//!
//! A writer may leave out compression; only a reader needs to support it.

use std::io::{self, Seek, SeekFrom, Write};

use resonarm_protocol::{Frame, FrameFormat, Id};

use super::{
    BASE_HEAD, CAN_FD_MESSAGE, CAN_MESSAGE, CONTAINER_HEAD, EXTENDED, FD_SHIFT, FILE_HEAD, LOG_CONTAINER, NANOSECONDS,
    NO_COMPRESSION, OBJECT_HEAD, OBJECT_SIGNATURE, REMOTE, SENT, SIGNATURE,
};
use crate::can_log::date;
use crate::can_log::{LogWriter, LoggedFrame, vector};
use crate::recording::Direction;

/// A container is written once its objects have this many bytes.
const CONTAINER: usize = 1 << 17;

/// Writes frames of channel 1, with times relative to the start of the log.
pub(in crate::can_log) struct Writer<W> {
    out: W,
    /// Objects that are not yet in a container.
    objects: Vec<u8>,
    count: u32,
    /// The head and the containers written so far, bytes.
    written: u64,
    /// The start of the log, and the time of its latest frame, ms of the UNIX epoch.
    start_ms: u64,
    last_ms: u64,
}

impl<W: Write + Seek> Writer<W> {
    pub fn new(out: W, start_ns: u64) -> Writer<W> {
        let start_ms = start_ns / 1_000_000;
        Writer { out, objects: Vec::new(), count: 0, written: 0, start_ms, last_ms: start_ms }
    }

    /// Reserves space for the head, once.
    fn begin(&mut self) -> io::Result<()> {
        if self.written == 0 {
            self.write_head()?;
            self.written = FILE_HEAD as u64;
        }
        Ok(())
    }

    /// Writes the pending objects as a container.
    fn write_container(&mut self) -> io::Result<()> {
        let mut head = Vec::with_capacity(CONTAINER_HEAD);
        base(&mut head, BASE_HEAD, CONTAINER_HEAD + self.objects.len(), LOG_CONTAINER);
        head.extend_from_slice(&NO_COMPRESSION.to_le_bytes());
        head.extend_from_slice(&[0; 6]);
        head.extend_from_slice(&(self.objects.len() as u32).to_le_bytes());
        head.extend_from_slice(&[0; 4]);
        self.out.write_all(&head)?;
        self.out.write_all(&self.objects)?;
        self.written += (head.len() + self.objects.len()) as u64;
        self.objects.clear();
        Ok(())
    }

    /// Writes the head of the file, whose counts are known only at the end.
    fn write_head(&mut self) -> io::Result<()> {
        let mut head = Vec::with_capacity(FILE_HEAD);
        head.extend_from_slice(SIGNATURE);
        head.extend_from_slice(&(FILE_HEAD as u32).to_le_bytes());
        // The program that wrote the file (none of Vector's); the version of the layout.
        head.extend_from_slice(&[0, 0, 0, 0, 2, 6, 8, 1]);
        // The size of the file, compressed and uncompressed.
        head.extend_from_slice(&self.written.to_le_bytes());
        head.extend_from_slice(&self.written.to_le_bytes());
        head.extend_from_slice(&self.count.to_le_bytes());
        head.extend_from_slice(&[0; 4]);
        head.extend_from_slice(&system_time(self.start_ms));
        head.extend_from_slice(&system_time(self.last_ms));
        head.resize(FILE_HEAD, 0);
        self.out.write_all(&head)
    }
}

impl<W: Write + Seek> LogWriter for Writer<W> {
    fn write(&mut self, logged: &LoggedFrame) -> io::Result<()> {
        self.begin()?;
        // Frames need not be in order, so the last one is not always the latest.
        self.last_ms = self.last_ms.max(logged.time_ns / 1_000_000);
        // A file with the date 0, of simulated time, has the times unchanged.
        let time_ns = vector::since(logged, stated_ms(self.start_ms))?;
        let (kind, body) = body(&logged.frame, logged.direction);
        base(&mut self.objects, OBJECT_HEAD, OBJECT_HEAD + body.len(), kind);
        self.objects.extend_from_slice(&NANOSECONDS.to_le_bytes());
        self.objects.extend_from_slice(&[0; 4]);
        self.objects.extend_from_slice(&time_ns.to_le_bytes());
        self.objects.extend_from_slice(&body);
        self.count = self.count.saturating_add(1);
        if self.objects.len() >= CONTAINER { self.write_container() } else { Ok(()) }
    }

    fn finish(&mut self) -> io::Result<()> {
        self.begin()?;
        if !self.objects.is_empty() {
            self.write_container()?;
        }
        // The size of the file and the number of objects are known now: the head is written a second time over its
        // place.
        self.out.seek(SeekFrom::Start(0))?;
        self.write_head()?;
        self.out.flush()
    }
}

/// Writes the base of an object's head.
fn base(bytes: &mut Vec<u8>, head: usize, length: usize, kind: u32) {
    bytes.extend_from_slice(OBJECT_SIGNATURE);
    bytes.extend_from_slice(&(head as u16).to_le_bytes());
    bytes.extend_from_slice(&1_u16.to_le_bytes());
    bytes.extend_from_slice(&(length as u32).to_le_bytes());
    bytes.extend_from_slice(&kind.to_le_bytes());
}

/// Returns kind and body of a frame's object; its length is a multiple of 4, so it needs no padding.
fn body(frame: &Frame, direction: Option<Direction>) -> (u32, Vec<u8>) {
    let sent = if direction == Some(Direction::Sent) { SENT } else { 0 };
    let remote = if frame.format() == FrameFormat::Remote { REMOTE } else { 0 };
    let id = match frame.id() {
        Id::Standard(id) => u32::from(id),
        Id::Extended(id) => id | EXTENDED,
    };
    let mut body = vec![1, 0, sent | remote, vector::dlc(frame) as u8];
    body.extend_from_slice(&id.to_le_bytes());
    match frame.format() {
        FrameFormat::Fd { .. } => {
            let flags = (vector::flags(frame.format()) >> FD_SHIFT) as u8;
            // Before the flags: the length on the bus in ns and the bits of the arbitration, both unknown.
            body.extend_from_slice(&[0, 0, 0, 0, 0, flags, frame.len() as u8, 0, 0, 0, 0, 0]);
            body.extend_from_slice(frame.data());
            body.resize(20 + 64, 0);
            (CAN_FD_MESSAGE, body)
        }
        FrameFormat::Classic | FrameFormat::Remote => {
            body.extend_from_slice(frame.data());
            body.resize(8 + 8, 0);
            (CAN_MESSAGE, body)
        }
    }
}

/// Earlier times are simulated ones: the file then states no date. python-can uses the same limit, 1990.
const EARLIEST_MS: u64 = 631_152_000_000;

/// Returns the time that a head states, ms of the UNIX epoch; 0 for none.
fn stated_ms(unix_ms: u64) -> u64 {
    if unix_ms < EARLIEST_MS { 0 } else { unix_ms }
}

/// Returns a Windows SYSTEMTIME: year, month, weekday, day, hour, minute, second, millisecond; all 0 means no date.
fn system_time(unix_ms: u64) -> [u8; 16] {
    let mut bytes = [0; 16];
    if stated_ms(unix_ms) > 0 {
        let date = date::utc(unix_ms);
        let weekday = date.weekday().to_sunday_zero_offset();
        let day = date.day();
        let hour = date.hour();
        let minute = date.minute();
        let second = date.second();
        let fields = [date.month(), weekday, day, hour, minute, second].map(i16::from);
        let fields = [date.year()].into_iter().chain(fields).chain([date.millisecond()]);
        for (field, place) in fields.zip(bytes.chunks_exact_mut(2)) {
            place.copy_from_slice(&field.to_le_bytes());
        }
    }
    bytes
}
