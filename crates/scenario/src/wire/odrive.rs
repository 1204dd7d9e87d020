//! ODrive motor controllers as a user protocol, one for each joint: the messages of CANSimple for torque
//! control.
//!
//! An identifier is the node's number times 32 plus that of the command; numbers are little-endian (ODrive, CAN
//! protocol, firmware 0.6: Heartbeat, Set_Axis_State, Set_Controller_Mode, Set_Input_Torque, Get_Encoder_Estimates and
//! others). An axis turns `gear_ratio` times for one turn of the joint: the motor's angle is n times the joint's, the
//! joint's torque n times the motor's.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::drives::DriveSpec;
use super::{
    CommandSpec, EventSpec, InputSpec, LockstepSpec, OnSpec, ReadingSpec, RequestSpec, SourceSpec, WireSection,
};

/// Names of the plant's and the controller's nodes in the generated DBC.
const NODES: [&str; 2] = ["Plant", "Controller"];
/// Axis states `AXIS_STATE_IDLE` and `AXIS_STATE_CLOSED_LOOP_CONTROL` of the ODrive firmware.
const IDLE: f64 = 1.0;
const CLOSED_LOOP: f64 = 8.0;
/// Modes `CONTROL_MODE_TORQUE_CONTROL` and `INPUT_MODE_PASSTHROUGH`, the only ones in which torques act.
const TORQUE_CONTROL: f64 = 1.0;
const PASSTHROUGH: f64 = 1.0;
/// Bits of `ODRIVE_ERROR` that report the faults of the plant.
const ERRORS: [(&str, u32); 8] = [
    ("none", 0),
    ("command-timeout", 0x0100_0000), // WATCHDOG_TIMER_EXPIRED
    ("stop", 0x0200_0000),            // ESTOP_REQUESTED
    ("overrun", 0x0000_0004),         // TIMING_ERROR
    ("bus-loss", 0x0000_0040),        // MISSING_INPUT
    ("sequence", 0x0000_0040),
    ("simulation-failed", 0x0000_0002), // SYSTEM_LEVEL
    ("other", 0x0000_0002),
];
/// Period of the heartbeats, s.
const HEARTBEAT_S: f64 = 0.1;
/// Constant readings of temperature and supply: room temperature, °C, and the voltage of a supply without load.
const TEMPERATURE_C: f64 = 25.0;
const SUPPLY_V: f64 = 24.0;

/// A signal of the DBC: name, start bit, width, kind (`+` unsigned, `f` float), unit.
type Row = (&'static str, u8, u8, char, &'static str);

/// A message: command number, name, index of the sender in [`NODES`], signals.
const MESSAGES: [(u32, &str, usize, &[Row]); 12] = [
    (
        0x01,
        "Heartbeat",
        0,
        &[
            ("Axis_Error", 0, 32, '+', ""),
            ("Axis_State", 32, 8, '+', ""),
            ("Procedure_Result", 40, 8, '+', ""),
            ("Trajectory_Done_Flag", 48, 1, '+', ""),
        ],
    ),
    (0x02, "Estop", 1, &[]),
    (0x03, "Get_Error", 0, &[("Active_Errors", 0, 32, '+', ""), ("Disarm_Reason", 32, 32, '+', "")]),
    (0x07, "Set_Axis_State", 1, &[("Axis_Requested_State", 0, 32, '+', "")]),
    (0x09, "Get_Encoder_Estimates", 0, &[("Pos_Estimate", 0, 32, 'f', "rev"), ("Vel_Estimate", 32, 32, 'f', "rev/s")]),
    (0x0B, "Set_Controller_Mode", 1, &[("Control_Mode", 0, 32, '+', ""), ("Input_Mode", 32, 32, '+', "")]),
    (0x0E, "Set_Input_Torque", 1, &[("Input_Torque", 0, 32, 'f', "Nm")]),
    (0x14, "Get_Iq", 0, &[("Iq_Setpoint", 0, 32, 'f', "A"), ("Iq_Measured", 32, 32, 'f', "A")]),
    (
        0x15,
        "Get_Temperature",
        0,
        &[("FET_Temperature", 0, 32, 'f', "deg C"), ("Motor_Temperature", 32, 32, 'f', "deg C")],
    ),
    (0x17, "Get_Bus_Voltage_Current", 0, &[("Bus_Voltage", 0, 32, 'f', "V"), ("Bus_Current", 32, 32, 'f', "A")]),
    (0x18, "Clear_Errors", 1, &[("Identify", 0, 8, '+', "")]),
    (0x1C, "Get_Torques", 0, &[("Torque_Target", 0, 32, 'f', "Nm"), ("Torque_Estimate", 32, 32, 'f', "Nm")]),
];

