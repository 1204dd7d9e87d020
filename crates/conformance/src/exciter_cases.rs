//! Cases for an exciter: answers to samples, faults. The tester plays the plant.

use super::counters::sample;
use super::damage::{Damage, needs_fd};
use super::exciter_role::{begin, commands, commands_of, exchange_hellos, is_arm};
use super::plant_role::period_ns;
use super::source::{FRAMES, Samples};
use super::stop::{Stop, failed, inconclusive, late, not_at_once, skipped, wrong};
use super::tester::{Tester, emergency, is_state};
use super::times::{GONE_NS, MARGIN_NS, MS, ms};
use resonarm_protocol::timing::{HEARTBEAT_TIMEOUT_NS, sample_period_ns};
use resonarm_protocol::{
    EmergencyCode, Hello, Message, MessageKind, Mismatch, Node, NodeState, OperatorCommand, OperatorRequest, Profile,
};

/// A heartbeat that must be sent at once is late after this time, ns. The protocol does not say how long a node may
/// take: this is less than the 80 ms after which the next one is due in most nodes, and longer than a machine usually
/// stops a process. A node fails only if it is this late three times.
const AT_ONCE_NS: u64 = 75 * MS;
/// Time for which samples may be answered before the heartbeat operational, ns: a controller may send frames of low
/// identifiers first.
const ANSWERS_AT_ONCE_NS: u64 = 20 * MS;
/// Time within which an exciter that arms the plant itself asks for it, ns from when the plant's hello fits.
const ARM_REQUEST_NS: u64 = 1000 * MS;
/// Number of samples sent of which each waits for the answer to the one before, and how many of them may have none.
const AWAITED: u16 = 60;
const MOST_MISSING: usize = 2;
/// The fewest distances between samples without an answer that show a rule.
const REGULAR: usize = 4;
/// An exciter that is still present this long after its work ended is taken to stay, ns.
const STAYS_NS: u64 = 3 * GONE_NS;

/// The exciter doesn't begin without a hello, and faults at a hello that doesn't fit.
pub(super) fn begins_for_a_hello(t: &mut Tester) -> Result<(), Stop> {
    exchange_hellos(t)?;
    t.boot()?;
    // Clears the hello, which is sent below.
    t.source.samples = Samples::Steady;
    t.send_state(NodeState::Operational)?;
    let from = t.heard.len();
    t.run_ns(2 * MARGIN_NS)?;
    refuse_begin(t, from, "without a hello of the plant")?;
    // One bit of the hash is the smallest difference that must be rejected.
    t.hello = Hello { dbc_hash: t.hello.dbc_hash ^ 1, ..t.hello };
    t.send_hello()?;
    match t.wait_for_emergency(MARGIN_NS)? {
        Some((_, e)) if (e.code, e.detail) == (EmergencyCode::Incompatible, Mismatch::DbcHash as u16) => {}
        Some((_, e)) => return failed(format!("at a hello with another DBC hash it reports: {e}")),
        None => return late("it ignores a hello with another DBC hash"),
    }
    t.run_ns(MARGIN_NS)?;
    refuse_begin(t, from, "for a hello that doesn't fit")
}

fn refuse_begin(t: &Tester, from: usize, why: &str) -> Result<(), Stop> {
    let began = t.heard[from..].iter().any(|heard| is_state(&heard.message, NodeState::Operational));
    if began || !commands(t, from).is_empty() { failed(format!("it begins {why}")) } else { Ok(()) }
}

/// A plant in fault is asked to reset, then to arm.
pub(super) fn plant_in_fault(t: &mut Tester) -> Result<(), Stop> {
    exchange_hellos(t)?;
    t.boot()?;
    t.send_state(NodeState::Fault)?;
    t.send_hello()?;
    let request = |message: &Message| match message {
        Message::Operator(OperatorCommand { request, target: Node::Plant }) => Some(*request),
        _ => None,
    };
    let first = t.wait_for(t.settings.patience_ns, |message| request(message).is_some())?;
    match first.and_then(|heard| request(&heard.message)) {
        Some(OperatorRequest::Reset) => {}
        Some(_) => return failed("its first request to a plant in fault is not the reset"),
        None => {
            return t.unready("it sends no request to a plant in fault: check that it is restarted after each case");
        }
    }
    t.send_state(NodeState::PreOperational)?;
    match t.wait_for(MARGIN_NS + 100 * MS, is_arm)? {
        Some(_) => Ok(()),
        None => late("it doesn't ask the plant to arm after the reset"),
    }
}

