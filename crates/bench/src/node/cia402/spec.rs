//! Drives of a plant, with the object dictionary of each.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

use resonarm_wire::canopen::dictionary::{Access, Dictionary, Entry, Kind, Mappable, Object, Text, Value, at};
use resonarm_wire::canopen::eds::Eds;
use resonarm_wire::canopen::{EVENT_TYPE, PdoDefaults, add_error_objects, add_pdos, mapping_word};

/// The only mode of operation: cyclic synchronous torque (CiA 402-2).
pub const TORQUE_MODE: i8 = 10;
/// Vendor id in the identity object; none has been assigned.
const VENDOR: u32 = 0;
/// Product code in the identity object.
const PRODUCT: u32 = 402;
/// Revision number in the identity object.
const REVISION: u32 = 0x0001_0000;

/// Drives of a plant, with their timeout.
#[derive(Clone, Debug, PartialEq)]
pub struct Cia402Spec {
    /// Drives at different joints, with different node ids.
    pub drives: Vec<DriveSpec>,
    /// Longest time of listening without an accepted target while a drive is enabled in real time, ns.
    pub timeout_ns: u64,
}

/// A CANopen drive at a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveSpec {
    /// CANopen node id, 1 to 127.
    pub node_id: u8,
    /// Joint that the drive turns, counted from 0 at the base, below [`MOST_JOINTS`](crate::rig::MOST_JOINTS).
    pub joint: usize,
    /// Turns of the motor for one turn of the joint, not 0. The gearbox has no losses.
    pub gear_ratio: f64,
    /// Rated torque of the motor, mN·m (object 6076).
    pub rated_torque_mnm: u32,
    /// Encoder counts for one turn of the motor.
    pub encoder_counts_per_turn: u32,
}

impl DriveSpec {
    /// Returns the torque at the joint for a target of 1, that is, a thousandth of the rated torque, N·m.
    pub fn torque_step_nm(&self) -> f64 {
        1e-6 * f64::from(self.rated_torque_mnm) * self.gear_ratio
    }

    /// Returns the encoder counts for 1 rad of the joint.
    pub fn counts_per_rad(&self) -> f64 {
        self.gear_ratio * f64::from(self.encoder_counts_per_turn) / core::f64::consts::TAU
    }

    /// Returns the electronic data sheet (CiA 306-1) for a file of this name, by a program of this version.
    pub fn eds(&self, file: &str, version: &str) -> String {
        let dictionary = self.dictionary();
        let product = &self.name();
        Eds { dictionary: &dictionary, node_id: self.node_id, file, product, version }.to_string()
    }

    fn name(&self) -> String {
        format!("Resonarm joint {}", self.joint + 1)
    }

    /// Returns the object dictionary after a reset.
    pub fn dictionary(&self) -> Dictionary {
        let mut dictionary = Dictionary::new();
        self.add_communication(&mut dictionary);
        self.add_drive(&mut dictionary);
        add_inert(&mut dictionary);
        dictionary
    }

    fn add_communication(&self, dictionary: &mut Dictionary) {
        use Access::{Const, ReadOnly, ReadWrite};
        let id = u32::from(self.node_id);
        let name = Text::new(self.name().as_bytes()).map_or(Value::U8(0), Value::Text);
        // The low word is the profile, 402, and the high word 2 says that it is a servo drive.
        dictionary.variable(0x1000, Entry::new(0, "Device type", Const, Value::U32(0x0002_0192)));
        let register = Entry::new(0, "Error register", ReadOnly, Value::U8(0));
        dictionary.variable(0x1001, register.mappable(Mappable::Transmit));
        dictionary.variable(0x1005, Entry::new(0, "COB-ID SYNC", Const, Value::U32(0x80)));
        dictionary.variable(0x1008, Entry::new(0, "Device name", Const, name));
        dictionary.variable(0x1014, Entry::new(0, "COB-ID EMCY", Const, Value::U32(0x80 + id)).by_node());
        dictionary.variable(0x1017, Entry::new(0, "Producer heartbeat time", ReadWrite, Value::U16(1000)));
        add_error_objects(dictionary);
        let identity = vec![
            Entry::new(0, "Largest subindex", Const, Value::U8(4)),
            Entry::new(1, "Vendor id", Const, Value::U32(VENDOR)),
            Entry::new(2, "Product code", Const, Value::U32(PRODUCT)),
            Entry::new(3, "Revision number", Const, Value::U32(REVISION)),
            Entry::new(4, "Serial number", Const, Value::U32(id)).by_node(),
        ];
        dictionary.add(Object { index: 0x1018, name: "Identity", kind: Kind::Record, entries: identity });
        let word = |index, bits| mapping_word(at(index, 0), bits);
        let none = PdoDefaults { kind: EVENT_TYPE, ..PdoDefaults::default() };
        let command = [word(0x6040, 16), word(0x6071, 16)];
        let status = [word(0x6041, 16), word(0x6061, 8), word(0x6077, 16)];
        let motion = [word(0x6064, 32), word(0x606C, 32)];
        // Commands act when they come, status follows a timer of 10 ms, and position and velocity come with
        // every SYNC.
        let command = PdoDefaults { mapped: &command, kind: EVENT_TYPE, event_timer_ms: 0 };
        let status = PdoDefaults { mapped: &status, kind: EVENT_TYPE, event_timer_ms: 10 };
        let motion = PdoDefaults { mapped: &motion, kind: 1, event_timer_ms: 0 };
        add_pdos(dictionary, self.node_id, &[command, none, none, none], &[status, motion, none, none]);
    }

