//! PDOs: when they act, when they are sent, how they are mapped anew.

use super::*;

const START: [u8; 2] = [1, NODE];

#[test]
fn pdos_act_and_are_sent_in_operational_only() {
    let mut master = Master::new();
    master.send(0x205, &[9, 0]);
    master.send(SYNC_ID, &[]);
    assert!(master.device.values.is_empty() && master.frames().is_empty());
    assert_eq!(master.send(NMT_ID, &START), Handled::Nmt(NmtCommand::Start));
    master.send(0x205, &[9, 0]);
    master.send(SYNC_ID, &[]);
    assert_eq!(master.device.values, [(0x2000, Value::U16(9))]);
    assert_eq!(texts(&master.frames()), ["185#FEFFFFFF"]);
    // Too short; longer than mapped; a value that may not be.
    assert_eq!(master.send(0x205, &[9]), Handled::ShortPdo { number: 1, mapped: 2 });
    assert_eq!(texts(&master.frames()), ["085#1082110101020000"]);
    assert_eq!(master.send(0x205, &[10, 0, 1, 2]), Handled::Taken);
    assert_eq!(master.send(0x205, &[13, 0]), Handled::Taken);
    assert_eq!(texts(&master.frames()), ["085#2082110104020000", "085#0000000000000000"]);
    assert_eq!(master.read(0x2000, 0), Ok(10));
}

#[test]
fn a_synchronous_pdo_acts_at_sync() {
    let mut master = Master::new();
    assert_eq!(master.write(0x1400, 2, &[0]), Ok(()));
    master.send(NMT_ID, &START);
    master.send(0x205, &[8, 0]);
    master.send(0x205, &[9, 0]);
    assert!(master.device.values.is_empty());
    master.send(SYNC_ID, &[1]);
    master.send(SYNC_ID, &[2]);
    assert_eq!(master.device.values, [(0x2000, Value::U16(9))]);
}

#[test]
fn transmission_types_say_when_a_pdo_is_sent() {
    let mut master = Master::new();
    master.send(NMT_ID, &START);
    assert_eq!(master.write(0x1800, 2, &[3]), Ok(()));
    let sent: Vec<usize> = (0..6)
        .map(|_| {
            master.send(SYNC_ID, &[]);
            master.frames().len()
        })
        .collect();
    assert_eq!(sent, [0, 0, 1, 0, 0, 1]);
    // At SYNC if a sample came before.
    master.write(0x1800, 2, &[0]).unwrap();
    master.send(SYNC_ID, &[]);
    master.server.sampled(0);
    master.frames();
    master.send(SYNC_ID, &[]);
    assert_eq!(master.frames().len(), 1);
    master.send(SYNC_ID, &[]);
    assert_eq!(master.frames().len(), 0);
    // Each sample, and no more often than the inhibit time allows.
    master.write(0x1800, 2, &[255]).unwrap();
    master.write(0x1800, 1, &(0x8000_0185_u32).to_le_bytes()).unwrap();
    assert_eq!(master.write(0x1800, 3, &25_u16.to_le_bytes()), Ok(()));
    master.write(0x1800, 1, &(0x185_u32).to_le_bytes()).unwrap();
    let sent: Vec<usize> = (100..106)
        .map(|sample| {
            master.server.sampled(sample * 1_000_000);
            master.frames().len()
        })
        .collect();
    assert_eq!(sent, [1, 0, 0, 1, 0, 0]);
    // By the clock.
    master.write(0x1800, 5, &4_u16.to_le_bytes()).unwrap();
    master.server.sampled(200_000_000);
    assert!(master.frames().is_empty());
    let sent: Vec<usize> = (200..209)
        .map(|ms| {
            master.server.handle_deadline(ms * 1_000_000);
            master.frames().len()
        })
        .collect();
    assert_eq!(sent.iter().sum::<usize>(), 3, "{sent:?}");
}

