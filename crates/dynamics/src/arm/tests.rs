use super::*;
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

pub(crate) fn arm(preset: Preset, beta1_deg: f64, beta2_deg: f64) -> Arm {
    Arm::new(preset.parameters().unwrap(), Pose { beta1_deg, beta2_deg }).unwrap()
}

/// Every preset in every pose, without gravity and with it, from the moon's to Jupiter's.
pub(crate) fn any_arm() -> impl Strategy<Value = Arm> {
    let gravity = (1.6..25.0, 0.0..60.0, 0.0..0.5).prop_map(|(gravity_m_s2, mass1_kg, centre1_m)| Gravity {
        gravity_m_s2,
        mass1_kg,
        centre1_m,
    });
    let pose = (-180.0..180.0, -180.0..180.0).prop_map(|(beta1_deg, beta2_deg)| Pose { beta1_deg, beta2_deg });
    (prop::sample::select(&Preset::ALL[..]), pose, prop::option::of(gravity)).prop_map(|(preset, pose, gravity)| {
        Arm::new(Parameters { gravity, ..preset.parameters().unwrap() }, pose).unwrap()
    })
}

/// The torques of the weight at joint angles q, N·m, from Gravity's definition.
fn weight_torque(parameters: &Parameters, q: Vector2<f64>) -> Vector2<f64> {
    let Some(g) = parameters.gravity else { return Vector2::zeros() };
    let forearm = g.gravity_m_s2 * parameters.mass2_kg * parameters.centre2_m * libm::cos(q.x + q.y);
    let upper_arm = g.mass1_kg * g.centre1_m + parameters.mass2_kg * parameters.length1_m;
    Vector2::new(g.gravity_m_s2 * upper_arm * libm::cos(q.x) + forearm, forearm)
}

fn relaxed_angles(arm: &Arm) -> Vector2<f64> {
    Vector2::new(arm.pose().beta1_deg.to_radians(), arm.pose().beta2_deg.to_radians())
}

fn any_state() -> impl Strategy<Value = State> {
    (prop::array::uniform2(-1.0..1.0), prop::array::uniform2(-50.0..50.0)).prop_map(|(x, v)| State::new(x, v))
}

fn any_load() -> impl Strategy<Value = Load> {
    (prop::array::uniform2(-2e3..2e3), prop::array::uniform2(-5e2..5e2))
        .prop_map(|(u, f): ([f64; 2], [f64; 2])| Load { torque_nm: u.into(), force_n: f.into() })
}

/// State after a small time at constant acceleration: enough for first derivatives in time.
fn moved(state: &State, acceleration: &Vector2<f64>, dt: f64) -> State {
    State {
        alpha_rad: state.alpha_rad + state.alpha_dot_rad_s * dt + acceleration * (0.5 * dt * dt),
        alpha_dot_rad_s: state.alpha_dot_rad_s + acceleration * dt,
    }
}