    fn add_drive(&self, dictionary: &mut Dictionary) {
        use Access::{Const, ReadOnly, ReadWrite};
        use Mappable::{Receive, Transmit};
        let all = [
            (0x603F, Entry::new(0, "Error code", ReadOnly, Value::U16(0)).mappable(Transmit)),
            (0x6040, Entry::new(0, "Controlword", ReadWrite, Value::U16(0)).mappable(Receive)),
            (0x6041, Entry::new(0, "Statusword", ReadOnly, Value::U16(0)).mappable(Transmit)),
            // Option 6: slow down and stay in quick stop active.
            (0x605A, Entry::new(0, "Quick stop option code", Const, Value::I16(6))),
            (0x6060, Entry::new(0, "Modes of operation", ReadWrite, Value::I8(0)).mappable(Receive)),
            (0x6061, Entry::new(0, "Modes of operation display", ReadOnly, Value::I8(0)).mappable(Transmit)),
            (0x6064, Entry::new(0, "Position actual value", ReadOnly, Value::I32(0)).mappable(Transmit)),
            (0x606C, Entry::new(0, "Velocity actual value", ReadOnly, Value::I32(0)).mappable(Transmit)),
            (0x6071, Entry::new(0, "Target torque", ReadWrite, Value::I16(0)).mappable(Receive)),
            (0x6076, Entry::new(0, "Motor rated torque", Const, Value::U32(self.rated_torque_mnm))),
            (0x6077, Entry::new(0, "Torque actual value", ReadOnly, Value::I16(0)).mappable(Transmit)),
            (0x6502, Entry::new(0, "Supported drive modes", Const, Value::U32(1 << (TORQUE_MODE - 1)))),
        ];
        all.into_iter().for_each(|(index, entry)| dictionary.variable(index, entry));
        let resolution = vec![
            Entry::new(0, "Largest subindex", Const, Value::U8(2)),
            Entry::new(1, "Encoder increments", Const, Value::U32(self.encoder_counts_per_turn)),
            Entry::new(2, "Motor revolutions", Const, Value::U32(1)),
        ];
        let name = "Position encoder resolution";
        dictionary.add(Object { index: 0x608F, name, kind: Kind::Array, entries: resolution });
    }
}

/// Adds objects of other modes, which masters write and map whatever the mode is. Written values are stored
/// without effect.
fn add_inert(dictionary: &mut Dictionary) {
    use Access::ReadWrite;
    use Mappable::Receive;
    let all = [
        (0x607A, Entry::new(0, "Target position", ReadWrite, Value::I32(0)).mappable(Receive)),
        (0x6081, Entry::new(0, "Profile velocity", ReadWrite, Value::U32(0)).mappable(Receive)),
        (0x6083, Entry::new(0, "Profile acceleration", ReadWrite, Value::U32(0)).mappable(Receive)),
        (0x60FF, Entry::new(0, "Target velocity", ReadWrite, Value::I32(0)).mappable(Receive)),
    ];
    all.into_iter().for_each(|(index, entry)| dictionary.variable(index, entry));
    let period = vec![
        Entry::new(0, "Largest subindex", Access::Const, Value::U8(2)),
        Entry::new(1, "Interpolation time period value", ReadWrite, Value::U8(1)),
        // A power of ten: with −3 the period above is in milliseconds.
        Entry::new(2, "Interpolation time index", ReadWrite, Value::I8(-3)).within(-128, 63),
    ];
    dictionary.add(Object { index: 0x60C2, name: "Interpolation time period", kind: Kind::Record, entries: period });
}
