//! Any forced system by integration in time: the reference for bench measurements and computed branches.
//!
//! The motion is sampled once a period of the excitation, always at phase 0: that is the stroboscopic map. A motion
//! that repeats after n periods is a fixed point of its nth power, a quasi-periodic one a closed curve, a chaotic one a
//! scatter. The map is followed until it can be proved where the transient ends ([`SettleOptions`]), or from many states
//! to the fixed points that they reach ([`BasinOutcome`]). [`crate::structure::time_domain`] has the map of a structure,
//! and what is made of it.

mod error;
mod fates;
mod fixed_point;
mod hysteresis;
mod map;
mod settle;
mod sweep;

pub use error::TimeDomainError;
pub use fates::BasinOutcome;
pub use hysteresis::hysteresis;
pub use settle::SettleOptions;
pub use sweep::{Direction, Grid};

pub(crate) use fates::{Attractor, fates};
pub(crate) use fixed_point::FixedPoint;
pub(crate) use map::Strobe;
pub(crate) use settle::follow;
pub(crate) use sweep::STEPS;
