//! What an exciter controller plays on the arm, and how it reads the answer.

mod profile;
mod sine_fit;
mod spec;

pub use profile::{Profile, Window};
pub use sine_fit::{Phasor, SineFit};
pub use spec::{Amplitude, ExcitationError, ExcitationSpec, Waveform};

#[cfg(test)]
mod tests;
