//! An instance: the states of FMI, its times and the values of its variables, on one model.
//!
//! ```text
//! Instantiated → Initialization → Step ⇄ Event → Terminated        a fault → Failed → Reset, SetFMUState or Free
//! ```

mod saved;
mod values;

use std::path::Path;

use crate::construction::{build, variables};
use crate::content::{Content, Interface};
use crate::fault::{Fault, WrongCall};
use crate::model::{Inputs, Model, Parameters, Span, TOLERANCE_SAMPLES};
use crate::model_state::Saved;
use crate::state::State;
use crate::variables::Variable;

/// A value of a variable, of the types that are numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A value of the type Float64.
    Float64(f64),
    /// A value of the type UInt64.
    UInt64(u64),
    /// A value of the type Boolean.
    Boolean(bool),
}

/// A state that an importer holds.
#[derive(Clone, Debug)]
pub struct SavedInstance {
    token: String,
    state: State,
    start_s: f64,
    time_s: f64,
    parameters: Parameters,
    inputs: Inputs,
    model: Saved,
}

/// An FMU that is simulated.
pub struct Instance {
    content: Content,
    token: String,
    variables: Vec<Variable>,
    state: State,
    event_mode_used: bool,
    start_s: f64,
    time_s: f64,
    parameters: Parameters,
    inputs: Inputs,
    /// Built when it is first needed, and again after a parameter is set.
    model: Option<Box<dyn Model>>,
}

/// States before the simulation, in which parameters may be set.
const BEFORE: [State; 2] = [State::Instantiated, State::Initialization];
/// States in which inputs may be set.
const ALIVE: [State; 4] = [State::Instantiated, State::Initialization, State::Event, State::Step];
/// States in which variables may be read.
const READABLE: [State; 5] = [State::Instantiated, State::Initialization, State::Event, State::Step, State::Terminated];

impl Instance {
    /// An instance of the FMU with the resources in `folder`; `token` is what its description says.
    ///
    /// # Errors
    /// As [`Content::read`], and [`Fault::Run`] if no run can be made of the scenario.
    pub fn new(folder: &Path, token: &str, event_mode_used: bool) -> Result<Instance, Fault> {
        let content = Content::read(folder, token)?;
        if content.settings.interface == Interface::Can && !event_mode_used {
            return Err(WrongCall::NeedsEventMode.into());
        }
        let parameters = Parameters::of(&content.scenario);
        let variables = variables(&content)?;
        Ok(Instance {
            parameters,
            variables,
            content,
            token: token.to_string(),
            state: State::Instantiated,
            event_mode_used,
            start_s: 0.0,
            time_s: 0.0,
            inputs: Inputs::default(),
            model: None,
        })
    }

    /// A call has failed: from now on only a reset, an earlier state or the end is possible.
    pub fn fail(&mut self) {
        self.state = State::Failed;
    }

    fn expect(&self, states: &[State], legal: &'static str) -> Result<(), Fault> {
        if states.contains(&self.state) { Ok(()) } else { Err(Fault::WrongState { state: self.state, legal }) }
    }

    fn model(&mut self) -> Result<&mut dyn Model, Fault> {
        // Built when it is first needed, since parameters may be set until then.
        let model = match self.model.take() {
            Some(model) => model,
            None => build(&self.content, &self.parameters)?,
        };
        Ok(&mut **self.model.insert(model))
    }

    /// Enters initialization mode, with the simulation's start at `start_s`, s.
    ///
    /// # Errors
    /// [`Fault::WrongState`], [`Fault::Call`] for a start that is not finite.
    pub fn enter_initialization(&mut self, start_s: f64) -> Result<(), Fault> {
        self.expect(&[State::Instantiated], "the state Instantiated")?;
        if !start_s.is_finite() {
            return Err(WrongCall::StartTime { got_s: start_s }.into());
        }
        self.start_s = start_s;
        self.time_s = start_s;
        self.state = State::Initialization;
        Ok(())
    }

    /// Leaves initialization mode, and begins the simulation.
    ///
    /// # Errors
    /// [`Fault::WrongState`]; what is wrong with the parameters; a recording that can't be created.
    pub fn exit_initialization(&mut self) -> Result<(), Fault> {
        self.expect(&[State::Initialization], "initialization mode")?;
        self.model()?.begin()?;
        self.state = if self.event_mode_used { State::Event } else { State::Step };
        Ok(())
    }

    /// Enters the event mode of FMI.
    ///
    /// # Errors
    /// [`Fault::WrongState`], also if the importer said that it does not use it.
    pub fn enter_event(&mut self) -> Result<(), Fault> {
        let legal = if self.event_mode_used { &[State::Step][..] } else { &[] };
        self.expect(legal, "step mode, with eventModeUsed at the instantiation")?;
        self.state = State::Event;
        Ok(())
    }

    /// Enters the step mode of FMI.
    ///
    /// # Errors
    /// [`Fault::WrongState`].
    pub fn enter_step(&mut self) -> Result<(), Fault> {
        self.expect(&[State::Event], "event mode")?;
        self.state = State::Step;
        Ok(())
    }

