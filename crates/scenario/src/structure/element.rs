//! Nonlinear and linear point elements of a structure, as a scenario states them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::element_kind::ElementKind;
use super::error::StructureSectionError;
use crate::nearest::nearest;
use resonarm_dynamics::structure::{Axis, ElementSpec, Law, Place, Side, Term, falls_along};

/// Where an element acts against the ground.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "`at` must be a point and an axis, as in \"tip.x\", or a list of them")]
pub enum At {
    /// A point and an axis, such as `tip.x`.
    One(String),
    /// The displacements of a polynomial: points with their axes, or joints, such as `joint2`.
    Several(Vec<String>),
}

/// A point element. Its values have the unit in their key: `stiffness_n_m` along an axis, `stiffness_nm_rad` at a
/// joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElementSection {
    /// Law of the element.
    pub kind: ElementKind,
    /// Point and axis that it acts at against the ground, such as `tip.x`; of a polynomial a list.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<At>,
    /// The joint of a chain that it acts about, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<usize>,
    /// Two ends of the element, where neither is the ground.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between: Option<[String; 2]>,
    /// Side of its axis on which a contact is; positive without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<Side>,
    /// Terms of a polynomial's potential.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<Term>,
    /// Parameters of the law, by keys that end in their unit.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

/// Suffix of a key by its unit: for an element along an axis, and for one at a joint.
#[derive(Clone, Copy)]
struct Unit(&'static str, &'static str);

const STIFFNESS: Unit = Unit("n_m", "nm_rad");
const STIFFNESS3: Unit = Unit("n_m3", "nm_rad3");
const STIFFNESS5: Unit = Unit("n_m5", "nm_rad5");
const DAMPING: Unit = Unit("n_s_m", "nm_s_rad");
const LENGTH: Unit = Unit("m", "rad");
const VELOCITY: Unit = Unit("m_s", "rad_s");
const FORCE: Unit = Unit("n", "nm");
const HERTZ: Unit = Unit("n_m1_5", "nm_rad1_5");
const DISSIPATION: Unit = Unit("s_m", "s_rad");

/// Reads the parameters of an element one by one and remembers which keys the law knows.
struct Values<'a> {
    number: usize,
    is_joint: bool,
    given: &'a BTreeMap<String, f64>,
    known: Vec<String>,
}

impl Values<'_> {
    fn key(&mut self, name: &str, unit: Unit) -> String {
        let key = format!("{name}_{}", if self.is_joint { unit.1 } else { unit.0 });
        self.known.push(key.clone());
        key
    }

    fn optional(&mut self, name: &str, unit: Unit) -> Option<f64> {
        let key = self.key(name, unit);
        self.given.get(&key).copied()
    }

    fn required(&mut self, name: &str, unit: Unit) -> Result<f64, StructureSectionError> {
        let key = self.key(name, unit);
        if let Some(value) = self.given.get(&key) {
            return Ok(*value);
        }
        let element = self.number;
        let is_joint = self.is_joint;
        // A value in the unit of the other kind of place is the usual mistake. The error then names the key to
        // use, not only the missing one.
        let got = format!("{name}_{}", if is_joint { unit.0 } else { unit.1 });
        Err(if self.given.contains_key(&got) {
            StructureSectionError::ElementUnit { element, got, key, is_joint }
        } else {
            StructureSectionError::ElementKeyMissing { element, key }
        })
    }

    /// Rejects keys that the law does not know.
    fn finish(self) -> Result<(), StructureSectionError> {
        let Some(key) = self.given.keys().find(|key| !self.known.contains(key)) else { return Ok(()) };
        // The first word of a key is the same for both kinds of place, whatever the unit behind it: stiffness, gap,
        // slip.
        let stem = |key: &str| key.split('_').next().unwrap_or_default().to_owned();
        // The same value in the unit of the other kind of place is nearer than any spelling.
        let same = self.known.iter().find(|known| stem(known) == stem(key)).cloned();
        let nearest = same.or_else(|| nearest(key, self.known.iter().map(String::as_str)));
        let known = self.known.join(", ");
        Err(StructureSectionError::ElementKeyUnknown { element: self.number, key: key.clone(), nearest, known })
    }
}

