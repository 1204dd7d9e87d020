//! Errors of structures, in words.

use insta::assert_snapshot;

use super::*;
use crate::integrate::Scheme;

fn three_links() -> ChainSpec {
    chain_of(&oracles("chains")[2])
}

fn chain_refused(change: impl Fn(&mut ChainSpec)) -> String {
    let mut chain = three_links();
    change(&mut chain);
    Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap_err().to_string()
}

#[test]
fn impossible_chains_are_refused() {
    let of_link = |change: fn(&mut Link)| chain_refused(|chain| change(&mut chain.links[1]));
    assert_snapshot!(chain_refused(|chain| chain.links.clear()), @"the structure has 0 links: it must have 1 to 8");
    assert_snapshot!(
        chain_refused(|chain| chain.links = vec![chain.links[0]; 9]),
        @"the structure has 9 links: it must have 1 to 8"
    );
    assert_snapshot!(
        of_link(|link| link.mass_kg = 0.0),
        @"link 2: `mass_kg` is 0: it must be a positive number"
    );
    assert_snapshot!(
        of_link(|link| link.mass_kg = -1.0),
        @"link 2: `mass_kg` is -1: it must be a positive number"
    );
    assert_snapshot!(
        of_link(|link| link.stiffness_nm_rad = f64::INFINITY),
        @"link 2: `stiffness_nm_rad` is inf: it must be a positive number"
    );
    assert_snapshot!(
        of_link(|link| link.centre_of_mass_m = f64::NAN),
        @"link 2: `centre_of_mass_m` is NaN: it must be a finite number"
    );
    assert_snapshot!(
        of_link(|link| link.damping_nm_s_rad = -0.5),
        @"link 2: `damping_nm_s_rad` is -0.5: it must be zero or a positive number"
    );
    assert_snapshot!(
        of_link(|link| link.angle_deg = 361.0),
        @"link 2: `angle_deg` is 361: it must be a number from -360 to 360 degrees"
    );
    assert_snapshot!(
        chain_refused(|chain| chain.gravity_m_s2 = -9.8),
        @"chain: `gravity_m_s2` is -9.8: it must be zero or a positive number"
    );
    assert_snapshot!(
        chain_refused(|chain| {
            chain.gravity_m_s2 = 9.80665;
            chain.links.iter_mut().for_each(|link| link.stiffness_nm_rad = 1.0);
        }),
        @"the joints can't hold the chain's weight at 9.80665 m/s²: no stable equilibrium is found from these angles; raise the stiffnesses or lower the masses"
    );
    assert_snapshot!(
        of_link(|link| link.stiffness_nm_rad = 1e-320),
        @"the structure's natural frequencies are computed as 5.3e-162 to 3.8e1 Hz: they must be positive and finite; check the proportion of stiffnesses and inertias"
    );
}

#[test]
fn impossible_modes_are_refused() {
    let refused = |change: fn(&mut ModalSpec)| {
        let BodySpec::Modal(mut modal) = two_modes(vec![]).spec().body.clone() else { unreachable!() };
        change(&mut modal);
        Assembly::new(&StructureSpec { body: BodySpec::Modal(modal), elements: vec![] }).unwrap_err().to_string()
    };
    assert_snapshot!(refused(|modal| modal.modes.clear()), @"the structure has 0 modes: it must have 1 to 32");
    assert_snapshot!(refused(|modal| modal.shapes.clear()), @"the structure has 0 shapes: it must have 1 to 256");
    assert_snapshot!(
        refused(|modal| modal.modes[1].frequency_hz = -0.1),
        @"mode 2: `frequency_hz` is -0.1: it must be a number from 0"
    );
    assert_snapshot!(
        refused(|modal| modal.modes[0].damping_ratio = f64::INFINITY),
        @"mode 1: `damping_ratio` is inf: it must be a number from 0"
    );
    assert_snapshot!(
        refused(|modal| modal.shapes[0].by_mode.push(0.1)),
        @"shape `tip.x` has 3 numbers: it must have one for each of the 2 modes"
    );
    assert_snapshot!(
        refused(|modal| modal.shapes[0].by_mode[1] = f64::NAN),
        @"shape tip.x: `by_mode` is NaN: it must be a finite number"
    );
    assert_snapshot!(
        refused(|modal| modal.shapes[1].point = "tip".into()),
        @"the shape `tip.x` is given twice: a point must have one for each axis"
    );
    assert_snapshot!(
        refused(|modal| modal.shapes[1].point = "a.b".into()),
        @"the name of a point is `a.b`: it must have at least one character, and no dot"
    );
}

