//! The structure under test, as the live view shows it: how it is called, drawn and read.

use serde::Serialize;

use super::rows::{self, Plotted, Shown};
use super::test_panel::TestPanel;
use resonarm_bench::control::ResponsePoint;
use resonarm_bench::plant::{Placed, TestedAssembly};
use resonarm_bench::structure::Quantity;
use resonarm_files::drawing::Drawing;
use resonarm_files::recording::channels::Channels;
use resonarm_scenario::{Scenario, ScenarioError, StructureSection};

/// The structure under test.
#[derive(Clone, Debug)]
pub struct UnderTest {
    /// Name of the structure, in words.
    pub name: String,
    /// Channels of which its states and readings consist.
    pub table: Channels,
    /// Drawing of the structure; `None` if the positions of its points are unknown.
    pub drawing: Option<Drawing>,
    /// Vibration test that the scenario controls, if it does.
    pub test: Option<TestPanel>,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    /// A chain or modes.
    Assembly(Box<TestedAssembly>),
    /// One that a program makes, or an FMU: with how many joints torques act on.
    Foreign { joints: usize },
}

impl Kind {
    fn foreign(section: &StructureSection) -> Kind {
        let is_driven = |joint: &str| section.inputs.contains_key(joint);
        Kind::Foreign { joints: if is_driven("joint2") { 2 } else { usize::from(is_driven("joint1")) } }
    }
}

/// Channels that each panel of the page plots.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Panels {
    /// The commanded torques about joints.
    pub torque: Vec<Plotted>,
    /// Components of the commanded force.
    pub force: Vec<Plotted>,
    /// The force in the impedance head.
    pub head: Vec<Plotted>,
    /// The accelerations of B and C.
    pub acceleration_b: Vec<Plotted>,
    pub acceleration_c: Vec<Plotted>,
    /// Coordinates, and states of elements.
    pub coordinates: Vec<Plotted>,
    pub elements: Vec<Plotted>,
    /// The readings of the sensors beside B and C.
    pub sensors: Vec<Plotted>,
}

/// A size of the responses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResponseAxis {
    /// Name of the point or coordinate that responds.
    pub label: String,
    /// Title of the size in plots: what is read of the point or coordinate.
    pub title: String,
    /// Unit of the size.
    pub unit: &'static str,
}

/// The sizes of a response, in the order of the axes, and whether each comes from clipped readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Sizes {
    pub amplitude: Vec<f64>,
    pub clipped: Vec<bool>,
}

impl UnderTest {
    /// Describes the structure under test of a scenario, called `name`, with the channels `table`.
    ///
    /// # Errors
    /// [`ScenarioError`] if the scenario makes no structure.
    pub fn new(scenario: &Scenario, name: String, table: Channels) -> Result<UnderTest, ScenarioError> {
        let kind = match scenario.foreign_structure() {
            Some(section) => Kind::foreign(section),
            None => Kind::Assembly(scenario.under_test()?.into()),
        };
        Ok(UnderTest { name, table, drawing: Drawing::of(scenario)?, test: TestPanel::new(scenario), kind })
    }

    /// Frequencies of the modes, Hz.
    pub fn modes_hz(&self) -> Vec<f64> {
        match &self.kind {
            Kind::Assembly(tested) => tested.assembly.modes().iter().map(|mode| mode.frequency_hz).collect(),
            Kind::Foreign { .. } => Vec::new(),
        }
    }

    /// The points at which the rig is, those of the exciter, B and C; unknown of a program's own structure and of
    /// an FMU.
    pub fn rig(&self) -> Option<[String; 3]> {
        match &self.kind {
            Kind::Assembly(tested) => {
                let places = [&tested.places.exciter, &tested.places.accelerometer_b, &tested.places.accelerometer_c];
                let point = |placed: &Placed| placed.along.into_iter().flatten().next().map(|dof| tested.dof_name(dof));
                // A degree of freedom is called `point.axis`.
                let name = |placed| point(placed).unwrap_or_default().split('.').next().unwrap_or_default().to_owned();
                Some(places.map(name))
            }
            Kind::Foreign { .. } => None,
        }
    }

    /// Whether B and C are at the ends of two links, so that their accelerations give the angles.
    pub fn angles_are_read(&self) -> bool {
        match &self.kind {
            Kind::Assembly(tested) => tested.measured_links_m().is_some(),
            Kind::Foreign { .. } => false,
        }
    }