proptest! {
    #[test]
    fn mass_matrix_is_symmetric_positive_definite(arm in any_arm(), state in any_state()) {
        let m = arm.mass_matrix(&state.alpha_rad);
        prop_assert_eq!(m, m.transpose());
        prop_assert!(m.m11 > 0.0 && m.determinant() > 0.0);
    }

    #[test]
    fn mass_rate_less_twice_coriolis_is_skew(arm in any_arm(), state in any_state()) {
        let h = 1e-6;
        let m_dot = (arm.mass_matrix(&(state.alpha_rad + state.alpha_dot_rad_s * h))
            - arm.mass_matrix(&(state.alpha_rad - state.alpha_dot_rad_s * h))) / (2.0 * h);
        let skew = m_dot - arm.coriolis_matrix(&state) * 2.0;
        prop_assert!((skew + skew.transpose()).norm() < 1e-5 * (1.0 + skew.norm()), "{skew}");
    }

    #[test]
    fn acceleration_solves_the_equation_of_motion(arm in any_arm(), state in any_state(), load in any_load()) {
        let a = arm.acceleration(&state, &load);
        let left = arm.mass_matrix(&state.alpha_rad) * a
            + (arm.coriolis_matrix(&state) + arm.damping_matrix()) * state.alpha_dot_rad_s
            + arm.stiffness_matrix() * (state.alpha_rad + arm.static_deflection_rad())
            + weight_torque(arm.parameters(), relaxed_angles(&arm) + arm.static_deflection_rad() + state.alpha_rad);
        let right = load.torque_nm + arm.tip_jacobian(&state.alpha_rad).transpose() * load.force_n;
        // The residual is rounding: in proportion to the largest torque, that of the springs.
        prop_assert!((left - right).norm() < 1e-9 * 555_000.0, "{left} {right}");
    }

    #[test]
    fn power_is_the_rate_of_energy(arm in any_arm(), state in any_state(), load in any_load()) {
        let a = arm.acceleration(&state, &load);
        let energy = |dt| arm.energy(&moved(&state, &a, dt)).total_j();
        let difference = |dt: f64| (energy(dt) - energy(-dt)) / (2.0 * dt);
        // L. F. Richardson, "The Approximate Arithmetical Solution by Finite Differences of Physical Problems Involving
        // Differential Equations", Phil. Trans. R. Soc. A 210 (1911): the error in dt² alone can be 10 W at 1e7 rad/s².
        let rate = (4.0 * difference(5e-8) - difference(1e-7)) / 3.0;
        let power = arm.power_w(&state, &load);
        prop_assert!((rate - power).abs() < 1e-4 * (1.0 + power.abs() + rate.abs()).max(1e5), "{rate} {power}");
    }

    #[test]
    fn jacobian_is_the_derivative(arm in any_arm(), state in any_state(), load in any_load()) {
        let jacobian = arm.acceleration_jacobian(&state, &load);
        prop_assert!((jacobian.acceleration_rad_s2 - arm.acceleration(&state, &load)).norm() == 0.0);
        for column in 0..2 {
            let h = 1e-6;
            let mut step = Vector2::zeros();
            step[column] = h;
            let shifted = |x: Vector2<f64>, v: Vector2<f64>| {
                arm.acceleration(&State { alpha_rad: x, alpha_dot_rad_s: v }, &load)
            };
            let (x, v) = (state.alpha_rad, state.alpha_dot_rad_s);
            let by_alpha = (shifted(x + step, v) - shifted(x - step, v)) / (2.0 * h);
            let by_alpha_dot = (shifted(x, v + step) - shifted(x, v - step)) / (2.0 * h);
            let close = |exact: Vector2<f64>, seen: Vector2<f64>, scale: f64| (exact - seen).norm() < 1e-6 * scale;
            let scale = 1.0 + jacobian.by_alpha.norm();
            prop_assert!(close(jacobian.by_alpha.column(column).into(), by_alpha, scale), "{jacobian:?} {by_alpha}");
            prop_assert!(close(jacobian.by_alpha_dot.column(column).into(), by_alpha_dot, scale), "{by_alpha_dot}");
        }
    }

    #[test]
    fn points_accelerate_as_they_move(arm in any_arm(), state in any_state(), load in any_load()) {
        let a = arm.acceleration(&state, &load);
        let dt = 1e-5;
        let at = |dt| arm.points(&moved(&state, &a, dt).alpha_rad);
        let exact = arm.point_accelerations(&state, &a);
        let second = |f: fn(&Points) -> Vector2<f64>| (f(&at(dt)) - f(&at(0.0)) * 2.0 + f(&at(-dt))) / (dt * dt);
        let scale = 1.0 + exact.b_m_s2.norm() + exact.c_m_s2.norm();
        prop_assert!((second(|p| p.b_m) - exact.b_m_s2).norm() < 1e-3 * scale);
        prop_assert!((second(|p| p.c_m) - exact.c_m_s2).norm() < 1e-3 * scale);
    }

    /// Elbow up and elbow down: (β2, α, F_y) → (−β2, −α, −F_y) with β1 → −β1 mirrors the arm on the x axis.
    #[test]
    fn mirrored_arm_moves_mirrored(
        preset in prop::sample::select(&Preset::ALL[..]), b1 in -180.0..180.0, b2 in -180.0..180.0,
        state in any_state(), load in any_load(),
    ) {
        let mirror = |l: &Load| Load { torque_nm: -l.torque_nm, force_n: Vector2::new(l.force_n.x, -l.force_n.y) };
        let mirrored = State { alpha_rad: -state.alpha_rad, alpha_dot_rad_s: -state.alpha_dot_rad_s };
        let a = arm(preset, b1, b2).acceleration(&state, &load);
        // Without gravity, which breaks the symmetry.
        let b = arm(preset, -b1, -b2).acceleration(&mirrored, &mirror(&load));
        prop_assert!((a + b).norm() <= 1e-12 * a.norm());
    }
}

proptest! {
    /// At α = 0 springs and weight balance, the arm is at rest, and its energy is least.
    #[test]
    fn rests_in_the_static_equilibrium(arm in any_arm(), state in any_state()) {
        let sag = arm.static_deflection_rad();
        let left_over = arm.stiffness_matrix() * sag + weight_torque(arm.parameters(), relaxed_angles(&arm) + sag);
        prop_assert!(left_over.norm() < 1e-9, "{left_over}");
        prop_assert_eq!(arm.acceleration(&State::default(), &Load::default()), Vector2::zeros());
        prop_assert_eq!(arm.energy(&State::default()).total_j(), 0.0);
        prop_assert!(arm.energy(&state).potential_j > 0.0, "{state:?}");
        prop_assert_eq!(sag == Vector2::zeros(), arm.parameters().gravity.is_none());
    }
}

