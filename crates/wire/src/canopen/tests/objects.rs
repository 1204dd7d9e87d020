//! SDO: values, segments, abort codes.

use super::*;

#[test]
fn values_are_read_and_written() {
    let mut master = Master::new();
    assert_eq!(master.read(0x1000, 0), Ok(0x0002_0192));
    assert_eq!(master.write(0x2000, 0, &500_u16.to_le_bytes()), Ok(()));
    assert_eq!(master.read(0x2000, 0), Ok(500));
    assert_eq!(master.read(0x2001, 0), Ok(0xFFFF_FFFE));
    assert_eq!(master.device.values, [(0x2000, Value::U16(500))]);
    // Without a size the type says how many bytes count.
    assert_eq!(outcome(master.sdo([0x22, 0x00, 0x20, 0, 9, 0, 1, 1]), 0x60).map(drop), Ok(()));
    assert_eq!(master.read(0x2000, 0), Ok(9));
}

#[test]
fn every_wrong_access_has_its_abort_code_and_changes_nothing() {
    let mut master = Master::new();
    assert_eq!(master.read(0x3000, 0), Err(0x0602_0000));
    assert_eq!(master.read(0x2000, 1), Err(0x0609_0011));
    assert_eq!(master.write(0x2001, 0, &[0; 4]), Err(0x0601_0002));
    assert_eq!(master.read(0x2002, 0), Err(0x0601_0001));
    assert_eq!(master.write(0x2000, 0, &[0; 4]), Err(0x0607_0012));
    assert_eq!(master.write(0x2000, 0, &[1]), Err(0x0607_0013));
    assert_eq!(master.write(0x2000, 0, &0_u16.to_le_bytes()), Err(0x0609_0032));
    assert_eq!(master.write(0x2000, 0, &1001_u16.to_le_bytes()), Err(0x0609_0031));
    assert_eq!(master.write(0x2000, 0, &13_u16.to_le_bytes()), Err(0x0609_0030));
    assert_eq!(master.read(0x2000, 0), Ok(7));
    assert!(master.device.values.is_empty());
    // A block transfer, segments of no transfer, a command that there is not.
    for command in [0xC0, 0xA0, 0x00, 0x60, 0xE0] {
        assert_eq!(outcome(master.sdo([command, 0x00, 0x20, 0, 0, 0, 0, 0]), 0), Err(0x0504_0001), "{command:x}");
    }
    assert_eq!(master.send(0x605, &[0x40, 0, 0x10]), Handled::Length);
}

#[test]
fn a_string_comes_in_segments() {
    let mut master = Master::new();
    assert_eq!(master.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]), [0x41, 0x08, 0x10, 0, 19, 0, 0, 0]);
    let mut bytes = Vec::new();
    // 19 bytes are segments of 7, 7 and 5 bytes. The toggle bit, 10h, changes with each; the last one states the two
    // bytes without data, and that it is the last.
    for (command, expected) in [(0x60, 0x00), (0x70, 0x10), (0x60, 0x05)] {
        let answer = master.sdo([command, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(answer[0], expected);
        bytes.extend_from_slice(&answer[1..8 - usize::from(answer[0] >> 1 & 7)]);
    }
    assert_eq!(bytes, b"a name of 19 bytes!");
    assert_eq!(outcome(master.sdo([0x70, 0, 0, 0, 0, 0, 0, 0]), 0), Err(0x0504_0001));
}

#[test]
fn a_repeated_segment_is_aborted() {
    let mut master = Master::new();
    master.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    master.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(outcome(master.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]), 0), Err(0x0503_0000));
}

#[test]
fn values_are_taken_in_segments() {
    let mut master = Master::new();
    assert_eq!(master.sdo([0x21, 0x03, 0x20, 0, 9, 0, 0, 0])[0], 0x60);
    assert_eq!(master.sdo(*b"\x00abcdefg")[0], 0x20);
    assert_eq!(master.sdo(*b"\x1Bhi\0\0\0\0\0")[0], 0x30);
    assert_eq!(master.device.values, [(0x2003, Value::Text(Text::new(b"abcdefghi").unwrap()))]);
    // Another length than announced; more than there is room for; the same toggle bit twice.
    master.sdo([0x21, 0x03, 0x20, 0, 9, 0, 0, 0]);
    assert_eq!(outcome(master.sdo(*b"\x01abcdefg"), 0), Err(0x0607_0010));
    assert_eq!(outcome(master.sdo([0x21, 0x03, 0x20, 0, 33, 0, 0, 0]), 0), Err(0x0607_0012));
    assert_eq!(outcome(master.sdo([0x21, 0x00, 0x20, 0, 3, 0, 0, 0]), 0), Err(0x0607_0012));
    master.sdo([0x20, 0x03, 0x20, 0, 0, 0, 0, 0]);
    assert_eq!(outcome(master.sdo(*b"\x10abcdefg"), 0), Err(0x0503_0000));
    // A number in one segment.
    master.sdo([0x21, 0x00, 0x20, 0, 2, 0, 0, 0]);
    assert_eq!(master.sdo([0x0B, 99, 0, 0, 0, 0, 0, 0])[0], 0x20);
    assert_eq!(master.read(0x2000, 0), Ok(99));
    // The master ends a transfer, without an answer.
    master.sdo([0x21, 0x03, 0x20, 0, 9, 0, 0, 0]);
    master.send(0x605, &[0x80, 0x03, 0x20, 0, 0, 0, 0, 0]);
    assert!(master.frames().is_empty());
}

#[test]
fn a_value_beyond_its_type_is_the_nearest_and_marked() {
    let mut master = Master::new();
    for (number, expected, is_limited) in
        [(2.5, 3, false), (1e12, i32::MAX, true), (-1e12, i32::MIN, true), (f64::NAN, 0, true)]
    {
        master.server.set(at(0x2001, 0), number);
        let entry = master.server.dictionary().entry(at(0x2001, 0)).unwrap();
        assert_eq!((entry.value, entry.is_limited), (Value::I32(expected), is_limited), "{number}");
    }
}