const SPRING: Law = Law::Cubic { stiffness3: 1.0, stiffness5: 0.0 };
const GAP: Law = Law::Gap { stiffness: 1e5, gap: 0.001, preload: 0.0 };

fn elements_refused(body: BodySpec, elements: Vec<ElementSpec>) -> String {
    Assembly::new(&StructureSpec { body, elements }).unwrap_err().to_string()
}

#[test]
fn impossible_places_are_refused() {
    let chain = |elements| elements_refused(BodySpec::Chain(three_links()), elements);
    let modal = |elements| elements_refused(two_modes(vec![]).spec().body.clone(), elements);
    let between = |at, to| ElementSpec::Point { at, to: Some(to), law: SPRING };
    assert_snapshot!(
        chain(vec![grounded(along("tip", Axis::Z), SPRING)]),
        @"there is no `tip.z` in this structure: expected one of joint2.x, joint2.y, joint3.x, joint3.y, tip.x, tip.y, joint1, joint2, joint3"
    );
    assert_snapshot!(
        modal(vec![grounded(along("end", Axis::X), SPRING)]),
        @"there is no `end.x` in this structure: expected one of tip.x, mid.x"
    );
    assert_snapshot!(
        chain(vec![grounded(Place::Joint(4), SPRING)]),
        @"there is no joint 4: the chain has joints 1 to 3"
    );
    assert_snapshot!(
        modal(vec![grounded(Place::Joint(1), SPRING)]),
        @"there is no joint 1: a structure of modes has no joints; name a point and an axis"
    );
    assert_snapshot!(
        chain(vec![grounded(along("joint1", Axis::X), SPRING)]),
        @"element 1 acts at `joint1.x`, which doesn't move: leave `to` out for the ground"
    );
    assert_snapshot!(
        chain(vec![between(Place::Joint(1), along("tip", Axis::X))]),
        @"element 1 is between `joint 1` and `tip.x`: both ends must be points, or both joints"
    );
    assert_snapshot!(
        chain(vec![between(Place::Joint(1), Place::Joint(1))]),
        @"element 1 has both ends at `joint 1`: they must differ"
    );
    let contact = Law::KelvinVoigt { stiffness: 1e5, damping: 0.0, gap: 0.0, side: Side::Negative, preload: 0.0 };
    let tip = || along("tip", Axis::X);
    assert_snapshot!(
        modal(vec![grounded(tip(), SPRING), grounded(tip(), contact), grounded(tip(), GAP)]),
        @"elements 2 and 3 are both contacts at `tip.x` on the same side: combine them into one element"
    );
    assert_snapshot!(
        modal(vec![grounded(tip(), SPRING); 17]),
        @"the structure has 17 elements: it must have 0 to 16"
    );
}

#[test]
fn impossible_laws_are_refused() {
    let refused = |law| {
        let body = two_modes(vec![]).spec().body.clone();
        elements_refused(body, vec![grounded(along("tip", Axis::X), SPRING), grounded(along("tip", Axis::X), law)])
    };
    assert_snapshot!(
        refused(Law::Gap { stiffness: 1e5, gap: -0.001, preload: 0.0 }),
        @"element 2, gap: `gap` is -0.001: it must be zero or a positive number"
    );
    assert_snapshot!(
        refused(Law::Friction { stiffness: 1e5, slip: 0.0 }),
        @"element 2, friction: `slip` is 0: it must be a positive number"
    );
    assert_snapshot!(
        refused(Law::Cubic { stiffness3: f64::NAN, stiffness5: 0.0 }),
        @"element 2, cubic: `stiffness3` is NaN: it must be a finite number"
    );
    let lugre = Law::Lugre {
        bristle_stiffness: 1e4,
        bristle_damping: 1.0,
        viscous: 0.0,
        coulomb: 3.0,
        breakaway: 2.0,
        stribeck: 0.1,
    };
    assert_snapshot!(refused(lugre), @"element 2, lugre: `breakaway` is 2: it must be at least `coulomb`");
}

