//! Cases for both nodes: heartbeats, hellos.

use super::counters::sample;
use super::load::BusLoad;
use super::stop::{Stop, failed, inconclusive, late, skipped, wrong};
use super::tester::{Heard, Tester, state_said};
use super::times::{MARGIN_NS, MS, ms};
use super::{exciter_role, plant_role};
use resonarm_protocol::timing::{HEARTBEAT_PERIOD_NS, HELLO_PERIOD_NS, REAL_TIME_RATE_MIN_HZ};
use resonarm_protocol::{Cycle, Frame, FrameFormat, Hello, Id, Message, MessageKind, Node, NodeState};

/// Time for which heartbeats are watched, ns.
const WATCH_NS: u64 = 1000 * MS;

/// The most heartbeats in a second, apart from those that report a change of state.
const MOST_HEARTBEATS: u64 = 20;
/// Number of remote frames that are sent for each message.
const REMOTE_FRAMES: u64 = 30;
/// Time between two remote frames, ns.
const REMOTE_PERIOD_NS: u64 = 5 * MS;

/// Heartbeats at least every 100 ms, and at most 20 a second. A single late one may be due to a stop of the node; not so
/// if the node was heard meanwhile, or if most are late.
pub(super) fn heartbeats(t: &mut Tester) -> Result<(), Stop> {
    if t.wait_for(t.settings.patience_ns, |_| true)?.is_none() {
        return inconclusive("no frame of the node under test was received");
    }
    let start_ns = t.now_ns();
    t.run_ns(WATCH_NS)?;
    let is_heartbeat = |message: &Message| matches!(message, Message::Heartbeat(_));
    let mut times: Vec<u64> = t.heard.iter().filter(|h| is_heartbeat(&h.message)).map(|h| h.at_ns).collect();
    // An exciter may end by itself before it is watched.
    if times.is_empty() && t.tested == Node::Exciter && t.heard.iter().all(|heard| heard.at_ns < start_ns) {
        return inconclusive("it left the bus");
    }
    let came = times.len() as u64;
    let all: Vec<NodeState> = t.heard.iter().filter_map(|heard| state_said(&heard.message)).collect();
    // A heartbeat that tells a new state is sent at once, beside those of the period.
    let changes = all.windows(2).filter(|two| two[0] != two[1]).count() as u64;
    // What was sent while the tester was held up waits on the bus.
    let watched_ns = t.now_ns() - start_ns + t.watch.held_up_ns;
    let most = (MOST_HEARTBEATS * watched_ns).div_ceil(WATCH_NS) + changes;
    if came > most {
        return wrong(format!(
            "{came} heartbeats, {changes} of them of a new state, came in {}: at most {MOST_HEARTBEATS} a second are \
             allowed besides those of a new state",
            ms(t.now_ns() - start_ns)
        ));
    }
    // The times before the first heartbeat and after the last are gaps, too.
    times.insert(0, start_ns.min(times.first().copied().unwrap_or(start_ns)));
    times.push(t.now_ns());
    let longest_ns = times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(WATCH_NS);
    t.note(format!("{came} in {}, longest gap {}", ms(WATCH_NS), ms(longest_ns)));
    if longest_ns <= HEARTBEAT_PERIOD_NS + MARGIN_NS {
        return Ok(());
    }
    let text = format!("no heartbeat for {}, at most {} is allowed", ms(longest_ns), ms(HEARTBEAT_PERIOD_NS));
    // If most are missing, no single stop of the node explains it.
    if came < WATCH_NS / HEARTBEAT_PERIOD_NS / 2 { failed(text) } else { late(text) }
}

/// Remote frames with the identifiers of the network are not answered: as many messages come with them as without, and
/// no sample comes, or is answered, twice.
pub(super) fn remote_frames(t: &mut Tester) -> Result<(), Stop> {
    match t.tested {
        Node::Plant => plant_role::meet(t)?,
        Node::Exciter => exciter_role::begin(t)?,
    }
    let duration_ns = REMOTE_FRAMES * REMOTE_PERIOD_NS;
    // Without remote frames, for comparison.
    let before = t.heard.len();
    t.run_ns(duration_ns + MARGIN_NS)?;
    let from = t.heard.len();
    let kinds: Vec<MessageKind> =
        MessageKind::ALL.into_iter().filter(|kind| kind.form(t.network.profile()).is_some()).collect();
    for _ in 0..REMOTE_FRAMES {
        for kind in &kinds {
            let Ok(frame) = Frame::new(Id::Standard(kind.id(t.network)), FrameFormat::Remote, &[0; 8]) else {
                continue;
            };
            match t.send_frame(&frame) {
                Err(Stop::Bus(error)) => return skipped(format!("the bus can't send a remote frame: {error}")),
                sent => sent?,
            }
        }
        t.run_ns(REMOTE_PERIOD_NS)?;
    }
    t.run_ns(MARGIN_NS)?;
    let count = |heard: &[Heard], kind| heard.iter().filter(|heard| heard.message.kind() == kind).count() as u64;
    for kind in kinds.into_iter().filter(|kind| kind.sender() == t.tested) {
        let without = count(&t.heard[before..from], kind);
        let with = count(&t.heard[from..], kind);
        let is_answered = match kind.cycle() {
            Cycle::Sample => indices(&t.heard[before..], kind).windows(2).any(|two| two[0] == two[1]),
            // By its events a node may send twice as much by chance; an answer to every second remote frame is no
            // chance.
            Cycle::Period { .. } | Cycle::Event => with > 2 * without + REMOTE_FRAMES / 2,
        };
        if is_answered {
            return wrong(format!(
                "it answers remote frames: {with} {kind} were received beside {REMOTE_FRAMES} remote frames of each \
                 message, and {without} without them"
            ));
        }
    }
    Ok(())
}

