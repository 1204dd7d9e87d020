//! Resonarm: a real-time vibration simulator of a compliant-joint robot arm, on a CAN bus.
//!
//! A plant is an arm with its instruments and an integrator. It is measured, given a load to hold, and advanced, sample
//! by sample; everything else carries the readings out and the loads in.
//!
//! ```
//! use resonarm::analysis::modes;
//! use resonarm::arm::Load;
//! use resonarm::plant::Plant;
//! use resonarm::scenario::Scenario;
//!
//! let scenario = Scenario::parse("arm = { preset = 'irb1600-fitted', beta2_deg = 60 }", "here")?;
//! let [first, _] = modes(&scenario.build_arm()?);
//! assert!((first.frequency_hz - 22.16).abs() < 0.01);
//!
//! let mut plant = Plant::new(&scenario.plant_spec()?)?;
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
//! | [`arm`] | equations of motion, presets, kinematics, energy |
//! | [`integrate`] | one-step methods, for one motion or several side by side |
//! | [`analysis`] | modes, frequency responses, continuation and stability of forced motions |
//! | [`excitation`], [`rig`] | what is played on the arm; exciter, impedance head, accelerometers |
//! | [`plant`] | the arm with its instruments, sample by sample |
//! | [`identify`] | frequency responses, modes and joint angles from what the instruments said |
//! | [`control`] | exciter controllers: what answers a sample |
//! | [`node`] | plant and exciter controller as CAN nodes without IO |
//! | [`protocol`] | the CAN protocol, a crate of its own |
//! | [`bus`], [`realtime`], [`recording`] | buses; clocks and threads; MCAP files |
//! | [`scenario`] | everything about a run, in one TOML file |
//! | [`run`] | runs: a [`Session`](run::Session) puts a scenario, both ends, a bus, a recording and the pace together |
//! | [`conformance`] | whether a node on a bus keeps the protocol |
//! | [`replay`] | recordings: their frames sent again, their runs simulated again |
//! | [`can_log`] | frames in the log files of other tools |
//! | [`diff`], [`statistics`] | two recordings compared; what is in one, in numbers |
//! | [`export`], [`import`] | recordings in the formats of other tools, and logs of them as recordings |
//! | [`experiment`] | whole experiments of several runs, scored against what is computed |
//! | [`study`] | sweeps, basins of attraction and other studies over all cores, which can be stopped and gone on with |
//! | [`toml_error`] | what is wrong with a scenario or settings as TOML |
//! | [`cli`] | the program, with its figures, those of the paper, and the live view |
//!
//! [`arm`] to [`node`] are pure: no clock, no thread, no file, no socket, and `no_std` without the feature `std`. SI
//! units throughout; a number that is not in a typed quantity carries its unit in its name. A `sample` is one of the
//! bench's, a `step` one of the integrator's: a sample takes several.
//!
//! `README.md` says how to run the program, `DESIGN.md` why things are so.
#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

pub mod analysis;
pub mod arm;
pub mod control;
mod dft;
pub(crate) mod ensemble;
pub mod excitation;
pub mod identify;
pub mod integrate;
pub mod node;
mod noise;
mod number;
pub mod plant;
pub mod rig;
mod seed;

#[cfg(feature = "std")]
pub mod bus;
#[cfg(feature = "std")]
pub mod can_log;
#[cfg(feature = "std")]
pub mod conformance;
#[cfg(feature = "std")]
pub mod diff;
#[cfg(feature = "std")]
pub mod experiment;
#[cfg(feature = "std")]
pub mod export;
#[cfg(feature = "std")]
pub mod import;
#[cfg(feature = "live")]
mod live;
#[cfg(feature = "cli")]
mod paper;
#[cfg(feature = "cli")]
mod plot;
#[cfg(feature = "std")]
pub mod realtime;
#[cfg(feature = "std")]
pub mod recording;
#[cfg(feature = "std")]
pub mod replay;
#[cfg(feature = "std")]
pub mod run;
#[cfg(feature = "std")]
pub mod scenario;
#[cfg(feature = "std")]
mod staged;
#[cfg(feature = "std")]
pub mod statistics;
#[cfg(feature = "std")]
pub mod study;
#[cfg(feature = "std")]
mod text_file;
#[cfg(feature = "std")]
pub mod toml_error;

#[cfg(feature = "cli")]
pub mod cli;

pub use resonarm_protocol as protocol;
