//! State and queues that the tasks of the server share.

use std::sync::atomic::{AtomicU64, AtomicUsize};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::extract::ws::Message;
use tokio::sync::{Semaphore, broadcast};

use super::admission::{Origins, Token};
use super::foxglove::{Channel, Published};
use super::model::Model;
use super::source::Source;

/// State shared by the server's tasks.
pub struct Shared {
    pub model: Mutex<Model>,
    pub source: Mutex<Source>,
    pub updates: broadcast::Sender<Message>,
    pub published: broadcast::Sender<Arc<Vec<Published>>>,
    pub token: Token,
    pub lost_updates: AtomicU64,
    pub viewers: AtomicUsize,
    /// Turns of the viewers that are sent all that is kept of the run, each a copy of some MB.
    pub greetings: Semaphore,
    pub session: String,
    /// The channels published for Foxglove.
    pub channels: Vec<Channel>,
    pub origins: Origins,
}

/// The model and the source are consistent between any two calls, so a panic elsewhere does not spoil them.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
