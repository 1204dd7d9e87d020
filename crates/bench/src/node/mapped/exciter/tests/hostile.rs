//! Frames that no good plant sends.

use super::*;
use resonarm_numeric::noise::Noise;

fn number(noise: &mut Noise) -> u64 {
    noise.normal().to_bits().wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20
}

/// Between good frames those with flipped bits, cut ones, old ones and those of other messages: no load is commanded
/// but those of the controller for a sample that was sent, and whatever ends the work, the plant is disarmed.
#[test]
fn of_hostile_frames_none_is_answered() {
    let mut noise = Noise::new(11, 0);
    for _ in 0..200 {
        let mut pair = Pair::new(1000);
        let mut old = vec![];
        for _ in 0..60 {
            let before = pair.exciter.samples_played();
            for _ in 0..3 {
                let frame = hostile(&mut noise, &old);
                pair.exciter.handle_frame(pair.now_ns, &frame);
            }
            let answered = pair.exciter.samples_played() - before;
            assert!(answered <= 3, "{answered}");
            let force_n = pair.tick();
            let samples = pair.exciter.samples_played() as f64;
            assert!(force_n <= COUNT_N * samples + 1e-9, "{force_n} N after {samples} samples");
            old = pair.sent.drain(..).collect();
        }
        pair.exciter.leave(pair.now_ns);
        pair.ticks(60);
        assert!(pair.exciter.outcome().is_some() && !pair.plant.is_armed());
    }
}

/// A frame with a wrong bit, a cut one, one of before, or one of nobody.
fn hostile(noise: &mut Noise, old: &[Frame]) -> Frame {
    let (kind, place) = (number(noise) % 4, number(noise) as usize);
    let Some(good) = old.first() else { return Frame::new(MEAS, FrameFormat::Classic, &[]).unwrap() };
    let mut data = good.data().to_vec();
    let end = data.len();
    match kind {
        0 => data[place % end] ^= 1 << (place % 8),
        1 => data.truncate(place % end),
        2 => {}
        _ => return Frame::new(Id::Standard(0x300 + place as u16 % 0x100), good.format(), &data).unwrap(),
    }
    Frame::new(good.id(), good.format(), &data).unwrap()
}
