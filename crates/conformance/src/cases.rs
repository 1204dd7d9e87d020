//! The table of cases.

use super::case::Case;
use super::common_cases::loaded;
use super::damage::Damage;
use super::stop::Stop;
use super::tester::Tester;
use super::{
    bus_off_cases, common_cases, counter_cases, exciter_cases, lockstep_cases, pair_cases, plant_cases, refusal_cases,
    saturation_cases, sine_cases, soak_cases,
};
use resonarm_protocol::{Node, NodeState};
use resonarm_session::run::Mode;

/// A case for a node on Resonarm's protocol.
pub type ProtocolCase = Case<Script>;

/// The script of a case for Resonarm's protocol.
#[derive(Clone, Copy, Debug)]
pub struct Script(pub(super) fn(&mut Tester) -> Result<(), Stop>);

type Row = (&'static str, &'static str, &'static [&'static str], fn(&mut Tester) -> Result<(), Stop>);

const PLANT: [Row; 41] = [
    ("plant-hello", "version, profile, DBC hash and rate in its hello", &["R-6.5"], common_cases::hello),
    (
        "plant-first-hello",
        "hellos, and one at once for a partner that has booted",
        &["R-6.2", "R-7.1"],
        common_cases::first_hello,
    ),
    ("plant-heartbeats", "heartbeats", &["R-6.1", "R-6.8"], common_cases::heartbeats),
    (
        "plant-frames",
        "all its frames are valid, its samples whole and in order",
        &["R-1.2", "R-3.2", "R-3.5", "R-8.1"],
        plant_cases::frames,
    ),
    ("plant-counters", "each message has its own counter, which steps by 1", &["R-2.1"], counter_cases::plant),
    ("plant-remote-frames", "remote frames with all identifiers", &["R-1.5"], common_cases::remote_frames),
    (
        "plant-arms-for-a-hello",
        "not armed without a hello that fits",
        &["R-5.3", "R-7.2", "R-9.3"],
        plant_cases::arms_for_a_hello,
    ),
    ("plant-states", "the table of states", &["R-5.1", "R-5.2"], plant_cases::states),
    ("plant-reset", "a reset in fault", &["R-5.1"], plant_cases::reset),
    ("plant-commands-act", "the head reads what is commanded", &[], plant_cases::commands_act),
    ("plant-not-armed", "commands before it is armed", &["R-8.4", "R-8.5"], plant_cases::not_armed),
    ("plant-wrong-crc", "commands with a wrong bit", &["R-2.4"], |t| refusal_cases::damaged(t, Damage::Bit)),
    ("plant-repeated-counter", "commands with the counter of the one before", &["R-2.2", "R-2.4"], |t| {
        refusal_cases::damaged(t, Damage::Repeated)
    }),
    ("plant-counter-jump", "commands whose counter jumps by 5", &["R-2.2", "R-2.4"], |t| {
        refusal_cases::damaged(t, Damage::Jump)
    }),
    ("plant-data-id", "commands of another network by their data id", &["R-2.4"], |t| {
        refusal_cases::damaged(t, Damage::DataId)
    }),
    ("plant-other-format", "commands in the frame format of the other profile", &["R-1.2", "R-2.4"], |t| {
        refusal_cases::damaged(t, Damage::Format)
    }),
    ("plant-length", "commands that are too short", &["R-2.4"], |t| refusal_cases::damaged(t, Damage::Length)),
    ("plant-extended-id", "commands under a 29-bit identifier", &["R-2.4"], |t| {
        refusal_cases::damaged(t, Damage::Extended)
    }),
    (
        "plant-foreign-base",
        "hello, request and commands with the identifiers of another base",
        &["R-2.4", "R-5.3"],
        plant_cases::foreign_base,
    ),
    ("plant-reserved-bit", "commands with a bit that has no signal", &["R-2.5"], |t| {
        refusal_cases::damaged(t, Damage::ReservedBit)
    }),
    ("plant-not-available", "commands with a value that is not available", &["R-2.5", "R-3.1"], |t| {
        refusal_cases::damaged(t, Damage::NotAvailable)
    }),
    ("plant-old-command", "commands for samples too old", &["R-8.4", "R-8.5"], refusal_cases::old),
    ("plant-early-command", "commands for samples still to come", &["R-8.4", "R-8.5"], refusal_cases::early),
    ("plant-same-sample", "further commands for a sample", &["R-8.4", "R-8.5"], refusal_cases::same_sample),
    (
        "plant-older-command",
        "commands for the sample before the last answered",
        &["R-8.4", "R-8.5"],
        refusal_cases::older,
    ),
    ("plant-too-large", "commands beyond the exciter's limit", &["R-8.4", "R-8.5"], refusal_cases::too_large),
    (
        "plant-too-fast",
        "commands that jump, where the rate of change is limited",
        &["R-8.13", "R-8.5"],
        refusal_cases::too_fast,
    ),
    (
        "plant-command-timeout",
        "silence of the exciter, and the ramp",
        &["R-8.6", "R-8.7", "R-9.1"],
        plant_cases::command_timeout,
    ),
    ("plant-disarm", "the ramp when it is disarmed", &["R-8.6"], plant_cases::disarm),
    ("plant-partner-fault", "a fault and a boot of the exciter", &["R-9.1"], plant_cases::partner_fault),
    ("plant-exciter-leaves", "the exciter leaves", &["R-8.9"], plant_cases::exciter_leaves),
    ("plant-second-sender", "another node with its identifiers", &["R-1.4"], plant_cases::second_sender),
    ("plant-stopped", "its process is stopped for a while", &["R-6.3"], plant_cases::stopped),
    ("plant-bus-off", "its CAN controller is bus-off", &["R-8.23"], bus_off_cases::plant),
    ("plant-saturation", "readings at the end of their range", &["R-3.7"], saturation_cases::plant),
    ("plant-pairs", "two samples a frame, if its capabilities say that it can", &["R-8.11"], pair_cases::plant),
    ("plant-load-hello", "its hello while the bus is loaded", &["R-6.5"], |t| loaded(t, common_cases::hello)),
    ("plant-load-wrong-crc", "commands with a wrong bit while the bus is loaded", &["R-2.4"], |t| {
        loaded(t, |t| refusal_cases::damaged(t, Damage::Bit))
    }),
    ("plant-load-states", "the table of states while the bus is loaded", &["R-5.1", "R-5.2"], |t| {
        loaded(t, plant_cases::states)
    }),
    (
        "plant-soak",
        "good and bad commands at random",
        &["R-2.2", "R-2.4", "R-2.5", "R-8.4", "R-8.5"],
        soak_cases::plant,
    ),
    // The last one, as it leaves the arm ringing.
    (
        "plant-too-far",
        "commands where the travel is limited, until the arm is beyond it",
        &["R-8.14", "R-9.1"],
        refusal_cases::too_far,
    ),
];

