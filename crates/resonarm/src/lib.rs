//! Resonarm: a real-time vibration simulator of a compliant-joint robot arm, on a CAN bus.
//!
//! A plant is an arm with its instruments and an integrator. It is measured, given a load to hold, and advanced, sample
//! by sample; everything else carries the readings out and the loads in.
//!
//! ```
//! use resonarm::rig::Load;
//! use resonarm::scenario::Scenario;
//!
//! let scenario = Scenario::parse("structure = { preset = 'irb1600-fitted', angles_deg = [0, 60] }", "here")?;
//! let structure = scenario.under_test()?.assembly;
//! assert!((structure.modes()[0].frequency_hz - 22.16).abs() < 0.01);
//!
//! let mut plant = scenario.plant()?;
//! for _ in 0..100 {
//!     let acceleration_c_m_s2 = plant.measure().acceleration_c_m_s2.map(|reading| reading.value);
//!     // A controller of your own: the force at the tip answers the acceleration there.
//!     plant.advance(&Load::force_n(10.0 - 0.5 * acceleration_c_m_s2[0], 0.0))?;
//! }
//! assert_eq!(plant.sample(), 100);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The modules, in the order in which they stand on each other:
//!
//! | | |
//! | --- | --- |
//! | [`integrate`] | one-step methods, for one motion or several side by side |
//! | [`analysis`] | modes, frequency responses, continuation and stability of periodic responses |
//! | [`excitation`], [`rig`] | what is played on the arm; exciter, impedance head, accelerometers |
//! | [`structure`] | structures under test: chains of links, presets, vibration modes, elements; their channels |
//! | [`plant`] | a structure with its instruments, sample by sample |
//! | [`identify`] | frequency responses, modes and joint angles from what the instruments said |
//! | [`control`] | exciter controllers: what answers a sample |
//! | [`node`] | plant and exciter controller as CAN nodes without IO |
//! | [`protocol`] | the CAN protocol, a crate of its own |
//! | [`bus`], [`realtime`], [`recording`] | buses; clocks and threads; MCAP files |
//! | [`scenario`] | everything about a run, in one TOML file |
//! | [`run`] | runs: a [`Session`](run::Session) puts a scenario, both ends, a bus, a recording and the pace together |
//! | [`conformance`] | whether a node on a bus keeps the protocol |
//! | [`replay`] | recordings: their frames sent again, their runs simulated again |
//! | [`wire`], [`dbc`] | frames of a user's own protocol: signals, counters, checksums; DBC files |
//! | [`decoder`] | frames explained by a DBC, and by what its messages mean to the plant |
//! | [`can_log`] | frames in the log files of other tools |
//! | [`diff`], [`statistics`] | two recordings compared; what is in one, in numbers |
//! | [`export`], [`import`] | recordings in the formats of other tools, and logs of them as recordings |
//! | [`responses`], [`modal_file`] | measured frequency responses in UFF files; identified modes as such a file |
//! | [`identification`] | what a recording says about its arm, by the methods of [`identify`] |
//! | [`specification`], [`judge`] | specifications of vibration and shock tests, verdicts on records and on recordings |
//! | [`audit`] | cases that judge controllers of vibration tests by records of their runs |
//! | [`experiment`] | whole experiments of several runs, scored against what is computed |
//! | [`survey`] | plans of runs that measure the modes of a structure, and folders with their recordings |
//! | [`study`] | sweeps, basins of attraction and other studies over all cores, which can be interrupted and resumed |
//! | [`toml_error`] | what is wrong with a scenario or settings as TOML |
//!
//! Each module is a crate or a module of one, see `ARCHITECTURE.md`. [`integrate`] to [`node`] are pure: no clock, no thread,
//! no file, no socket, and `no_std`. SI units throughout; a number that is not in a typed quantity carries its unit in
//! its name. A `sample` is one of the bench's, a `step` one of the integrator's: a sample takes several.
//!
//! `docs/commands.md` describes the program's commands, `DESIGN.md` the reasons for decisions.

pub use resonarm_analysis as analysis;
pub use resonarm_audit as audit;
pub use resonarm_bench::{control, excitation, identify, node, plant, rig};
pub use resonarm_conformance as conformance;
pub use resonarm_dynamics::integrate;
pub use resonarm_files::{
    can_log, cut, decoder, diff, drawing, export, import, judge, modal_file, recording, responses, signals, statistics,
};
pub use resonarm_files::{same_file, wait_for_reader, write_whole};
pub use resonarm_modal as modal;
pub use resonarm_protocol as protocol;
pub use resonarm_realtime as realtime;
pub use resonarm_scenario as scenario;
pub use resonarm_scenario::{dbc, toml_error};
pub use resonarm_session::{experiment, identification, replay, run, study, survey};
pub use resonarm_specification as specification;
pub use resonarm_wire as wire;

/// Structures: the channels by which a plant knows one; chains of links, vibration modes, and elements at their points.
pub mod structure {
    pub use resonarm_bench::structure::*;
    pub use resonarm_dynamics::structure::{
        Armature, ArmatureMotion, Assembly, BodySpec, Branch, ChainSpec, Coil, CoordinateUnit, Dof, Element,
        ElementSpec, Law, Linear, Linearised, Link, LoadHarmonic, MOST_LOAD_HARMONICS, ModalSpec, ModeSpec, Parameter,
        Place, Polynomial, Preset, Reaction, ShapeSpec, Side, StateRate, StepError, StepLoad, Stepper,
        StructureError as SpecError, StructureMode, StructureSpec, Term,
    };
}

/// CAN buses: those of the crate `resonarm-bus`, and with the feature `python-can` any adapter that python-can knows.
pub mod bus {
    pub use resonarm_bus::*;
    #[cfg(feature = "python-can")]
    pub use resonarm_python_can as python_can;

    /// Opens the bus that `address` names, with the default options of its backend.
    ///
    /// # Errors
    /// [`BusError`]: what the environment lacks, and how to fix it; [`BusError::NoPythonCan`] without the feature
    /// `python-can`. [`BusAddress::Memory`] can't be opened by name, see [`BusError::MemoryIsNotShared`].
    pub fn open(address: &BusAddress) -> Result<Box<dyn Bus>, BusError> {
        match address {
            #[cfg(feature = "python-can")]
            BusAddress::PythonCan(options) => Ok(Box::new(python_can::PythonCan::open(options)?)),
            other => resonarm_bus::open(other),
        }
    }
}
