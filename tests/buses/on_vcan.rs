//! The bus contract and what only SocketCAN has, on real virtual CAN interfaces.
//!
//! Run by `tests/vcan/with-vcan`, which says where they are. Tests that take an interface down or slow it make one of
//! their own.

use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use std::time::Duration;

use assert_no_alloc::assert_no_alloc;
use resonarm::bus::fault::Faulty;
use resonarm::bus::socketcan::{Options, SocketCan, interfaces};
use resonarm::bus::{Bus, BusError, ControllerErrors, ControllerState, Filter, Received, Sent, Statistics};
use resonarm::protocol::{Frame, FrameFormat, Id, Node, bits};
use resonarm::realtime::SystemClock;
use socketcan::Socket;

use crate::{Formats, contract};

/// Longer than a busy machine takes for a frame; no test waits so long unless it fails.
const PATIENCE: Duration = Duration::from_secs(30);

/// The interface that everybody shares.
fn vcan() -> String {
    std::env::var("RESONARM_TEST_VCAN").expect("RESONARM_TEST_VCAN is unset: run this by tests/vcan/with-vcan")
}

/// A virtual interface for one test.
struct Interface(&'static str);

impl Interface {
    fn new(name: &'static str) -> Interface {
        run(&format!("ip link add {name} type vcan"));
        // The size of a `struct canfd_frame`: an interface with this MTU carries CAN FD.
        run(&format!("ip link set {name} mtu 72 up"));
        Interface(name)
    }

    fn open(&self) -> SocketCan {
        SocketCan::open(self.0, Options::default()).unwrap()
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        // Gone already where that was the test.
        _ = Command::new("ip").args(["link", "del", self.0]).stderr(Stdio::null()).status();
    }
}

fn run(command: &str) {
    let mut words = command.split(' ');
    let status = Command::new(words.next().unwrap()).args(words).status().unwrap();
    assert!(status.success(), "`{command}` ended with {status}");
}

/// Frames, of all interfaces, that the kernel dropped between sender and receiver, because too many (sysctl
/// `net.core.netdev_max_backlog`) waited for their CPU: the second column of a line for each CPU. A vcan sends through
/// this queue as a real adapter receives through it, and a busy machine does overflow it.
fn lost_by_the_backlog() -> u64 {
    let table = std::fs::read_to_string("/proc/net/softnet_stat").unwrap();
    table.lines().map(|cpu| u64::from_str_radix(cpu.split(' ').nth(1).unwrap(), 16).unwrap()).sum()
}

/// Pins this thread, and so what it sends, to one CPU: the backlog of a CPU hands frames on in their order.
fn pin() {
    let mut one = rustix::thread::CpuSet::new();
    one.set(rustix::thread::sched_getcpu());
    rustix::thread::sched_setaffinity(None, &one).unwrap();
}

/// Waits until the kernel has handed on every frame that `near` has sent: `witness`, which takes frames of `last`
/// alone, gets one that was sent after them. The backlog may drop it, too; then the next one tells.
fn handed_on(near: &mut SocketCan, witness: &mut SocketCan, last: &Frame) {
    let is_through = (0..PATIENCE.as_millis()).any(|_| {
        near.send(last).unwrap();
        witness.wait(Duration::from_millis(1)).unwrap()
    });
    assert!(is_through, "no frame comes through");
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::classic(Id::Standard(id), data).unwrap()
}

fn next(bus: &mut dyn Bus) -> Received {
    assert!(bus.wait(PATIENCE).unwrap(), "no frame came");
    bus.receive().unwrap().unwrap()
}

fn refusal(interface: &str) -> BusError {
    SocketCan::open(interface, Options::default()).err().expect("opened all the same")
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn socketcan_keeps_the_contract() {
    let end = || Box::new(SocketCan::open(&vcan(), Options::default()).unwrap()) as Box<dyn Bus>;
    contract(|| (end(), end()), Formats::All, lost_by_the_backlog);
}

/// What a scenario without faults makes of every bus.
#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn socketcan_without_faults_keeps_the_contract() {
    let open = || SocketCan::open(&vcan(), Options::default()).unwrap();
    let end = || Box::new(Faulty::new(open(), SystemClock, &[], Node::Plant, 0)) as Box<dyn Bus>;
    contract(|| (end(), end()), Formats::All, lost_by_the_backlog);
}

/// Two ends that python-can opens on the same interface.
#[cfg(feature = "python-can")]
#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn socketcan_of_python_can_keeps_the_contract() {
    let address = format!("python-can:interface=socketcan,channel={},fd=true", vcan()).parse().unwrap();
    let end = || resonarm::bus::open(&address).unwrap();
    contract(|| (end(), end()), Formats::All, lost_by_the_backlog);
}