const EXCITER: [Row; 36] = [
    ("exciter-hello", "version, profile, DBC hash and rate in its hello", &["R-6.5"], common_cases::hello),
    (
        "exciter-first-hello",
        "hellos, and one at once for a partner that has booted",
        &["R-6.2", "R-7.1"],
        common_cases::first_hello,
    ),
    ("exciter-heartbeats", "heartbeats", &["R-6.1", "R-6.8"], common_cases::heartbeats),
    ("exciter-begins-for-a-hello", "no work without a hello that fits", &["R-5.4"], exciter_cases::begins_for_a_hello),
    ("exciter-plant-in-fault", "a plant that is in fault when it is met", &["R-7.3"], exciter_cases::plant_in_fault),
    ("exciter-asks-to-arm", "it asks for arming in time", &["R-7.5"], exciter_cases::asks_to_arm),
    (
        "exciter-answers",
        "each sample answered once, with its index, in valid frames",
        &["R-1.2", "R-3.2", "R-3.5", "R-8.2"],
        exciter_cases::answers,
    ),
    ("exciter-counters", "each message has its own counter, which steps by 1", &["R-2.1"], counter_cases::exciter),
    ("exciter-remote-frames", "remote frames with all identifiers", &["R-1.5"], common_cases::remote_frames),
    ("exciter-incomplete", "samples of which a frame is lost, each in turn", &["R-8.2"], exciter_cases::incomplete),
    ("exciter-wrong-crc", "samples with a wrong bit", &["R-2.4"], |t| exciter_cases::damaged(t, Damage::Bit)),
    ("exciter-repeated-counter", "samples with the counter of the one before", &["R-2.2", "R-2.4"], |t| {
        exciter_cases::damaged(t, Damage::Repeated)
    }),
    ("exciter-data-id", "samples of another network by their data id", &["R-2.4"], |t| {
        exciter_cases::damaged(t, Damage::DataId)
    }),
    (
        "exciter-foreign-base",
        "a hello and samples with the identifiers of another base",
        &["R-2.4", "R-5.4"],
        exciter_cases::foreign_base,
    ),
    ("exciter-not-available", "samples with a value that is not available", &["R-2.5", "R-3.1"], |t| {
        exciter_cases::damaged(t, Damage::NotAvailable)
    }),
    (
        "exciter-repeated-samples",
        "a plant whose index stands still",
        &["R-8.3", "R-9.1"],
        exciter_cases::repeated_samples,
    ),
    ("exciter-outside-window", "an index far from the last one", &["R-8.3", "R-9.1"], exciter_cases::outside_window),
    ("exciter-sensor-timeout", "silence of the plant", &["R-6.6", "R-9.1"], exciter_cases::sensor_timeout),
    ("exciter-plant-faults", "the plant faults", &["R-8.10"], |t| exciter_cases::stops_at(t, NodeState::Fault)),
    (
        "exciter-plant-emergency",
        "an emergency of the plant whose heartbeat stays operational",
        &["R-8.10"],
        exciter_cases::plant_emergency,
    ),
    ("exciter-plant-boots", "the plant boots", &["R-8.10"], |t| exciter_cases::stops_at(t, NodeState::BootUp)),
    ("exciter-plant-disarmed", "the plant is disarmed", &["R-8.10", "R-5.2"], exciter_cases::plant_disarmed),
    ("exciter-state-changes", "its heartbeats at changes of state", &["R-5.2"], exciter_cases::state_changes),
    ("exciter-leaves", "its leaving when it has ended", &["R-8.9"], |t| {
        exciter_cases::leaves(t, NodeState::PreOperational)
    }),
    ("exciter-leaves-faulted", "its leaving after a fault", &["R-8.9"], |t| exciter_cases::leaves(t, NodeState::Fault)),
    ("exciter-plant-leaves", "the plant leaves", &["R-8.8"], exciter_cases::plant_leaves),
    ("exciter-second-sender", "another node with its identifiers", &["R-1.4"], exciter_cases::second_sender),
    ("exciter-bus-off", "its CAN controller is bus-off", &["R-8.23"], bus_off_cases::exciter),
    ("exciter-own-limits", "commands within the limits that it states", &["R-4.1"], sine_cases::own_limits),
    ("exciter-sine", "the sine that it is set to command", &[], sine_cases::sine),
    ("exciter-saturation", "samples with clipped readings", &["R-8.2"], saturation_cases::exciter),
    ("exciter-pairs", "two samples a frame, if its capabilities say that it can", &["R-8.12"], pair_cases::exciter),
    ("exciter-load-hello", "its hello while the bus is loaded", &["R-6.5"], |t| loaded(t, common_cases::hello)),
    ("exciter-load-wrong-crc", "samples with a wrong bit while the bus is loaded", &["R-2.4"], |t| {
        loaded(t, |t| exciter_cases::damaged(t, Damage::Bit))
    }),
    ("exciter-load-plant-disarmed", "the plant is disarmed while the bus is loaded", &["R-8.10", "R-5.2"], |t| {
        loaded(t, exciter_cases::plant_disarmed)
    }),
    ("exciter-soak", "good and bad samples at random", &["R-2.2", "R-2.4", "R-2.5", "R-8.2"], soak_cases::exciter),
];

