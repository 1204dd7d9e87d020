//! A live view of a run or a recording in a browser.
//!
//! ```text
//! run loop ── ring ──► server thread: model ──► messages, made once ──► every viewer
//! player of a recording ──►                └──► Foxglove WebSocket
//! ```
//!
//! A watched loop pushes plain records into its ring ([`run::watch`](resonarm_session::run::watch())) and never
//! waits. One thread takes them thirty times a second, keeps the data that later viewers need, reduces the samples to
//! extremes, and sends each message to all viewers. A viewer that is too slow loses updates, which are counted; the
//! loop is not affected. Requests return through another ring, and pass the node's own gate.

extern crate alloc;

mod about;
mod admission;
mod branches;
mod connections;
mod error;
mod extremes;
mod foxglove;
mod message;
mod missed;
mod model;
mod moving;
mod page;
mod player;
mod rows;
mod server;
mod shared;
mod source;
mod spectrum;
mod test_panel;
mod under_test;
mod viewer;

pub use about::{About, Action, CoordinateChannels, Steering};
pub use admission::Origins;
pub use branches::ComputeBranch;
pub use error::LiveError;
pub use message::{BranchLines, SPEEDS};
pub use model::Model;
pub use player::{Play, play};
pub use server::{Live, Options, Shown, serve};
pub use source::Source;
pub use under_test::UnderTest;
