//! The variables of an FMU: the one table from which description, documentation and access follow. A variable's value
//! reference is its place in the table.

use crate::content::{Content, Interface, Role, Settings, TxClock};
use crate::units::{self, DEGREE, SECOND, Unit};
use resonarm_bench::plant::Plant;
use resonarm_bench::rig::{Load, MOST_JOINTS};
use resonarm_bench::structure::{Channel, LOADS, Quantity};

/// Quantity that a variable stands for. Numbers are places in the tables of channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    Time,
    /// One of the loads, by its index in [`LOADS`].
    Load(usize),
    /// One of the outputs of the structure, as the instrument reads it.
    Reading(usize),
    /// Whether that reading was beyond the range of the instrument.
    Clipped(usize),
    /// The same output as the converter samples it, before the instrument.
    Sampled(usize),
    /// A state of the structure.
    State(usize),
    /// The number of the sample.
    Sample,
    /// The angle of a link of a preset.
    LinkAngle(usize),
    Seed,
    Noise,
    Recording,
    Overwrite,
    /// The state of a node, as in its heartbeat.
    NodeState,
    /// Code of the fault that the plant's node has latched.
    FaultCode,
    /// Samples that the exciter has answered.
    Played,
    /// Responses that the exciter has read.
    Responses,
    /// Frames on the bus.
    Frames,
    ErrorFrames,
    /// Data that come in at the terminal of this number, from 0.
    RxData(usize),
    RxClock(usize),
    TxData(usize),
    TxClock(usize),
}

/// The type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Float64,
    UInt64,
    Boolean,
    String,
    Binary,
    Clock,
}

impl Kind {
    /// The name of its element in the description.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Float64 => "Float64",
            Kind::UInt64 => "UInt64",
            Kind::Boolean => "Boolean",
            Kind::String => "String",
            Kind::Binary => "Binary",
            Kind::Clock => "Clock",
        }
    }
}

/// Part of a variable in the model, as FMI calls it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Causality {
    Independent,
    Parameter,
    Input,
    Output,
}

/// A variable in the model description.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Variable {
    pub name: String,
    pub source: Source,
    pub kind: Kind,
    pub causality: Causality,
    pub unit: Option<Unit>,
    /// Value of an input or a parameter at the start.
    pub start: Option<String>,
    pub description: String,
}

/// The variables of an FMU with this content; `plant` is the plant at its start, of an FMU that has one.
pub(crate) fn table(content: &Content, plant: Option<&Plant>) -> Vec<Variable> {
    let mut all = vec![Variable {
        unit: Some(SECOND),
        ..variable("time", Source::Time, Kind::Float64, Causality::Independent, "simulated time")
    }];
    match (plant, content.settings.interface) {
        (Some(plant), Interface::Signals) => {
            all.extend(loads(plant));
            all.extend(readings(plant.structure().outputs()));
        }
        (_, Interface::Can) => {
            let of_one = |(index, name): (usize, String)| terminal(index, &name, content.settings.clock);
            all.extend(terminals(&content.settings).into_iter().enumerate().flat_map(of_one));
        }
        (None, Interface::Signals) => {}
    }
    if let Some(plant) = plant {
        all.extend(states(plant));
    }
    all.extend(counts(&content.settings));
    if plant.is_some() {
        all.extend(parameters(content));
    }
    all
}

/// The names of the terminals.
pub(crate) fn terminals(settings: &Settings) -> Vec<String> {
    match (settings.interface, settings.role) {
        (Interface::Signals, _) => Vec::new(),
        (Interface::Can, Role::Plant | Role::Exciter) => vec![String::from("can")],
        (Interface::Can, Role::Bus) => (1..=settings.nodes).map(|node| format!("node{node}")).collect(),
    }
}

/// The variables of a terminal: data and clock of what comes in and of what leaves.
fn terminal(index: usize, name: &str, clock: TxClock) -> [Variable; 4] {
    let tx = if clock == TxClock::Triggered { Causality::Output } else { Causality::Input };
    let member = |member: &str, source, kind, causality, description: &str| {
        variable(format!("{name}.{member}"), source, kind, causality, description)
    };
    [
        member("Rx_Data", Source::RxData(index), Kind::Binary, Causality::Input, "operations that come"),
        member("Rx_Clock", Source::RxClock(index), Kind::Clock, Causality::Input, "when they come"),
        member("Tx_Data", Source::TxData(index), Kind::Binary, Causality::Output, "operations that leave"),
        member("Tx_Clock", Source::TxClock(index), Kind::Clock, tx, "when they leave"),
    ]
}

/// Returns the variables that count what happened at nodes and bus, or report their state.
fn counts(settings: &Settings) -> Vec<Variable> {
    let rows: &[(&str, Source, &str)] = match (settings.interface, settings.role) {
        (Interface::Signals, _) => &[],
        (Interface::Can, Role::Plant) => &[
            (
                "node.state",
                Source::NodeState,
                "state of the node: 0 boot-up, 4 stopped by a fault, 5 armed, 127 not armed",
            ),
            (
                "node.fault",
                Source::FaultCode,
                "code of the fault that is latched, as in the emergency message; 0 for none",
            ),
        ],
        (Interface::Can, Role::Exciter) => &[
            ("node.state", Source::NodeState, "state of the node: 0 boot-up, 4 stopped by a fault, 5 plays, 127 waits"),
            ("node.played", Source::Played, "samples answered"),
            ("node.responses", Source::Responses, "responses read"),
        ],
        (Interface::Can, Role::Bus) => &[
            ("bus.frames", Source::Frames, "frames sent"),
            ("bus.error_frames", Source::ErrorFrames, "frames that an error destroyed"),
        ],
    };
    let row = |(name, source, description): &(&str, Source, &str)| {
        variable(*name, *source, Kind::UInt64, Causality::Output, *description)
    };
    rows.iter().map(row).collect()
}

