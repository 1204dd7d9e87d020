//! A CANopen node without IO (CiA 301 v4.2): object dictionary, SDO server, network management, PDOs, emergencies.
//!
//! [`Server`] is given frames and the time, and asked for frames. The meaning of a value is up to a [`Device`],
//! which judges every write of the master before it is stored: a write that it aborts changes nothing. Memory
//! is allocated only where something is constructed.
//!
//! | identifier | what | direction |
//! | --- | --- | --- |
//! | 000 | network management: start, stop, pre-operational, reset | to the node |
//! | 080 | SYNC | to the node |
//! | 080 + node | emergency | from the node |
//! | 180, 280, 380, 480 + node | PDOs that the node sends; the master may change the identifiers | from the node |
//! | 200, 300, 400, 500 + node | PDOs that the node receives; likewise | to the node |
//! | 580 + node, 600 + node | SDO, answer and request | both |
//! | 700 + node | boot-up and heartbeat | from the node |
//!
//! [`listen`] interprets the frames between a node and its master for someone who only listens.
//!
//! Not supported, and aborted or ignored: block transfer, node guarding, SDO clients, time stamps, LSS, CAN FD,
//! 29-bit identifiers.

mod abort;
pub mod cia402;
pub mod dictionary;
pub mod eds;
mod errors;
mod heartbeat;
pub mod listen;
mod nmt;
mod pdo;
mod sdo;
mod server;
#[cfg(test)]
mod tests;

pub use abort::Abort;
pub use errors::add_error_objects;
pub use nmt::{NmtCommand, NmtState};
pub use pdo::{EVENT_TYPE, EnabledPdo, PDOS, PdoDefaults, add_pdos, enabled_pdos, mapping_word};
pub use server::{Device, Handled, Server};

/// Identifier of network management.
pub const NMT_ID: u16 = 0x000;
/// Identifier of SYNC, the synchronisation object.
pub const SYNC_ID: u16 = 0x080;
/// Base identifier of emergencies, to which the node id is added.
pub const EMERGENCY_BASE: u16 = 0x080;
/// Base identifier of SDO answers, to which the node id is added.
pub const SDO_ANSWER_BASE: u16 = 0x580;
/// Base identifier of SDO requests, to which the node id is added.
pub const SDO_REQUEST_BASE: u16 = 0x600;
/// Base identifier of boot-up and heartbeat, to which the node id is added.
pub const HEARTBEAT_BASE: u16 = 0x700;
/// Largest node id; the least is 1.
pub const NODE_ID_MAX: u8 = 127;
