//! BLF logs of Vector's CANalyzer and CANoe.
//!
//! A file is a head and containers; a container is a sequence of objects, each with its own head, compressed or not.
//! An object may continue in the next container. All numbers are little-endian. Vector publishes no layout; this one is
//! that of python-can, can/io/blf.py.

mod fault;
mod object;
mod reader;
mod writer;

pub use fault::BlfFault;
pub(super) use reader::Reader;
pub(super) use writer::Writer;

/// The first bytes of a file.
const SIGNATURE: &[u8; 4] = b"LOGG";
/// Bytes of a file's head as this program writes it.
const FILE_HEAD: usize = 144;
/// The first bytes of an object.
const OBJECT_SIGNATURE: &[u8; 4] = b"LOBJ";
/// Signature, length of the head, its version, length of the object, kind of the object.
const BASE_HEAD: usize = 16;
/// Flags, client, version, time: after the base of an object with a time.
const OBJECT_HEAD: usize = BASE_HEAD + 16;
/// Method of compression and length: after the base of a container.
const CONTAINER_HEAD: usize = BASE_HEAD + 16;

const CAN_MESSAGE: u32 = 1;
const LOG_CONTAINER: u32 = 10;
const CAN_MESSAGE2: u32 = 86;
const CAN_FD_MESSAGE: u32 = 100;
const CAN_FD_MESSAGE_64: u32 = 101;

/// Units of an object's time: 10 µs or 1 ns.
const TEN_MICROSECONDS: u32 = 1;
const NANOSECONDS: u32 = 2;

const NO_COMPRESSION: u16 = 0;
const DEFLATE: u16 = 2;

/// In the flags of a frame other than [`CAN_FD_MESSAGE_64`]: the direction, and whether it is remote.
const DIRECTION: u8 = 0x0F;
const REMOTE: u8 = 0x80;
/// Directions. Larger values are requests to send, which are not frames on the bus.
const RECEIVED: u8 = 0;
const SENT: u8 = 1;
/// Bit of an identifier that marks it as extended, with 29 bits.
const EXTENDED: u32 = 0x8000_0000;

/// Flags of [`CAN_FD_MESSAGE`]: those of CAN FD that [`vector`](super::vector) has, shifted.
const FD_FLAGS: u8 = 0b111;
const FD_SHIFT: u32 = 12;