/// Returns the DBC of these drives.
pub(super) fn dbc(drives: &[DriveSpec]) -> String {
    let mut text = format!("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: {}\n", NODES.join(" "));
    let mut types = String::new();
    for drive in drives {
        for (command, name, sender, signals) in MESSAGES {
            // CANSimple identifiers have the node id above 5 bits of command.
            let id = u32::from(drive.node_id) << 5 | command;
            let length = if signals.is_empty() { 0 } else { 8 };
            _ = writeln!(text, "\nBO_ {id} Axis{}_{name}: {length} {}", drive.node_id, NODES[sender]);
            for (signal, start, bits, kind, unit) in signals {
                // A DBC marks floating-point signals as signed; `SIG_VALTYPE_` states the type.
                let sign = if *kind == 'f' { '-' } else { *kind };
                // There are two nodes, so what one sends the other receives.
                let receiver = NODES[1 - sender];
                _ = writeln!(text, " SG_ {signal} : {start}|{bits}@1{sign} (1,0) [0|0] \"{unit}\" {receiver}");
                if *kind == 'f' {
                    _ = writeln!(types, "SIG_VALTYPE_ {id} {signal} : 1;");
                }
            }
        }
    }
    text + "\n" + &types
}

/// Returns the mapping of these drives' messages, at `rate_hz` samples per second.
pub(super) fn section(section: &WireSection, rate_hz: f64) -> WireSection {
    let mut whole = WireSection {
        node: Some(NODES[0].to_string()),
        lockstep: section.lockstep,
        text: Some(dbc(&section.drives)),
        ..WireSection::default()
    };
    // In lockstep the controller answers every sample and so needs its readings every sample. In real time it
    // gets them every 10 ms, or every sample if samples are further apart.
    let every = match section.lockstep {
        Some(LockstepSpec::Command | LockstepSpec::Sync) => 1,
        None => (libm::round(0.01 * rate_hz) as u64).max(1),
    };
    for (number, drive) in section.drives.iter().enumerate() {
        let axis = Axis { number, drive, timeout_s: section.timeout_s.unwrap_or(super::drives::TIMEOUT_S), every };
        whole.commands.push(axis.command());
        whole.events.extend(axis.events());
        whole.readings.extend(axis.readings());
    }
    whole
}

/// One axis of the drives, with the settings that its messages share.
struct Axis<'a> {
    number: usize,
    drive: &'a DriveSpec,
    timeout_s: f64,
    every: u64,
}

