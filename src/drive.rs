//! The excitation of the commands that analyse a structure: loads A·sin(2πft) at its degrees of freedom.

use std::collections::BTreeMap;

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::flags::repeated;
use crate::help::heading;
use crate::numbers;
use crate::read_at::{ReadAt, dof};
use resonarm::analysis::{Coordinate, Forced};
use resonarm::plant::TestedAssembly;
use resonarm::rig;
use resonarm::structure::{Assembly, Dof, LoadHarmonic, MOST_LOAD_HARMONICS};
use resonarm_numeric::number::short;

/// The loads.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::LOADS)]
pub(crate) struct DriveFlags {
    /// Load A·sin(2πft), as tip.x=20, N, or joint1=60, N·m; may be repeated.
    ///
    /// DOF is a degree of freedom: a point and an axis, as tip.x, or a joint, as joint1. Several loads are in phase.
    #[arg(long = "drive", value_name = "DOF=A", allow_hyphen_values = true, value_parser = load_flag)]
    loads: Vec<LoadFlag>,
    /// Harmonic K of the loads, as 3=2 or 3=2@90: 2 N at 3 times f, 90° ahead.
    ///
    /// K=A@DEG adds A·sin(2πKft + DEG) to the first load, in its unit, and the same in proportion to the others. It may be
    /// repeated for up to 8 harmonics.
    #[arg(
        long = "drive-harmonic",
        value_name = "K=A",
        requires = "loads",
        allow_hyphen_values = true,
        value_parser = harmonic_flag,
        hide_short_help = true
    )]
    harmonics: Vec<HarmonicFlag>,
}

/// The highest order of a load's harmonic.
const MOST_ORDER: u8 = 50;

/// A harmonic of the loads: its order, its amplitude in the unit of the first load, and its phase, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HarmonicFlag {
    order: u8,
    amplitude: f64,
    phase_deg: f64,
}

fn harmonic_flag(text: &str) -> Result<HarmonicFlag, String> {
    let (order, rest) = text.split_once('=').ok_or("it must be a harmonic with its amplitude, as 3=2")?;
    let known = || format!("harmonic {order}: expected a whole number from 2 to {MOST_ORDER}");
    let order = order.parse().ok().filter(|order| (2..=MOST_ORDER).contains(order)).ok_or_else(known)?;
    let (amplitude, phase) = rest.split_once('@').unwrap_or((rest, "0"));
    let amplitude = numbers::finite(amplitude)?;
    let phase_deg = numbers::finite(phase)?;
    Ok(HarmonicFlag { order, amplitude: nonzero(amplitude)?, phase_deg })
}

/// Rejects an amplitude of 0: it would drive nothing, and the other loads are stated by their ratio to the first.
fn nonzero(amplitude: f64) -> Result<f64, String> {
    if amplitude == 0.0 { Err(String::from("the amplitude must be a number other than 0")) } else { Ok(amplitude) }
}

/// A degree of freedom, with an amplitude or without.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LoadFlag {
    pub name: String,
    pub amplitude: Option<f64>,
}

pub(crate) fn load_flag(text: &str) -> Result<LoadFlag, String> {
    let Some((name, amplitude)) = text.split_once('=') else {
        return Ok(LoadFlag { name: text.to_owned(), amplitude: None });
    };
    Ok(LoadFlag { name: name.to_owned(), amplitude: Some(nonzero(numbers::finite(amplitude)?)?) })
}

/// A load at a degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Load {
    /// Degree of freedom at which the load acts.
    pub at: ReadAt,
    /// Its peak, N, N·m at a joint, or m/s² of a base.
    pub amplitude: f64,
}

/// A load in a document, which names the degree of freedom.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct LoadDocument {
    pub amplitude: f64,
    /// Other programs may leave it out.
    #[serde(default)]
    pub unit: Option<String>,
}

/// Loads in phase, at least one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Drive {
    pub loads: Vec<Load>,
    /// Harmonics that all loads have.
    pub harmonics: Vec<LoadHarmonic>,
}

impl DriveFlags {
    /// Returns the loads with their amplitudes.
    pub fn drive(&self, assembly: &Assembly) -> Result<Drive, Failure> {
        self.check_given(assembly)?;
        match self.loads.iter().find(|load| load.amplitude.is_none()) {
            Some(LoadFlag { name, .. }) => Err(lacks_amplitude(name, dof("--drive", name, assembly)?)),
            None => self.resolved(assembly),
        }
    }

    /// Says whether no load is given.
    pub fn is_empty(&self) -> bool {
        self.loads.is_empty()
    }

    /// Returns the loads of responses that are followed in a coordinate. Where it is the amplitude, --drive states only
    /// where the loads act, and their ratio.
    pub fn along(&self, coordinate: Coordinate, assembly: &Assembly) -> Result<Drive, Failure> {
        if coordinate == Coordinate::Amplitude { self.direction(assembly) } else { self.drive(assembly) }
    }

