//! Requirements of a user protocol on the nodes that speak it.

use crate::requirements::{Requirement, tested, untested};

/// All of them: those of every protocol (W-1), of a controller (W-2), of a plant (W-3), of CANopen drives (W-4), of
/// both in lockstep (W-5).
pub const WIRE_REQUIREMENTS: [Requirement; 33] = [
    tested("W-1.1", "a frame has its length, its checksum and finite values; of CANopen it keeps the rules"),
    tested("W-1.2", "a message with a counter counts up by 1"),
    untested(
        "W-1.3",
        "readings with a wrong checksum, a wrong length or a repeated counter are not used by a controller",
        "the bus doesn't show what a controller uses",
    ),
    untested("W-1.4", "a second sender of a node's messages is noticed", "neither DBC nor CiA 301 says what follows"),
    tested("W-2.1", "a controller arms the plant by the messages of the mapping: an axis, or a drive, by its requests"),
    tested("W-2.2", "it commands no load before it has armed the plant"),
    tested("W-2.3", "while the plant is armed the loads come in time"),
    tested("W-2.4", "what it commands acts: the values that are required, or the mode of operation, come before"),
    tested("W-2.5", "no load is beyond the exciter's limits"),
    tested("W-2.6", "it commands no load to a plant that says a fault, or resets the fault"),
    tested("W-2.7", "it commands no load to a plant that says that it is disarmed, or arms it anew"),
    untested(
        "W-2.8",
        "it ends by disarming the plant",
        "the bus doesn't show when a controller ends its work, and when it is killed",
    ),
    untested(
        "W-2.9",
        "it does not act on a plant that is silent",
        "a mapping has no time after which readings are late",
    ),
    untested(
        "W-2.10",
        "no load changes faster than the exciter's limits, or beyond its travel",
        "frames that are late together look like a jump, and the travel is the plant's",
    ),
    tested("W-3.1", "readings come as often as the mapping says"),
    tested("W-3.2", "a reading that is sent on request answers one"),
    tested("W-3.3", "the plant is armed by the messages of the mapping"),
    tested("W-3.4", "a load that is commanded acts, in both directions"),
    tested("W-3.5", "without a load for the timeout it says a fault, with its reason, and the load becomes zero"),
    tested("W-3.6", "disarmed, it is not armed, and the load becomes zero"),
    tested("W-3.7", "a fault is reset by the messages of the mapping"),
    tested("W-3.8", "a message that stops makes it fault"),
    tested("W-3.9", "a frame with a wrong checksum, counter or length, or a load that is no number, has no effect"),
    tested("W-3.10", "a load beyond the limits is rejected"),
    untested(
        "W-3.11",
        "loads before it is armed don't act (DBC)",
        "the emulated exciter arms by the frames that command",
    ),
    tested("W-4.1", "objects of the drive say what the scenario says of it"),
    tested("W-4.2", "what can't be read or written is aborted"),
    tested("W-4.3", "controlwords and statuswords are those of the state machine of CiA 402"),
    tested("W-4.4", "heartbeats come as object 1017 says"),
    tested("W-4.5", "a SYNC asks for a position"),
    tested("W-4.6", "a target of a drive that is not enabled doesn't act"),
    tested("W-4.7", "a fault has an emergency, and so has its end"),
    tested("W-5.1", "in lockstep each sample is answered once, and no sample comes before that; silence is a fault"),
];