impl Axis<'_> {
    fn name(&self, message: &str) -> String {
        format!("Axis{}_{message}", self.drive.node_id)
    }

    fn command(&self) -> CommandSpec {
        let torque = InputSpec {
            signal: String::from("Input_Torque"),
            gear_ratio: Some(self.drive.gear_ratio),
            ..InputSpec::default()
        };
        let mut command = CommandSpec {
            message: self.name("Set_Input_Torque"),
            timeout_s: Some(self.timeout_s),
            drive: self.number,
            ..CommandSpec::default()
        };
        if let Some(input) = command.torque_nm(self.drive.joint) {
            *input = Some(torque);
        }
        command
    }

    fn event(&self, message: &str) -> EventSpec {
        EventSpec { message: self.name(message), every_frame: true, drive: self.number, ..EventSpec::default() }
    }

    fn events(&self) -> [EventSpec; 5] {
        let signal = |name: &str| Some(String::from(name));
        // The mode has two signals, and torques act only if both have the right value, so that it makes two events.
        let mode = self.event("Set_Controller_Mode");
        [
            EventSpec {
                signal: signal("Axis_Requested_State"),
                arm: vec![CLOSED_LOOP],
                disarm: vec![IDLE],
                ..self.event("Set_Axis_State")
            },
            EventSpec { signal: signal("Control_Mode"), require: vec![TORQUE_CONTROL], ..mode.clone() },
            EventSpec { signal: signal("Input_Mode"), require: vec![PASSTHROUGH], ..mode },
            EventSpec { on_frame: Some(RequestSpec::Stop), ..self.event("Estop") },
            EventSpec { on_frame: Some(RequestSpec::Reset), ..self.event("Clear_Errors") },
        ]
    }

    fn reading(&self, message: &str, signals: &[(&str, SourceSpec)]) -> ReadingSpec {
        ReadingSpec {
            message: self.name(message),
            on_request: true,
            drive: self.number,
            signals: signals.iter().map(|(name, source)| ((*name).to_string(), source.clone())).collect(),
            ..ReadingSpec::default()
        }
    }

    fn readings(&self) -> Vec<ReadingSpec> {
        let joint = self.drive.joint;
        let errors: BTreeMap<String, f64> =
            ERRORS.iter().map(|(name, bits)| ((*name).to_string(), f64::from(*bits))).collect();
        // An ODrive in fault is idle, and tells the fault by its error alone.
        let states = [("pre-operational", IDLE), ("operational", CLOSED_LOOP), ("fault", IDLE)];
        let states = states.into_iter().map(|(name, number)| (name.to_string(), number)).collect();
        let error = SourceSpec { reason: Some(errors), ..SourceSpec::default() };
        let state = SourceSpec { state: Some(states), ..SourceSpec::default() };
        let constant = |value| SourceSpec { constant: Some(value), ..SourceSpec::default() };
        let of_motor = |quantity: String| SourceSpec {
            quantity: Some(quantity),
            gear_ratio: Some(self.drive.gear_ratio),
            ..SourceSpec::default()
        };
        let torque = of_motor(format!("torque{joint}_nm"));
        let current = self.drive.torque_constant_nm_a.map_or(constant(0.0), |constant_nm_a| SourceSpec {
            constant_per_a: Some(constant_nm_a),
            ..torque.clone()
        });
        let position = of_motor(format!("alpha{joint}_rad"));
        let rate = of_motor(format!("alpha{joint}_dot_rad_s"));
        let encoder = [("Pos_Estimate", position), ("Vel_Estimate", rate)];
        let heartbeat = [("Axis_Error", error.clone()), ("Axis_State", state)];
        let temperature =
            [("FET_Temperature", constant(TEMPERATURE_C)), ("Motor_Temperature", constant(TEMPERATURE_C))];
        let asked = |reading: ReadingSpec| ReadingSpec { on: Some(OnSpec::Remote), ..reading };
        let regular = |reading: ReadingSpec| ReadingSpec { every: Some(self.every), ..reading };
        vec![
            ReadingSpec { period_s: Some(HEARTBEAT_S), ..self.reading("Heartbeat", &heartbeat) },
            asked(self.reading("Get_Error", &[("Active_Errors", error.clone()), ("Disarm_Reason", error)])),
            regular(self.reading("Get_Encoder_Estimates", &encoder)),
            regular(self.reading("Get_Iq", &[("Iq_Setpoint", current.clone()), ("Iq_Measured", current)])),
            asked(self.reading("Get_Temperature", &temperature)),
            asked(self.reading("Get_Bus_Voltage_Current", &[("Bus_Voltage", constant(SUPPLY_V))])),
            regular(self.reading("Get_Torques", &[("Torque_Target", torque.clone()), ("Torque_Estimate", torque)])),
        ]
    }
}
