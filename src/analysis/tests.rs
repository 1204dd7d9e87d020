use super::*;
use crate::arm::tests::arm;
use crate::arm::{Load, Preset};

fn forced(beta2_deg: f64) -> ForcedArm {
    ForcedArm::new(arm(Preset::Irb1600Fitted, 0.0, beta2_deg), Load::torque_nm(1.0, 0.0), 60.0)
}

#[test]
fn first() {
    let start = std::time::Instant::now();
    let branch = trace(forced(60.0), 21.0, Coordinate::FrequencyHz, &BranchOptions::new(21.0, 23.5)).unwrap();
    println!("{:?}", start.elapsed());
    println!("{} points {:?}", branch.orbits.len(), branch.work);
    for o in branch.orbits.iter().step_by(1) {
        println!("{:.6} {:.5} {:.5} H{} {} {:.6} {:.1e}", o.frequency_hz, o.amplitude_rad[0], o.harmonic1_rad[0], o.harmonics(), o.is_stable(), o.multipliers()[0].norm(), o.stability.liouville_defect);
    }
    for b in &branch.bifurcations {
        println!("{:?} {:.12} {:?}", b.kind, b.orbit.frequency_hz, b.orbit.harmonic1_rad);
    }
}
