//! Units of an FMU's variables, by the factor and the offset of their `BaseUnit`: SI = factor · value + offset.

use std::collections::BTreeMap;

use roxmltree::Node;

/// The base units in the order of exponents; radian counts for nothing, as 1 rad = 1.
const NAMES: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];

/// Exponents of base units.
pub(crate) type Exponents = [i32; NAMES.len()];

/// A unit by its exponents, factor and offset in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    /// Exponents; `None` of a unit that doesn't say what it is in SI.
    pub exponents: Option<Exponents>,
    pub factor: f64,
    pub offset: f64,
}

/// A conversion to SI and back; without one the number is the same to the last bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conversion {
    factor: f64,
    offset: f64,
}

impl Conversion {
    /// The conversion that leaves every number unchanged.
    pub const NONE: Conversion = Conversion { factor: 1.0, offset: 0.0 };

    pub fn new(factor: f64, offset: f64) -> Conversion {
        Conversion { factor, offset }
    }

    /// The SI value of a variable's value.
    pub fn to_si(self, value: f64) -> f64 {
        // The number is passed on as it is: 1 · x + 0 would turn −0 into +0.
        if self == Conversion::NONE { value } else { self.factor * value + self.offset }
    }

    /// The value of a variable for an SI value.
    pub fn of_si(self, si: f64) -> f64 {
        if self == Conversion::NONE { si } else { (si - self.offset) / self.factor }
    }
}

/// Exponents in words: `kg·m·s^-2`.
pub(crate) fn words(exponents: &Exponents) -> String {
    let part = |(name, exponent): (&str, &i32)| match exponent {
        0 => None,
        1 => Some(name.to_owned()),
        other => Some(format!("{name}^{other}")),
    };
    let parts: Vec<String> = NAMES.into_iter().zip(exponents).filter_map(part).collect();
    if parts.is_empty() { String::from("1") } else { parts.join("·") }
}

/// The units that a description defines, by name. A number that can't be read leaves a unit unknown.
pub(crate) fn read(root: &Node<'_, '_>) -> BTreeMap<String, Unit> {
    let units = root.children().filter(|node| node.has_tag_name("UnitDefinitions")).flat_map(|node| node.children());
    let unit = |node: Node<'_, '_>| {
        let name = node.attribute("name")?.to_owned();
        let base = node.children().find(|node| node.has_tag_name("BaseUnit"));
        let number = |base: &Node<'_, '_>, key: &str, default: f64| match base.attribute(key) {
            None => Some(default),
            Some(text) => text.trim().parse().ok().filter(|number: &f64| number.is_finite()),
        };
        let known = base.and_then(|base| {
            let factor = number(&base, "factor", 1.0)?;
            let offset = number(&base, "offset", 0.0)?;
            let mut exponents = [0; NAMES.len()];
            for (exponent, key) in exponents.iter_mut().zip(NAMES) {
                *exponent = number(&base, key, 0.0)? as i32;
            }
            (factor != 0.0).then_some(Unit { exponents: Some(exponents), factor, offset })
        });
        Some((name, known.unwrap_or(Unit { exponents: None, factor: 1.0, offset: 0.0 })))
    };
    units.filter(|node| node.has_tag_name("Unit")).filter_map(unit).collect()
}
