//! Shared flags and counters of a running session: the request to stop, progress, gauges; and the events of a run.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use serde::{Serialize, Serializer};

use super::fault::Fault;
use super::gauges::Gauges;
use resonarm_bus::{BusError, ControllerState};
use resonarm_protocol::Id;

/// Signals between the run's threads and the rest of the program.
#[derive(Debug, Default)]
pub struct Signals {
    stop: AtomicBool,
    /// Whether the exciter of the same process has ended, so that nobody arms the plant any more.
    has_exciter_ended: AtomicBool,
    done: AtomicU64,
    responses: AtomicU64,
    gauges: Gauges,
}

impl Signals {
    /// Asks the run to end in order.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Says whether the run was asked to end.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Sets whether the exciter of the same process has ended.
    pub(super) fn set_exciter_ended(&self, has_ended: bool) {
        self.has_exciter_ended.store(has_ended, Ordering::Release);
    }

    /// Says whether the only exciter on the plant's bus has ended: a plant that is not armed by then never will be.
    pub(super) fn has_exciter_ended(&self) -> bool {
        self.has_exciter_ended.load(Ordering::Acquire)
    }

    /// Returns the progress: the current sample of a run, or the count of any other work.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Returns the number of responses that the exciter has read.
    pub fn responses(&self) -> u64 {
        self.responses.load(Ordering::Relaxed)
    }

    /// Returns the gauges, by which the run's loop shows its state and timing.
    pub fn gauges(&self) -> &Gauges {
        &self.gauges
    }

    /// Sets how many responses the controller has read.
    pub fn set_responses(&self, responses: usize) {
        self.responses.store(responses as u64, Ordering::Relaxed);
    }

    /// Sets how many samples are done.
    pub fn set_done(&self, done: u64) {
        self.done.store(done, Ordering::Relaxed);
    }
}

/// Cause of a loss of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BusLoss {
    /// The controller is bus-off (ISO 11898-1).
    BusOff,
    /// The interface is down.
    Down,
}

impl BusLoss {
    /// Returns the cause of the loss, from the error of a bus that may come back.
    pub(super) const fn of(error: &BusError) -> BusLoss {
        match error {
            BusError::BusOff { .. } => BusLoss::BusOff,
            _ => BusLoss::Down,
        }
    }
}

/// Something that happened to a plant during a run. `sample` is the index of the sample at which it was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum RunEvent {
    /// The plant is on its bus and can be armed.
    Ready,
    /// The plant was armed.
    Armed {
        /// Sample at which the plant was armed.
        sample: u64,
    },
    /// The plant was disarmed.
    Disarmed {
        /// Sample at which the plant was disarmed.
        sample: u64,
    },
    /// The plant went to the state fault.
    Faulted {
        /// Fault that was latched.
        fault: Fault,
        /// The fault that the exciter reported, where that is the reason.
        #[serde(skip_serializing_if = "Option::is_none")]
        partner: Option<Fault>,
    },
    /// The plant rejected the request to arm.
    NotArmed {
        /// Reason of the rejection.
        fault: Fault,
    },
    /// The run was late, and its schedule moved ([`OverrunPolicy::Slip`](resonarm_realtime::OverrunPolicy::Slip)).
    Slipped {
        /// Sample at which the schedule moved.
        sample: u64,
        /// Number of sample periods by which it moved.
        periods: u32,
    },
    /// The bus is lost, perhaps for a while.
    BusLost {
        /// Sample at which the loss was found.
        sample: u64,
        /// The cause of the loss of the bus.
        cause: BusLoss,
    },
    /// The bus works again.
    BusBack {
        /// Sample at which the bus worked again.
        sample: u64,
    },
    /// A frame arrived under an identifier that only the plant sends, and that is not of its network; the first of a
    /// run.
    OtherSender {
        /// Sample at which the frame was received.
        sample: u64,
        /// Identifier of the frame.
        #[serde(serialize_with = "as_number")]
        identifier: Id,
    },
    /// The CAN controller of the plant's end has entered another state. The run continues.
    Controller {
        /// Sample at which the report was read.
        sample: u64,
        /// State that the controller has entered.
        state: ControllerState,
    },
}

fn as_number<S: Serializer>(identifier: &Id, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u32(identifier.raw())
}
