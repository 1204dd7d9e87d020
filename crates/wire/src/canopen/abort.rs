//! Abort codes of SDO transfers.

use thiserror::Error;

/// Reason why an access to the object dictionary is aborted, with its SDO abort code (CiA 301, table 22).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[repr(u32)]
pub enum Abort {
    /// A segment was repeated or lost: the toggle bit has not changed.
    #[error("the toggle bit has not changed")]
    Toggle = 0x0503_0000,
    /// The command is unknown, or no transfer precedes it.
    #[error("the command is unknown or not allowed now")]
    Command = 0x0504_0001,
    /// A read of a write-only entry.
    #[error("the object is write-only")]
    WriteOnly = 0x0601_0001,
    /// A write to a read-only entry.
    #[error("the object is read-only")]
    ReadOnly = 0x0601_0002,
    /// The dictionary has no object of this index.
    #[error("there is no such object")]
    NoObject = 0x0602_0000,
    /// The object can't be mapped to a PDO.
    #[error("the object can't be mapped to this PDO")]
    NotMappable = 0x0604_0041,
    /// The mapping has more than 8 bytes, or more than 8 entries.
    #[error("the mapped objects are longer than a PDO")]
    MappingLength = 0x0604_0042,
    /// The value contradicts another parameter.
    #[error("the value contradicts another parameter")]
    Incompatible = 0x0604_0043,
    /// The length differs from that of the type.
    #[error("the length does not fit the type")]
    Length = 0x0607_0010,
    /// The value has more bytes than its type.
    #[error("the value is longer than its type")]
    LengthTooHigh = 0x0607_0012,
    /// The value has fewer bytes than its type.
    #[error("the value is shorter than its type")]
    LengthTooLow = 0x0607_0013,
    /// The object has no entry of this subindex.
    #[error("the object has no such subindex")]
    NoSubindex = 0x0609_0011,
    /// The value is not one of the allowed ones.
    #[error("the value is not allowed")]
    Value = 0x0609_0030,
    /// The value exceeds the upper limit of the entry.
    #[error("the value is too high")]
    ValueTooHigh = 0x0609_0031,
    /// The value is below the lower limit of the entry.
    #[error("the value is too low")]
    ValueTooLow = 0x0609_0032,
    /// The present state of the node forbids the access.
    #[error("the value can't be stored in the present state of the node")]
    DeviceState = 0x0800_0022,
    /// The entry holds no data to read.
    #[error("the object has no data")]
    NoData = 0x0800_0024,
}

impl Abort {
    /// All abort reasons that this node gives.
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

    /// Returns the SDO abort code.
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// Returns the reason for an abort code; `None` for a code that no node here gives.
    pub fn of(code: u32) -> Option<Abort> {
        Abort::ALL.into_iter().find(|abort| abort.code() == code)
    }
}
