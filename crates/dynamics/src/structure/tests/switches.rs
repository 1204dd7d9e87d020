//! Elements in time.
