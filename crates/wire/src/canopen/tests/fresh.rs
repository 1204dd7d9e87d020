//! PDO data that wait act only while they are fresh, and no request is forgotten.

use super::*;

const START: [u8; 2] = [1, NODE];
const MS: u64 = 1_000_000;

/// RPDO 1 acts at SYNC, and holds 9.
fn waiting() -> Master {
    let mut master = Master::new();
    assert_eq!(master.write(0x1400, 2, &[1]), Ok(()));
    master.send(NMT_ID, &START);
    master.send(0x205, &[9, 0]);
    master
}

fn written(index: u16, subindex: u8, value: u32) -> [u8; 8] {
    let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
    [0x23, low, high, subindex, a, b, c, d]
}

#[test]
fn data_that_waits_for_sync_is_dropped_when_its_pdo_is_disabled_or_its_type_is_written() {
    for parameter in [written(0x1400, 1, 0x8000_0205), [0x2F, 0x00, 0x14, 2, 1, 0, 0, 0]] {
        let mut master = waiting();
        assert_eq!(master.sdo(parameter)[0], 0x60);
        master.send(SYNC_ID, &[]);
        assert!(master.device.values.is_empty(), "{parameter:x?}");
        assert_eq!(master.server.take_dropped(), 1);
    }
}

/// The bytes 9, 0 would be the low half of another object.
#[test]
fn data_of_an_earlier_mapping_never_acts() {
    let mut master = waiting();
    for (index, subindex, value) in [(0x1400, 1, 0x8000_0205), (0x1600, 1, 0x2004_0020), (0x1400, 1, 0x205)] {
        if index == 0x1600 {
            assert_eq!(master.write(index, 0, &[0]), Ok(()));
        }
        assert_eq!(master.sdo(written(index, subindex, value))[0], 0x60);
        if index == 0x1600 {
            assert_eq!(master.write(index, 0, &[1]), Ok(()));
        }
    }
    master.send(SYNC_ID, &[]);
    assert!(master.device.values.is_empty(), "{:?}", master.device.values);
}

#[test]
fn data_of_an_earlier_state_of_the_device_never_acts() {
    let mut master = waiting();
    master.device.epoch += 1;
    master.send(SYNC_ID, &[]);
    assert!(master.device.values.is_empty());
    master.send(0x205, &[8, 0]);
    master.send(SYNC_ID, &[]);
    assert_eq!(master.device.values, [(0x2000, Value::U16(8))]);
}

#[test]
fn data_older_than_the_limit_never_acts() {
    for (age_ns, acts) in [(WAIT_LIMIT_NS, true), (WAIT_LIMIT_NS + 1, false)] {
        let mut master = waiting();
        master.server.look(age_ns);
        master.send(SYNC_ID, &[]);
        assert_eq!(!master.device.values.is_empty(), acts, "{age_ns}");
        assert_eq!(master.server.take_dropped(), u64::from(!acts));
    }
}

#[test]
fn frames_of_can_fd_and_of_other_lengths_are_refused() {
    let mut master = waiting();
    let fd = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    for id in [NMT_ID, SYNC_ID, 0x605, 0x205] {
        let frame = Frame::new(Id::Standard(id), fd, &[2, 0]).unwrap();
        assert_eq!(master.server.handle_frame(0, &frame, &mut master.device), Handled::Format, "{id:x}");
    }
    assert_eq!(master.send(SYNC_ID, &[1, 2]), Handled::Length);
    assert_eq!(master.send(NMT_ID, &[2]), Handled::Length);
    assert_eq!(master.send(NMT_ID, &[2, 0, 0]), Handled::Length);
    assert_eq!(master.server.state(), NmtState::Operational);
    assert!(master.device.values.is_empty());
}

/// A longer PDO acts by its first bytes (CiA 301, section 7.5.2.36), and the master is told.
#[test]
fn a_pdo_of_another_length_is_told_once() {
    let mut master = Master::new();
    master.send(NMT_ID, &START);
    for _ in 0..3 {
        master.send(0x205, &[9]);
    }
    // Code 8210h, the error register, then the number of the PDO, the bytes received and those of the mapping.
    assert_eq!(texts(&master.frames()), ["085#1082110101020000"]);
    assert_eq!(master.read(0x1001, 0), Ok(0x11));
    assert_eq!((master.read(0x1003, 0), master.read(0x1003, 1)), (Ok(1), Ok(0x0101_8210)));
    master.send(0x205, &[9, 0, 0]);
    assert_eq!(texts(&master.frames()), ["085#2082110103020000"]);
    master.send(0x205, &[9, 0]);
    assert_eq!(texts(&master.frames()), ["085#0000000000000000"]);
    assert_eq!(master.read(0x1001, 0), Ok(0));
}