/// The samples of these messages, in the order in which they came.
fn indices(heard: &[Heard], kind: MessageKind) -> Vec<u16> {
    heard.iter().filter(|heard| heard.message.kind() == kind).filter_map(|heard| sample(&heard.message)).collect()
}

/// Exchanges hellos with the node under test.
fn exchange_hellos(t: &mut Tester) -> Result<Hello, Stop> {
    match t.tested {
        Node::Plant => plant_role::exchange_hellos(t),
        Node::Exciter => exciter_role::exchange_hellos(t),
    }
}

/// Checks version, profile, hash and rate of its hello.
pub(super) fn hello(t: &mut Tester) -> Result<(), Stop> {
    let theirs = match exchange_hellos(t) {
        Err(Stop::Inconclusive(text)) => return no_hello(t, text),
        answered => answered?,
    };
    if let Some(mismatch) = t.hello.mismatch(&theirs) {
        let theirs = described(&theirs);
        let own = described(&t.hello);
        return wrong(format!("its hello is incompatible with this program's ({mismatch}): {theirs}, expected {own}"));
    }
    if theirs.rate_hz < REAL_TIME_RATE_MIN_HZ {
        return wrong(format!("{} samples a second, at least {REAL_TIME_RATE_MIN_HZ} in real time", theirs.rate_hz));
    }
    t.note(format!("{} Hz", theirs.rate_hz));
    Ok(())
}

/// Fails for a hello that was rejected; otherwise there was none.
fn no_hello(t: &Tester, text: String) -> Result<(), Stop> {
    let kind = match t.tested {
        Node::Plant => MessageKind::PlantHello,
        Node::Exciter => MessageKind::ExciterHello,
    };
    match t.traffic.refused_of(|refused| refused == kind).next() {
        Some(refused) => wrong(format!("its hello is wrong: {refused}")),
        None => inconclusive(text),
    }
}

/// A hello in words.
fn described(hello: &Hello) -> String {
    let Hello { version, dbc_hash, profile, rate_hz } = hello;
    format!("version {version}, DBC hash {dbc_hash:#08X}, profile {profile}, {rate_hz} Hz").replace("0X", "0x")
}

/// A partner that has booted is answered at once, and hellos are sent periodically.
pub(super) fn first_hello(t: &mut Tester) -> Result<(), Stop> {
    let is_hello = |message: &Message| matches!(message, Message::PlantHello(_) | Message::ExciterHello(_));
    exchange_hellos(t)?;
    if t.wait_for(HELLO_PERIOD_NS + MARGIN_NS, is_hello)?.is_none() {
        return late(format!("no hello within {}", ms(HELLO_PERIOD_NS + MARGIN_NS)));
    }
    t.boot()?;
    let asked_ns = t.now_ns();
    t.send_hello()?;
    match t.wait_for(MARGIN_NS, is_hello)? {
        Some(heard) => t.note(format!("answered after {}", ms(heard.at_ns - asked_ns))),
        None => {
            return late(format!("the hello of a partner that has booted isn't answered within {}", ms(MARGIN_NS)));
        }
    }
    Ok(())
}

/// Runs a script while the bus is loaded.
pub(super) fn loaded(t: &mut Tester, script: fn(&mut Tester) -> Result<(), Stop>) -> Result<(), Stop> {
    let Some(bit_rate_hz) = t.settings.bit_rate_hz else {
        return skipped("no bit rate is given (--bit-rate-hz), so a bus load of 70 % can't be made");
    };
    // The load goes on through all steps of the script, also those that bring the node under test into its state.
    t.load = Some(BusLoad::new(bit_rate_hz, t.settings.seed, t.now_ns()));
    let result = script(t);
    let now_ns = t.now_ns();
    if let Some(load) = t.load.take() {
        t.note(format!("{:.0} % of {bit_rate_hz} bit/s", 100.0 * load.share(now_ns)));
    }
    result
}