const LOCKSTEP_PLANT: [Row; 5] = [
    ("lockstep-plant-heartbeats", "heartbeats", &["R-6.1", "R-6.8"], common_cases::heartbeats),
    ("lockstep-plant-waits", "no sample before the last is answered", &["R-8.20"], lockstep_cases::plant_waits),
    (
        "lockstep-plant-other-samples",
        "commands for the samples before and after",
        &["R-8.20"],
        lockstep_cases::plant_takes_no_other,
    ),
    ("lockstep-plant-timeout", "silence of the exciter", &["R-8.21"], lockstep_cases::plant_timeout),
    (
        "lockstep-plant-refused",
        "an exciter that gives up after its command was rejected",
        &["R-8.25"],
        lockstep_cases::plant_reports_refusal,
    ),
];

const LOCKSTEP_EXCITER: [Row; 4] = [
    ("lockstep-exciter-heartbeats", "heartbeats", &["R-6.1", "R-6.8"], common_cases::heartbeats),
    ("lockstep-exciter-answers", "each sample answered once", &["R-8.2"], lockstep_cases::exciter_answers),
    ("lockstep-exciter-waits", "a plant that takes its time", &["R-8.22"], lockstep_cases::exciter_waits),
    ("lockstep-exciter-timeout", "silence of the plant", &["R-8.22"], lockstep_cases::exciter_timeout),
];

/// The cases for a node in real time or in lockstep, in order; none for [`Mode::Free`], which has no bus.
pub fn cases(tested: Node, mode: Mode) -> impl Iterator<Item = ProtocolCase> {
    let rows: &'static [Row] = match (mode, tested) {
        (Mode::RealTime, Node::Plant) => &PLANT,
        (Mode::RealTime, Node::Exciter) => &EXCITER,
        (Mode::Lockstep, Node::Plant) => &LOCKSTEP_PLANT,
        (Mode::Lockstep, Node::Exciter) => &LOCKSTEP_EXCITER,
        (Mode::Free, _) => &[],
    };
    rows.iter().map(move |&(id, title, requirements, script)| Case {
        id,
        tested,
        mode,
        title,
        requirements,
        script: Script(script),
    })
}