#[test]
fn a_pdo_is_sent_when_it_is_asked_for() {
    let mut master = Master::new();
    assert_eq!(master.ask(0x185), Handled::Taken);
    assert!(master.frames().is_empty());
    master.send(NMT_ID, &START);
    master.ask(0x185);
    assert_eq!(texts(&master.frames()), ["185#FEFFFFFF"]);
    master.write(0x1800, 1, &0x4000_0185_u32.to_le_bytes()).unwrap();
    master.ask(0x185);
    assert!(master.frames().is_empty());
    assert_eq!(master.send(0x185, &[0; 4]), Handled::OtherSender);
    assert_eq!(master.send(0x585, &[0; 8]), Handled::OtherSender);
}

#[test]
fn a_pdo_is_mapped_anew() {
    let mut master = Master::new();
    let word = |index: u32, bits: u32| (index << 16 | bits).to_le_bytes();
    assert_eq!(master.write(0x1601, 0, &[0]), Ok(()));
    assert_eq!(master.write(0x1601, 1, &word(0x2002, 8)), Ok(()));
    assert_eq!(master.write(0x1601, 2, &word(0x2004, 32)), Ok(()));
    assert_eq!(master.write(0x1601, 0, &[2]), Ok(()));
    assert_eq!(master.write(0x1401, 1, &0x305_u32.to_le_bytes()), Ok(()));
    master.send(NMT_ID, &START);
    master.send(0x305, &[0xFF, 1, 2, 3, 4]);
    assert_eq!(master.device.values, [(0x2002, Value::I8(-1)), (0x2004, Value::U32(0x0403_0201))]);
    // A reset of the communication brings the mapping back.
    master.send(NMT_ID, &[0x82, 0]);
    assert_eq!(texts(&master.frames()), ["705#00"]);
    assert_eq!(master.read(0x1601, 0), Ok(0));
    assert_eq!(master.read(0x1401, 1), Ok(0x8000_0305));
}

#[test]
fn what_no_pdo_can_be_is_aborted() {
    let mut master = Master::new();
    let word = |index: u32, bits: u32| (index << 16 | bits).to_le_bytes();
    assert_eq!(master.write(0x1600, 0, &[0]), Err(0x0800_0022), "enabled");
    assert_eq!(master.write(0x1601, 1, &word(0x2001, 32)), Err(0x0604_0041), "it is sent, and not received");
    assert_eq!(master.write(0x1601, 1, &word(0x2004, 16)), Err(0x0604_0041), "half of it");
    assert_eq!(master.write(0x1601, 1, &word(0x3000, 16)), Err(0x0602_0000));
    for subindex in 1..=3 {
        assert_eq!(master.write(0x1601, subindex, &word(0x2004, 32)), Ok(()));
    }
    assert_eq!(master.write(0x1601, 0, &[3]), Err(0x0604_0042));
    assert_eq!(master.write(0x1601, 0, &[9]), Err(0x0604_0042));
    assert_eq!(master.write(0x1601, 0, &[4]), Err(0x0602_0000), "the fourth is empty");
    assert_eq!(master.write(0x1601, 0, &[2]), Ok(()));
    assert_eq!(master.write(0x1601, 1, &word(0x2004, 32)), Err(0x0800_0022), "counted");
    assert_eq!(master.write(0x1400, 1, &0x206_u32.to_le_bytes()), Err(0x0609_0030), "enabled");
    for id in [0_u32, 0x80, 0x185 | 1 << 29, 0x605, 0x705, 0x1001] {
        assert_eq!(master.write(0x1401, 1, &id.to_le_bytes()), Err(0x0609_0030), "{id:x}");
    }
    assert_eq!(master.write(0x1400, 2, &[241]), Err(0x0609_0030));
    assert_eq!(master.write(0x1400, 2, &[253]), Err(0x0609_0030));
    assert_eq!(master.write(0x1800, 2, &[253]), Ok(()));
    assert_eq!(master.write(0x1800, 3, &[1, 0]), Err(0x0800_0022), "enabled");
}

#[test]
fn what_waits_of_a_pdo_that_is_disabled_is_not_sent() {
    let mut master = Master::new();
    master.send(NMT_ID, &START);
    master.send(SYNC_ID, &[]);
    assert_eq!(master.server.waiting(), 1);
    master.send(0x605, &[0x23, 0x00, 0x18, 1, 0x85, 0x01, 0, 0x80]);
    assert_eq!(texts(&master.frames()), ["585#6000180100000000"]);
}
