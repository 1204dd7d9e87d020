//! Operations of FMI-LS-BUS 1.0.0 on a CAN bus: frames, confirmations, errors, configuration, as bytes.
//!
//! An operation is its code, u32, its length with this head, u32, and its fields, little-endian. Several follow each
//! other without a gap.

use crate::fault::Fault;
use resonarm_protocol::{Frame, FrameFormat, Id};

/// The media type of the bytes.
pub(crate) const MIME: &str = "application/org.fmi-standard.fmi-ls-bus.can; version=\"1.0.0\"";

/// Bytes of code and length.
const HEAD: usize = 8;

const FORMAT_ERROR: u32 = 0x01;
const TRANSMIT: u32 = 0x10;
const FD_TRANSMIT: u32 = 0x11;
const CONFIRM: u32 = 0x20;
const ARBITRATION_LOST: u32 = 0x30;
const BUS_ERROR: u32 = 0x31;
const CONFIGURATION: u32 = 0x40;
const STATUS: u32 = 0x41;
const WAKEUP: u32 = 0x42;

/// State of a node on the bus, as the operation Status reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Status {
    Active = 1,
    Passive = 2,
    BusOff = 3,
}

/// Cause that destroyed a frame, as far as the bus reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum BusErrorCode {
    Bit = 1,
    Acknowledgement = 5,
}

/// An operation of FMI-LS-BUS on a CAN bus.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Operation {
    /// A frame is to be sent, or was received.
    Transmit(Frame),
    /// The frame of this identifier was sent.
    Confirm(u32),
    /// The frame of this identifier was destroyed; whether the receiver of the operation had sent it.
    BusError { id: u32, code: BusErrorCode, is_sender: bool },
    /// The bit rate of arbitration, Hz.
    BaudRate(u32),
    /// The bit rate of the data of FD frames, Hz.
    FdBaudRate(u32),
    /// Frames that lose the arbitration are sent later; `false` asks for them to be discarded.
    Buffers(bool),
    /// State of the sender's CAN controller.
    Status(Status),
    /// The receiver could not read these bytes that the sender of the operation has got from it.
    FormatError(Vec<u8>),
    /// Another one, from which nothing follows here.
    Ignored,
}

impl Operation {
    /// Appends the operation in its binary form to `bytes`.
    pub fn write(&self, bytes: &mut Vec<u8>) {
        match self {
            Operation::Transmit(frame) => write_frame(frame, bytes),
            Operation::Confirm(id) => write(bytes, CONFIRM, &[&id.to_le_bytes()]),
            Operation::BusError { id, code, is_sender } => {
                // A bus without length has no node that detects an error first: it is said to be the sender of the
                // frame.
                let flag = if *is_sender { 1 } else { 2 };
                write(bytes, BUS_ERROR, &[&id.to_le_bytes(), &[*code as u8, flag, u8::from(*is_sender)]]);
            }
            Operation::BaudRate(rate_hz) => write(bytes, CONFIGURATION, &[&[1], &rate_hz.to_le_bytes()]),
            Operation::FdBaudRate(rate_hz) => write(bytes, CONFIGURATION, &[&[2], &rate_hz.to_le_bytes()]),
            Operation::Buffers(buffers) => write(bytes, CONFIGURATION, &[&[4, if *buffers { 1 } else { 2 }]]),
            Operation::Status(status) => write(bytes, STATUS, &[&[*status as u8]]),
            Operation::FormatError(data) => {
                // The length of the data has 16 bits, so what is beyond them is left out.
                let kept = &data[..data.len().min(usize::from(u16::MAX))];
                write(bytes, FORMAT_ERROR, &[&(kept.len() as u16).to_le_bytes(), kept]);
            }
            Operation::Ignored => {}
        }
    }

