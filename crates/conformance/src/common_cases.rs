//! Cases for both nodes: heartbeats, hellos.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::load::BusLoad;
use super::stop::{Stop, failed, inconclusive, late, wrong};
use super::tester::Tester;
use super::times::{MARGIN_NS, MS, ms};
use super::{exciter_role, plant_role};
use resonarm_protocol::timing::{HEARTBEAT_PERIOD_NS, HELLO_PERIOD_NS, REAL_TIME_RATE_MIN_HZ};
use resonarm_protocol::{Hello, Message, MessageKind, Node};

/// How long heartbeats are watched, ns.
const WATCH_NS: u64 = 1000 * MS;

/// Heartbeats at least every 100 ms. A single late one may be due to a stop of the node; not so if the node was heard
/// meanwhile, or if most are late.
pub(super) fn heartbeats(t: &mut Tester) -> Result<(), Stop> {
    if t.wait_for(t.settings.patience_ns, |_| true)?.is_none() {
        return inconclusive("nothing of the node under test came");
    }
    let start_ns = t.now_ns();
    t.run_ns(WATCH_NS)?;
    let is_heartbeat = |message: &Message| matches!(message, Message::Heartbeat(_));
    let mut times: Vec<u64> = t.heard.iter().filter(|h| is_heartbeat(&h.message)).map(|h| h.at_ns).collect();
    if times.is_empty() && t.tested == Node::Exciter && t.heard.iter().all(|heard| heard.at_ns < start_ns) {
        return inconclusive("it left the bus");
    }
    let came = times.len() as u64;
    times.insert(0, start_ns.min(times.first().copied().unwrap_or(start_ns)));
    times.push(t.now_ns());
    let longest_ns = times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(WATCH_NS);
    t.note(format!("{came} in {}, longest gap {}", ms(WATCH_NS), ms(longest_ns)));
    if longest_ns <= HEARTBEAT_PERIOD_NS + MARGIN_NS {
        return Ok(());
    }
    let text = format!("no heartbeat for {}, at most {} is allowed", ms(longest_ns), ms(HEARTBEAT_PERIOD_NS));
    if came < WATCH_NS / HEARTBEAT_PERIOD_NS / 2 { failed(text) } else { late(text) }
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
        let (theirs, own) = (described(&theirs), described(&t.hello));
        return wrong(format!("its hello doesn't fit this program's ({mismatch}): {theirs}, not {own}"));
    }
    if theirs.rate_hz < REAL_TIME_RATE_MIN_HZ {
        return wrong(format!("{} samples a second, at least {REAL_TIME_RATE_MIN_HZ} in real time", theirs.rate_hz));
    }
    t.note(format!("{} Hz", theirs.rate_hz));
    Ok(())
}

/// Fails for a hello that was refused; otherwise there was none.
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
        return Err(Stop::Skipped(String::from(
            "no bit rate is given (--bit-rate-hz), so 70 % of the bus is not known",
        )));
    };
    t.load = Some(BusLoad::new(bit_rate_hz, t.settings.seed, t.now_ns()));
    let result = script(t);
    let now_ns = t.now_ns();
    if let Some(load) = t.load.take() {
        t.note(format!("{:.0} % of {bit_rate_hz} bit/s", 100.0 * load.share(now_ns)));
    }
    result
}
