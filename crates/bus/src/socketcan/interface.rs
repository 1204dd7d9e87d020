//! The CAN interfaces that this process can reach.

use std::{fs, io};

use socketcan::{CanAddr, CanFdSocket, Socket};

/// The names of all CAN interfaces in this process's network namespace, up or down, sorted. None where the kernel has
/// no SocketCAN.
///
/// An interface counts as CAN if a CAN socket can be bound to it. The type in sysfs would not do: sysfs shows the
/// network namespace it was mounted in, which need not be that of the process.
///
/// # Errors
/// The error of reading `/proc/self/net/dev`.
pub fn interfaces() -> io::Result<Vec<String>> {
    let table = fs::read_to_string("/proc/self/net/dev")?;
    let mut names: Vec<String> =
        names(&table).filter(|name| CanFdSocket::open(name).is_ok()).map(str::to_owned).collect();
    names.sort();
    Ok(names)
}

/// The MTU of a CAN interface: 16 bytes carry classical frames, 72 also CAN FD frames. `None` if sysfs does not show the
/// interface of this process's network namespace.
pub(super) fn mtu(interface: &str) -> Option<u32> {
    let read = |name: &str| fs::read_to_string(format!("/sys/class/net/{interface}/{name}")).ok()?.trim().parse().ok();
    let index: u32 = read("ifindex")?;
    let address = CanAddr::from_iface(interface).ok()?;
    (address.ifindex() == index).then(|| read("mtu"))?
}

/// The interfaces in a table of counters: two lines of headings, then one line each, `name: figures`.
fn names(table: &str) -> impl Iterator<Item = &str> {
    table.lines().skip(2).filter_map(|line| line.split_once(':')).map(|(name, _)| name.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_before_the_colon() {
        let table =
            "Inter-|   Receive  |  Transmit\n face |bytes packets|bytes packets\n    lo: 1 2 3\nvcan0:    0   0\n";
        assert_eq!(names(table).collect::<Vec<_>>(), ["lo", "vcan0"]);
    }
}
