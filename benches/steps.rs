//! Cost of a step of every scheme, and of periods alone and side by side: `cargo bench --bench steps`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use resonarm::analysis::structure::Forced;
use resonarm::analysis::structure::time_domain::StroboscopicMap;
use resonarm::arm::{Arm, ArmError, Load, Pose, Preset, Sine, State};
use resonarm::integrate::{Integrator, Scheme};
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ChainSpec, ElementSpec, Law, Link, ModalSpec, ModeSpec, Place, ShapeSpec, Side, Stepper,
    StructureSpec,
};

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

/// A thousand steps of a structure at 2 kHz, from a start, with a force along x at the tip that is held or swings.
fn steps_of(bencher: Bencher, spec: &StructureSpec, scheme: Scheme, start: &[f64], force: impl Fn(u32) -> f64) {
    let Ok(assembly) = Assembly::new(spec) else { return };
    let Ok(tip) = assembly.dof("tip.x") else { return };
    let Ok(mut stepper) = Stepper::new(&assembly, &[tip], scheme, 2000.0) else { return };
    let mut states = vec![0.0; stepper.states()];
    states.iter_mut().zip(start).for_each(|(state, start)| *state = *start);
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        stepper.restore(&states)?;
        (0..STEPS).try_for_each(|k| stepper.advance(f64::from(k) / 2000.0, black_box(&[force(k)])))
    });
}

fn chain_of(links: usize) -> StructureSpec {
    const ANGLES_DEG: [f64; 8] = [40.0, -70.0, 30.0, 55.0, -20.0, 35.0, 15.0, -30.0];
    let link = |(i, &angle_deg): (usize, &f64)| Link {
        length_m: 0.5,
        mass_kg: 12.0 - i as f64,
        centre_of_mass_m: 0.2,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: 0.5,
        angle_deg,
        stiffness_nm_rad: 4e5 / (1.0 + i as f64),
        damping_nm_s_rad: 3.0,
    };
    let links = ANGLES_DEG.iter().take(links).enumerate().map(link).collect();
    StructureSpec { body: BodySpec::Chain(ChainSpec { links, gravity_m_s2: 0.0, unstated: vec![] }), elements: vec![] }
}

/// The arm of the other measurements as a chain, with the steps of `held` and the default scheme.
#[divan::bench(args = Scheme::ALL)]
fn arm_as_chain(bencher: Bencher, scheme: Scheme) {
    let Ok(arm) = arm() else { return };
    let body = BodySpec::Chain(ChainSpec::from_arm(arm.parameters(), arm.pose()));
    steps_of(bencher, &StructureSpec { body, elements: vec![] }, scheme, &[0.02, -0.03], |_| 20.0);
}

/// Chains of as many links, at vibration of 5 mrad.
#[divan::bench(args = [1, 2, 3, 4, 6, 8])]
fn chain(bencher: Bencher, links: usize) {
    steps_of(bencher, &chain_of(links), Scheme::Exponential8, &[0.005, -0.005][..links.min(2)], |_| 20.0);
}

/// Modes from 20 Hz on, 30 Hz apart, with an element at the tip or none.
fn modes(count: usize, law: Option<Law>) -> StructureSpec {
    let mode = |i: usize| ModeSpec { frequency_hz: 20.0 + 30.0 * i as f64, damping_ratio: 0.005 };
    let by_mode = (0..count).map(|i| 0.5 / (1.0 + 0.3 * i as f64)).collect();
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode }];
    let at = Place::Dof { point: "tip".into(), axis: Axis::X };
    StructureSpec {
        body: BodySpec::Modal(ModalSpec { modes: (0..count).map(mode).collect(), shapes }),
        elements: law.map(|law| ElementSpec { at, to: None, law }).into_iter().collect(),
    }
}

const NUMBERS_OF_MODES: [usize; 3] = [2, 8, 32];

#[divan::bench(args = NUMBERS_OF_MODES)]
fn modes_alone(bencher: Bencher, count: usize) {
    steps_of(bencher, &modes(count, None), Scheme::Exponential8, &[], |_| 20.0);
}

/// With two touches and releases a period of 50 ms.
#[divan::bench(args = NUMBERS_OF_MODES)]
fn modes_with_contact(bencher: Bencher, count: usize) {
    let law = Law::KelvinVoigt { stiffness: 2e5, damping: 10.0, gap: 0.0002, side: Side::Positive };
    let swing = |k: u32| if (k / 50).is_multiple_of(2) { 40.0 } else { -40.0 };
    steps_of(bencher, &modes(count, Some(law)), Scheme::Exponential8, &[], swing);
}

#[divan::bench(args = NUMBERS_OF_MODES)]
fn modes_with_friction(bencher: Bencher, count: usize) {
    let law = Law::Friction { stiffness: 4e4, slip: 5.0 };
    let swing = |k: u32| if (k / 50).is_multiple_of(2) { 40.0 } else { -40.0 };
    steps_of(bencher, &modes(count, Some(law)), Scheme::Exponential8, &[], swing);
}

/// A hundred periods of many motions of the arm as a chain under a sine, on one thread, in periods of one motion: alone,
/// and side by side.
#[divan::bench(args = [1, 8, 64, 512])]
fn periods(bencher: Bencher, motions: usize) {
    let Ok(arm) = arm() else { return };
    let body = BodySpec::Chain(ChainSpec::from_arm(arm.parameters(), arm.pose()));
    let Ok(assembly) = Assembly::new(&StructureSpec { body, elements: vec![] }) else { return };
    let Ok(joint) = assembly.dof("joint1") else { return };
    let Ok(map) = StroboscopicMap::new(&Forced::new(assembly, joint, 60.0), 22.1) else { return };
    let start = vec![0.02, -0.03, 0.0, 0.0];
    bencher
        .counter(ItemsCount::new(100 * motions))
        .with_inputs(|| vec![start.clone(); motions])
        .bench_local_refs(|states| map.advance_all(states, 100));
}
