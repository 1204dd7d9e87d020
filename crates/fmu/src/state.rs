//! The states of an instance, as FMI names them.

use core::fmt;

/// The state of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// The instance was created or reset, and is not yet initialized.
    Instantiated,
    /// The instance is in initialization mode.
    Initialization,
    /// The instance is in event mode.
    Event,
    /// The instance is in step mode.
    Step,
    /// The simulation has ended.
    Terminated,
    /// A call has failed.
    Failed,
}

impl State {
    const ALL: [State; 6] =
        [State::Instantiated, State::Initialization, State::Event, State::Step, State::Terminated, State::Failed];

    /// The state of this number.
    pub(crate) fn of(number: u8) -> Option<State> {
        State::ALL.into_iter().find(|state| *state as u8 == number)
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            State::Instantiated => "the state Instantiated",
            State::Initialization => "initialization mode",
            State::Event => "event mode",
            State::Step => "step mode",
            State::Terminated => "the state Terminated",
            State::Failed => "the state after an error",
        })
    }
}