#[test]
fn impossible_steps_are_refused() {
    let chain = assembly(BodySpec::Chain(three_links()), vec![]);
    let refused =
        |assembly: &Assembly, scheme, rate_hz| Stepper::new(assembly, &[], scheme, rate_hz).unwrap_err().to_string();
    assert_snapshot!(
        refused(&chain, Scheme::Rk4, 0.0),
        @"the integration rate is 0 Hz: it must be a positive number"
    );
    assert_snapshot!(
        refused(&chain, Scheme::Rk4, 50.0),
        @"scheme rk4 is too coarse for this structure at 50 Hz: its fastest mode needs a rate of at least 116 Hz"
    );
    let stiff =
        two_modes(vec![grounded(along("tip", Axis::X), Law::Gap { stiffness: 1e13, gap: 0.001, preload: 0.0 })]);
    assert_snapshot!(
        refused(&stiff, Scheme::Rk4, 1000.0),
        @"the step at t = 0 s needs more than 256 parts for the stiffness of the elements: raise the integration rate to at least 19778 Hz, or check for an element that is far too stiff"
    );
    let mut stepper = Stepper::new(&chain, &[], Scheme::Exponential8, 1000.0).unwrap();
    assert_snapshot!(
        stepper.advance(0.0, &[1.0]).unwrap_err(),
        @"got 1 loads: expected 0, one for each degree of freedom of the drive"
    );
    assert_snapshot!(
        stepper.restore(&[0.0, f64::NAN]).unwrap_err(),
        @"the saved state has 1 finite numbers: expected 6, or 6 with the branches of the elements"
    );
}

#[test]
fn elements_on_the_base_are_refused() {
    let BodySpec::Modal(mut modal) = two_modes(vec![]).spec().body.clone() else { unreachable!() };
    modal.shapes.push(ShapeSpec { point: BASE.into(), axis: Axis::X, by_mode: vec![1.0, 0.5] });
    let law = Law::Cubic { stiffness3: 1.0, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: along("tip", Axis::X), to: Some(along(BASE, Axis::X)), law }];
    let refused = Assembly::new(&StructureSpec { body: BodySpec::Modal(modal), elements }).unwrap_err();
    assert_snapshot!(refused, @"element 1 acts at `base.x`, which doesn't move: leave `to` out for the ground");
}

/// A preset knows nothing of the weight of link 1: it says what is needed, and takes it in one go.
#[test]
fn values_that_a_preset_does_not_state_are_asked_for_where_they_count() {
    for preset in Preset::ALL {
        let spec = StructureSpec { body: BodySpec::Chain(preset.chain().unwrap()), elements: vec![] };
        let plain = Assembly::new(&spec).unwrap();
        let with = |values: &[(&str, f64)]| {
            let values: Vec<_> = values.iter().map(|(name, value)| (plain.parameter(name).unwrap(), *value)).collect();
            plain.with_all(&values).map_err(|error| error.to_string())
        };
        let (gravity, mass, centre) =
            (("gravity_m_s2", 9.81), ("link1.mass_kg", 40.0), ("link1.centre_of_mass_m", 0.1));
        insta::allow_duplicates! {
            assert_snapshot!(with(&[gravity]).unwrap_err(), @"gravity, and a centre of mass of link 1 away from its joint, need values that the source of this chain does not state: give link1.mass_kg, link1.centre_of_mass_m, link1.inertia_kg_m2; link1.inertia_kg_m2 is about the centre of mass, and the source states 0.55 kg·m² about the joint, which is mass_kg · centre_of_mass_m² more");
            assert_snapshot!(with(&[mass, centre]).unwrap_err(), @"gravity, and a centre of mass of link 1 away from its joint, need values that the source of this chain does not state: give link1.inertia_kg_m2; link1.inertia_kg_m2 is about the centre of mass, and the source states 0.55 kg·m² about the joint, which is mass_kg · centre_of_mass_m² more");
        }
        let inertia = ("link1.inertia_kg_m2", 0.55 - 40.0 * 0.1 * 0.1);
        let weighed = with(&[gravity, mass, centre, inertia]).unwrap();
        assert!(weighed.sag_rad().unwrap()[0] < 0.0);
        // Without gravity the link is the same wherever its centre of mass is said to be.
        let moved = with(&[mass, centre, inertia]).unwrap();
        for (mode, other) in plain.modes().iter().zip(moved.modes()) {
            assert!((mode.frequency_hz / other.frequency_hz - 1.0).abs() < 1e-14);
        }
    }
}