/// Each whole sample is answered once, with its index.
pub(super) fn answers(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let from = t.heard.len();
    let first = t.source.index;
    t.run_ns(300 * MS)?;
    let sent = t.source.index.wrapping_sub(first);
    let awaited = t.source.index;
    await_answers(t)?;
    t.check_frames()?;
    let answered = commands(t, from);
    if answered.windows(2).any(|pair| pair[1] == pair[0]) {
        return failed("it answers a sample twice");
    }
    if let Some(sample) = t.source.unsent {
        return failed(format!("it answers sample {sample} before that is sent"));
    }
    let answers = Answered::new(&answered, first, sent);
    t.note(format!("{} of {sent} samples answered", answers.count));
    let awaited = Answered::new(&answered, awaited, AWAITED);
    t.note(format!("{} of {AWAITED} awaited ones", awaited.count));
    // On a busy machine some answers are lost, but not more than a fifth.
    if 5 * answers.missing() > answers.sent + 10 {
        return late(format!("it answers {} of {sent} samples", answers.count));
    }
    judge_awaited(&awaited)?;
    // When no more samples come, the last answer is to the last sample.
    t.source.samples = Samples::Off;
    t.run_ns(MARGIN_NS)?;
    match (commands(t, from).last(), t.source.index.wrapping_sub(1)) {
        (Some(answered), sent) if *answered == sent => Ok(()),
        (Some(answered), sent) => late(format!("of the samples up to {sent} the last that it answers is {answered}")),
        (None, sent) => late(format!("it answers none of the samples up to {sent}")),
    }
}

/// Sends samples of which each waits for the answer to the one before, for as long as a machine may hold the exciter up.
/// So none remains without an answer because a process was held up.
fn await_answers(t: &mut Tester) -> Result<(), Stop> {
    t.source.samples = Samples::Awaited;
    for _ in 0..AWAITED {
        let awaited = t.source.index;
        t.source.due_ns = t.source.sent_ns + period_ns(t);
        t.wait_for(MARGIN_NS, |message| sample(message) == Some(awaited))?;
    }
    Ok(())
}

/// Few awaited samples may remain without an answer: the exciter was held up for longer than it is waited for.
fn judge_awaited(answers: &Answered) -> Result<(), Stop> {
    let missing = answers.missing();
    let sent = answers.sent;
    if let Some(distance) = answers.distance() {
        return wrong(format!(
            "of {sent} samples it leaves {missing} without an answer within {}, at a regular distance of {distance} samples",
            ms(MARGIN_NS)
        ));
    }
    if missing > MOST_MISSING {
        return not_at_once(format!(
            "of {sent} samples it leaves {missing} without an answer within {}: at most {MOST_MISSING} may be",
            ms(MARGIN_NS)
        ));
    }
    Ok(())
}

/// Samples of a series that are answered.
pub(super) struct Answered {
    sent: usize,
    /// Number of samples that are answered.
    pub count: usize,
    /// The samples that are the first of some in a row without an answer, counted from the first of the series, and how
    /// many those are.
    gaps: Vec<Gap>,
}

struct Gap {
    at: usize,
    samples: usize,
}

impl Answered {
    /// Finds those of the `sent` samples from `first` on that these commands answer. Answers to earlier samples don't
    /// count.
    pub fn new(commands: &[u16], first: u16, sent: u16) -> Answered {
        let mut is_answered = vec![false; usize::from(sent)];
        for sample in commands {
            // Answers to earlier samples wrap around to numbers beyond the series.
            if let Some(sample) = is_answered.get_mut(usize::from(sample.wrapping_sub(first))) {
                *sample = true;
            }
        }
        let count = is_answered.iter().filter(|is_answered| **is_answered).count();
        let mut gaps: Vec<Gap> = Vec::new();
        for (at, _) in is_answered.iter().enumerate().filter(|(_, is_answered)| !**is_answered) {
            match gaps.last_mut().filter(|gap| gap.at + gap.samples == at) {
                Some(gap) => gap.samples += 1,
                None => gaps.push(Gap { at, samples: 1 }),
            }
        }
        Answered { sent: is_answered.len(), count, gaps }
    }

    /// The samples without an answer.
    pub fn missing(&self) -> usize {
        self.sent - self.count
    }

