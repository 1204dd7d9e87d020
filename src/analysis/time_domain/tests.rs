use super::*;
use crate::arm::tests::arm;
use crate::arm::{Load, Preset, State};

#[test]
fn probe() {
    let arm = arm(Preset::Irb1600Fitted, 0.0, 60.0);
    for (direction, n) in [(Direction::Up, 51), (Direction::Down, 51)] {
        let sweep = Sweep {
            parameter: SweepParameter::Frequency { amplitude: Load::torque_nm(60.0, 0.0) },
            grid: Grid::new(21.0, 23.5, n).unwrap(),
            direction,
        };
        let mut state = State::default();
        for i in 0..n {
            let s = sweep.respond(&arm, i, &state, &SettleOptions::default(), &|| false).unwrap();
            println!("{:.4} {:?} {:?} m {:?} p {} d {:.1e}", sweep.value(i), s.amplitude_rad, s.period, s.largest_multiplier, s.settling_periods, s.drift);
            state = s.end;
        }
    }
}
