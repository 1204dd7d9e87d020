//! The drawing of the structure under test, and the positions of its points as it moves.
//!
//! Links are drawn with their turns m times as large: link i at the angle θ_i = θ₀_i + m Σ_{k≤i} α_k, its end l_i (cos
//! θ_i, sin θ_i) from that of the link before. Modal structures are drawn with their displacements m times as large:
//! p_a = p₀_a + m Σ_k φ_ak q_k along each axis a.

use std::collections::BTreeMap;

use serde::Serialize;

use resonarm_dynamics::structure::{Assembly, Axis};
use resonarm_scenario::{Scenario, ScenarioError, StructureSection};

/// Largest turn of a link in the drawing if the magnification is chosen automatically, rad.
const DRAWN_RAD: f64 = 0.22;
/// Largest displacement by modes in the drawing then, relative to the size of the structure.
const DRAWN_OF_SIZE: f64 = 0.12;

/// Relation of the points to the coordinates.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DrawnMotion {
    /// The turns of links move the points.
    Links {
        /// Lengths of the links, m.
        lengths_m: Vec<f64>,
        /// Their angles at rest against the x axis, rad.
        angles_rad: Vec<f64>,
    },
    /// Shapes move the points: for each point along x, y and z the displacement by each coordinate, 1/√kg; empty where
    /// there is none.
    Shapes(Vec<[Vec<f64>; 3]>),
}

/// A structure as lines between points in the base frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drawing {
    /// The names of its points.
    pub points: Vec<String>,
    /// Positions of the points at rest, along x, y and z, m.
    pub rest_m: Vec<[f64; 3]>,
    /// Lines from point to point, by their places in `points`.
    pub lines: Vec<Vec<usize>>,
    /// Relation of the points to the coordinates.
    pub motion: DrawnMotion,
}

impl Drawing {
    /// Draws the structure of a scenario; `None` if the positions of its points are not known: for modes without
    /// places, a structure that a program makes, and an FMU.
    ///
    /// # Errors
    /// [`ScenarioError`] if the scenario has no valid structure.
    pub fn of(scenario: &Scenario) -> Result<Option<Drawing>, ScenarioError> {
        if scenario.foreign_structure().is_some() {
            return Ok(None);
        }
        Ok(Drawing::of_assembly(&scenario.structure, &scenario.under_test()?.assembly))
    }

    /// Draws the structure of a section; `None` for modes without places.
    pub fn of_assembly(section: &StructureSection, assembly: &Assembly) -> Option<Drawing> {
        match assembly.rest_m() {
            Some(rest_m) => Some(Drawing::of_links(assembly.points(), &rest_m)),
            None => Drawing::of_modes(section, assembly),
        }
    }