    /// Assigns the channels of a sample to the panels, with a label for each.
    pub fn panels(&self) -> Panels {
        let shown = Shown::new(&self.table);
        let all = |first: usize, labels: [&str; 2]| {
            let one = |(channel, label): (usize, &str)| shown.plotted(channel, label.to_owned());
            (first..).zip(labels).map(one).collect::<Vec<_>>()
        };
        let of = |first: usize, labels: [&str; 2], name: &str, placed: fn(&TestedAssembly) -> &Placed| {
            let Kind::Assembly(tested) = &self.kind else { return all(first, labels) };
            let named = (first..).zip(placed(tested).along).filter_map(|(channel, dof)| {
                let axis = tested.dof_name(dof?).rsplit('.').next().unwrap_or_default().to_owned();
                Some(shown.plotted(channel, if name.is_empty() { axis } else { format!("{name} {axis}") }))
            });
            named.collect()
        };
        let mut torque: Vec<Plotted> =
            all(rows::TORQUE, ["torque 1", "torque 2"]).into_iter().take(self.joints()).collect();
        torque.extend(shown.other_loads(Quantity::Torque));
        let mut force = of(rows::FORCE, ["load x", "load y"], "load", |tested| &tested.places.exciter);
        force.extend(shown.other_loads(Quantity::Force));
        Panels {
            torque,
            force,
            head: of(rows::HEAD, ["head x", "head y"], "head", |tested| &tested.places.exciter),
            acceleration_b: of(rows::ACCELERATION_B, ["x", "y"], "", |tested| &tested.places.accelerometer_b),
            acceleration_c: of(rows::ACCELERATION_C, ["x", "y"], "", |tested| &tested.places.accelerometer_c),
            coordinates: shown.coordinates(),
            elements: shown.elements(),
            sensors: shown.sensors(),
        }
    }

    /// The joints that torques act on, at most 2.
    fn joints(&self) -> usize {
        match &self.kind {
            Kind::Assembly(tested) => tested.loaded().iter().take(2).flatten().count(),
            Kind::Foreign { joints } => *joints,
        }
    }

    /// The axes of the responses: what is read, in the order of `Sizes`.
    pub fn responses(&self) -> Vec<ResponseAxis> {
        let displacement =
            |name: String| ResponseAxis { title: format!("amplitude of {name}"), label: name, unit: "m" };
        match &self.kind {
            Kind::Assembly(tested) => tested.read().into_iter().map(|read| displacement(read.name)).collect(),
            Kind::Foreign { .. } => FOREIGN.map(|(name, _)| displacement(name.to_owned())).to_vec(),
        }
    }

    /// The size along the scenario's load, if one is; else the first.
    pub fn driven_response(&self, scenario: &Scenario) -> usize {
        let Kind::Assembly(tested) = &self.kind else { return 0 };
        let driven = scenario.amplitude().and_then(|amplitude| tested.driven(amplitude).first().copied());
        let place = driven.and_then(|(dof, _)| tested.read().iter().position(|read| read.dof == dof));
        place.unwrap_or(0)
    }

    /// The sizes of a response: the fundamentals of displacements.
    pub fn sizes(&self, point: &ResponsePoint) -> Sizes {
        let read: Vec<usize> = match &self.kind {
            Kind::Assembly(tested) => tested.read().into_iter().map(|read| read.channel).collect(),
            Kind::Foreign { .. } => FOREIGN.map(|(_, channel)| channel).to_vec(),
        };
        let size = |channel: &usize| {
            let displacement = point.displacement_m(*channel);
            libm::hypot(displacement.re, displacement.im)
        };
        Sizes {
            amplitude: read.iter().map(size).collect(),
            clipped: read.iter().map(|channel| point.clipped[*channel]).collect(),
        }
    }
}

/// Readings of a program's own structure, or of an FMU, with the channels of a response.
const FOREIGN: [(&str, usize); 4] = [("C x", 4), ("C y", 5), ("B x", 2), ("B y", 3)];

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_bench::control::ResponsePoint;
    use resonarm_bench::excitation::Phasor;

    fn under_test(text: &str) -> UnderTest {
        let scenario = Scenario::parse(text, "bench.toml").unwrap();
        let table = match scenario.foreign_structure() {
            None => Channels::of_structure(scenario.plant().unwrap().structure()),
            Some(_) => Channels::arm(true),
        };
        UnderTest::new(&scenario, String::from("it"), table).unwrap()
    }

    fn named(plotted: &[Plotted]) -> String {
        plotted.iter().map(|one| format!("{} {} ({})", one.channel, one.label, one.unit)).collect::<Vec<_>>().join(", ")
    }

    const MODAL: &str = r#"