    /// The regular distance of the samples without an answer, if there is one: most of the gaps follow each other in it.
    fn distance(&self) -> Option<usize> {
        let mut distances: Vec<usize> = self.gaps.windows(2).map(|two| two[1].at - two[0].at).collect();
        // In a regular series nearly all distances are the same, and so is their median. A quarter may differ, as
        // hold-ups add gaps of their own.
        distances.sort_unstable();
        let distance = *distances.get(distances.len() / 2)?;
        let alike = distances.iter().filter(|other| **other == distance).count();
        (distances.len() >= REGULAR && 4 * alike >= 3 * distances.len()).then_some(distance)
    }
}

/// The exciter asks for arming soon after its partner's hello fits.
pub(super) fn asks_to_arm(t: &mut Tester) -> Result<(), Stop> {
    exchange_hellos(t)?;
    t.boot()?;
    let give_up_ns = t.now_ns() + t.settings.patience_ns;
    loop {
        t.send_hello()?;
        let asked_ns = t.now_ns();
        let left_ns = give_up_ns.saturating_sub(asked_ns);
        let word = t.wait_for(left_ns, |message| is_arm(message) || is_state(message, NodeState::BootUp))?;
        let Some(heard) = word else {
            return t.unready("it doesn't ask the plant to arm: check that it is restarted after each case");
        };
        if !is_arm(&heard.message) {
            // Another one has been started, which has heard no hello.
            continue;
        }
        let took_ns = heard.at_ns - asked_ns;
        t.note(format!("after {}", ms(took_ns)));
        return match took_ns > ARM_REQUEST_NS + MARGIN_NS {
            true => late(format!(
                "it asks for arming {} after the plant's hello, at most {} are allowed",
                ms(took_ns),
                ms(ARM_REQUEST_NS)
            )),
            false => Ok(()),
        };
    }
}

/// Lets an exciter begin, then sends what must stop it, and arms no more. Returns the length of the log before that.
fn stop(t: &mut Tester, send: impl FnOnce(&mut Tester) -> Result<(), Stop>) -> Result<usize, Stop> {
    begin(t)?;
    t.source.arms = false;
    let from = t.heard.len();
    send(t).map(|()| from)
}

/// The plant's emergency stops it, whatever the plant's heartbeat says.
pub(super) fn plant_emergency(t: &mut Tester) -> Result<(), Stop> {
    let from = stop(t, |t| t.send_emergency(EmergencyCode::CommandTimeout, 0))?;
    ends(t, from, NodeState::Fault)
}

/// Samples that are incomplete or damaged are not answered; those after them are.
fn unanswered(t: &mut Tester, samples: Samples) -> Result<(), Stop> {
    let from = t.heard.len();
    let bad = t.source.index;
    let period_ns = sample_period_ns(t.hello.rate_hz);
    t.source.samples = samples;
    // Three bad samples by their index, however long the tester is held up.
    while t.source.index.wrapping_sub(bad) < 3 {
        t.run_ns(period_ns)?;
    }
    t.source.samples = Samples::Steady;
    let good = t.source.index;
    t.run_ns(MARGIN_NS + 10 * period_ns)?;
    if let Some(e) = t.heard[from..].iter().find_map(|heard| emergency(&heard.message)) {
        return failed(format!("it faults: {e}"));
    }
    let answered = commands(t, from);
    let n_bad = good.wrapping_sub(bad);
    let now = t.source.index;
    if let Some(wrong) = answered.iter().find(|sample| sample.wrapping_sub(bad) < n_bad) {
        return failed(format!("it answers sample {wrong}"));
    }
    match answered.iter().any(|sample| sample.wrapping_sub(good) < now.wrapping_sub(good)) {
        true => Ok(()),
        false => late("it doesn't continue with the samples after them"),
    }
}

/// The exciter ignores the frames of a network with another base.
pub(super) fn foreign_base(t: &mut Tester) -> Result<(), Stop> {
    exchange_hellos(t)?;
    t.boot()?;
    let from = t.heard.len();
    t.send_at_other_base(&Message::PlantHello(t.hello))?;
    t.run_ns(2 * MARGIN_NS)?;
    if t.heard[from..].iter().any(|heard| is_arm(&heard.message)) {
        return failed("it arms the plant for a hello with another base");
    }
    begin(t)?;
    unanswered(t, Samples::Damaged(Damage::Base))
}

pub(super) fn incomplete(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let frames = match t.network.profile() {
        Profile::Classic => FRAMES,
        Profile::Fd => 1,
    };
    // Each frame is left out in turn, since an exciter may answer by the last one alone.
    (0..frames).try_for_each(|lost| unanswered(t, Samples::Without(lost)))
}