    /// The operation with these fields; `None` if they are malformed.
    fn read(code: u32, fields: &[u8]) -> Option<Operation> {
        let number = |bytes: &[u8]| bytes.try_into().ok().map(u32::from_le_bytes);
        Some(match (code, fields) {
            (TRANSMIT, [i0, i1, i2, i3, ide, rtr @ (0 | 1), l0, l1, data @ ..]) => {
                let length = u16::from_le_bytes([*l0, *l1]);
                let format = if *rtr == 1 { FrameFormat::Remote } else { FrameFormat::Classic };
                frame([*i0, *i1, *i2, *i3], *ide, format, length, data)?
            }
            (FD_TRANSMIT, [i0, i1, i2, i3, ide, brs @ (0 | 1), esi @ (0 | 1), l0, l1, data @ ..]) => {
                let format = FrameFormat::Fd { bit_rate_switch: *brs == 1, error_state_indicator: *esi == 1 };
                frame([*i0, *i1, *i2, *i3], *ide, format, u16::from_le_bytes([*l0, *l1]), data)?
            }
            (CONFIRM, id) => Operation::Confirm(number(id)?),
            (BUS_ERROR, [id @ .., code @ (1..=6), _flag @ (1 | 2), is_sender @ (0 | 1)]) => {
                // Only a missing acknowledgement counts differently at the sender; all other causes are alike.
                let code = if *code == 5 { BusErrorCode::Acknowledgement } else { BusErrorCode::Bit };
                Operation::BusError { id: number(id)?, code, is_sender: *is_sender == 1 }
            }
            (CONFIGURATION, [1, rate_hz @ ..]) => Operation::BaudRate(number(rate_hz)?),
            (CONFIGURATION, [2, rate_hz @ ..]) => Operation::FdBaudRate(number(rate_hz)?),
            // The bit rate of CAN XL, which no node here uses. It is checked for its form alone.
            (CONFIGURATION, [3, rate_hz @ ..]) => number(rate_hz).map(|_| Operation::Ignored)?,
            (CONFIGURATION, [4, behaviour @ (1 | 2)]) => Operation::Buffers(*behaviour == 1),
            (STATUS, [1]) => Operation::Status(Status::Active),
            (STATUS, [2]) => Operation::Status(Status::Passive),
            (STATUS, [3]) => Operation::Status(Status::BusOff),
            (FORMAT_ERROR, [l0, l1, data @ ..]) if usize::from(u16::from_le_bytes([*l0, *l1])) == data.len() => {
                Operation::FormatError(data.to_vec())
            }
            (ARBITRATION_LOST, id) => number(id).map(|_| Operation::Ignored)?,
            (WAKEUP, []) => Operation::Ignored,
            _ => return None,
        })
    }
}

/// The operations in `bytes`; in place of a malformed one the Format Error that answers it.
///
/// # Errors
/// [`Fault::Operation`] if the bytes end within an operation: nothing behind it can be read.
pub(crate) fn read(name: &str, bytes: &[u8]) -> Result<Vec<Result<Operation, Operation>>, Fault> {
    let mut operations = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let at = bytes.len() - rest.len();
        let got = rest.len();
        let truncated = |expected| Fault::Operation { name: name.to_string(), at, got, expected };
        let Some((head, _)) = rest.split_first_chunk::<HEAD>() else { return Err(truncated(HEAD)) };
        let [code, length] = [&head[..4], &head[4..]].map(|half| half.try_into().map_or(0, u32::from_le_bytes));
        // A length below that of the head would not advance, and the loop would never end.
        let length = (length as usize).max(HEAD);
        let Some((operation, behind)) = rest.split_at_checked(length) else { return Err(truncated(length)) };
        let read = Operation::read(code, &operation[HEAD..]);
        operations.push(read.ok_or_else(|| Operation::FormatError(operation.to_vec())));
        rest = behind;
    }
    Ok(operations)
}

fn write(bytes: &mut Vec<u8>, code: u32, fields: &[&[u8]]) {
    let length = HEAD + fields.iter().map(|field| field.len()).sum::<usize>();
    bytes.extend(code.to_le_bytes());
    bytes.extend((length as u32).to_le_bytes());
    fields.iter().for_each(|field| bytes.extend(*field));
}

