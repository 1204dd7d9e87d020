//! Behaviour of masters: the order of ros2_canopen's driver, mappings of their own.

use super::*;

impl Bench {
    fn map(&mut self, node: u8, (communication, mapping, base): (u16, u16, u32), kind: u8, words: &[u32]) {
        let id = base + u32::from(node);
        let mut write = |index: u16, subindex: u8, bytes: &[u8]| {
            let [low, high] = index.to_le_bytes();
            let mut request = [0x23 | ((4 - bytes.len()) as u8) << 2, low, high, subindex, 0, 0, 0, 0];
            request[4..4 + bytes.len()].copy_from_slice(bytes);
            assert_eq!(self.sdo(node, request)[0], 0x60, "{index:x} {subindex}");
        };
        write(communication, 1, &(id | 1 << 31).to_le_bytes());
        write(communication, 2, &[kind]);
        write(mapping, 0, &[0]);
        for (word, subindex) in words.iter().zip(1..) {
            write(mapping, subindex, &word.to_le_bytes());
        }
        write(mapping, 0, &[words.len() as u8]);
        write(communication, 1, &id.to_le_bytes());
    }

    /// Controlword and mode in RPDO 1, target torque and position in RPDO 2, both at SYNC.
    fn cycle(&mut self, controlword: u16, mode: u8, target: i16) {
        let ([a, b], [c, d]) = (controlword.to_le_bytes(), target.to_le_bytes());
        self.send(0x201, &[a, b, mode]);
        self.send(0x301, &[c, d, 1, 2, 3, 4]);
        self.send(0x80, &[]);
        self.tick();
    }
}

/// ros2_canopen enables before a mode is set, and halts until it has a first target; it maps objects of all modes, and
/// sends all of them at every SYNC.
#[test]
fn a_master_may_enable_before_it_sets_a_mode_and_halt_until_a_target() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.write(1, 0x6081, &1000_u32.to_le_bytes()).unwrap();
    bench.write(1, 0x6083, &2000_u32.to_le_bytes()).unwrap();
    assert_eq!(bench.sdo(1, [0x2F, 0xC2, 0x60, 1, 50, 0, 0, 0])[0], 0x60);
    assert_eq!(bench.sdo(1, [0x2F, 0xC2, 0x60, 2, 0xFD, 0, 0, 0])[0], 0x60);
    bench.map(1, (0x1400, 0x1600, 0x200), 1, &[0x6040_0010, 0x6060_0008]);
    bench.map(1, (0x1401, 0x1601, 0x300), 1, &[0x6071_0010, 0x607A_0020]);
    bench.map(1, (0x1800, 0x1A00, 0x180), 1, &[0x6041_0010, 0x6061_0008]);
    bench.map(1, (0x1801, 0x1A01, 0x280), 1, &[0x6064_0020, 0x606C_0020]);
    bench.send(0, &[1, 1]);
    for controlword in [0x06, 0x07, 0x0F] {
        bench.cycle(controlword, 0, 50);
    }
    assert_eq!((bench.node.state(), bench.torques_nm()), (NodeState::Operational, [0.0; 2]));
    for _ in 0..100 {
        bench.cycle(0x10F, 10, 50);
    }
    assert_eq!((bench.node.state(), bench.torques_nm()), (NodeState::Operational, [0.0; 2]));
    bench.frames();
    bench.cycle(0x0F, 10, 50);
    assert_eq!(bench.torques_nm(), [5.0, 0.0]);
    let sent = bench.sent();
    assert_eq!(sent, ["181#37120A", "281#0000000000000000"]);
    assert_eq!(bench.read(1, 0x607A), 0x0403_0201);
    assert_eq!(bench.node.refusals().total(), 0);
}

/// The newest RPDO of each kind counts, and a SYNC without one leaves the torque as it is until the timeout.
#[test]
fn a_sync_alone_is_no_sign_of_life() {
    let mut bench = Bench::new(1, TimeBase::Clock);
    bench.enable(&[1]);
    bench.target(1, 10);
    bench.tick();
    for _ in 0..TIMEOUT_NS / TICK_NS - 2 {
        bench.send(0x80, &[]);
        bench.tick();
        assert_eq!(bench.torques_nm(), [1.0, 0.0]);
    }
    for _ in 0..3 {
        bench.send(0x80, &[]);
        bench.tick();
    }
    assert_eq!(bench.node.state(), NodeState::Fault);
}
