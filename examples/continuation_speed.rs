//! Times the forced branch that AUTO-07p is compared on (see `benches/peers/auto`), and the paper's Fig. 4.

use resonarm::analysis::{BifurcationKind, Branch, BranchOptions, Coordinate, ForcedArm, trace};
use resonarm::arm::{Arm, Load, Pose, Preset};
use std::time::Instant;

fn branch(beta2_deg: f64, from_hz: f64, to_hz: f64) -> Result<Branch, Box<dyn std::error::Error>> {
    let arm = Arm::new(Preset::Irb1600Fitted.parameters()?, Pose { beta1_deg: 0.0, beta2_deg })?;
    let forced = ForcedArm::new(arm, Load::torque_nm(1.0, 0.0), 60.0);
    Ok(trace(forced, from_hz, Coordinate::FrequencyHz, &BranchOptions::new(from_hz, to_hz))?)
}

#[allow(clippy::disallowed_methods, clippy::print_stdout)]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut best = f64::INFINITY;
    let mut result = branch(60.0, 21.0, 23.5)?;
    for _ in 0..20 {
        let start = Instant::now();
        result = branch(60.0, 21.0, 23.5)?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("peer case: {} points in {:.3} ms, {:?}", result.orbits.len(), best * 1e3, result.work);
    for b in result.bifurcations.iter().filter(|b| b.kind == BifurcationKind::Fold) {
        println!("fold {:.10} Hz", b.orbit.frequency_hz);
    }
    let start = Instant::now();
    for beta2_deg in [0.0, 30.0, 60.0, 90.0, 120.0, 150.0] {
        let start = Instant::now();
        let result = branch(beta2_deg, 0.5, 80.0);
        let result = match result {
            Ok(r) => r,
            Err(e) => {
                println!("{beta2_deg}: {e}");
                continue;
            }
        };
        println!(
            "{beta2_deg}: {} points in {:.1} ms {:?}",
            result.orbits.len(),
            start.elapsed().as_secs_f64() * 1e3,
            result.work
        );
        for b in &result.bifurcations {
            println!("  {:?} {:.7} Hz {:.4}", b.kind, b.orbit.frequency_hz, b.orbit.harmonic1_rad[0]);
        }
    }
    println!("Fig. 4 on one core: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    Ok(())
}