fn write_frame(frame: &Frame, bytes: &mut Vec<u8>) {
    let id = frame.id().raw().to_le_bytes();
    let ide = u8::from(matches!(frame.id(), Id::Extended(_)));
    let data = if frame.format() == FrameFormat::Remote { &[] } else { frame.data() };
    let length = (frame.len() as u16).to_le_bytes();
    match frame.format() {
        FrameFormat::Classic | FrameFormat::Remote => {
            let rtr = u8::from(frame.format() == FrameFormat::Remote);
            write(bytes, TRANSMIT, &[&id, &[ide, rtr], &length, data]);
        }
        FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
            let flags = [ide, u8::from(bit_rate_switch), u8::from(error_state_indicator)];
            write(bytes, FD_TRANSMIT, &[&id, &flags, &length, data]);
        }
    }
}

fn frame(id: [u8; 4], ide: u8, format: FrameFormat, length: u16, data: &[u8]) -> Option<Operation> {
    let raw = u32::from_le_bytes(id);
    let id = match ide {
        // `Frame::new` refuses what fits 16 bits and not the 11 of the identifier.
        0 => Id::Standard(u16::try_from(raw).ok()?),
        1 => Id::Extended(raw),
        _ => return None,
    };
    let frame = match (format, data) {
        // A remote frame states a length and has no data.
        (FrameFormat::Remote, []) => Frame::new(id, format, [0; 8].get(..usize::from(length))?),
        _ if data.len() == usize::from(length) => Frame::new(id, format, data),
        _ => return None,
    };
    frame.ok().map(Operation::Transmit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_have_the_bytes_of_the_standard() {
        let of = |operation: Operation| {
            let mut bytes = Vec::new();
            operation.write(&mut bytes);
            bytes
        };
        let classic = Frame::new(Id::Standard(0x123), FrameFormat::Classic, &[1, 2, 3]).unwrap();
        let fd = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
        let fd = Frame::new(Id::Extended(0x1234_5678), fd, &[9; 12]).unwrap();
        let remote = Frame::new(Id::Standard(5), FrameFormat::Remote, &[0; 4]).unwrap();
        let hex = |bytes: Vec<u8>| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        insta::assert_snapshot!(hex(of(Operation::Transmit(classic))), @"10000000130000002301000000000300010203");
        insta::assert_snapshot!(hex(of(Operation::Transmit(fd))), @"110000001d000000785634120101000c00090909090909090909090909");
        insta::assert_snapshot!(hex(of(Operation::Transmit(remote))), @"10000000100000000500000000010400");
        insta::assert_snapshot!(hex(of(Operation::Confirm(0x123))), @"200000000c00000023010000");
        insta::assert_snapshot!(hex(of(Operation::BaudRate(500_000))), @"400000000d0000000120a10700");
        insta::assert_snapshot!(hex(of(Operation::Buffers(true))), @"400000000a0000000401");
        let all = [classic, fd, remote].map(Operation::Transmit);
        let bytes: Vec<u8> = all.iter().flat_map(|operation| of(operation.clone())).collect();
        let read: Vec<_> = read("Rx", &bytes).unwrap().into_iter().map(Result::unwrap).collect();
        assert_eq!(read, all);
    }

    #[test]
    fn a_malformed_operation_is_answered_and_a_truncated_one_refused() {
        let frame = Frame::new(Id::Standard(1), FrameFormat::Classic, &[7; 8]).unwrap();
        let mut bytes = Vec::new();
        Operation::Transmit(frame).write(&mut bytes);
        let whole = bytes.clone();
        bytes[12] = 2; // neither a base nor an extended identifier
        assert_eq!(read("Rx", &bytes).unwrap(), [Err(Operation::FormatError(bytes.clone()))]);
        let error = read("Rx", &whole[..20]).unwrap_err();
        insta::assert_snapshot!(error, @"`Rx`: the operation at byte 0 has 20 bytes, expected 24: the bytes were cut off, or are not operations of FMI-LS-BUS");
        assert!(read("Rx", &whole[..5]).is_err());
    }
}