    fn of_links(points: Vec<String>, rest_m: &[[f64; 2]]) -> Drawing {
        let links = || rest_m.windows(2).map(|ends| [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]]);
        Drawing {
            lines: vec![(0..points.len()).collect()],
            points,
            rest_m: rest_m.iter().map(|[x, y]| [*x, *y, 0.0]).collect(),
            motion: DrawnMotion::Links {
                lengths_m: links().map(|[x, y]| libm::hypot(x, y)).collect(),
                angles_rad: links().map(|[x, y]| libm::atan2(y, x)).collect(),
            },
        }
    }

    /// Draws the points that have places. A point that no shape moves is at rest.
    fn of_modes(section: &StructureSection, assembly: &Assembly) -> Option<Drawing> {
        let shape = |name: &str, axis: Axis| {
            let dof = assembly.dof(&format!("{name}.{axis}")).ok()?;
            Some(assembly.direction_at_rest(dof))
        };
        let shapes = |name: &String| Axis::ALL.map(|axis| shape(name, axis).unwrap_or_default());
        let points: Vec<String> = section.points.keys().cloned().collect();
        let place = |name: &String| points.iter().position(|point| point == name);
        let drawing = Drawing {
            rest_m: section.points.values().copied().collect(),
            lines: section.lines.iter().map(|line| line.iter().filter_map(place).collect()).collect(),
            motion: DrawnMotion::Shapes(points.iter().map(shapes).collect()),
            points,
        };
        (!drawing.points.is_empty()).then_some(drawing)
    }

    /// Returns the positions of the points at rest by their names, m, and the lines by the names of their points.
    pub fn named(&self) -> (BTreeMap<String, [f64; 3]>, Vec<Vec<String>>) {
        let name = |place: &usize| self.points.get(*place).cloned();
        (
            self.points.iter().cloned().zip(self.rest_m.iter().copied()).collect(),
            self.lines.iter().map(|line| line.iter().filter_map(name).collect()).collect(),
        )
    }

    /// Returns the positions of the points at these coordinates, the vibration `magnification` times as large, m.
    pub fn positions_m(&self, coordinates: &[f64], magnification: f64) -> Vec<[f64; 3]> {
        match &self.motion {
            DrawnMotion::Links { lengths_m, angles_rad } => {
                let mut end = self.rest_m.first().copied().unwrap_or_default();
                let mut positions = vec![end];
                let links = lengths_m.iter().zip(angles_rad).zip(turns(coordinates));
                positions.extend(links.map(|((length, rest), turn)| {
                    let (sine, cosine) = libm::sincos(rest + magnification * turn);
                    end = [end[0] + length * cosine, end[1] + length * sine, end[2]];
                    end
                }));
                positions
            }
            DrawnMotion::Shapes(shapes) => {
                let moved = |(rest, shapes): (&[f64; 3], &[Vec<f64>; 3])| {
                    let by = displacement(shapes, coordinates);
                    [0, 1, 2].map(|axis| rest[axis] + magnification * by[axis])
                };
                self.rest_m.iter().zip(shapes).map(moved).collect()
            }
        }
    }

    /// Returns the size of the vibration in the picture, relative to the largest that is drawn if the magnification is
    /// chosen automatically: the largest turn of a link, or the largest displacement relative to the size.
    pub fn vibration(&self, coordinates: &[f64]) -> f64 {
        match &self.motion {
            DrawnMotion::Links { .. } => turns(coordinates).map(f64::abs).fold(0.0, f64::max) / DRAWN_RAD,
            DrawnMotion::Shapes(shapes) => {
                let far = |shapes| norm(displacement(shapes, coordinates));
                // Relative to the size of the structure, so that a plate and a tower fill the picture alike.
                shapes.iter().map(far).fold(0.0, f64::max) / (DRAWN_OF_SIZE * self.size_m())
            }
        }
    }

    /// Returns the diagonal of the box around the points at rest, m; 1 m for a single point.
    pub fn size_m(&self) -> f64 {
        let range = |axis: usize| {
            let along = || self.rest_m.iter().map(|point| point[axis]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        let size = norm([0, 1, 2].map(range));
        // A single point has no size, and no points make it infinite. Widths of lines need a positive number.
        if size.is_finite() && size > 0.0 { size } else { 1.0 }
    }
}

/// Returns the turns of links: sums of the deflections of their joints from the base out.
fn turns(coordinates: &[f64]) -> impl Iterator<Item = f64> {
    coordinates.iter().scan(0.0, |turn, deflection| {
        *turn += deflection;
        Some(*turn)
    })
}

fn displacement(shapes: &[Vec<f64>; 3], coordinates: &[f64]) -> [f64; 3] {
    shapes.each_ref().map(|shape| shape.iter().zip(coordinates).map(|(shape, q)| shape * q).sum())
}

fn norm([x, y, z]: [f64; 3]) -> f64 {
    libm::hypot(libm::hypot(x, y), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing(text: &str) -> Option<Drawing> {
        Drawing::of(&Scenario::parse(text, "bench.toml").unwrap()).unwrap()
    }

    fn near(found: &[[f64; 3]], expected: &[[f64; 3]]) {
        let apart = found.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
        assert!(found.len() == expected.len() && apart.fold(0.0, f64::max) < 1e-12, "{found:?}, {expected:?}");
    }

    /// The arm has links of 0.63 and 0.6 m.
    #[test]
    fn the_arm_is_drawn_in_its_pose() {
        for (text, [beta1_deg, beta2_deg]) in [
            ("", [0.0_f64, 60.0]),
            ("structure.angles_deg = [25.0, -70.0]\n", [25.0, -70.0]),
            ("[structure]\n", [0.0, 60.0]),
        ] {
            let drawing = drawing(text).unwrap();
            assert_eq!(
                (&drawing.points[..], &drawing.lines[..]),
                (&["joint1", "joint2", "tip"].map(String::from)[..], &[vec![0, 1, 2]][..])
            );
            let first = beta1_deg.to_radians() + 0.06;
            let second = (beta1_deg + beta2_deg).to_radians() + 0.04;
            let elbow = [0.63 * libm::cos(first), 0.63 * libm::sin(first), 0.0];
            let tip = [elbow[0] + 0.6 * libm::cos(second), elbow[1] + 0.6 * libm::sin(second), 0.0];
            near(&drawing.positions_m(&[3e-3, -1e-3], 20.0), &[[0.0; 3], elbow, tip]);
            assert!((drawing.vibration(&[3e-3, -5e-3]) - 3e-3 / 0.22).abs() < 1e-15);
        }
    }

    const CHAIN: &str = r#"
[structure]
kind = "chain"
links = [
  { length_m = 0.5, mass_kg = 10.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.3, angle_deg = 90.0, stiffness_nm_rad = 2e5, damping_nm_s_rad = 5.0 },
  { length_m = 0.4, mass_kg = 6.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.1, angle_deg = -90.0, stiffness_nm_rad = 1e5, damping_nm_s_rad = 3.0 },
  { length_m = 0.3, mass_kg = 3.0, centre_of_mass_m = 0.1, inertia_kg_m2 = 0.05, angle_deg = -90.0, stiffness_nm_rad = 5e4, damping_nm_s_rad = 1.0 },
]
"#;

    #[test]
    fn a_chain_is_drawn_link_by_link() {
        let drawing = drawing(CHAIN).unwrap();
        assert_eq!(drawing.lines, [vec![0, 1, 2, 3]]);
        assert_eq!(drawing.points, ["joint1", "joint2", "joint3", "tip"]);
        near(&drawing.rest_m, &[[0.0; 3], [0.0, 0.5, 0.0], [0.4, 0.5, 0.0], [0.4, 0.2, 0.0]]);
        // A quarter turn at the second joint, half of it drawn twice.
        let quarter = 0.25 * std::f64::consts::PI;
        near(
            &drawing.positions_m(&[0.0, quarter, 0.0], 2.0),
            &[[0.0; 3], [0.0, 0.5, 0.0], [0.0, 0.9, 0.0], [0.3, 0.9, 0.0]],
        );
        assert!((drawing.vibration(&[0.1, -0.3, 0.1]) - 0.2 / 0.22).abs() < 1e-15, "the turns are 0.1, −0.2, −0.1");
    }

    /// A joint that sags holds the weight of a link on a soft spring: k s = −m g lc cos(s) with the link along x.
    #[test]
    fn a_chain_is_drawn_as_it_hangs() {
        let one = CHAIN.lines().filter(|line| !line.contains("angle_deg = -90.0")).collect::<Vec<_>>().join("\n");
        let text = one.replace("angle_deg = 90.0", "angle_deg = 0.0").replace("2e5", "100.0");
        let hanging = drawing(&text.replace("kind =", "gravity_m_s2 = 9.81\nkind =")).unwrap();
        let DrawnMotion::Links { angles_rad, lengths_m } = &hanging.motion else { panic!("no links") };
        let sag = angles_rad[0];
        assert!(sag < -0.1 && (100.0 * sag + 10.0 * 9.81 * 0.2 * libm::cos(sag)).abs() < 1e-9, "{sag}");
        assert!((lengths_m[0] - 0.5).abs() < 1e-15);
    }

    const MODAL: &str = r#"
[structure]
kind = "modal"
lines = [["root", "mid", "tip"]]
[structure.points]
root = [0.0, 0.0, 0.0]
mid = [0.2, 0.0, 0.1]
tip = [0.4, 0.0, 0.3]
[[structure.modes]]
frequency_hz = 20
damping_ratio = 0.004
shape = { "tip.x" = 0.5, "mid.x" = 0.3, "tip.z" = 0.25 }
[[structure.modes]]
frequency_hz = 57.0
damping_ratio = 0.006
shape = { "tip.x" = -0.4, "mid.x" = 0.35, "tip.z" = 0.0 }
"#;

    #[test]
    fn modes_are_drawn_by_their_points() {
        let drawing = drawing(MODAL).unwrap();
        assert_eq!(
            (&drawing.points[..], &drawing.lines[..]),
            (&["mid", "root", "tip"].map(String::from)[..], &[vec![1, 0, 2]][..])
        );
        assert_eq!(drawing.size_m(), 0.5);
        // mid: 0.3·0.01 − 0.35·0.02 = −0.004; tip: 0.005 + 0.008 along x, 0.0025 along z.
        let q = [0.01, -0.02];
        near(&drawing.positions_m(&q, 10.0), &[[0.16, 0.0, 0.1], [0.0; 3], [0.53, 0.0, 0.325]]);
        let far = libm::hypot(0.013, 0.0025);
        assert!((drawing.vibration(&q) - far / (0.12 * 0.5)).abs() < 1e-12);
    }

    #[test]
    fn without_places_nothing_is_drawn() {
        let places = MODAL.split("[structure.points]").nth(1).unwrap().split("[[").next().unwrap();
        let bare = MODAL.replace(places, "\n").replace("lines = [[\"root\", \"mid\", \"tip\"]]\n", "");
        assert_eq!(drawing(&bare), None);
        assert_eq!(drawing("[structure]\nkind = \"own\"\n"), None);
    }
}
