//! A run or a recording in a browser, while it goes.
//!
//! ```text
//! run loop ── ring ──► server thread: model ──► messages, made once ──► every viewer
//! player of a recording ──►                └──► Foxglove WebSocket
//! ```
//!
//! A loop that is watched pushes plain records into a ring of its own ([`run::watch`](resonarm_session::run::watch())) and never
//! waits. One thread takes them thirty times a second, keeps what later viewers need, thins the samples out to
//! extremes, and sends each message to all viewers. Who is too slow loses updates, which are counted; the loop knows
//! nothing of it. What somebody asks for goes back through a ring as well, and passes the node's own gate.

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
mod moving_arm;
mod page;
mod player;
mod rows;
mod server;
mod source;
mod spectrum;
mod viewer;

pub use about::{About, Action, Steering};
pub use admission::Origins;
pub use branches::ComputeBranch;
pub use error::LiveError;
pub use message::{BranchLines, SPEEDS};
pub use model::Model;
pub use player::{Play, play};
pub use server::{Live, Options, Shown, serve};
pub use source::Source;