    /// Ends an iteration of event mode; another is needed if it returns `true`.
    ///
    /// # Errors
    /// [`Fault::WrongState`]; what is wrong with the frames that came in.
    pub fn update_discrete_states(&mut self) -> Result<bool, Fault> {
        self.expect(&[State::Event], "event mode")?;
        self.model()?.update()
    }

    /// Checks that discrete states may be evaluated now: there is nothing to do for it.
    ///
    /// # Errors
    /// [`Fault::WrongState`].
    pub fn evaluate_discrete_states(&self) -> Result<(), Fault> {
        let legal = [State::Initialization, State::Event];
        self.expect(&legal, "initialization mode and event mode")
    }

    /// Ends the simulation, and its recording.
    ///
    /// # Errors
    /// [`Fault::WrongState`]; a recording that can't be finished.
    pub fn terminate(&mut self) -> Result<(), Fault> {
        self.expect(&[State::Event, State::Step], "event mode and step mode")?;
        self.state = State::Terminated;
        self.model()?.end()
    }

    /// Returns to what it was when it was made; a recording ends.
    ///
    /// # Errors
    /// A recording that can't be finished.
    pub fn reset(&mut self) -> Result<(), Fault> {
        // The instance is reset even if its recording can't be finished; that error is returned at the end.
        let ended = self.model.take().map_or(Ok(()), |mut model| model.end());
        self.state = State::Instantiated;
        self.parameters = Parameters::of(&self.content.scenario);
        self.inputs = Inputs::default();
        self.start_s = 0.0;
        self.time_s = 0.0;
        ended
    }

    /// Simulates from `from_s` on for `length_s`, s. Returns whether event mode is needed then.
    ///
    /// # Errors
    /// [`Fault::WrongState`]; [`Fault::Call`] of the times; what the model says.
    pub fn step(&mut self, from_s: f64, length_s: f64) -> Result<bool, Fault> {
        self.expect(&[State::Step], "step mode")?;
        if !(length_s.is_finite() && length_s >= 0.0) {
            return Err(WrongCall::StepSize { got_s: length_s }.into());
        }
        let tolerance_s = TOLERANCE_SAMPLES / self.content.scenario.simulation.rate_hz;
        // NaN is no more than the tolerance away from any time, so it is asked for by itself.
        if (from_s - self.time_s).abs() > tolerance_s || from_s.is_nan() {
            return Err(WrongCall::StepStart { got_s: from_s, at_s: self.time_s }.into());
        }
        let to_s = from_s + length_s;
        // A step below the resolution of the time would leave the FMU where it is, however often it is called.
        if length_s > 0.0 && to_s <= from_s {
            return Err(WrongCall::StepTooSmall { got_s: length_s, at_s: from_s }.into());
        }
        let span = Span { from_s: from_s - self.start_s, to_s: to_s - self.start_s };
        let inputs = self.inputs;
        let event = self.model()?.step(span, &inputs)?;
        self.time_s = to_s;
        Ok(event)
    }

    /// Returns the time of the simulation, s.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The state now, to return to.
    ///
    /// # Errors
    /// [`Fault::WrongState`] after an error; [`Fault::Call`] of a model without states.
    pub fn save(&mut self) -> Result<SavedInstance, Fault> {
        self.expect_readable()?;
        let model = self.model()?.save()?;
        Ok(SavedInstance {
            token: self.token.clone(),
            state: self.state,
            start_s: self.start_s,
            time_s: self.time_s,
            parameters: self.parameters.clone(),
            inputs: self.inputs,
            model,
        })
    }

    /// Returns to a state, from any other.
    ///
    /// # Errors
    /// [`Fault::Saved`] of another FMU, [`Fault::Recorded`] if a recording has already what came behind it.
    pub fn restore(&mut self, saved: &SavedInstance) -> Result<(), Fault> {
        if saved.token != self.token {
            return Err(Fault::Saved("its instantiation token is that of another FMU"));
        }
        // The model is built from the parameters, so other ones need another model.
        if saved.parameters != self.parameters {
            self.model = None;
            self.parameters = saved.parameters.clone();
        }
        self.model()?.restore(&saved.model)?;
        self.state = saved.state;
        self.start_s = saved.start_s;
        self.time_s = saved.time_s;
        self.inputs = saved.inputs;
        Ok(())
    }

    /// A state as bytes.
    ///
    /// # Errors
    /// [`Fault::Call`] of a model whose states have no such form.
    pub fn serialize(&self, saved: &SavedInstance) -> Result<Vec<u8>, Fault> {
        Ok(saved::write(saved).ok_or(WrongCall::NotOffered { why: "canSerializeFMUState is false" })?)
    }

    /// The state that `bytes` are.
    ///
    /// # Errors
    /// [`Fault::Saved`] if they are none of this FMU.
    pub fn deserialize(&self, bytes: &[u8]) -> Result<SavedInstance, Fault> {
        saved::read(bytes, &self.token, |parameters| Ok(parameters.session(&self.content)?.plant_at_start()))
    }
}

impl Drop for Instance {
    /// A recording ends even if the importer does not terminate the simulation.
    fn drop(&mut self) {
        if let Some(model) = &mut self.model {
            // There is nobody to hear of a failure.
            let _unfinished = model.end();
        }
    }
}

#[cfg(test)]
mod tests;
