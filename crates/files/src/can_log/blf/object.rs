//! Objects of a BLF log, and the frames in them.

use resonarm_protocol::{Frame, FrameFormat, Id};

use super::fault::BlfFault;
use super::{
    BASE_HEAD, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64, CAN_MESSAGE, CAN_MESSAGE2, DIRECTION, EXTENDED, FD_FLAGS, FD_SHIFT,
    NANOSECONDS, OBJECT_HEAD, RECEIVED, REMOTE, SENT, TEN_MICROSECONDS,
};
use crate::can_log::LoggedFrame;
use crate::can_log::reader::Entry;
use crate::can_log::vector::{self, LONGEST_CLASSIC, format, length};
use crate::recording::Direction;

/// Longest data of a frame, bytes.
const PAYLOAD_MAX_BYTES: usize = 64;

/// An object with its head.
pub(super) struct Object<'a>(&'a [u8]);

/// The channel, direction and frame in an object.
struct FrameFields {
    channel: u16,
    direction: u8,
    frame: Frame,
}

impl<'a> Object<'a> {
    /// `bytes` hold at least the base of the head.
    pub fn new(bytes: &'a [u8]) -> Object<'a> {
        Object(bytes)
    }

    /// Returns the kind, which is at the end of the base.
    pub fn kind(&self) -> Result<u32, BlfFault> {
        self.number(12).map(u32::from_le_bytes)
    }

    /// Returns the bytes from offset `at` to the end.
    pub fn from(&self, at: usize) -> Result<&'a [u8], BlfFault> {
        self.bytes(at, 0)?;
        Ok(&self.0[at..])
    }

    /// Returns the entry that the object makes in a log that begins at `start_ns`.
    pub fn entry(&self, start_ns: u64) -> Result<Entry, BlfFault> {
        Ok(self.frame(start_ns)?.map_or(Entry::Other, Entry::Frame))
    }

    /// Returns the frame in the object; `None` for objects of other kinds and requests to send.
    fn frame(&self, start_ns: u64) -> Result<Option<LoggedFrame>, BlfFault> {
        let fields = match self.kind()? {
            CAN_MESSAGE | CAN_MESSAGE2 => self.classic()?,
            CAN_FD_MESSAGE => self.fd()?,
            CAN_FD_MESSAGE_64 => self.fd64()?,
            _ => return Ok(None),
        };
        let direction = match fields.direction {
            RECEIVED => Direction::Received,
            SENT => Direction::Sent,
            _ => return Ok(None),
        };
        Ok(Some(LoggedFrame {
            time_ns: self.time_ns(start_ns)?,
            interface: Some(fields.channel.to_string()),
            direction: Some(direction),
            frame: fields.frame,
        }))
    }

    /// Parses the time after the base: unit; client and version (version 1) or status and version (version 2); time.
    fn time_ns(&self, start_ns: u64) -> Result<u64, BlfFault> {
        let version = u16::from_le_bytes(self.number(6)?);
        if !matches!(version, 1 | 2) {
            return Err(BlfFault::Number {
                what: "the head of a frame has version",
                got: version.into(),
                expected: "1 or 2",
            });
        }
        let unit_ns = match u32::from_le_bytes(self.number(BASE_HEAD)?) {
            TEN_MICROSECONDS => 10_000,
            NANOSECONDS => 1,
            got => {
                let what = "the time of a frame has unit";
                let expected = "1 (10 µs) or 2 (1 ns)";
                return Err(BlfFault::Number { what, got, expected });
            }
        };
        let time = u64::from_le_bytes(self.number(BASE_HEAD + 8)?);
        let time_ns = time.checked_mul(unit_ns).and_then(|time_ns| time_ns.checked_add(start_ns));
        time_ns.ok_or(BlfFault::Time { got: time })
    }

