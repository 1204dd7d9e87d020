//! Errors of a bus, each with its fix.

use std::io;

use thiserror::Error;

/// Errors of opening or using a bus.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BusError {
    /// The bus was closed by this end.
    #[error("the bus is closed")]
    Closed,
    /// The address is not one that any backend understands.
    #[error(
        "`{address}` is not a bus: {reason}. Examples: vcan0, memory, python-can:interface=slcan,channel=/dev/ttyACM0"
    )]
    Address {
        /// Address as the user gave it.
        address: String,
        /// Reason why the address is invalid.
        reason: String,
    },
    /// A memory bus was asked for by its address.
    #[error(
        "a memory bus exists only inside one process, and no other program can be reached on it: expected a bus that \
         several processes share. Use vcan0 or another CAN interface; `resonarm demo` runs plant and exciter \
         together on a memory bus"
    )]
    MemoryIsNotShared,
    /// The program was built without python-can.
    #[error("this build does not include python-can; build with `cargo build --release --features python-can`")]
    NoPythonCan,
    /// The kernel has no SocketCAN raw sockets and could not load them.
    #[error(
        "this kernel does not provide SocketCAN ({source}). Load it with `sudo modprobe -a can can_raw vcan` (in a \
         container: on its host); if the kernel was built without CAN, install one that has it. `resonarm demo` \
         needs no SocketCAN"
    )]
    NoSocketCan {
        /// Error that the kernel returned.
        source: io::Error,
    },
    /// There is no network interface of this name.
    #[error("the CAN interface {interface} does not exist ({}). {}", list(.present), creation(.interface))]
    InterfaceMissing {
        /// Interface that was asked for.
        interface: String,
        /// The CAN interfaces there are.
        present: Vec<String>,
    },
    /// The network interface is of another kind.
    #[error(
        "{interface} is a network interface, but not a CAN interface; list those with `ip -brief link show type can` and `ip -brief link show type vcan`"
    )]
    NotCan {
        /// Interface that was asked for.
        interface: String,
    },
    /// The interface is down, or went down.
    #[error("{interface} is down. {}", bring_up(.interface))]
    InterfaceDown {
        /// Name of the network interface.
        interface: String,
    },
    /// The interface was removed while it was in use.
    #[error(
        "the interface {interface} has been removed: its adapter was unplugged, or `ip link del` deleted it. Connect it again and restart the command"
    )]
    InterfaceGone {
        /// Name of the network interface.
        interface: String,
    },
    /// The CAN controller has left the bus after too many transmit errors (ISO 11898-1, bus-off).
    #[error(
        "the controller of {interface} is bus-off: too many transmit errors. Check bit rate, wiring and the two \
         terminations of 120 Ω; {}", restart(.interface)
    )]
    BusOff {
        /// Name of the network interface.
        interface: String,
    },
    /// A CAN FD frame was sent on an interface that carries classical frames only.
    #[error("{interface} is not configured for CAN FD frames. {}", enable_fd(.interface))]
    FdNotEnabled {
        /// Name of the network interface.
        interface: String,
    },
    /// The process lacks the permission.
    #[error(
        "{interface}: {action} is not permitted ({source}). SocketCAN needs no privileges, so a sandbox denies the call: allow AF_CAN in its seccomp profile (systemd: RestrictAddressFamilies)"
    )]
    Permission {
        /// Name of the network interface.
        interface: String,
        /// Operation that was denied.
        action: &'static str,
        /// Error that the kernel returned.
        source: io::Error,
    },
    /// Another answer of the operating system.
    #[error("{interface}: {action} failed: {source}")]
    Os {
        /// Name of the network interface.
        interface: String,
        /// Name of the operation that failed.
        action: &'static str,
        /// Error that the kernel returned.
        source: io::Error,
    },
    /// python-can, or the Python it needs, failed.
    #[error(transparent)]
    PythonCan(Box<dyn core::error::Error + Send + Sync>),
}

impl BusError {
    /// Whether the bus may work again without being opened anew: it is down, or its controller is bus-off.
    pub const fn is_recoverable(&self) -> bool {
        matches!(self, BusError::InterfaceDown { .. } | BusError::BusOff { .. })
    }
}

fn is_virtual(interface: &str) -> bool {
    interface.starts_with("vcan")
}

fn list(present: &[String]) -> String {
    match present {
        [] => "there are no CAN interfaces".into(),
        _ => format!("CAN interfaces: {}", present.join(", ")),
    }
}

fn creation(interface: &str) -> String {
    if is_virtual(interface) {
        format!("Create it with `sudo ip link add {interface} type vcan && sudo ip link set {interface} mtu 72 up`")
    } else {
        format!("Is the adapter plugged in and its driver loaded? {}", bring_up(interface))
    }
}

fn bring_up(interface: &str) -> String {
    if is_virtual(interface) {
        format!("Bring it up with `sudo ip link set {interface} up`")
    } else {
        format!("Start it at 1 Mbit/s with `sudo ip link set {interface} up type can bitrate 1000000`")
    }
}