pub(super) fn damaged(t: &mut Tester, damage: Damage) -> Result<(), Stop> {
    begin(t)?;
    match unanswered(t, Samples::Damaged(damage)) {
        Err(Stop::Bus(error)) if needs_fd(damage, t.network.profile()) => {
            skipped(format!("the bus can't send a CAN FD frame: {error}"))
        }
        other => other,
    }
}

/// A repeated sample is answered once; ten repetitions are a fault.
pub(super) fn repeated_samples(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let from = t.heard.len();
    let index = t.source.index;
    t.source.samples = Samples::Standing;
    faults(t, HEARTBEAT_TIMEOUT_NS, EmergencyCode::SampleSequence)?;
    match commands(t, from).iter().filter(|sample| **sample == index).count() {
        0 | 1 => Ok(()),
        n => failed(format!("it answers sample {index} {n} times")),
    }
}

/// An index outside the window is a fault.
pub(super) fn outside_window(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    t.source.index = t.source.index.wrapping_add(0x4000);
    faults(t, MARGIN_NS + 50 * MS, EmergencyCode::SampleSequence)
}

/// Without new samples it faults after 350 ms, not earlier.
pub(super) fn sensor_timeout(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    t.source.samples = Samples::Off;
    let silent_ns = t.now_ns();
    let period_ns = sample_period_ns(t.hello.rate_hz);
    let most_ns = HEARTBEAT_TIMEOUT_NS + period_ns + MARGIN_NS;
    let from = t.heard.len();
    let text = format!("no emergency {} after the last sample", ms(most_ns));
    let (heard, e) = t.expect_emergency(most_ns, EmergencyCode::SensorTimeout, text)?;
    let after_ns = heard.at_ns - silent_ns;
    if e.code != EmergencyCode::SensorTimeout {
        return failed(format!("without samples it reports: {e}"));
    }
    // The last sample was sent up to a period, and the tester's hold-up, earlier.
    if after_ns + 2 * period_ns + t.watch.held_up_ns < HEARTBEAT_TIMEOUT_NS {
        return failed(format!(
            "it faults {} after the last sample, not after {}",
            ms(after_ns),
            ms(HEARTBEAT_TIMEOUT_NS)
        ));
    }
    t.note(format!("fault after {}", ms(after_ns)));
    ends(t, from, NodeState::Fault)
}

/// A fault or a boot of the plant stops it.
pub(super) fn stops_at(t: &mut Tester, state: NodeState) -> Result<(), Stop> {
    let from = stop(t, |t| t.send_state(state))?;
    ends(t, from, NodeState::Fault)?;
    let at = |holds: &dyn Fn(&Message) -> bool| t.heard[from..].iter().find(|h| holds(&h.message)).map(|h| h.at_ns);
    let Some(emergency_ns) = at(&|message| emergency(message).is_some()) else { return Ok(()) };
    let heartbeat_ns = at(&|message| is_state(message, NodeState::Fault)).unwrap_or(emergency_ns);
    match heartbeat_ns.checked_sub(emergency_ns) {
        None => failed("its heartbeat fault comes before its emergency"),
        Some(late_ns) if late_ns > AT_ONCE_NS => {
            not_at_once(format!("its heartbeat fault comes {} after its emergency, not at once", ms(late_ns)))
        }
        Some(_) => Ok(()),
    }
}

/// The exciter sends the heartbeat at once when it becomes operational (judged by the samples answered before it), and
/// when it no longer is.
pub(super) fn state_changes(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let place = |holds: &dyn Fn(&Message) -> bool, from: usize| {
        t.heard[from..].iter().position(|heard| holds(&heard.message)).map_or(t.heard.len(), |place| from + place)
    };
    let armed = place(&is_arm, 0);
    let operational = place(&|message| is_state(message, NodeState::Operational), armed);
    let early = commands_of(&t.heard[armed..operational]).count();
    let most = ANSWERS_AT_ONCE_NS / period_ns(t) + 4;
    t.note(format!("{early} samples answered before its heartbeat operational"));
    if early as u64 > most {
        return failed(format!("it answers {early} samples before its heartbeat operational, which comes at once"));
    }
    t.source.arms = false;
    let asked_ns = t.now_ns();
    t.send_state(NodeState::PreOperational)?;
    let text = format!("no heartbeat pre-operational within {}", ms(MARGIN_NS));
    t.expect_state(MARGIN_NS, NodeState::PreOperational, text)?;
    let last = t.heard.iter().rfind(|heard| is_state(&heard.message, NodeState::PreOperational));
    let late_ns = last.map_or(0, |heard| heard.at_ns - asked_ns);
    t.note(format!("pre-operational after {}", ms(late_ns)));
    if late_ns > AT_ONCE_NS {
        return not_at_once(format!(
            "its heartbeat pre-operational comes {} after the plant's, not at once",
            ms(late_ns)
        ));
    }
    Ok(())
}