[structure]
kind = "modal"
modes = [
  { frequency_hz = 20.0, damping_ratio = 0.004, shape = { "tip.z" = 0.5, "mid.x" = 0.3, "mid.y" = 0.1 } },
  { frequency_hz = 57.0, damping_ratio = 0.006, shape = { "tip.z" = -0.4, "mid.x" = 0.35, "mid.y" = 0.2 } },
]
elements = [
  { kind = "gap", at = "mid.x", stiffness_n_m = 1e4, gap_m = 1e-3 },
  { kind = "friction", at = "tip.z", stiffness_n_m = 1e4, slip_force_n = 1.0 },
]
[rig.exciter]
at = "tip.z"
[rig.sensors.b]
at = "mid"
"#;

    #[test]
    fn panels_plot_the_axes_that_there_are() {
        let arm = under_test("").panels();
        assert_eq!(named(&arm.torque), "0 torque 1 (N·m), 1 torque 2 (N·m)");
        assert_eq!(named(&arm.force), "2 load x (N), 3 load y (N)");
        assert_eq!(named(&arm.head), "4 head x (N), 5 head y (N)");
        assert_eq!(named(&arm.acceleration_c), "8 x (m/s²), 9 y (m/s²)");
        assert_eq!((named(&arm.coordinates), named(&arm.elements)), ("10 α₁ (rad), 11 α₂ (rad)".into(), String::new()));
        let modal = under_test(MODAL).panels();
        assert_eq!((named(&modal.torque), named(&modal.force)), (String::new(), String::from("2 load z (N)")));
        assert_eq!(named(&modal.head), "4 head z (N)");
        assert_eq!(named(&modal.acceleration_b), "6 x (m/s²), 7 y (m/s²)");
        assert_eq!(named(&modal.acceleration_c), "8 z (m/s²)");
        assert_eq!(named(&modal.coordinates), "10 q₁ (m·√kg), 11 q₂ (m·√kg)");
        assert!(modal.sensors.is_empty());
        let link = "{ length_m = 0.3, mass_kg = 2, centre_of_mass_m = 0.1, inertia_kg_m2 = 0.02, angle_deg = 0, stiffness_nm_rad = 1e4, damping_nm_s_rad = 2 }";
        let chain = under_test(&format!("structure = {{ kind = 'chain', links = [{link}, {link}, {link}] }}")).panels();
        assert_eq!(named(&chain.torque), "0 torque 1 (N·m), 1 torque 2 (N·m), 13 torque 3 (N·m)");
        let both = MODAL.replace("\"tip.z\" = ", "\"tip.x\" = 0.2, \"tip.z\" = ");
        let both = under_test(&both.replace("[rig.exciter]\nat = \"tip.z\"", "[rig.exciter]\nat = \"tip\"")).panels();
        assert_eq!(named(&both.force), "2 load x (N), 13 load z (N)");
        let sensed = "[rig.sensors.m3]\nat = \"mid\"\n[rig.sensors.v]\nat = \"tip.z\"\nmeasures = \"velocity\"\n";
        let sensed = under_test(&format!("{MODAL}{sensed}")).panels();
        assert_eq!(named(&sensed.sensors), "13 m3 x (m/s²), 14 m3 y (m/s²), 15 v z (m/s)");
        // The gap has no state, and the branches of both are not plotted.
        assert_eq!(named(&modal.elements), "12 element 2 (m)");
    }

    #[test]
    fn angles_are_read_of_two_links_with_b_and_c_at_their_ends() {
        assert!(under_test("").angles_are_read() && under_test("[structure]\n").angles_are_read());
        assert!(!under_test("[structure]\n[rig.sensors.c]\nat = \"tip.y\"\n").angles_are_read());
        assert!(!under_test("[structure]\n[rig.sensors.b]\nat = \"tip\"\n").angles_are_read());
        assert!(!under_test(MODAL).angles_are_read());
    }

    #[test]
    fn responses_are_displacements_that_the_accelerometers_read() {
        let harmonic = |size: f64| [Phasor::new(0.0, size), Phasor::new(0.0, 0.0), Phasor::new(0.0, 0.0)];
        let readings = [0.0, 0.0, 2.0, 3.0, 4.0, 5.0].map(harmonic);
        let mut point = ResponsePoint::of_harmonics(10.0, 1.0, &readings);
        point.clipped[3] = true;
        let square = (core::f64::consts::TAU * 10.0).powi(2);
        let modal = under_test(MODAL);
        let labels: Vec<String> = modal.responses().into_iter().map(|axis| axis.label).collect();
        assert_eq!(labels, ["tip.z", "mid.x", "mid.y"]);
        let Sizes { amplitude, clipped } = modal.sizes(&point);
        for (found, expected) in amplitude.iter().zip([4.0, 2.0, 3.0]) {
            assert!((found * square - expected).abs() < 1e-12, "{found}");
        }
        assert_eq!((amplitude.len(), &clipped[..]), (3, &[false, false, true][..]));
        let own = under_test("[structure]\nkind = \"own\"\n");
        assert_eq!((own.drawing.clone(), own.rig(), own.modes_hz()), (None, None, vec![]));
        assert!((own.sizes(&point).amplitude[1] * square - 5.0).abs() < 1e-12);
        let torques = |inputs: &str| {
            let text = format!("[structure]\nkind = \"fmu\"\nfile = \"a.fmu\"\ninputs = {{ {inputs} }}\n");
            named(&under_test(&text).panels().torque)
        };
        assert_eq!(torques("'tip.x' = 'F'"), "");
        assert_eq!(torques("joint1 = 'M'"), "0 torque 1 (N·m)");
        assert_eq!(torques("joint2 = 'M'"), "0 torque 1 (N·m), 1 torque 2 (N·m)");
    }

    #[test]
    fn the_response_along_the_load_is_shown_first() {
        let load = |key: &str| {
            let profile = "profile = { waveform = \"dwell\", frequency_hz = 15.0, duration_s = 1.0, settle_s = 0.1 }";
            let text = format!("[structure]\n[excitation]\namplitude = {{ {key} = 2.0 }}\n{profile}\n");
            under_test(&text).driven_response(&Scenario::parse(&text, "bench.toml").unwrap())
        };
        assert_eq!(["exciter_x", "exciter_y", "joint1"].map(load), [0, 1, 0]);
    }
}
