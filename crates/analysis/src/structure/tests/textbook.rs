//! Structures whose bifurcations are known from the literature.

use super::*;
use crate::continuation::ContinuationSettings;

/// A link with a spring at its joint and no damper, of inertia 1 kg·m², under an axial force at its tip: q̈ + k q + F l
/// sin Ωt sin q = 0.
fn link(stiffness_nm_rad: f64) -> Assembly {
    let link = Link {
        length_m: 1.0,
        mass_kg: 0.5,
        centre_of_mass_m: 1.0,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: 0.5,
        angle_deg: 0.0,
        stiffness_nm_rad,
        damping_nm_s_rad: 0.0,
    };
    let body = BodySpec::Chain(ChainSpec { links: vec![link], gravity_m_s2: 0.0, unstated: vec![] });
    Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap()
}

/// Small motions of the link follow Mathieu's equation, q̈ + (a − 2q cos 2t) q = 0 with a = k, 2q = F l and t shifted. At
/// q = 1 its characteristic values are a₁ = 1.859108072514, b₂ = 3.917024772998 and a₂ = 4.371300982735 (M. Abramowitz,
/// I. A. Stegun, "Handbook of Mathematical Functions", 1964, Ch. 20). At a₁ a motion of period 2π appears, twice that of
/// the force: a multiplier is −1. At b₂ and a₂ one of period π does: a multiplier is 1, and since rest stays a motion,
/// they are branch points.
#[test]
fn a_link_under_an_axial_force_has_the_characteristic_values_of_mathieu() {
    let assembly = link(0.5);
    let tip = assembly.dof("tip.x").unwrap();
    let stiffness = Coordinate::Parameter(assembly.parameter("link1.stiffness_nm_rad").unwrap());
    let forced = Forced::new(assembly, tip, 2.0);
    let mut options = TraceOptions::new(&forced, stiffness, [0.5, 6.0], vec![tip]);
    // Rest needs no harmonics, but the motions that leave it do.
    options.branch.least_harmonics = 9;
    options.branch.continuation = ContinuationSettings { state_floor: 0.1, ..options.branch.continuation };
    let branch = super::super::trace(&forced, 2.0 / TAU, stiffness, &options).unwrap();
    let expected = [
        (BifurcationKind::PeriodDoubling, 1.859_108_072_514_364),
        (BifurcationKind::BranchPoint, 3.917_024_772_998_471),
        (BifurcationKind::BranchPoint, 4.371_300_982_735_085),
    ];
    let found: Vec<_> = branch.bifurcations.iter().map(|found| (found.kind, found.orbit.value)).collect();
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.0, expected.0, "{found:?}");
        near(found.1, expected.1, 1e-9);
    }
}
