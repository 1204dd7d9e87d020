//! Excitation signals of an exciter controller, and the reading of the arm's response.

mod error;
mod harmonic_fit;
mod load_file;
mod profile;
mod spec;
mod spectrum;
mod synthesis;
mod waveform;

pub use error::ExcitationError;
pub(crate) use error::check_amplitude;
pub use harmonic_fit::{HarmonicFit, Phasor, SineFit};
pub use load_file::{LoadFile, LoadFileError};
pub use profile::{Profile, Window};
pub use spec::ExcitationSpec;
pub use spectrum::Spectrum;
pub use waveform::{Phases, SweepLaw, Waveform};

#[cfg(test)]
mod signal_tests;
#[cfg(test)]
mod tests;
