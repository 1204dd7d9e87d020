//! Cost of a step of every scheme, and of periods alone and side by side: `cargo bench --bench steps`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use resonarm::analysis::Forced;
use resonarm::analysis::time_domain::StroboscopicMap;
use resonarm::integrate::Scheme;
use resonarm::structure::SpecError;
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ChainSpec, ElementSpec, Law, Link, ModalSpec, ModeSpec, Place, Preset, ShapeSpec, Side,
    StepError, StepLoad, Stepper, StructureSpec,
};

const RATE_HZ: f64 = 8000.0;
const STEPS: u32 = 1000;

fn main() {
    divan::main();
}

/// The fitted arm.
fn arm() -> Result<Assembly, SpecError> {
    let chain = Preset::Irb1600Fitted.chain()?.at_angles_deg(&[20.0, 60.0]);
    Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] })
}

/// A thousand steps of the arm from a deflection, under loads at joint 1 and along x at the tip.
fn steps_of_the_arm(bencher: Bencher, scheme: Scheme, rate_hz: f64, load: StepLoad<'_>) {
    let Ok(arm) = arm() else { return };
    let (Ok(joint), Ok(tip)) = (arm.dof("joint1"), arm.dof("tip.x")) else { return };
    let Ok(mut stepper) = Stepper::new(&arm, &[joint, tip], scheme, rate_hz) else { return };
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| -> Result<(), StepError> {
        // From the same state in every round: with a decaying vibration later rounds would be of another cost.
        stepper.restore(&[0.02, -0.03, 0.0, 0.0])?;
        (0..STEPS).try_for_each(|k| stepper.advance_under(f64::from(k) / rate_hz, black_box(&load)))
    });
}

/// Free vibration.
#[divan::bench(args = Scheme::ALL)]
fn free(bencher: Bencher, scheme: Scheme) {
    steps_of_the_arm(bencher, scheme, RATE_HZ, StepLoad::Held(&[0.0, 0.0]));
}

/// Under a sine at joint 1 and the tip.
#[divan::bench(args = Scheme::ALL)]
fn driven(bencher: Bencher, scheme: Scheme) {
    let omega_rad_s = core::f64::consts::TAU * 22.0;
    steps_of_the_arm(bencher, scheme, RATE_HZ, StepLoad::Sine { amplitude: &[60.0, 20.0], omega_rad_s });
}

/// As in a run at 1 kHz: the scheme's default number of steps a sample, with the force at the tip held.
#[divan::bench(args = Scheme::ALL)]
fn held(bencher: Bencher, scheme: Scheme) {
    let rate_hz = 1000.0 * f64::from(scheme.steps_per_sample());
    steps_of_the_arm(bencher, scheme, rate_hz, StepLoad::Held(&[0.0, 20.0]));
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
        elements: law.map(|law| ElementSpec::Point { at, to: None, law }).into_iter().collect(),
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
    let law = Law::KelvinVoigt { stiffness: 2e5, damping: 10.0, gap: 0.0002, side: Side::Positive, preload: 0.0 };
    let swing = |k: u32| if (k / 50).is_multiple_of(2) { 40.0 } else { -40.0 };
    steps_of(bencher, &modes(count, Some(law)), Scheme::Exponential8, &[], swing);
}

#[divan::bench(args = NUMBERS_OF_MODES)]
fn modes_with_friction(bencher: Bencher, count: usize) {
    let law = Law::Friction { stiffness: 4e4, slip: 5.0 };
    let swing = |k: u32| if (k / 50).is_multiple_of(2) { 40.0 } else { -40.0 };
    steps_of(bencher, &modes(count, Some(law)), Scheme::Exponential8, &[], swing);
}

/// A hundred periods of many motions of the arm under a sine, on one thread, in periods of one motion: alone,
/// and side by side.
#[divan::bench(args = [1, 8, 64, 512])]
fn periods(bencher: Bencher, motions: usize) {
    let Ok(assembly) = arm() else { return };
    let Ok(joint) = assembly.dof("joint1") else { return };
    let Ok(map) = StroboscopicMap::new(&Forced::new(assembly, joint, 60.0), 22.1) else { return };
    let start = vec![0.02, -0.03, 0.0, 0.0];
    bencher
        .counter(ItemsCount::new(100 * motions))
        .with_inputs(|| vec![start.clone(); motions])
        .bench_local_refs(|states| map.advance_all(states, 100));
}
