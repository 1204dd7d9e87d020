//! The table of cases for users' own protocols.

use super::craft::Damage;
use super::protocol::UserWire;
use super::refusal_cases::damaged;
use super::tester::Tester;
use super::{controller_cases, drive_cases, lockstep_cases, plant_cases, refusal_cases};
use crate::case::Case;
use crate::stop::Stop;
use resonarm_protocol::{Node, NodeState};
use resonarm_scenario::wire::PresetSpec;
use resonarm_session::run::Mode;

/// A case for a node on a user protocol.
pub type WireCase = Case<WireScript>;

/// The script of such a case.
#[derive(Clone, Copy, Debug)]
pub struct WireScript(pub(super) fn(&mut Tester) -> Result<(), Stop>);

type Row = (&'static str, &'static str, &'static [&'static str], fn(&mut Tester) -> Result<(), Stop>);

const CONTROLLER: [Row; 9] = [
    ("exciter-arms", "arms the plant", &["W-2.1"], controller_cases::arms),
    ("exciter-before-arming", "no load before the plant is armed", &["W-2.2"], controller_cases::before_arming),
    ("exciter-frames", "length, checksum and values of its frames", &["W-1.1"], controller_cases::frames),
    ("exciter-counters", "counters step by 1", &["W-1.2"], controller_cases::counters),
    ("exciter-in-time", "loads come in time while the plant is armed", &["W-2.3"], controller_cases::in_time),
    ("exciter-acts", "what it commands acts", &["W-2.4"], controller_cases::acts),
    ("exciter-limits", "loads within the exciter's limits", &["W-2.5"], controller_cases::limits),
    ("exciter-plant-faults", "the plant faults", &["W-2.6"], |t| controller_cases::stops_once(t, NodeState::Fault)),
    ("exciter-plant-disarmed", "the plant is disarmed by its operator", &["W-2.7"], |t| {
        controller_cases::stops_once(t, NodeState::PreOperational)
    }),
];

const LOCKSTEP_CONTROLLER: [Row; 4] = [
    ("lockstep-exciter-frames", "length, checksum and values of its frames", &["W-1.1"], controller_cases::frames),
    ("lockstep-exciter-counters", "counters step by 1", &["W-1.2"], controller_cases::counters),
    ("lockstep-exciter-answers", "each sample answered once", &["W-5.1"], lockstep_cases::controller_answers),
    ("lockstep-exciter-waits", "a plant that takes its time", &["W-5.1"], lockstep_cases::controller_waits),
];

/// Cases for every plant.
const PLANT: [Row; 16] = [
    ("plant-rates", "readings as often as the mapping says", &["W-3.1"], plant_cases::rates),
    ("plant-requests", "readings on request", &["W-3.2"], plant_cases::requests),
    ("plant-frames", "length, checksum and values of its frames", &["W-1.1"], plant_cases::frames),
    ("plant-counters", "counters step by 1", &["W-1.2"], plant_cases::counters),
    ("plant-arms", "armed by the messages of the mapping", &["W-3.3"], plant_cases::arms),
    ("plant-commands-act", "the reported load is the commanded one", &["W-3.4"], plant_cases::commands_act),
    ("plant-wrong-checksum", "commands with a wrong checksum", &["W-3.9"], |t| damaged(t, Damage::Checksum)),
    ("plant-repeated-counter", "commands with the counter of the one before", &["W-3.9"], |t| {
        damaged(t, Damage::Repeated)
    }),
    ("plant-counter-jump", "commands after which too many seem lost", &["W-3.9"], |t| damaged(t, Damage::Jump)),
    ("plant-length", "commands that are too short", &["W-3.9"], |t| damaged(t, Damage::Short)),
    ("plant-not-finite", "commands of a load that is no number", &["W-3.9"], |t| damaged(t, Damage::NotFinite)),
    ("plant-too-large", "commands beyond the exciter's limit", &["W-3.10"], refusal_cases::too_large),
    ("plant-command-timeout", "silence of the controller", &["W-3.5"], plant_cases::command_timeout),
    ("plant-disarm", "disarmed by the messages of the mapping", &["W-3.6"], plant_cases::disarm),
    ("plant-reset", "a reset in fault", &["W-3.7"], plant_cases::reset),
    ("plant-stop", "a message that stops it", &["W-3.8"], plant_cases::stop),
];

/// Cases of CANopen drives, beside those of every plant.
const DRIVES: [Row; 7] = [
    ("plant-objects", "objects as the scenario says", &["W-4.1"], drive_cases::objects),
    ("plant-aborts", "SDO transfers that are aborted", &["W-4.2"], drive_cases::aborts),
    ("plant-states", "the state machine of CiA 402", &["W-4.3"], drive_cases::states),
    ("plant-heartbeats", "heartbeats", &["W-4.4"], drive_cases::heartbeats),
    ("plant-positions", "a position for each SYNC", &["W-4.5"], drive_cases::positions),
    ("plant-not-enabled", "targets before it is enabled", &["W-4.6"], drive_cases::not_enabled),
    ("plant-emergencies", "emergencies", &["W-4.7"], drive_cases::emergencies),
];

const LOCKSTEP_PLANT: [Row; 4] = [
    ("lockstep-plant-frames", "length, checksum and values of its frames", &["W-1.1"], plant_cases::frames),
    ("lockstep-plant-counters", "counters step by 1", &["W-1.2"], plant_cases::counters),
    ("lockstep-plant-waits", "no sample before the last is answered", &["W-5.1"], lockstep_cases::plant_waits),
    ("lockstep-plant-timeout", "silence of the controller", &["W-5.1"], lockstep_cases::plant_timeout),
];

/// The cases for the node under test of a user protocol, in order; none for [`Mode::Free`], which has no bus.
pub fn wire_cases(on: &UserWire) -> Vec<WireCase> {
    let drives: &[Row] = if on.preset == Some(PresetSpec::Cia402) { &DRIVES } else { &[] };
    let (rows, more): (&[Row], &[Row]) = match (on.mode, on.tested) {
        (Mode::RealTime, Node::Plant) => (&PLANT, drives),
        (Mode::RealTime, Node::Exciter) => (&CONTROLLER, &[]),
        (Mode::Lockstep, Node::Plant) => (&LOCKSTEP_PLANT, &[]),
        (Mode::Lockstep, Node::Exciter) => (&LOCKSTEP_CONTROLLER, &[]),
        (Mode::Free, _) => (&[], &[]),
    };
    let tested = on.tested;
    let mode = on.mode;
    let case = |&(id, title, requirements, script): &Row| WireCase {
        id,
        tested,
        mode,
        title,
        requirements,
        script: WireScript(script),
    };
    rows.iter().chain(more).map(case).collect()
}
