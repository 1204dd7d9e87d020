//! The demands of `SPEC.md`, by their numbers there.

/// A demand of the specification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Requirement {
    /// Number of the requirement in `SPEC.md`: the section, and a number within it.
    pub id: &'static str,
    /// A summary of the demand.
    pub text: &'static str,
    /// Way in which the requirement is checked.
    pub check: Check,
}

/// Way in which a requirement is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// The requirement is checked by the cases that name it.
    Cases,
    /// The requirement is not checked by a case of this program, for this reason.
    Elsewhere(&'static str),
}

pub(super) const fn tested(id: &'static str, text: &'static str) -> Requirement {
    Requirement { id, text, check: Check::Cases }
}

pub(super) const fn untested(id: &'static str, text: &'static str, why: &'static str) -> Requirement {
    Requirement { id, text, check: Check::Elsewhere(why) }
}

/// All of them, in the order of their sections.
pub const REQUIREMENTS: [Requirement; 58] = [
    untested(
        "R-1.1",
        "CAN FD frames are accepted with and without bit rate switch",
        "an interface may have one data bit rate only",
    ),
    tested("R-1.2", "a message that the profile doesn't have is neither sent nor accepted"),
    untested(
        "R-1.3",
        "no OperatorCommand of the exciter beside a station's",
        "the bus doesn't show who sent a request",
    ),
    tested("R-1.4", "a second sender of the node's messages is a fault"),
    tested("R-1.5", "a remote frame is not answered"),
    tested("R-2.1", "each message has its own counter, which steps by 1"),
    tested("R-2.2", "repeated counters and jumps of 5 or more are rejected"),
    untested(
        "R-2.3",
        "the boot-up heartbeat is sent before anything else competes for the bus",
        "only a busy bus with arbitration shows it",
    ),
    tested("R-2.4", "a rejected frame has no effect"),
    tested("R-2.5", "reserved bits, values that are not available or not finite, and unknown values are rejected"),
    tested("R-3.1", "the count that means not available is rejected"),
    tested("R-3.2", "not a number and infinity are not sent (classic)"),
    untested(
        "R-3.3",
        "a command beyond the range is not sent, and never clipped",
        "the bus can't make a controller ask for it",
    ),
    tested("R-3.7", "a reading beyond its range is the end of the range, with its flag"),
    untested("R-3.4", "the controller notices a command beyond the range", "it is inside the controller"),
    tested("R-3.5", "not a number and infinity are not sent (FD)"),
    untested(
        "R-3.6",
        "a command beyond a single is not sent, a reading beyond it is marked",
        "the bus can't make an arm or a controller reach it",
    ),
    tested("R-4.1", "no command of an exciter is beyond the limits of its capabilities"),
    tested("R-5.1", "the table of states"),
    tested("R-5.2", "a change of state is reported at once, a fault after its emergency"),
    tested("R-5.3", "the plant arms only for a hello that fits"),
    tested("R-5.4", "the exciter begins only after a hello that fits"),
    tested("R-6.1", "a heartbeat at least every 100 ms"),
    tested("R-6.8", "at most 20 heartbeats in 1000 ms, besides those of a change of state"),
    tested("R-6.6", "350 ms without a new whole sample are a fault of the exciter"),
    tested("R-6.2", "a hello at least every 1000 ms"),
    tested("R-6.3", "a node that was stopped doesn't take its own silence for its partner's"),
    untested("R-6.4", "a node looks at least once a sample period", "the bus doesn't show when a node looks"),
    tested("R-6.5", "in real time at least 100 samples a second"),
    untested(
        "R-6.7",
        "of timeouts that pass together bus loss is reported before the others, and heartbeat lost last",
        "which timeouts pass at one look of a node is chance on a bus",
    ),
    tested("R-7.1", "the first hello of a partner that has booted is answered at once"),
    tested("R-7.2", "a boot-up heartbeat makes a node forget the partner's hello"),
    tested("R-7.3", "a plant in fault is asked for the reset before it is asked to arm"),
    untested(
        "R-7.4",
        "an exciter in fault resets no plant",
        "the bus doesn't distinguish its requests from those of an operator's station",
    ),
    tested("R-7.5", "an exciter that asks for arming by itself asks within 1000 ms of a hello that fits"),
    tested("R-8.1", "a sample's messages, in their order, with one index that has no gap"),
    tested("R-8.2", "a whole sample is answered with its index, an incomplete one is not"),
    tested("R-8.3", "repeated samples are ignored, ten are a fault, and so is an index outside the window"),
    tested("R-8.4", "commands that are too large, old, early or repeated, or come while not operational, are rejected"),
    tested("R-8.5", "a rejected command neither acts nor restarts the timeout"),
    tested("R-8.6", "what was held goes to zero in equal steps"),
    tested("R-8.7", "20 ms without a command are a fault, and the force is zero 50 ms later"),
    tested("R-8.8", "an exciter ends when the plant leaves"),
    tested("R-8.9", "an exciter that ends says so; a plant disarms when the exciter leaves, and forgets its hello"),
    tested("R-8.10", "an exciter stops when the plant faults, boots, or is disarmed"),
    tested(
        "R-8.11",
        "a plant that can, armed by an exciter that can, sends two samples a frame, the first with an even index",
    ),
    tested("R-8.12", "an exciter that can answers the second sample of a frame"),
    tested("R-8.13", "a plant with a largest rate of change rejects what changes the load faster"),
    tested("R-8.14", "a plant with a largest travel rejects every command beyond it"),
    tested("R-8.20", "in lockstep a plant waits for the command with the index of its sample, and accepts no other"),
    tested("R-8.21", "in lockstep a plant without an answer faults after 1000 ms"),
    tested("R-8.22", "in lockstep an exciter waits 1000 ms for the next sample, and faults without it"),
    tested("R-8.23", "an operational node whose CAN controller is bus-off faults"),
    untested(
        "R-8.24",
        "an exciter that ends asks for the disarm until the plant has answered, and commands no more",
        "the bus can't end the work of an exciter whose plant stays armed",
    ),
    tested("R-8.25", "in lockstep a plant whose exciter gives up reports why it rejected the last commands"),
    tested("R-9.1", "a fault is reported once, then the state is fault"),
    untested(
        "R-9.2",
        "after code 7, and code 14 of a shaker, a plant must be started again",
        "the bus can't make a simulation fail, and a plant whose shaker has tripped is gone for the cases after it",
    ),
    tested("R-9.3", "of several reasons why a hello doesn't fit the first is reported"),
];
