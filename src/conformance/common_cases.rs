//! What both nodes must do: heartbeats.

use alloc::format;
use alloc::vec::Vec;

use super::tester::{MARGIN_NS, MS, Stop, Tester, failed, inconclusive, ms};
use crate::protocol::timing::HEARTBEAT_PERIOD_NS;
use crate::protocol::{Message, Node};

/// How long heartbeats are watched, ns.
const WATCH_NS: u64 = 1000 * MS;

/// Heartbeats at least every 100 ms.
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
    times.insert(0, start_ns.min(times.first().copied().unwrap_or(start_ns)));
    times.push(t.now_ns());
    let longest_ns = times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(WATCH_NS);
    t.note(format!("{} in {}, longest gap {}", times.len() - 2, ms(WATCH_NS), ms(longest_ns)));
    if longest_ns > HEARTBEAT_PERIOD_NS + MARGIN_NS {
        return failed(format!("no heartbeat for {}, at most {} is allowed", ms(longest_ns), ms(HEARTBEAT_PERIOD_NS)));
    }
    Ok(())
}