fn restart(interface: &str) -> String {
    if interface.starts_with("python-can:") {
        "if the adapter does not recover by itself, restart the command to open it again".into()
    } else {
        format!("make it recover by itself with `sudo ip link set {interface} type can restart-ms 100`")
    }
}

fn enable_fd(interface: &str) -> String {
    let options = if is_virtual(interface) { "mtu 72" } else { "type can bitrate 1000000 dbitrate 5000000 fd on" };
    format!("Enable them with `sudo ip link set {interface} down && sudo ip link set {interface} up {options}`")
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::*;

    fn source(errno: i32) -> io::Error {
        io::Error::from_raw_os_error(errno)
    }

    #[test]
    fn bus_messages_say_how_to_continue() {
        assert_snapshot!(BusError::Closed, @"the bus is closed");
        assert_snapshot!(BusError::MemoryIsNotShared, @"a memory bus exists only inside one process, and no other program can be reached on it: expected a bus that several processes share. Use vcan0 or another CAN interface; `resonarm demo` runs plant and exciter together on a memory bus");
        assert_snapshot!(BusError::NoPythonCan, @"this build does not include python-can; build with `cargo build --release --features python-can`");
    }

    #[test]
    fn kernel_messages_say_how_to_fix() {
        assert_snapshot!(BusError::NoSocketCan { source: source(libc::EAFNOSUPPORT) }, @"this kernel does not provide SocketCAN (Address family not supported by protocol (os error 97)). Load it with `sudo modprobe -a can can_raw vcan` (in a container: on its host); if the kernel was built without CAN, install one that has it. `resonarm demo` needs no SocketCAN");
        let interface = "can0".to_string();
        let action = "opening the socket";
        assert_snapshot!(BusError::Permission { interface, action, source: source(libc::EPERM) }, @"can0: opening the socket is not permitted (Operation not permitted (os error 1)). SocketCAN needs no privileges, so a sandbox denies the call: allow AF_CAN in its seccomp profile (systemd: RestrictAddressFamilies)");
        let interface = "can0".to_string();
        assert_snapshot!(BusError::Os { interface, action: "sending", source: source(libc::EIO) }, @"can0: sending failed: Input/output error (os error 5)");
    }

    #[test]
    fn interface_messages_name_the_command() {
        let missing = |interface: &str, present: &[&str]| BusError::InterfaceMissing {
            interface: interface.into(),
            present: present.iter().map(|name| name.to_string()).collect(),
        };
        assert_snapshot!(missing("vcan0", &[]), @"the CAN interface vcan0 does not exist (there are no CAN interfaces). Create it with `sudo ip link add vcan0 type vcan && sudo ip link set vcan0 mtu 72 up`");
        assert_snapshot!(missing("can1", &["can0", "vcan0"]), @"the CAN interface can1 does not exist (CAN interfaces: can0, vcan0). Is the adapter plugged in and its driver loaded? Start it at 1 Mbit/s with `sudo ip link set can1 up type can bitrate 1000000`");
        assert_snapshot!(BusError::NotCan { interface: "lo".into() }, @"lo is a network interface, but not a CAN interface; list those with `ip -brief link show type can` and `ip -brief link show type vcan`");
        assert_snapshot!(BusError::InterfaceDown { interface: "vcan0".into() }, @"vcan0 is down. Bring it up with `sudo ip link set vcan0 up`");
        assert_snapshot!(BusError::InterfaceDown { interface: "can0".into() }, @"can0 is down. Start it at 1 Mbit/s with `sudo ip link set can0 up type can bitrate 1000000`");
        assert_snapshot!(BusError::InterfaceGone { interface: "can0".into() }, @"the interface can0 has been removed: its adapter was unplugged, or `ip link del` deleted it. Connect it again and restart the command");
        assert_snapshot!(BusError::BusOff { interface: "can0".into() }, @"the controller of can0 is bus-off: too many transmit errors. Check bit rate, wiring and the two terminations of 120 Ω; make it recover by itself with `sudo ip link set can0 type can restart-ms 100`");
        assert_snapshot!(BusError::BusOff { interface: "python-can:interface=gs_usb,channel=0".into() }, @"the controller of python-can:interface=gs_usb,channel=0 is bus-off: too many transmit errors. Check bit rate, wiring and the two terminations of 120 Ω; if the adapter does not recover by itself, restart the command to open it again");
        assert_snapshot!(BusError::FdNotEnabled { interface: "vcan0".into() }, @"vcan0 is not configured for CAN FD frames. Enable them with `sudo ip link set vcan0 down && sudo ip link set vcan0 up mtu 72`");
        assert_snapshot!(BusError::FdNotEnabled { interface: "can0".into() }, @"can0 is not configured for CAN FD frames. Enable them with `sudo ip link set can0 down && sudo ip link set can0 up type can bitrate 1000000 dbitrate 5000000 fd on`");
    }
}