fn variable(
    name: impl Into<String>,
    source: Source,
    kind: Kind,
    causality: Causality,
    description: impl Into<String>,
) -> Variable {
    Variable { name: name.into(), source, kind, causality, unit: None, start: None, description: description.into() }
}

/// The loads that the structure takes.
fn loads(plant: &Plant) -> impl Iterator<Item = Variable> {
    LOADS.iter().enumerate().filter(|(index, _)| takes(plant, *index)).map(|(index, channel)| Variable {
        unit: units::of(channel.quantity),
        start: Some(String::from("0")),
        ..variable(
            format!("load.{}", channel.name),
            Source::Load(index),
            Kind::Float64,
            Causality::Input,
            format!("{}, held from sample to sample", words(channel)),
        )
    })
}

/// Whether exciter and structure take load `index`: a thousandth of the limit can be held for a sample.
fn takes(plant: &Plant, index: usize) -> bool {
    let (limit_n, limit_nm) = plant.exciter().limits();
    // Far below any limit, so that a structure is asked whether it takes the load and not how much of it.
    let mut loads = [0.0; LOADS.len()];
    loads[index] = 1e-3 * if index < MOST_JOINTS { limit_nm } else { limit_n };
    let load = Load::from_parts(&loads);
    // Tried on a copy: a structure refuses a load only when it is advanced.
    loads[index] != 0.0 && plant.exciter().can_produce(&load) && plant.clone().advance(&load).is_ok()
}

/// Returns the variables of what the instruments read, whether it was beyond their ranges, and what they would read
/// without errors.
fn readings(outputs: &[Channel]) -> impl Iterator<Item = Variable> {
    type Group = (&'static str, fn(usize) -> Source, Kind, &'static str);
    const GROUPS: [Group; 3] = [
        ("reading", Source::Reading, Kind::Float64, "as the instrument reads it"),
        ("clipped", Source::Clipped, Kind::Boolean, "whether the reading was beyond the range of the instrument"),
        (
            "true",
            Source::Sampled,
            Kind::Float64,
            "value that the converter samples, without the errors of the instrument",
        ),
    ];
    GROUPS.into_iter().flat_map(move |(group, source, kind, what)| {
        outputs.iter().enumerate().map(move |(index, channel)| {
            let name = format!("{group}.{}", channel.name);
            let description = format!("{}, {what}", words(channel));
            // A truth value has no unit, whatever the reading that it is about.
            let unit = units::of(channel.quantity).filter(|_| kind == Kind::Float64);
            Variable { unit, ..variable(name, source(index), kind, Causality::Output, description) }
        })
    })
}

/// The states of the structure, and the number of the sample at which it is.
fn states(plant: &Plant) -> Vec<Variable> {
    let state = |(index, channel): (usize, &Channel)| Variable {
        unit: units::of(channel.quantity),
        ..variable(
            format!("state.{}", channel.name),
            Source::State(index),
            Kind::Float64,
            Causality::Output,
            format!("{} at the sample", words(channel)),
        )
    };
    let states = plant.structure().states().iter().enumerate().map(state);
    let description = "the number of the last sample, from 0 at the start";
    states.chain([variable("sample", Source::Sample, Kind::UInt64, Causality::Output, description)]).collect()
}

/// Returns the parameters that may be set before the simulation begins.
fn parameters(content: &Content) -> Vec<Variable> {
    let scenario = &content.scenario;
    let parameter = |name: &str, source, kind, start: String, unit, description: &str| Variable {
        start: Some(start),
        unit,
        ..variable(format!("parameter.{name}"), source, kind, Causality::Parameter, description)
    };
    let angles = scenario.structure.angles_deg.iter().enumerate().map(|(index, start)| {
        let name = format!("link{}.angle_deg", index + 1);
        let start = format!("{start:?}");
        let description = "the angle of the link against the one before, with the spring of its joint relaxed";
        parameter(&name, Source::LinkAngle(index), Kind::Float64, start, Some(DEGREE), description)
    });
    let [seed, yes, no] = [scenario.simulation.seed.to_string(), String::from("true"), String::from("false")];
    let described = "an MCAP file to record the run in; empty for none";
    let rest = [
        parameter("seed", Source::Seed, Kind::UInt64, seed, None, "the seed of all noise"),
        parameter("noise", Source::Noise, Kind::Boolean, yes, None, "whether the sensors have their noise"),
        parameter("recording", Source::Recording, Kind::String, String::new(), None, described),
        parameter(
            "overwrite",
            Source::Overwrite,
            Kind::Boolean,
            no,
            None,
            "whether a recording that is there is replaced",
        ),
    ];
    angles.chain(rest).collect()
}

/// A channel in words: `acceleration at tip C along x`.
fn words(channel: &Channel) -> String {
    let what = match channel.quantity {
        Quantity::Angle => "angle",
        Quantity::AngularVelocity => "angular velocity",
        Quantity::Torque => "torque",
        Quantity::Force => "force",
        Quantity::Acceleration => "acceleration",
        Quantity::Current => "current in the shaker's coil",
        Quantity::ModalDisplacement => "modal coordinate",
        Quantity::ModalVelocity => "rate of the modal coordinate",
        Quantity::Displacement => "displacement",
        Quantity::Velocity => "velocity",
        Quantity::Length => "deflection of the spring",
        Quantity::Branch => "branch of the law",
    };
    let point = channel.point.name();
    let axis = channel.axis.name();
    let along = match axis {
        "x" | "y" | "z" => format!(" along {axis}"),
        _ => String::new(),
    };
    format!("{what} at {point}{along}")
}