    /// Returns the loads whose common amplitude varies: one without an amplitude, which counts as 1, or several, whose
    /// ratio their amplitudes are.
    fn direction(&self, assembly: &Assembly) -> Result<Drive, Failure> {
        self.check_given(assembly)?;
        match &self.loads[..] {
            [LoadFlag { name, amplitude: Some(_) }] => Err(Failure::usage(format!(
                "the amplitude is the quantity that varies: give --drive {name} without one"
            ))),
            [_] => self.resolved(assembly),
            _ => self.drive(assembly),
        }
    }

    /// Returns the loads, whose amplitude may be left out; it is then 1, and `None` is returned for it. Without loads a
    /// torque at joint 1 of a chain.
    pub fn up_to(&self, assembly: &Assembly) -> Result<(Drive, Option<f64>), Failure> {
        match &self.loads[..] {
            [] if assembly.dof("joint1").is_ok() => {
                let load = LoadFlag { name: String::from("joint1"), amplitude: None };
                Ok((DriveFlags { loads: vec![load], harmonics: vec![] }.resolved(assembly)?, None))
            }
            // A single load without an amplitude says where it acts: another limit ends the curve.
            [LoadFlag { amplitude: None, .. }] => Ok((self.resolved(assembly)?, None)),
            _ => {
                let drive = self.drive(assembly)?;
                let amplitude = drive.amplitude();
                Ok((drive, Some(amplitude)))
            }
        }
    }

    fn check_given(&self, assembly: &Assembly) -> Result<(), Failure> {
        if let Some(HarmonicFlag { order, .. }) = repeated(&self.harmonics, |a, b| a.order == b.order) {
            return Err(Failure::usage(format!("--drive-harmonic {order} is given twice: give each harmonic once")));
        }
        if self.harmonics.len() > MOST_LOAD_HARMONICS {
            let got = self.harmonics.len();
            return Err(Failure::usage(format!(
                "{got} harmonics are given by --drive-harmonic: a load can have at most {MOST_LOAD_HARMONICS}"
            )));
        }
        match repeated(&self.loads, |a, b| a.name == b.name) {
            Some(LoadFlag { name, .. }) => {
                Err(Failure::usage(format!("--drive {name} is given twice: give each load once")))
            }
            None if self.loads.is_empty() => Err(missing("--drive DOF=A", assembly)),
            None => Ok(()),
        }
    }

    fn resolved(&self, assembly: &Assembly) -> Result<Drive, Failure> {
        let load = |LoadFlag { name, amplitude }: &LoadFlag| {
            let at = ReadAt { dof: dof("--drive", name, assembly)?, name: name.clone() };
            Ok(Load { at, amplitude: amplitude.unwrap_or(1.0) })
        };
        let loads = self.loads.iter().map(load).collect::<Result<Vec<Load>, Failure>>()?;
        let first = loads[0].amplitude;
        let harmonic = |of: &HarmonicFlag| LoadHarmonic {
            order: usize::from(of.order),
            ratio: of.amplitude / first,
            phase_rad: of.phase_deg.to_radians(),
        };
        Ok(Drive { loads, harmonics: self.harmonics.iter().map(harmonic).collect() })
    }

    /// Fails if harmonics are given; `why` says what the command needs.
    pub fn refuse_harmonics(&self, why: &str) -> Result<(), Failure> {
        let refused = |_: &HarmonicFlag| Err(Failure::usage(format!("{why}: leave --drive-harmonic out")));
        self.harmonics.first().map_or(Ok(()), refused)
    }
}

/// Returns the failure of a command without its load.
pub(crate) fn missing(flag: &str, assembly: &Assembly) -> Failure {
    let known = assembly.dof_names().join(", ");
    Failure::usage(format!("the excitation is missing: give it by {flag}, with DOF one of {known}"))
}

/// Returns the failure of a load without its amplitude.
pub(crate) fn lacks_amplitude(name: &str, dof: Dof) -> Failure {
    Failure::usage(format!("--drive {name} has no amplitude: give --drive {name}=A, in {}", dof.load_unit()))
}

impl Drive {
    /// Returns the loads of a scenario's exciter; `None` if they act at no point of the structure.
    pub fn of_exciter(amplitude: &rig::Load, tested: &TestedAssembly) -> Option<Drive> {
        let load = |(dof, amplitude)| Load { at: ReadAt { dof, name: tested.dof_name(dof) }, amplitude };
        let loads: Vec<Load> = tested.driven(amplitude).into_iter().map(load).collect();
        (!loads.is_empty()).then_some(Drive { loads, harmonics: vec![] })
    }