/// A hanging arm is a pendulum: with negligible springs it swings at √(g m lc / I), here for both links as one.
#[test]
fn hanging_arm_with_soft_springs_is_a_pendulum() {
    let preset = Preset::Irb1600Fitted.parameters().unwrap();
    let gravity = Some(Gravity { gravity_m_s2: 9.806_65, mass1_kg: 20.0, centre1_m: 0.3 });
    let parameters = Parameters { stiffness1_nm_rad: 1e-9, gravity, ..preset };
    let arm = Arm::new(parameters, Pose { beta1_deg: -90.0, beta2_deg: 0.0 }).unwrap();
    let moment = 9.806_65 * (20.0 * 0.3 + 50.58 * (0.63 + 0.1));
    let inertia = 0.55 + 1.5 + 50.58 * (0.63_f64 + 0.1).powi(2);
    let expected = (moment / inertia).sqrt();
    let seen = arm.angular_frequencies_rad_s()[0];
    // The elbow's spring, 128 kN·m/rad, gives a little.
    assert!((seen / expected - 1.0).abs() < 1e-3, "{seen} {expected}");
}

#[test]
fn presets_are_table_1_and_its_fit() {
    let [table1, fitted] = Preset::ALL.map(|preset| preset.parameters().unwrap());
    assert_eq!(Parameters { inertia2_kg_m2: 1.5, ..table1 }, fitted);
    assert_eq!(table1.inertia2_kg_m2, 0.0009);
    let arm = arm(Preset::Irb1600Fitted, 0.0, 60.0);
    let expected = Matrix2::new(0.55 + 1.5 + 50.58 * (0.63 * 0.63 + 0.01) + 50.58 * 0.63 * 0.1, 0.0, 0.0, 2.0058);
    let m = arm.mass_matrix(&Vector2::zeros());
    assert!((m.m11 - expected.m11).abs() < 1e-12 && (m.m22 - expected.m22).abs() < 1e-12);
}

#[test]
fn says_what_is_wrong_with_an_arm() {
    let good = Preset::Irb1600Fitted.parameters().unwrap();
    let says = |parameters, pose| Arm::new(parameters, pose).unwrap_err().to_string();
    let pose = Pose::default();
    insta::assert_snapshot!(says(Parameters { mass2_kg: -1.0, ..good }, pose), @"arm parameter `mass2_kg` is -1: it must be a positive number");
    insta::assert_snapshot!(says(Parameters { damping2_nm_s_rad: f64::NAN, ..good }, pose), @"arm parameter `damping2_nm_s_rad` is NaN: it must be zero or a positive number");
    insta::assert_snapshot!(says(good, Pose { beta2_deg: f64::NAN, ..pose }), @"pose angle `beta2_deg` is NaN: it must be a number from -360 to 360 degrees");
    let gravity = Gravity { gravity_m_s2: 9.81, mass1_kg: -3.0, centre1_m: 0.3 };
    insta::assert_snapshot!(says(Parameters { gravity: Some(gravity), ..good }, pose), @"arm parameter `mass1_kg` is -3: it must be zero or a positive number");
    let weak = Parameters { stiffness1_nm_rad: 100.0, gravity: Some(Gravity { mass1_kg: 20.0, ..gravity }), ..good };
    insta::assert_snapshot!(says(weak, Pose { beta1_deg: 90.0, beta2_deg: 0.0 }), @"the joints can't hold the arm's weight at 9.81 m/s²: no stable equilibrium is found from this pose; raise the stiffnesses or lower the masses");
    let thin = Parameters { inertia1_kg_m2: 1e-20, inertia2_kg_m2: 1e-20, ..good };
    insta::assert_snapshot!(says(thin, pose), @"the mass matrix of the straight arm has a determinant of 1.7e-16 of the product of its inertias: it must be at least 1e-6; raise `inertia1_kg_m2` or `inertia2_kg_m2`, or lower `mass2_kg`");
    insta::assert_snapshot!(says(Parameters { mass2_kg: 1e308, ..good }, pose), @"the mass matrix of the straight arm has a determinant of NaN of the product of its inertias: it must be at least 1e-6; raise `inertia1_kg_m2` or `inertia2_kg_m2`, or lower `mass2_kg`");
    let loose = Parameters { stiffness1_nm_rad: 1e-200, stiffness2_nm_rad: 1e-200, ..good };
    insta::assert_snapshot!(says(loose, pose), @"the arm's natural frequencies come out as 0e0 and 1.1216738969513605e-101 Hz: they must be positive and finite; stiffnesses and inertias are out of proportion");
    insta::assert_snapshot!("irb1600".parse::<Preset>().unwrap_err(), @"there is no preset `irb1600`: the presets are irb1600-table1, irb1600-fitted");
}
