//! Why an access to an object is aborted.

use thiserror::Error;

/// Why an access is aborted, with its code on the wire (CiA 301, table 22).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[repr(u32)]
pub enum Abort {
    /// A segment came twice, or one was lost.
    #[error("the toggle bit has not changed")]
    Toggle = 0x0503_0000,
    /// No such command, or one that nothing preceded.
    #[error("the command is unknown or out of place")]
    Command = 0x0504_0001,
    /// It can't be read.
    #[error("the object is write-only")]
    WriteOnly = 0x0601_0001,
    /// It can't be written.
    #[error("the object is read-only")]
    ReadOnly = 0x0601_0002,
    /// There is no such object.
    #[error("there is no such object")]
    NoObject = 0x0602_0000,
    /// It can't be mapped.
    #[error("the object can't be mapped to this PDO")]
    NotMappable = 0x0604_0041,
    /// More than 8 bytes, or more than 8 entries.
    #[error("the mapped objects are longer than a PDO")]
    MappingLength = 0x0604_0042,
    /// It contradicts another parameter.
    #[error("the value contradicts another parameter")]
    Incompatible = 0x0604_0043,
    /// Another length than the type's.
    #[error("the length does not fit the type")]
    Length = 0x0607_0010,
    /// More bytes than the type's.
    #[error("the value is longer than its type")]
    LengthTooHigh = 0x0607_0012,
    /// Fewer bytes than the type's.
    #[error("the value is shorter than its type")]
    LengthTooLow = 0x0607_0013,
    /// There is no such subindex.
    #[error("the object has no such subindex")]
    NoSubindex = 0x0609_0011,
    /// A value that is not allowed.
    #[error("the value is not allowed")]
    Value = 0x0609_0030,
    /// Above what is allowed.
    #[error("the value is too high")]
    ValueTooHigh = 0x0609_0031,
    /// Below what is allowed.
    #[error("the value is too low")]
    ValueTooLow = 0x0609_0032,
    /// Not now.
    #[error("the value can't be stored in the present state of the node")]
    DeviceState = 0x0800_0022,
    /// There is nothing to read.
    #[error("the object has no data")]
    NoData = 0x0800_0024,
}

impl Abort {
    /// Every reason.
    pub const ALL: [Abort; 17] = [
        Abort::Toggle,
        Abort::Command,
        Abort::WriteOnly,
        Abort::ReadOnly,
        Abort::NoObject,
        Abort::NotMappable,
        Abort::MappingLength,
        Abort::Incompatible,
        Abort::Length,
        Abort::LengthTooHigh,
        Abort::LengthTooLow,
        Abort::NoSubindex,
        Abort::Value,
        Abort::ValueTooHigh,
        Abort::ValueTooLow,
        Abort::DeviceState,
        Abort::NoData,
    ];

    /// The code on the wire.
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// The reason with this code; `None` of one that no node here gives.
    pub fn of(code: u32) -> Option<Abort> {
        Abort::ALL.into_iter().find(|abort| abort.code() == code)
    }
}