    /// Reads the loads of a document, by the names of the degrees of freedom.
    ///
    /// # Errors
    /// If the structure has no such degree of freedom, or a load has another unit than it has there.
    pub fn of_document(loads: &BTreeMap<String, LoadDocument>, assembly: &Assembly) -> Result<Drive, Failure> {
        let load = |(name, load): (&String, &LoadDocument)| {
            let dof = dof("drive", name, assembly)?;
            match &load.unit {
                // The other loads are stated by their ratio to the first.
                _ if load.amplitude == 0.0 || !load.amplitude.is_finite() => Err(Failure::usage(format!(
                    "the load at {name} is {}: it must be a finite number other than 0",
                    load.amplitude
                ))),
                Some(unit) if unit != dof.load_unit() => {
                    Err(Failure::usage(format!("the load at {name} is in {unit}, expected {}", dof.load_unit())))
                }
                _ => Ok(Load { at: ReadAt { dof, name: name.clone() }, amplitude: load.amplitude }),
            }
        };
        Ok(Drive { loads: loads.iter().map(load).collect::<Result<_, Failure>>()?, harmonics: vec![] })
    }

    /// Returns the size of the loads together: √Σ A², like that of a force along a direction.
    pub fn size(&self) -> f64 {
        self.loads.iter().map(|load| load.amplitude * load.amplitude).sum::<f64>().sqrt()
    }

    /// Returns all loads times a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Drive {
        let scaled = |load: &Load| Load { amplitude: factor * load.amplitude, ..load.clone() };
        Drive { loads: self.loads.iter().map(scaled).collect(), harmonics: self.harmonics.clone() }
    }

    /// Returns the structure under these loads.
    pub fn forced(&self, assembly: &Assembly) -> Forced {
        let amplitude = self.amplitude();
        // The continuation varies one amplitude, that of the first load. The others are stated by their ratio to it.
        let shares: Vec<(Dof, f64)> = self.loads.iter().map(|load| (load.at.dof, load.amplitude / amplitude)).collect();
        Forced::at_several(assembly.clone(), &shares, amplitude).with_harmonics(self.harmonics.clone())
    }

    /// Returns the amplitude of the first load; the others keep their ratio to it.
    pub fn amplitude(&self) -> f64 {
        self.loads[0].amplitude
    }

    /// Returns the unit of the first load.
    pub fn unit(&self) -> &'static str {
        self.loads[0].at.dof.load_unit()
    }

    /// Returns the degrees of freedom on which the loads act.
    pub fn driven(&self) -> Vec<ReadAt> {
        self.loads.iter().map(|load| load.at.clone()).collect()
    }

    /// Says in words where the loads act: `tip.x and tip.y`.
    pub fn at(&self) -> String {
        self.loads.iter().map(|load| load.at.name.as_str()).collect::<Vec<_>>().join(" and ")
    }

    /// States the loads in words: `60 N·m at joint1`.
    pub fn words(&self) -> String {
        self.words_by(|amplitude| short(&amplitude).to_string())
    }

    /// States the loads in words, without their amplitudes if these are among the coordinates that vary.
    pub fn words_without(&self, varied: &[Coordinate]) -> String {
        if varied.contains(&Coordinate::Amplitude) { format!("driven at {}", self.at()) } else { self.words() }
    }

    /// States loads that were measured in words, with at most three decimals.
    pub fn rounded_words(&self) -> String {
        self.words_by(|amplitude| short(&((1e3 * amplitude).round() / 1e3)).to_string())
    }

    fn words_by(&self, number: impl Fn(f64) -> String) -> String {
        let one = |Load { at, amplitude }: &Load| {
            let amplitude = number(*amplitude).replace('-', "−");
            format!("{amplitude} {} at {}", at.dof.load_unit(), at.name)
        };
        let harmonic = |of: &LoadHarmonic| {
            let amplitude = number(of.ratio * self.amplitude()).replace('-', "−");
            format!("harmonic {}: {amplitude} {}", of.order, self.unit())
        };
        let loads = self.loads.iter().map(one);
        loads.chain(self.harmonics.iter().map(harmonic)).collect::<Vec<_>>().join(", ")
    }

    /// Adds the loads, and their harmonics if there are any, to the inputs of results.
    pub fn describe(&self, configuration: &mut Value) {
        configuration["drive"] = self.document();
        if self.harmonics.is_empty() {
            return;
        }
        let harmonic = |of: &LoadHarmonic| {
            let amplitude = of.ratio * self.amplitude();
            json!({ "order": of.order, "amplitude": amplitude, "phase_deg": of.phase_rad.to_degrees() })
        };
        configuration["drive_harmonics"] = self.harmonics.iter().map(harmonic).collect();
    }

    /// Returns the amplitudes and their units by the degrees of freedom.
    pub fn document(&self) -> Value {
        let document = |Load { at, amplitude }: &Load| LoadDocument {
            amplitude: *amplitude,
            unit: Some(at.dof.load_unit().to_owned()),
        };
        self.loads.iter().map(|load| (load.at.name.clone(), json!(document(load)))).collect()
    }
}
