//! The forced arm by integration in time: the reference for bench measurements and computed branches.
//!
//! The motion is sampled once a period of the excitation, always at phase 0: that is the [`StroboscopicMap`]. A motion
//! that repeats after n periods is a fixed point of its nth power, a quasi-periodic one a closed curve, a chaotic one a
//! scatter. [`settle()`] follows the map until it can prove where the transient ends; [`Sweep`] does so for one value
//! of a parameter after the other, each from where the last one ended, like a stepped sweep on a bench. The points in
//! which a settled motion meets the map's section are its Poincaré section; over a range of a parameter they are the
//! bifurcation diagram.
//!
//! Structures have the same in [`crate::structure::time_domain`].

mod basins;
mod error;
mod fates;
mod fixed_point;
mod hysteresis;
mod map;
mod measure;
mod path;
mod settle;
mod strobe;
mod sweep;

pub use basins::{StableMotion, StateCoordinate, UnknownStateCoordinate, outcomes, reach, stable_motions};
pub use error::TimeDomainError;
pub use fates::BasinOutcome;
pub use hysteresis::hysteresis;
pub use measure::readings;
pub use path::path;
pub use settle::{SettleOptions, Settled, settle};
pub use strobe::StroboscopicMap;
pub use sweep::{Direction, Grid, Sweep, SweepFrequencies, SweepParameter};

pub(crate) use basins::{REACH, WINDOW};
pub(crate) use fates::{Attractor, fates};
pub(crate) use fixed_point::FixedPoint;
pub(crate) use map::Strobe;
pub(crate) use measure::UNSETTLED_PERIODS;
pub(crate) use settle::follow;
pub(crate) use strobe::{MOST_STEPS, steps_in_period};
pub(crate) use sweep::STEPS;

#[cfg(test)]
mod tests;
