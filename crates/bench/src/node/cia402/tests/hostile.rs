//! Frames of any content.

use super::*;

struct Random(u64);

impl Random {
    /// Returns the next number of SplitMix64, a generator of random numbers.
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// A frame that reaches the drives, often with an index that there is.
    fn frame(&mut self) -> Frame {
        let ids = [0x000, 0x080, 0x201, 0x202, 0x301, 0x401, 0x501, 0x601, 0x602, 0x181, 0x281, 0x581, 0x701];
        let id = match self.next() % 8 {
            0 => (self.next() % 0x800) as u16,
            _ => ids[(self.next() % ids.len() as u64) as usize],
        };
        let mut data = self.next().to_le_bytes();
        if id == 0x601 || id == 0x602 {
            let indices = [0x1400_u16, 0x1401, 0x1600, 0x1601, 0x1800, 0x1A00, 0x1017, 0x6040, 0x6060, 0x6071, 0x60C2];
            let [low, high] = indices[(self.next() % indices.len() as u64) as usize].to_le_bytes();
            (data[1], data[2], data[3]) = (low, high, data[3] % 4);
            if self.next().is_multiple_of(2) {
                data[0] = [0x23, 0x2B, 0x2F, 0x40][(self.next() % 4) as usize];
            }
        }
        let length = if self.next().is_multiple_of(4) { (self.next() % 9) as usize } else { 8 };
        let format = if self.next().is_multiple_of(16) { FrameFormat::Remote } else { FrameFormat::Classic };
        Frame::new(Id::Standard(id), format, &data[..length]).unwrap()
    }
}

#[test]
fn random_frames_never_give_a_load_while_disabled() {
    let mut random = Random(20260);
    let mut enabled = 0;
    for time_base in [TimeBase::Clock, TimeBase::Lockstep] {
        let mut bench = Bench::new(2, time_base);
        let mut ramps_nm = f64::INFINITY;
        for frame in 0..500_000 {
            bench.node.handle_frame(bench.now_ns, &random.frame());
            if frame % 8 > 0 {
                continue;
            }
            bench.tick();
            bench.frames();
            let [first_nm, second_nm] = bench.torques_nm();
            let size_nm = first_nm.abs() + second_nm.abs();
            assert!(Exciter::default().can_produce(&bench.load));
            if bench.node.is_armed() {
                (enabled, ramps_nm) = (enabled + 1, f64::INFINITY);
            } else {
                assert!(size_nm == 0.0 || bench.node.is_ramping() || size_nm <= ramps_nm, "{size_nm} after {ramps_nm}");
                ramps_nm = size_nm;
            }
        }
    }
    // The frames say so at times: that is a master's right.
    assert!(enabled < 125_000);
}