impl ElementSection {
    /// Returns the place in words: `at tip.x`, `at joint 2`, `between tip.x and mid.x`.
    pub fn place(&self) -> String {
        match (&self.at, self.joint, &self.between) {
            (Some(At::One(at)), _, _) => format!("at {at}"),
            (Some(At::Several(at)), _, _) => format!("at {}", at.join(", ")),
            (None, Some(joint), _) => format!("at joint {joint}"),
            (None, None, Some([at, to])) => format!("between {at} and {to}"),
            (None, None, None) => String::from("nowhere"),
        }
    }

    /// Converts the section to the element of the dynamics; `number` counts from 1.
    pub(super) fn spec(&self, number: usize) -> Result<ElementSpec, StructureSectionError> {
        if self.kind == ElementKind::Polynomial {
            return self.polynomial(number);
        }
        if !self.terms.is_empty() {
            return Err(StructureSectionError::TermsIdle { element: number, kind: self.kind });
        }
        let (at, to) = self.ends(number)?;
        let is_joint = matches!(at, Place::Joint(_));
        let mut values = Values { number, is_joint, given: &self.values, known: Vec::new() };
        // The law comes first: it asks for its keys and so tells `finish` which ones are known.
        let law = self.law(&mut values)?;
        values.finish()?;
        match (self.side, &law) {
            (None, _) | (_, Law::KelvinVoigt { .. } | Law::HuntCrossley { .. }) => {
                Ok(ElementSpec::Point { at, to, law })
            }
            (Some(_), _) => Err(StructureSectionError::SideIdle { element: number }),
        }
    }

    /// Converts a section of kind `polynomial`.
    fn polynomial(&self, number: usize) -> Result<ElementSpec, StructureSectionError> {
        let at = match (&self.at, self.joint, &self.between) {
            (Some(At::One(at)), None, None) => core::slice::from_ref(at),
            (Some(At::Several(at)), None, None) => &at[..],
            _ => return Err(StructureSectionError::PolynomialPlace { element: number }),
        };
        if let Some(key) = self.values.keys().next() {
            let key = key.clone();
            let known = String::from("at, terms");
            return Err(StructureSectionError::ElementKeyUnknown { element: number, key, nearest: None, known });
        }
        if self.side.is_some() {
            return Err(StructureSectionError::SideIdle { element: number });
        }
        let at = at.iter().map(|at| place(at)).collect::<Result<_, _>>()?;
        Ok(ElementSpec::Polynomial { at, terms: self.terms.clone() })
    }

    /// Returns a warning if the potential of a polynomial falls without bound by itself.
    pub(super) fn unbounded(&self, number: usize) -> Option<String> {
        let names = match &self.at {
            Some(At::One(at)) => core::slice::from_ref(at),
            Some(At::Several(at)) => &at[..],
            None => &[],
        };
        let along = falls_along(&self.terms)?.into_iter().zip(names).filter(|(along, _)| *along != 0);
        let along = along.map(|(along, name)| format!("{}{name}", if along < 0 { "-" } else { "" }));
        Some(format!(
            "structure.elements, number {number}: the potential falls without bound along {}: beyond a certain load the \
             structure runs away, unless other elements hold it; terms of even degree bound the potential",
            along.collect::<Vec<_>>().join(", ")
        ))
    }

    fn ends(&self, number: usize) -> Result<(Place, Option<Place>), StructureSectionError> {
        match (&self.at, self.joint, &self.between) {
            (Some(At::One(at)), None, None) => Ok((place(at)?, None)),
            (Some(At::Several(at)), None, None) => {
                Err(StructureSectionError::SeveralPlaces { element: number, got: at.len(), kind: self.kind })
            }
            (None, Some(joint), None) => Ok((Place::Joint(joint), None)),
            (None, None, Some([at, to])) => Ok((place(at)?, Some(place(to)?))),
            _ => Err(StructureSectionError::ElementPlace { element: number }),
        }
    }

