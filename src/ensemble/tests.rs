use super::*;
use crate::arm::real::{Lanes, Two};
use crate::arm::tests::any_arm;
use crate::arm::{Load, Pose, Preset};
use crate::integrate::Sine;
use proptest::prelude::*;

fn bits(state: &State) -> [u64; 4] {
    [state.alpha_rad.x, state.alpha_rad.y, state.alpha_dot_rad_s.x, state.alpha_dot_rad_s.y].map(f64::to_bits)
}

/// Each arm by the integrator alone.
fn one_by_one(rate_hz: f64, arms: &[Arm], states: &[State], sines: &[Sine], steps: u32) -> Vec<State> {
    let step_s = 1.0 / rate_hz;
    let alone = |((arm, state), sine): ((&Arm, &State), &Sine)| {
        let integrator = Integrator::new(Scheme::Rk4, rate_hz, arm).unwrap();
        (0..steps).fold(*state, |state, k| integrator.step(arm, f64::from(k) * step_s, &state, sine).unwrap())
    };
    arms.iter().zip(states).zip(sines).map(alone).collect()
}

fn any_member() -> impl Strategy<Value = (Arm, State, Sine)> {
    // Small and large deflections, so that both ways to a sine are taken, and loads with and without a force at the tip.
    let pair = |limit: f64| prop::array::uniform2(-limit..limit);
    let state = (prop_oneof![pair(1e-3), pair(0.4), pair(1.5)], pair(20.0)).prop_map(|(x, v)| State::new(x, v));
    let sine = (pair(500.0), prop_oneof![Just([0.0, 0.0]), Just([0.0, 30.0]), pair(100.0)], 1.0..60.0).prop_map(
        |(u, f, frequency_hz)| Sine { amplitude: Load { torque_nm: u.into(), force_n: f.into() }, frequency_hz },
    );
    (any_arm(), state, sine)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Arms with and without gravity and force, in groups whole and not, by every way there is on this machine.
    #[test]
    fn moves_every_arm_as_if_it_were_alone(
        members in prop::collection::vec(any_member(), 1..40),
    ) {
        let (arms, rest): (Vec<_>, Vec<_>) = members.into_iter().map(|(arm, state, sine)| (arm, (state, sine))).unzip();
        let (states, sines): (Vec<_>, Vec<_>) = rest.into_iter().unzip();
        let expected: Vec<_> = one_by_one(16_000.0, &arms, &states, &sines, 60).iter().map(bits).collect();
        let ensemble = Ensemble::new(Scheme::Rk4, 16_000.0, &arms, &states).unwrap();
        let seen = |ensemble: &Ensemble| ensemble.states().iter().map(bits).collect::<Vec<_>>();

        let mut detected = ensemble.clone();
        detected.advance(20, &sines).unwrap();
        detected.advance(40, &sines).unwrap();
        prop_assert_eq!(seen(&detected), &expected[..]);
        prop_assert_eq!(detected.time_s(), 60.0 / 16_000.0);

        let mut eight = ensemble.clone();
        eight.stretch(60).side_by_side(&eight.arms, &mut eight.motions, &sines, lanes::portable::<Lanes>);
        prop_assert_eq!(seen(&eight), &expected[..]);
        let mut sixteen = ensemble.clone();
        sixteen.stretch(60).side_by_side(&sixteen.arms, &mut sixteen.motions, &sines, lanes::portable::<Two<Lanes>>);
        prop_assert_eq!(seen(&sixteen), &expected[..]);

        #[cfg(feature = "std")]
        for threads in [1, 2, 5] {
            let mut spread = ensemble.clone();
            spread.advance_on(core::num::NonZeroUsize::new(threads).unwrap(), 60, &sines).unwrap();
            prop_assert_eq!(seen(&spread), &expected[..]);
        }
    }
}

#[test]
fn says_what_is_wrong() {
    let arm = Arm::new(Preset::Irb1600Table1.parameters().unwrap(), Pose::default()).unwrap();
    let (arms, states) = ([arm.clone(), arm], [State::default(); 2]);
    let says = |scheme, rate_hz, states: &[State]| Ensemble::new(scheme, rate_hz, &arms, states).unwrap_err();
    insta::assert_snapshot!(says(Scheme::Gl6, 8000.0, &states), @"scheme gl6 does not go side by side: an ensemble takes rk4");
    insta::assert_snapshot!(says(Scheme::Rk4, 8000.0, &states[..1]), @"an ensemble of 2 arms was given 1 states: it needs one for each arm");
    insta::assert_snapshot!(says(Scheme::Rk4, 1000.0, &states), @"arm 0 of the ensemble: scheme rk4 can't carry this arm at 1000 Hz: its second mode needs at least 1265 Hz");
    let mut ensemble = Ensemble::new(Scheme::Rk4, 8000.0, &arms, &states).unwrap();
    insta::assert_snapshot!(ensemble.advance(1, &[Load::default()]).unwrap_err(), @"an ensemble of 2 arms was given 1 excitations: it needs one for each arm");
    let loads = [Load::default(), Load::torque_nm(f64::MAX, 0.0)];
    insta::assert_snapshot!(ensemble.advance(8, &loads).unwrap_err(), @"arm 1 of the ensemble: the state at t = 0.001 s is not finite: raise the rate, or look for a load beyond what the arm can bear");
}
