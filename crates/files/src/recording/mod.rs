//! Recordings: MCAP files that a separate thread writes, and that are read back.
//!
//! Nothing here depends on the arm: the recorder is passed plain numbers ([`Record`]), and a clock where it needs one.
//!
//! ```no_run
//! use resonarm_files::recording::{Configuration, Options, Record, Recorder};
//!
//! # fn records() -> Vec<Record> { Vec::new() }
//! let configuration = Configuration::new().with("scenario", "preset = \"irb1600-fitted\"").with("seed", 1);
//! let recorder = Recorder::create("run.mcap", &configuration, Options::virtual_time(1e-3, "memory"))?;
//! let mut channel = recorder.channel("plant", 8192)?;
//! for record in records() {
//!     channel.push_blocking(&record)?;
//! }
//! let summary = recorder.finish(&[("overruns", "0".to_string())])?;
//! println!("{} bytes", summary.bytes);
//! # Ok::<(), resonarm_files::recording::RecordingError>(())
//! ```

mod batch;
mod build_info;
pub mod channels;
mod checked_reader;
mod contents;
mod decode;
mod error;
mod frames;
mod layout;
mod lengths;
mod number_batch;
mod options;
mod plots;
mod reader;
mod record;
mod recorder;
mod records;
mod recover;
mod salvage;
mod scan;
mod schema;
mod shared;
mod sink;
pub mod slots;
mod summary;
mod writer;

pub use crate::staged::Existing;
pub use batch::{Batch, Batcher};
pub use build_info::{BuildInfo, build_info};
pub use error::RecordingError;
pub use frames::FrameBatcher;
pub use layout::{ChannelsError, Layout, Plot};
pub use number_batch::{NumberBatch, Numbers};
pub use options::{Compression, FlushPolicy, Naming, Options};
pub use plots::Plots;
pub use reader::Recording;
pub use record::{Clipped, Direction, Event, FrameRecord, Record, SampleRecord, StateRecord, TickRecord};
pub use recorder::{Channel, Pushed, Recorder};
pub use records::Records;
pub use recover::{MissingSamples, Recovered, recover};
pub use salvage::LostChunk;
pub use schema::{Topic, proto};
pub use summary::{Integrity, Origin, RecordedFault, RecordingSummary, RunTime, TopicSummary};
pub use writer::Summary;

pub use resonarm_scenario::Configuration;
