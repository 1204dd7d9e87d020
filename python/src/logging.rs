//! Passes the library's log to Python's `logging`.
//!
//! A thread that logs must not wait for the interpreter's lock, so messages are kept until a call from Python passes
//! them to the logger `resonarm`.

use core::fmt::{Debug, Write};
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

use crate::errors;

/// Most messages that are kept; later ones are dropped.
const KEPT: usize = 256;

static MESSAGES: Mutex<Vec<(Level, String)>> = Mutex::new(Vec::new());

/// Keeps warnings and errors.
struct Keeper;

impl Subscriber for Keeper {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::WARN
    }

    fn new_span(&self, _span: &Attributes<'_>) -> Id {
        // All spans have the same identifier.
        Id::from_u64(1)
    }

    fn record(&self, _span: &Id, _values: &Record<'_>) {}

    fn record_follows_from(&self, _span: &Id, _follows: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut text = Text::default();
        event.record(&mut text);
        let mut messages = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
        // The first messages are nearest to a cause, and a long run must not fill the memory.
        if messages.len() < KEPT {
            messages.push((*event.metadata().level(), text.message + &text.fields));
        }
    }

    fn enter(&self, _span: &Id) {}

    fn exit(&self, _span: &Id) {}
}

/// A message, followed by its fields.
#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let _infallible = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.fields, ", {name}: {value:?}"),
        };
    }
}

/// Keeps log messages from now on.
pub fn begin() {
    // Refused if another subscriber is set, which then receives them.
    let _ = tracing::subscriber::set_global_default(Keeper);
}

/// Passes the messages kept to the logger.
pub fn hand_over(py: Python<'_>) -> PyResult<()> {
    // Taken out first: a handler of the logger may call this library, which would find the lock held.
    let messages = core::mem::take(&mut *MESSAGES.lock().unwrap_or_else(PoisonError::into_inner));
    if messages.is_empty() {
        return Ok(());
    }
    let logger = py.import("logging")?.call_method1("getLogger", ("resonarm",))?;
    for (level, message) in messages {
        logger.call_method1(
            if level == Level::ERROR { "error" } else { "warning" },
            // As an argument, so that a percent sign in the message does not format anything.
            ("%s", errors::printable(message)),
        )?;
    }
    Ok(())
}