#[test]
fn the_history_has_the_newest_error_first_and_can_only_be_cleared() {
    let mut master = Master::new();
    assert_eq!(master.read(0x1003, 0), Ok(0));
    assert_eq!(master.read(0x1003, 1), Err(0x0800_0024));
    for code in 1..=9_u16 {
        master.server.emergency(0x8200 + code, 0x11, [7, 0, 0, 0, 0]);
        master.frames();
    }
    assert_eq!(master.read(0x1003, 0), Ok(8));
    // Nine errors were recorded, and the history holds eight: the first, 8201h, has fallen out.
    assert_eq!((master.read(0x1003, 1), master.read(0x1003, 8)), (Ok(0x0007_8209), Ok(0x0007_8202)));
    assert_eq!(master.write(0x1003, 0, &[1]), Err(0x0609_0030));
    assert_eq!(master.write(0x1003, 1, &[0; 4]), Err(0x0601_0002));
    assert_eq!(master.write(0x1003, 0, &[0]), Ok(()));
    assert_eq!((master.read(0x1003, 0), master.read(0x1003, 1)), (Ok(0), Err(0x0800_0024)));
}

#[test]
fn a_heartbeat_is_watched_from_the_first_on() {
    let mut master = Master::new();
    assert_eq!(master.write(0x1016, 1, &0x0020_0064_u32.to_le_bytes()), Ok(()));
    assert_eq!(master.write(0x1016, 2, &0x0020_0032_u32.to_le_bytes()), Err(0x0604_0043), "the same node");
    assert_eq!(master.write(0x1016, 2, &0x0080_0032_u32.to_le_bytes()), Err(0x0609_0030), "no node");
    master.send(NMT_ID, &START);
    let lost = |master: &mut Master, now_ns: u64| {
        master.server.takes_heartbeat_loss(|heard_ns, time_ns| now_ns >= heard_ns + time_ns)
    };
    assert!(!lost(&mut master, 1000 * MS), "none has come");
    master.server.look(1000 * MS);
    assert_eq!(master.send(0x720, &[5]), Handled::Taken);
    assert_eq!(master.send(0x721, &[5]), Handled::Foreign);
    assert_eq!(master.send(0x720, &[5, 0]), Handled::Length);
    assert!(!lost(&mut master, 1099 * MS) && master.server.state() == NmtState::Operational);
    assert!(lost(&mut master, 1100 * MS) && master.server.state() == NmtState::PreOperational);
    assert!(!lost(&mut master, 2000 * MS), "it is watched again from the next one on");
}

/// CiA 301, section 7.5.2.17: the time that is written runs from then on.
#[test]
fn a_write_of_the_heartbeat_time_restarts_it() {
    let mut master = Master::new();
    master.send_at(0, 0x605, &[0x2B, 0x17, 0x10, 0, 0xE8, 0x03, 0, 0]);
    assert_eq!(master.server.next_deadline_ns(), Some(1000 * MS));
    master.send_at(700 * MS, 0x605, &[0x2B, 0x17, 0x10, 0, 0x64, 0x00, 0, 0]);
    assert_eq!(master.server.next_deadline_ns(), Some(800 * MS));
    master.frames();
    master.server.handle_deadline(799 * MS);
    assert!(master.frames().is_empty());
    master.server.handle_deadline(800 * MS);
    assert_eq!(texts(&master.frames()), ["705#7F"]);
}

#[test]
fn what_asks_for_a_pdo_within_its_inhibit_time_is_deferred() {
    let mut master = Master::new();
    master.write(0x1800, 1, &0x8000_0185_u32.to_le_bytes()).unwrap();
    master.write(0x1800, 2, &[255]).unwrap();
    // 10 ms.
    master.write(0x1800, 3, &100_u16.to_le_bytes()).unwrap();
    master.write(0x1800, 1, &0x185_u32.to_le_bytes()).unwrap();
    master.send(NMT_ID, &START);
    master.server.sampled(100 * MS);
    assert_eq!(master.frames().len(), 1);
    master.server.sampled(103 * MS);
    let remote = Frame::new(Id::Standard(0x185), FrameFormat::Remote, &[0; 4]).unwrap();
    master.server.handle_frame(104 * MS, &remote, &mut master.device);
    assert!(master.frames().is_empty());
    assert_eq!(master.server.next_deadline_ns(), Some(110 * MS));
    master.server.handle_deadline(109 * MS);
    assert!(master.frames().is_empty());
    master.server.handle_deadline(110 * MS);
    assert_eq!(master.frames().len(), 1, "both requests are answered by one PDO");
    master.server.handle_deadline(200 * MS);
    assert!(master.frames().is_empty());
}
