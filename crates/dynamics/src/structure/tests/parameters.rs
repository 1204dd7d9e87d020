//! Parameters by name: a structure with another value is the one that a specification with that value makes.

use super::*;

/// A parameter of a link has the name of the link's key in a scenario, and changes nothing else.
#[test]
fn parameters_of_links_are_their_keys() {
    let chain = chain_of(&oracles("chains")[2]);
    let structure = assembly(BodySpec::Chain(chain.clone()), vec![]);
    let key = |parameter: &Parameter| parameter.to_string().strip_prefix("link2.").map(str::to_string);
    let of_link: Vec<Parameter> = structure.parameters().into_iter().filter(|found| key(found).is_some()).collect();
    assert_eq!(of_link.len(), 8);
    for parameter in of_link {
        let (key, value) = (key(&parameter).unwrap(), structure.value(parameter).unwrap());
        let wanted = if value == 0.0 { 0.01 } else { 1.01 * value };
        let mut expected = chain.clone();
        let mut link = serde_json::to_value(chain.links[1]).unwrap();
        link[key] = wanted.into();
        expected.links[1] = serde_json::from_value(link).unwrap();
        assert_eq!(structure.with(parameter, wanted).unwrap(), assembly(BodySpec::Chain(expected), vec![]));
        assert_eq!(structure.parameter(&parameter.to_string()), Ok(parameter));
    }
}

/// The keys of elements have the unit of their place; values are checked as those of a specification.
#[test]
fn parameters_of_modes_and_elements() {
    let contact = Law::KelvinVoigt { stiffness: 1e5, damping: 0.0, gap: 1e-3, side: Side::Positive, preload: 0.0 };
    let structure = two_modes(vec![grounded(along("tip", Axis::X), contact)]);
    let names: Vec<String> = structure.parameters().iter().map(ToString::to_string).collect();
    assert_eq!(
        names,
        [
            "mode1.frequency_hz",
            "mode1.damping_ratio",
            "mode2.frequency_hz",
            "mode2.damping_ratio",
            "element1.stiffness_n_m",
            "element1.damping_n_s_m",
            "element1.gap_m",
            "element1.preload_n"
        ]
    );
    let gap = structure.parameter("element1.gap_m").unwrap();
    assert_eq!((gap.unit(), structure.value(gap)), ("m", Ok(1e-3)));
    assert_eq!(structure.with(gap, 2e-3).unwrap().value(gap), Ok(2e-3));
    insta::assert_snapshot!(structure.with(gap, -1.0).unwrap_err(), @"element 1, kelvin-voigt: `gap` is -1: it must be zero or a positive number");
    insta::assert_snapshot!(two_modes(vec![]).value(gap).unwrap_err(), @"there is no parameter `element1.gap_m` in this structure: expected one of mode1.frequency_hz, mode1.damping_ratio, mode2.frequency_hz, mode2.damping_ratio");
}