/// The same where the caller does the work.
#[cfg(feature = "python-can")]
#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn socketcan_of_python_can_keeps_the_contract_on_the_caller() {
    let address = format!("python-can:interface=socketcan,channel={},fd=true", vcan()).parse().unwrap();
    let end = || {
        let mut end = resonarm::bus::open(&address).unwrap();
        end.work_on_caller().unwrap();
        end
    };
    contract(|| (end(), end()), Formats::All, lost_by_the_backlog);
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn sends_and_receives_without_allocating() {
    let interface = Interface::new("rtalloc");
    let (mut near, mut far) = (interface.open(), interface.open());
    let frames = [frame(1, &[1, 2, 3]); 40];
    let received = assert_no_alloc(|| {
        (0..8).for_each(|_| _ = near.send(&frames[0]));
        let sent = near.send_all(&mut &frames[..]);
        let one = || far.wait(PATIENCE).ok().and_then(|_| far.receive().ok().flatten());
        (sent.is_ok(), std::iter::from_fn(one).take(48).count())
    });
    assert_eq!(received, (true, 48));
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn a_whole_tick_takes_no_memory() {
    let interface = Interface::new("rttick");
    for profile in ["classic", "fd"] {
        crate::whole_tick::takes_no_memory((Box::new(interface.open()), Box::new(interface.open())), profile);
    }
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn kernel_timestamps_lie_between_sending_and_receiving() {
    #[allow(clippy::disallowed_methods, reason = "the kernel stamps by the system's clock")]
    let now_ns = || std::time::UNIX_EPOCH.elapsed().unwrap().as_nanos() as u64;
    let interface = Interface::new("rtstamp");
    let (mut near, mut far) = (interface.open(), interface.open());
    for _ in 0..20 {
        let before_ns = now_ns();
        near.send(&frame(1, &[])).unwrap();
        let stamp_ns = next(&mut far).timestamp_ns.expect("the kernel stamps every frame");
        assert!((before_ns..=now_ns()).contains(&stamp_ns), "{before_ns} {stamp_ns} {}", now_ns());
    }
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn candump_sees_the_frames_that_were_sent() {
    let interface = Interface::new("rtdump");
    let fd = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    let frames = [
        frame(0x123, &[0x11, 0x22]),
        frame(0x7FF, &[]),
        Frame::classic(Id::Extended(0x1234_5678), &[0xFF; 8]).unwrap(),
        Frame::new(Id::Standard(0x321), FrameFormat::Remote, &[0; 4]).unwrap(),
        Frame::new(Id::Extended(1), fd, &[0xA5; 64]).unwrap(),
    ];
    let count = frames.len().to_string();
    let arguments = ["-L", "-T", "5000", "-n", &count, interface.0];
    let mut candump = Command::new("candump").args(arguments).stdout(Stdio::piped()).spawn().unwrap();
    let mut bus = interface.open();
    // The kernel lists who receives from which interface, one a line; this end is one of the two.
    let listening = || std::fs::read_to_string("/proc/net/can/rcvlist_all").unwrap().matches(interface.0).count() == 2;
    (0..500).find(|_| listening() || bus.wait(Duration::from_millis(10)).unwrap()).expect("candump does not listen");
    frames.iter().for_each(|frame| assert_eq!(bus.send(frame).unwrap(), Sent::Queued));
    let mut log = String::new();
    candump.stdout.take().unwrap().read_to_string(&mut log).unwrap();
    assert!(candump.wait().unwrap().success());
    // candump writes the flags as they are, among them FDF (4), which marks any FD frame and says no more than `##`.
    let seen: Vec<String> = log.lines().map(|line| line.split(' ').nth(2).unwrap().replace("##5", "##1")).collect();
    assert_eq!(seen, frames.map(|frame| frame.to_string()));
}

/// can-utils computes the stuff bits of classical frames; those of FD frames it does not.
#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn canbusload_counts_the_same_bits() {
    let interface = Interface::new("rtload");
    let argument = format!("{}@1000000", interface.0);
    let mut canbusload = Command::new("canbusload").args(["-e", &argument]).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(canbusload.stdout.take().unwrap()).lines();
    // Its first line comes when it listens.
    lines.next().unwrap().unwrap();
    let mut bus = interface.open();
    let frames: Vec<Frame> = (0..200_u32)
        .map(|k| {
            // Odd factors spread the bits, so that runs of equal bits, after which one is stuffed, have every length.
            let data = (u64::from(k) * 0x0123_4567_89AB_CDEF).to_le_bytes();
            let id = if k % 2 == 0 { Id::Standard((k * 11 % 0x800) as u16) } else { Id::Extended(k * 2_654_435) };
            Frame::classic(id, &data[..(k % 9) as usize]).unwrap()
        })
        .collect();
    frames.iter().for_each(|frame| assert_eq!(bus.send(frame).unwrap(), Sent::Queued));
    // A line a second: interface, frames, bits, bits of content, load.
    let (mut seen, mut counted) = (0, 0);
    while seen < frames.len() as u64 {
        let line = lines.next().unwrap().unwrap();
        let numbers: Vec<u64> = line.split_whitespace().skip(1).filter_map(|word| word.parse().ok()).collect();
        if let [came, total, ..] = numbers[..] {
            (seen, counted) = (seen + came, counted + total);
        }
    }
    canbusload.kill().unwrap();
    canbusload.wait().unwrap();
    assert_eq!((seen, counted), (200, frames.iter().map(|frame| bits::of(frame).total()).sum()));
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn receives_what_cansend_sends() {
    let interface = Interface::new("rtsend");
    let mut bus = interface.open();
    for text in ["123#DEADBEEF", "1FFFFFFF#", "5AA#R3", "00000123##3AABBCCDDEEFF001122334455"] {
        run(&format!("cansend {} {text}", interface.0));
        assert_eq!(next(&mut bus).frame.to_string(), text);
    }
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn says_which_interface_is_missing() {
    let vcan = vcan();
    assert!(interfaces().unwrap().contains(&vcan));
    let BusError::InterfaceMissing { interface, present } = refusal("rtnone") else { panic!("another error") };
    assert_eq!(interface, "rtnone");
    assert!(present.contains(&vcan), "{present:?} lacks {vcan}");
    assert!(matches!(refusal("lo"), BusError::NotCan { .. }));
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn says_that_the_interface_is_down_and_works_when_it_is_up_again() {
    let interface = Interface::new("rtdown");
    let down = |outcome: BusError| matches!(&outcome, BusError::InterfaceDown { interface } if interface == "rtdown");
    let (mut near, mut far) = (interface.open(), interface.open());
    run("ip link set rtdown down");
    assert!(down(far.wait(PATIENCE).unwrap_err()), "the waiting end must hear of it");
    assert!(down(near.receive().unwrap_err()));
    assert!(down(near.send(&frame(1, &[])).unwrap_err()));
    // An interface that is down can't be opened either, and the message is the same.
    assert!(down(refusal("rtdown")));
    run("ip link set rtdown up");
    assert_eq!(near.send(&frame(2, &[])).unwrap(), Sent::Queued);
    assert_eq!(next(&mut far).frame, frame(2, &[]));
    assert_eq!(near.statistics(), Statistics { sent: 1, ..Statistics::default() });
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn says_that_the_interface_was_removed() {
    let interface = Interface::new("rtgone");
    let mut bus = interface.open();
    run("ip link del rtgone");
    // The kernel takes an interface down before it removes it, and a socket hears of one of the two first.
    let first = bus.receive().unwrap_err();
    assert!(matches!(first, BusError::InterfaceGone { .. } | BusError::InterfaceDown { .. }), "{first}");
    let then = bus.send(&frame(1, &[])).unwrap_err();
    assert!(matches!(then, BusError::InterfaceGone { .. }), "{then}");
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn refuses_fd_frames_where_the_interface_is_classical() {
    let interface = Interface::new("rtclassic");
    run("ip link set rtclassic down");
    // The size of a `struct can_frame`, which has no place for more than 8 bytes.
    run("ip link set rtclassic mtu 16 up");
    let mut bus = interface.open();
    let fd = FrameFormat::Fd { bit_rate_switch: false, error_state_indicator: false };
    let refused = bus.send(&Frame::new(Id::Standard(1), fd, &[0; 12]).unwrap()).unwrap_err();
    assert!(matches!(refused, BusError::FdNotEnabled { .. }), "{refused}");
    assert_eq!(bus.send(&frame(1, &[])).unwrap(), Sent::Queued);
}

/// A transmit queue of four frames before a slow wire, as a real adapter has: so slow that no frame leaves it before
/// all are sent, should this process be stopped in between.
#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn counts_the_frames_that_the_transmit_queue_refuses() {
    let interface = Interface::new("rtslow");
    run("tc qdisc add dev rtslow root netem delay 2000ms limit 4");
    let (mut near, mut far) = (interface.open(), interface.open());
    let outcomes: Vec<Sent> = (0..6).map(|id| near.send(&frame(id, &[])).unwrap()).collect();
    assert_eq!(outcomes[..4], [Sent::Queued; 4]);
    assert_eq!(outcomes[4..], [Sent::QueueFull; 2]);
    assert_eq!(near.statistics(), Statistics { sent: 4, queue_full: 2, ..Statistics::default() });
    let frames = [4, 5].map(|id| frame(id, &[]));
    let mut rest = &frames[..];
    assert_eq!(near.send_all(&mut rest).unwrap(), Sent::QueueFull);
    assert_eq!((rest, near.statistics().queue_full), (&frames[..], 3));
    near.close().unwrap();
    for id in 0..4 {
        assert_eq!(next(&mut far).frame, frame(id, &[]), "frames queued before the close are still sent");
    }
    // What the queue refused must not come after all.
    assert!(!far.wait(Duration::from_millis(400)).unwrap());
}

/// A transmit queue with room for a part of a batch.
#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn what_the_transmit_queue_refuses_of_a_batch_is_left() {
    let interface = Interface::new("rtpart");
    run("tc qdisc add dev rtpart root netem delay 2000ms limit 4");
    let (mut near, mut far) = (interface.open(), interface.open());
    let frames = [1, 2, 3, 4, 5, 6].map(|id| frame(id, &[]));
    let mut rest = &frames[..];
    assert_eq!(near.send_all(&mut rest).unwrap(), Sent::QueueFull);
    assert_eq!(rest, &frames[4..]);
    assert_eq!(near.statistics(), Statistics { sent: 4, queue_full: 1, ..Statistics::default() });
    frames[..4].iter().for_each(|frame| assert_eq!(next(&mut far).frame, *frame));
}

/// Sends error frames, as a controller does, with this byte of its own state. The kernel hands them on as any frame.
fn send_state(controller: &socketcan::CanFdSocket, class: u32, state: libc::c_int) {
    let message = socketcan::CanErrorFrame::new_error(class, &[0, state as u8, 0, 0, 0, 0, 0, 0]).unwrap();
    controller.write_frame(&message).unwrap();
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn what_can_t_be_a_frame_is_counted_and_left_out() {
    let interface = Interface::new("rtodd");
    let (mut near, mut far) = (interface.open(), interface.open());
    let raw = socketcan::CanFdSocket::open(interface.0).unwrap();
    // `struct canfd_frame`: identifier, length, flags, two reserved bytes, 64 of content. No frame of CAN FD has 9.
    let mut odd = [0_u8; 72];
    odd[..4].copy_from_slice(&0x201_u32.to_ne_bytes());
    odd[4] = 9;
    let send_odd = || assert_eq!(rustix::io::write(&raw, &odd), Ok(odd.len()));
    send_odd();
    near.send(&frame(0x123, &[7])).unwrap();
    // Found by a wait, and by a call that doesn't wait.
    assert_eq!(next(&mut far).frame, frame(0x123, &[7]));
    send_odd();
    assert!(!far.wait(Duration::from_millis(30)).unwrap());
    send_odd();
    assert_eq!(far.receive().unwrap(), None);
    assert_eq!(far.statistics(), Statistics { received: 1, malformed: 3, ..Statistics::default() });
}

/// What `far` makes of what the controller of `interface` tells between the frames of `near`.
fn error_frames_are_counted_and_bus_off_comes_out(interface: &Interface, far: &mut dyn Bus) {
    pin();
    let mut near = interface.open();
    let controller = socketcan::CanFdSocket::open(interface.0).unwrap();
    near.send(&frame(1, &[])).unwrap();
    send_state(&controller, libc::CAN_ERR_CRTL, libc::CAN_ERR_CRTL_TX_WARNING);
    send_state(&controller, libc::CAN_ERR_CRTL | libc::CAN_ERR_ACK, libc::CAN_ERR_CRTL_TX_PASSIVE);
    near.send(&frame(2, &[])).unwrap();
    // A lost arbitration is no error: the frame is sent again, and nothing is counted.
    send_state(&controller, libc::CAN_ERR_LOSTARB, 0);
    send_state(&controller, libc::CAN_ERR_PROT | libc::CAN_ERR_BUSERROR, 0);
    send_state(&controller, libc::CAN_ERR_BUSOFF, 0);
    near.send(&frame(3, &[])).unwrap();
    send_state(&controller, libc::CAN_ERR_RESTARTED, 0);
    assert_eq!((next(far).frame, far.controller()), (frame(1, &[]), ControllerState::Active));
    assert_eq!((next(far).frame, far.controller()), (frame(2, &[]), ControllerState::Passive));
    assert!(far.wait(PATIENCE).unwrap(), "bus-off ends a wait");
    let off = far.receive().unwrap_err();
    assert!(matches!(&off, BusError::BusOff { interface: name } if name == interface.0), "{off}");
    assert_eq!(far.controller(), ControllerState::BusOff);
    assert_eq!(next(far).frame, frame(3, &[]));
    let is_back = (0..PATIENCE.as_millis()).any(|_| {
        assert!(!far.wait(Duration::from_millis(1)).unwrap(), "what is counted alone is not waited for");
        far.controller() == ControllerState::Active
    });
    assert!(is_back && far.receive().unwrap().is_none());
    let errors = ControllerErrors {
        protocol: 1,
        no_ack: 1,
        warning: 1,
        passive: 1,
        bus_off: 1,
        restarted: 1,
        ..ControllerErrors::default()
    };
    assert_eq!(far.statistics(), Statistics { received: 3, errors, ..Statistics::default() });
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn socketcan_counts_error_frames_and_gives_bus_off_out_in_its_place() {
    let interface = Interface::new("rtoff");
    error_frames_are_counted_and_bus_off_comes_out(&interface, &mut interface.open());
}

/// The same over python-can, on its threads and on the caller.
#[cfg(feature = "python-can")]
#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn socketcan_of_python_can_counts_error_frames_and_gives_bus_off_out_in_its_place() {
    let interface = Interface::new("rtoffpy");
    let address = format!("python-can:interface=socketcan,channel={}", interface.0).parse().unwrap();
    error_frames_are_counted_and_bus_off_comes_out(&interface, &mut *resonarm::bus::open(&address).unwrap());
    let mut on_caller = resonarm::bus::open(&address).unwrap();
    on_caller.work_on_caller().unwrap();
    error_frames_are_counted_and_bus_off_comes_out(&interface, &mut *on_caller);
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn the_receive_buffer_bounds_what_is_kept() {
    pin();
    let interface = Interface::new("rtbuffer");
    let only = |id| [Filter { id: Id::Standard(id), mask: 0x7FF }];
    let kept = |receive_buffer_bytes, last| {
        let options = Options { receive_buffer_bytes, ..Options::default() };
        let (mut near, mut far) = (interface.open(), SocketCan::open(interface.0, options).unwrap());
        assert_eq!(far.buffers(), options, "a privileged process gets what it asks for");
        far.set_filters(&only(1)).unwrap();
        let mut witness = interface.open();
        witness.set_filters(&only(last)).unwrap();
        let lost_before = lost_by_the_backlog();
        (0..20_000).for_each(|_| _ = near.send(&frame(1, &[0; 8])).unwrap());
        let sent = near.statistics().sent;
        handed_on(&mut near, &mut witness, &frame(last, &[]));
        let dropped = far.statistics().dropped;
        let received = std::iter::from_fn(|| far.receive().unwrap()).count() as u64;
        let (counted, lost) = (received + dropped, lost_by_the_backlog() - lost_before);
        assert!((counted..=counted + lost).contains(&sent), "{received} + {dropped}, {lost} lost");
        assert_eq!(far.statistics().dropped, dropped);
        far.close().unwrap();
        assert_eq!(far.statistics().dropped, dropped, "the count outlives the socket");
        received
    };
    let (small, default) = (kept(64 << 10, 2), kept(Options::default().receive_buffer_bytes, 3));
    println!("{small} frames fit 64 KiB, {default} the default");
    assert!(small > 50 && default > 20 * small, "{small} {default}");
}

#[test]
#[ignore = "needs vcan0: tests/vcan/with-vcan cargo test --test buses -- --ignored on_vcan"]
fn too_many_filters_are_an_error() {
    let interface = Interface::new("rtfilter");
    let filters: Vec<Filter> = (0..600).map(|id| Filter { id: Id::Standard(id), mask: 0x7FF }).collect();
    let mut bus = interface.open();
    // 512 is the most that the kernel takes, `CAN_RAW_FILTER_MAX` of linux/can/raw.h.
    bus.set_filters(&filters[..512]).unwrap();
    let refused = bus.set_filters(&filters).unwrap_err();
    assert!(matches!(refused, BusError::Os { action: "setting the receive filters", .. }), "{refused}");
}
