//! A point at which simulated time stands still, and functions of the caller.

use std::sync::Arc;

/// A function of the caller's, which has no text for `Debug`.
pub(super) struct Callback<R>(pub Arc<dyn Fn() -> R + Send + Sync>);

impl<R> Clone for Callback<R> {
    fn clone(&self) -> Callback<R> {
        Callback(Arc::clone(&self.0))
    }
}

impl<R> core::fmt::Debug for Callback<R> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Callback")
    }
}

/// Holds simulated time before a sample.
#[derive(Clone, Debug)]
pub(super) struct Hold {
    /// Sample before which time stands.
    pub sample: u64,
    /// Says whether time goes on.
    pub is_over: Callback<bool>,
}