    /// Parses channel, flags, DLC, identifier, data.
    fn classic(&self) -> Result<FrameFields, BlfFault> {
        let body = self.body()?;
        let [flags, dlc] = self.number(body + 2)?;
        let format = if flags & REMOTE != 0 { FrameFormat::Remote } else { FrameFormat::Classic };
        // These objects always have eight bytes of data. The DLC says how many of them count, and one above 8 means 8
        // (ISO 11898-1).
        let data: [u8; LONGEST_CLASSIC] = self.number(body + 8)?;
        let frame = Frame::new(self.id(body + 4)?, format, &data[..LONGEST_CLASSIC.min(dlc.into())])?;
        Ok(FrameFields { channel: u16::from_le_bytes(self.number(body)?), direction: flags & DIRECTION, frame })
    }

    /// Parses channel, flags, DLC, identifier, length on the bus, bits of the arbitration, flags of CAN FD, length,
    /// data.
    fn fd(&self) -> Result<FrameFields, BlfFault> {
        let body = self.body()?;
        let [flags, _dlc] = self.number(body + 2)?;
        let [of_fd, length] = self.number(body + 13)?;
        let remote = if flags & REMOTE != 0 { vector::REMOTE } else { 0 };
        let format = format(u32::from(of_fd & FD_FLAGS) << FD_SHIFT | remote);
        let frame = Frame::new(self.id(body + 4)?, format, self.bytes(body + 20, length.into())?)?;
        Ok(FrameFields { channel: u16::from_le_bytes(self.number(body)?), direction: flags & DIRECTION, frame })
    }

    /// Parses channel, DLC, number of valid bytes, number of tries, identifier, length on the bus, flags, bit timings,
    /// direction, offset of further data, CRC, data. The DLC states the length; bytes that are not valid, or missing at
    /// the end, count as 0, as in Vector's tools (python-can, issues 1586 and 1905).
    fn fd64(&self) -> Result<FrameFields, BlfFault> {
        let body = self.body()?;
        let [channel, dlc, valid] = self.number(body)?;
        let format = format(u32::from_le_bytes(self.number(body + 12)?));
        let [direction, further] = self.number(body + 34)?;
        let rest = self.from(body + 40)?;
        // The offset counts from the beginning of the object; 0 means that nothing follows the data.
        let rest = match usize::from(further).checked_sub(body + 40) {
            Some(end) => &rest[..end.min(rest.len())],
            None => rest,
        };
        let length = match format {
            FrameFormat::Fd { .. } => {
                let expected = "0 to 15";
                length(dlc.into()).ok_or(BlfFault::Number { what: "a frame has DLC", got: dlc.into(), expected })?
            }
            _ => LONGEST_CLASSIC.min(dlc.into()),
        };
        let mut data = [0; PAYLOAD_MAX_BYTES];
        // Each of the three comes from the file, and any of them may be wrong.
        let used = rest.len().min(valid.into()).min(length);
        data[..used].copy_from_slice(&rest[..used]);
        let frame = Frame::new(self.id(body + 4)?, format, &data[..length])?;
        Ok(FrameFields { channel: channel.into(), direction, frame })
    }

    fn id(&self, at: usize) -> Result<Id, BlfFault> {
        let id = u32::from_le_bytes(self.number(at)?);
        match id & EXTENDED {
            0 => u16::try_from(id).map(Id::Standard).map_err(|_| BlfFault::Id { got: id }),
            // `Frame::new` rejects what has more than 29 bits.
            _ => Ok(Id::Extended(id & !EXTENDED)),
        }
    }

    /// Returns the offset of the body: the length that the head states for itself.
    fn body(&self) -> Result<usize, BlfFault> {
        let got = u16::from_le_bytes(self.number(4)?);
        let body = usize::from(got);
        if body < OBJECT_HEAD { Err(BlfFault::Head { got, least: OBJECT_HEAD }) } else { Ok(body) }
    }

    fn bytes(&self, at: usize, length: usize) -> Result<&'a [u8], BlfFault> {
        let got = self.0.len();
        let expected = at + length;
        self.0.get(at..expected).ok_or_else(|| BlfFault::Object {
            kind: self.kind().unwrap_or_default(),
            got,
            expected,
        })
    }

    /// Returns the bytes of a number.
    pub fn number<const N: usize>(&self, at: usize) -> Result<[u8; N], BlfFault> {
        let mut number = [0; N];
        number.copy_from_slice(self.bytes(at, N)?);
        Ok(number)
    }
}
