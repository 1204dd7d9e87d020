//! The queues between a program and the bus.

use std::fs;
use std::process::Command;

use serde::Deserialize;

use resonarm::bus::socketcan;
use resonarm::realtime::Finding;

/// Length of a transmit queue, frames, that holds more than a node sends at once, and all that `replay` sends in 10 ms.
const TRANSMIT_QUEUE: u32 = 100;
/// Packets queued by the kernel until a core processes them: the kernel's default.
const BACKLOG: usize = 1000;
/// Queue disciplines that send frames in order and drop none without an error.
const IN_ORDER: [&str; 5] = ["pfifo_fast", "pfifo", "bfifo", "noqueue", "netem"];

/// An interface in the output of `ip -json link show`.
#[derive(Debug, Deserialize)]
struct Link {
    ifname: String,
    #[serde(default)]
    qdisc: String,
    #[serde(default)]
    txqlen: u32,
    link_type: String,
}

/// Reports the transmit queue of each CAN interface, and the kernel's limits.
pub(super) fn findings() -> Vec<Finding> {
    // What this program asks for of its own sockets.
    let wanted = socketcan::Options::default();
    let limits = [
        limit("receive backlog", "netdev_max_backlog", BACKLOG, "frames"),
        limit("receive buffer", "rmem_max", wanted.receive_buffer_bytes, "bytes"),
        limit("send buffer", "wmem_max", wanted.send_buffer_bytes, "bytes"),
    ];
    transmit_queues().into_iter().chain(limits.into_iter().flatten()).collect()
}

fn transmit_queues() -> Vec<Finding> {
    let Ok(output) = Command::new("ip").args(["-json", "link", "show"]).output() else {
        let state = String::from("not known: there is no `ip`");
        let fix = Some(String::from("`sudo apt-get install iproute2`; CAN interfaces are set up with it"));
        return vec![Finding { subject: "transmit queue", state, fix }];
    };
    // An `ip` without JSON output, such as BusyBox's, yields no findings. The other checks still run.
    let links: Vec<Link> = serde_json::from_slice(&output.stdout).unwrap_or_default();
    links.iter().filter(|link| link.link_type == "can").map(transmit_queue).collect()
}

fn transmit_queue(link: &Link) -> Finding {
    let Link { ifname, qdisc, txqlen, .. } = link;
    // Without a queue, as on vcan, each frame goes straight to the driver: nothing can fill up or reorder. An
    // interface that is down has the discipline `noop` and gets its real one when it is brought up.
    let fix = if qdisc == "noqueue" {
        None
    } else if !IN_ORDER.contains(&qdisc.as_str()) && qdisc != "noop" {
        Some(format!(
            "{qdisc} may reorder frames, or drop them without an error: `sudo tc qdisc replace dev {ifname} root pfifo_fast`"
        ))
    } else if *txqlen < TRANSMIT_QUEUE {
        Some(format!("too short for a burst of frames: `sudo ip link set {ifname} txqueuelen 1000`"))
    } else {
        None
    };
    let state =
        if qdisc == "noqueue" { format!("{ifname}: none") } else { format!("{ifname}: {txqlen} frames, {qdisc}") };
    Finding { subject: "transmit queue", state, fix }
}

/// Reports a limit of the kernel; `None` where it is not visible, as in most containers.
fn limit(subject: &'static str, name: &str, least: usize, unit: &str) -> Option<Finding> {
    let text = fs::read_to_string(format!("/proc/sys/net/core/{name}")).ok()?;
    Some(judge(subject, name, text.trim().parse().ok()?, least, unit))
}

fn judge(subject: &'static str, name: &str, got: usize, least: usize, unit: &str) -> Finding {
    let state = format!("at most {got} {unit} (net.core.{name})");
    let fix = (got < least).then(|| format!("`sudo sysctl net.core.{name}={least}` allows what this program asks for"));
    Finding { subject, state, fix }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(finding: &Finding) -> String {
        format!("{} | {}", finding.state, finding.fix.as_deref().unwrap_or("ok"))
    }

    #[test]
    fn a_short_queue_and_one_that_reorders_are_reported_with_the_fix() {
        // Output of `ip -json link show` of iproute2 6.1, shortened.
        let json = r#"[
            {"ifindex":1,"ifname":"lo","mtu":65536,"qdisc":"noqueue","txqlen":1000,"link_type":"loopback"},
            {"ifindex":2,"ifname":"can0","mtu":16,"qdisc":"pfifo_fast","txqlen":10,"link_type":"can"},
            {"ifindex":3,"ifname":"can1","mtu":72,"qdisc":"fq_codel","txqlen":1000,"link_type":"can"},
            {"ifindex":4,"ifname":"can2","mtu":72,"qdisc":"pfifo_fast","txqlen":1000,"link_type":"can"},
            {"ifindex":5,"ifname":"vcan0","mtu":72,"qdisc":"noqueue","link_type":"can"}]"#;
        let links: Vec<Link> = serde_json::from_str(json).unwrap();
        let found: Vec<String> = links.iter().skip(1).map(|link| text(&transmit_queue(link))).collect();
        insta::assert_snapshot!(found.join("\n"), @r"
        can0: 10 frames, pfifo_fast | too short for a burst of frames: `sudo ip link set can0 txqueuelen 1000`
        can1: 1000 frames, fq_codel | fq_codel may reorder frames, or drop them without an error: `sudo tc qdisc replace dev can1 root pfifo_fast`
        can2: 1000 frames, pfifo_fast | ok
        vcan0: none | ok
        ");
    }

    #[test]
    fn a_limit_below_the_requested_size_is_reported_with_the_fix() {
        let found = |got| text(&judge("receive buffer", "rmem_max", got, 2 << 20, "bytes"));
        insta::assert_snapshot!(found(212_992), @"at most 212992 bytes (net.core.rmem_max) | `sudo sysctl net.core.rmem_max=2097152` allows what this program asks for");
        insta::assert_snapshot!(found(4 << 20), @"at most 4194304 bytes (net.core.rmem_max) | ok");
    }
}
