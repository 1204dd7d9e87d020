//! Cost of a step of every scheme, and of periods alone and side by side: `cargo bench --bench steps`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use resonarm::analysis::time_domain::StroboscopicMap;
use resonarm::arm::{Arm, ArmError, Load, Pose, Preset, Sine, State};
use resonarm::integrate::{Integrator, Scheme};

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

/// A thousand steps as in a run at 1 kHz: the scheme's default number a sample, with the force at the tip held.
#[divan::bench(args = Scheme::ALL)]
fn held(bencher: Bencher, scheme: Scheme) {
    let Ok(arm) = arm() else { return };
    let rate_hz = 1000.0 * f64::from(scheme.steps_per_sample());
    let Ok(integrator) = Integrator::new(scheme, rate_hz, &arm) else { return };
    let load = Load { torque_nm: [0.0, 0.0].into(), force_n: [20.0, 0.0].into() };
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        (0..STEPS).try_fold(start(), |state, k| integrator.step(&arm, f64::from(k) / rate_hz, &state, black_box(&load)))
    });
}

/// A hundred periods of many motions under a sine, on one thread, in periods of one motion: alone, and side by side.
#[divan::bench(args = [1, 8, 64, 512])]
fn periods(bencher: Bencher, motions: usize) {
    let Ok(arm) = arm() else { return };
    let amplitude = Load { torque_nm: [60.0, 0.0].into(), force_n: [0.0, 0.0].into() };
    let Ok(map) = StroboscopicMap::new(&arm, Sine { amplitude, frequency_hz: 22.1 }) else { return };
    bencher.counter(ItemsCount::new(100 * motions)).with_inputs(|| vec![start(); motions]).bench_local_refs(|states| {
        if motions == 1 {
            let advance = |state, _period| map.advance(&state);
            (0..100).try_fold(states[0], advance).map(|state| states[0] = state)
        } else {
            map.advance_all(states, 100);
            Ok(())
        }
    });
}