    fn law(&self, values: &mut Values<'_>) -> Result<Law, StructureSectionError> {
        let side = self.side.unwrap_or_default();
        Ok(match self.kind {
            ElementKind::Cubic => Law::Cubic {
                stiffness3: values.required("stiffness3", STIFFNESS3)?,
                stiffness5: values.optional("stiffness5", STIFFNESS5).unwrap_or(0.0),
            },
            ElementKind::Gap => Law::Gap {
                stiffness: values.required("stiffness", STIFFNESS)?,
                gap: values.required("gap", LENGTH)?,
                preload: values.optional("preload", FORCE).unwrap_or(0.0),
            },
            // The presence of `dissipation` chooses the model, since a Hunt–Crossley stiffness has another unit
            // (N/m^1.5) than a Kelvin–Voigt one.
            ElementKind::Contact => match values.optional("dissipation", DISSIPATION) {
                Some(damping) => {
                    let stiffness = values.required("stiffness", HERTZ)?;
                    let (gap, preload) = gap_or_preload(values)?;
                    Law::HuntCrossley { stiffness, damping, gap, side, preload }
                }
                None => {
                    let stiffness = values.required("stiffness", STIFFNESS)?;
                    let damping = values.optional("damping", DAMPING).unwrap_or(0.0);
                    let (gap, preload) = gap_or_preload(values)?;
                    Law::KelvinVoigt { stiffness, damping, gap, side, preload }
                }
            },
            ElementKind::Friction => {
                let slip = slip(values)?;
                Law::Friction { stiffness: values.required("stiffness", STIFFNESS)?, slip }
            }
            ElementKind::Lugre => {
                let coulomb = slip(values)?;
                Law::Lugre {
                    bristle_stiffness: values.required("stiffness", STIFFNESS)?,
                    bristle_damping: values.optional("damping", DAMPING).unwrap_or(0.0),
                    viscous: values.optional("viscous", DAMPING).unwrap_or(0.0),
                    coulomb,
                    breakaway: values.optional("breakaway", FORCE).unwrap_or(coulomb),
                    stribeck: values.required("stribeck", VELOCITY)?,
                }
            }
            ElementKind::Linear => {
                let [stiffness, damping] =
                    [("stiffness", STIFFNESS), ("damping", DAMPING)].map(|(name, unit)| values.optional(name, unit));
                // Either value may be missing, but not both. An element with a value in the wrong unit is not
                // empty and gets the error of `finish`, which names the right key.
                if self.values.is_empty() {
                    values.required("stiffness", STIFFNESS)?;
                }
                Law::Linear { stiffness: stiffness.unwrap_or(0.0), damping: damping.unwrap_or(0.0) }
            }
            ElementKind::Tanh => Law::Tanh { slip: slip(values)?, velocity: values.required("velocity", VELOCITY)? },
            // `spec` has taken polynomials, whose forces follow no law of one displacement.
            ElementKind::Polynomial => {
                return Err(StructureSectionError::PolynomialPlace { element: values.number });
            }
        })
    }
}

/// Reads `slip_force_n` along an axis, or `slip_torque_nm` at a joint.
fn slip(values: &mut Values<'_>) -> Result<f64, StructureSectionError> {
    let name = if values.is_joint { "slip_torque" } else { "slip_force" };
    values.required(name, FORCE)
}

/// Reads the gap of a contact, and its preload; with one the gap may be left out.
fn gap_or_preload(values: &mut Values<'_>) -> Result<(f64, f64), StructureSectionError> {
    let preload = values.optional("preload", FORCE);
    let gap = if preload.is_some() { values.optional("gap", LENGTH) } else { Some(values.required("gap", LENGTH)?) };
    Ok((gap.unwrap_or(0.0), preload.unwrap_or(0.0)))
}

/// Parses a place: `tip.x`, or, in a chain, `joint2`.
pub(super) fn place(text: &str) -> Result<Place, StructureSectionError> {
    let unknown = || StructureSectionError::Place { got: text.to_owned() };
    match text.split_once('.') {
        Some((point, axis)) => {
            let axis = Axis::ALL.into_iter().find(|known| known.name() == axis).ok_or_else(unknown)?;
            Ok(Place::Dof { point: point.to_owned(), axis })
        }
        None => {
            let number = text.strip_prefix("joint").and_then(|number| number.parse().ok()).ok_or_else(unknown)?;
            Ok(Place::Joint(number))
        }
    }
}