/// The exciter says after its end, by a disarmed plant or by one in fault, that it leaves, before it boots again or is
/// gone.
pub(super) fn leaves(t: &mut Tester, state: NodeState) -> Result<(), Stop> {
    let from = stop(t, |t| t.send_state(state))?;
    let give_up_ns = t.now_ns() + STAYS_NS;
    while t.now_ns() < give_up_ns {
        let word =
            t.wait_for(GONE_NS, |message| emergency(message).is_some() || is_state(message, NodeState::BootUp))?;
        match word.map(|heard| heard.message) {
            Some(Message::Emergency(e)) if e.code == EmergencyCode::Leaving => return Ok(()),
            Some(Message::Emergency(_)) => {}
            Some(_) => return failed("it boots again, and did not say before that it leaves"),
            // All that was heard is older: the exciter is gone.
            None if t.heard[from..].iter().all(|heard| heard.at_ns + GONE_NS < t.now_ns()) => {
                return failed(format!("it is silent for {}, and did not say before that it leaves", ms(GONE_NS)));
            }
            None => {}
        }
    }
    skipped("it stays on the bus when its work is over, so that it need not say that it leaves")
}

/// The plant is disarmed.
pub(super) fn plant_disarmed(t: &mut Tester) -> Result<(), Stop> {
    let from = stop(t, |t| t.send_state(NodeState::PreOperational))?;
    ends(t, from, NodeState::PreOperational)
}

/// The plant leaves: the exciter ends, and is not in fault.
pub(super) fn plant_leaves(t: &mut Tester) -> Result<(), Stop> {
    let from = stop(t, |t| {
        t.is_alive = false;
        t.send_emergency(EmergencyCode::Leaving, 0)
    })?;
    ends(t, from, NodeState::PreOperational)
}

/// Another node with the exciter's identifiers.
pub(super) fn second_sender(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let hello = Message::ExciterHello(t.hello);
    let Ok(frame) = t.stranger().frame(&hello) else { return inconclusive("the tester can't make a hello") };
    t.send_frame(&frame)?;
    faults(t, MARGIN_NS, EmergencyCode::SecondSender)?;
    let identifier = MessageKind::ExciterHello.id(t.network);
    match t.heard.iter().find_map(|heard| emergency(&heard.message)) {
        Some(e) if e.detail != identifier => failed(format!("the detail is not the identifier {identifier:#x}: {e}")),
        _ => Ok(()),
    }
}

/// It sends the code, then the heartbeat fault, and commands nothing more.
fn faults(t: &mut Tester, within_ns: u64, code: EmergencyCode) -> Result<(), Stop> {
    let from = t.heard.len();
    let text = format!("no emergency {code} within {}", ms(within_ns));
    match t.expect_emergency(within_ns, code, text)? {
        (_, e) if e.code == code => ends(t, from, NodeState::Fault),
        (_, e) => failed(format!("expected emergency {code}, but it reports: {e}")),
    }
}

/// It sends this state after index `from` of the log, and commands nothing more.
fn ends(t: &mut Tester, from: usize, state: NodeState) -> Result<(), Stop> {
    t.run_ns(MARGIN_NS)?;
    let Some(place) = t.heard[from..].iter().position(|heard| is_state(&heard.message, state)) else {
        return late(format!("no heartbeat {state} within {}", ms(MARGIN_NS)));
    };
    match commands(t, from + place).first() {
        Some(sample) => failed(format!("it commands for sample {sample} after its heartbeat {state}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hold_up_in_the_middle_hides_no_regular_distance() {
        // Every tenth sample has no answer, and, in the middle of the series, the three after one of them as well.
        let is_missing = |sample: u16| sample % 10 == 5 || (57..60).contains(&sample);
        let commands: Vec<u16> = (0..110).filter(|sample| !is_missing(*sample)).collect();
        let answered = Answered::new(&commands, 0, 110);
        assert_eq!((answered.missing(), answered.distance()), (14, Some(10)));
    }
}
