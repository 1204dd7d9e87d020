//! Cost of a step of every scheme, and of an ensemble: `cargo bench --bench steps`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use resonarm::arm::{Arm, ArmError, Load, Pose, Preset, State};
use resonarm::ensemble::Ensemble;
use resonarm::integrate::{Integrator, Scheme, Sine};

const RATE_HZ: f64 = 8000.0;
const STEPS: u32 = 1000;

fn main() {
    divan::main();
}

fn arm() -> Result<Arm, ArmError> {
    Arm::new(Preset::Irb1600Fitted.parameters()?, Pose { beta1_deg: 20.0, beta2_deg: 60.0 })
}

fn start() -> State {
    State::new([0.02, -0.03], [0.0, 0.0])
}

/// A thousand steps of free vibration.
#[divan::bench(args = Scheme::ALL)]
fn free(bencher: Bencher, scheme: Scheme) {
    let Ok(arm) = arm() else { return };
    let Ok(integrator) = Integrator::new(scheme, RATE_HZ, &arm) else { return };
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        (0..STEPS).try_fold(start(), |state, k| {
            integrator.step(&arm, f64::from(k) / RATE_HZ, &state, black_box(&Load::default()))
        })
    });
}

/// A thousand steps under a sine at joint 1 and the tip.
#[divan::bench(args = Scheme::ALL)]
fn driven(bencher: Bencher, scheme: Scheme) {
    let Ok(arm) = arm() else { return };
    let Ok(integrator) = Integrator::new(scheme, RATE_HZ, &arm) else { return };
    let amplitude = Load { torque_nm: [60.0, 0.0].into(), force_n: [20.0, 0.0].into() };
    let sine = Sine { amplitude, frequency_hz: 22.0 };
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        (0..STEPS).try_fold(start(), |state, k| integrator.step(&arm, f64::from(k) / RATE_HZ, &state, black_box(&sine)))
    });
}

/// A thousand steps of many arms on one thread.
#[divan::bench(args = [8, 64, 512])]
fn ensemble(bencher: Bencher, arms: u32) {
    let Ok(arm) = arm() else { return };
    let count = arms as usize;
    let Ok(ensemble) = Ensemble::new(Scheme::Rk4, RATE_HZ, &vec![arm; count], &vec![start(); count]) else { return };
    let loads = vec![Load::default(); count];
    bencher
        .counter(ItemsCount::new(STEPS * arms))
        .with_inputs(|| ensemble.clone())
        .bench_local_refs(|ensemble| ensemble.advance(STEPS, black_box(&loads)));
}
