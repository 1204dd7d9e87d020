//! Recordings: MCAP files written by a thread of their own, and read back.
//!
//! This room knows nothing of the arm: it is handed plain numbers ([`Record`]), and a clock where it needs one.
//!
//! ```no_run
//! use resonarm::recording::{Configuration, Options, Record, Recorder};
//!
//! # fn records() -> Vec<Record> { Vec::new() }
//! let configuration = Configuration::new().with("scenario", "preset = \"irb1600-fitted\"").with("seed", 1);
//! let recorder = Recorder::create("run.mcap", &configuration, Options::virtual_time(1e-3, "memory"))?;
//! let mut channel = recorder.channel("plant", 8192)?;
//! for record in records() {
//!     channel.push_blocking(record)?;
//! }
//! let summary = recorder.finish(&[("overruns", "0".to_string())])?;
//! println!("{} bytes", summary.bytes);
//! # Ok::<(), resonarm::recording::RecordingError>(())
//! ```

mod batch;
mod build_info;
mod error;
mod options;
mod record;
mod recorder;
mod schema;
mod sink;
mod writer;

pub use build_info::{BuildInfo, build_info};
pub use error::RecordingError;
pub use options::{Compression, Configuration, Existing, FlushPolicy, Options, TimeBase};
pub use record::{Direction, Event, FrameRecord, Record, SampleRecord, StepRecord, TickRecord};
pub use recorder::{Channel, Pushed, Recorder, Summary};
pub use schema::Topic;
