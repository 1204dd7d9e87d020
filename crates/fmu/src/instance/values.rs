//! The values of an instance's variables.

use super::{ALIVE, BEFORE, Instance, READABLE, Value};
use crate::fault::{Fault, WrongCall};
use crate::state::State;
use crate::terminal::{Interval, Terminal};
use crate::variables::{Causality, Kind, Source, Variable};

fn wrong_type(variable: &Variable) -> Fault {
    WrongCall::WrongType { name: variable.name.clone(), is: variable.kind.name() }.into()
}

impl Instance {
    /// The variable of a value reference, if it is of this type.
    fn variable(&self, reference: u32, kind: Kind) -> Result<&Variable, Fault> {
        let variable = self.any_variable(reference)?;
        if variable.kind == kind { Ok(variable) } else { Err(wrong_type(variable)) }
    }

    fn any_variable(&self, reference: u32) -> Result<&Variable, Fault> {
        let most = self.variables.len().saturating_sub(1);
        let unknown = WrongCall::UnknownReference { got: reference, most };
        Ok(self.variables.get(reference as usize).ok_or(unknown)?)
    }

    /// Returns the error for a variable whose value a function for a type that no variable has asks for.
    pub fn refused_type(&self, reference: u32) -> Fault {
        self.any_variable(reference).map_or_else(|fault| fault, wrong_type)
    }

    pub(super) fn expect_readable(&self) -> Result<(), Fault> {
        self.expect(&READABLE, "all states but that after an error")
    }

    /// The value of a variable of the type Float64.
    ///
    /// # Errors
    /// [`Fault::Call`] for no variable of this type, [`Fault::WrongState`]; before the simulation what is wrong with the
    /// parameters.
    pub fn float64(&mut self, reference: u32) -> Result<f64, Fault> {
        self.expect_readable()?;
        match self.variable(reference, Kind::Float64)?.source {
            Source::Time => Ok(self.time_s),
            Source::Load(index) => Ok(self.inputs[index]),
            // Parameters are read from here and not from the model, which need not be built to know them.
            Source::LinkAngle(index) => Ok(self.parameters.angles_deg[index]),
            source => Ok(self.model()?.number(source)),
        }
    }

    /// The value of a variable of the type UInt64.
    ///
    /// # Errors
    /// As [`Instance::float64`].
    pub fn uint64(&mut self, reference: u32) -> Result<u64, Fault> {
        self.expect_readable()?;
        match self.variable(reference, Kind::UInt64)?.source {
            Source::Seed => Ok(self.parameters.seed),
            source => Ok(self.model()?.count(source)),
        }
    }

    /// The value of a variable of the type Boolean.
    ///
    /// # Errors
    /// As [`Instance::float64`].
    pub fn boolean(&mut self, reference: u32) -> Result<bool, Fault> {
        self.expect_readable()?;
        match self.variable(reference, Kind::Boolean)?.source {
            Source::Noise => Ok(self.parameters.noise),
            Source::Overwrite => Ok(self.parameters.overwrite),
            source => Ok(self.model()?.number(source) != 0.0),
        }
    }

    /// The value of a variable of the type String.
    ///
    /// # Errors
    /// As [`Instance::float64`].
    pub fn string(&self, reference: u32) -> Result<&str, Fault> {
        self.expect_readable()?;
        self.variable(reference, Kind::String)?;
        Ok(&self.parameters.recording)
    }

    /// The bytes of a variable of the type Binary.
    ///
    /// # Errors
    /// As [`Instance::float64`].
    pub fn binary(&mut self, reference: u32) -> Result<&[u8], Fault> {
        self.expect_readable()?;
        match self.variable(reference, Kind::Binary)?.source {
            Source::TxData(index) => Ok(self.terminal(index)?.map_or(&[], |terminal| terminal.tx_data())),
            _ => Ok(&[]),
        }
    }

    /// Sets a variable of the type Binary: takes what came.
    ///
    /// # Errors
    /// As [`Instance::set`]; [`Fault::Operation`] of bytes that were cut.
    pub fn set_binary(&mut self, reference: u32, bytes: &[u8]) -> Result<(), Fault> {
        let source = self.settable(reference, Kind::Binary)?;
        // An empty value is the start value of a terminal, which importers set before there is event mode.
        if bytes.is_empty() {
            return Ok(());
        }
        self.expect(&[State::Event], "event mode")?;
        match source {
            Source::RxData(index) => self.terminal(index)?.map_or(Ok(()), |terminal| terminal.take(bytes)),
            _ => Ok(()),
        }
    }

    /// Whether a clock ticks in this iteration of event mode.
    ///
    /// # Errors
    /// [`Fault::Call`] for no variable of this type, [`Fault::WrongState`].
    pub fn clock(&mut self, reference: u32) -> Result<bool, Fault> {
        let source = self.variable(reference, Kind::Clock)?.source;
        self.expect(&[State::Initialization, State::Event], "initialization mode and event mode")?;
        match source {
            Source::TxClock(index) => Ok(self.terminal(index)?.is_some_and(|terminal| terminal.tx_clock())),
            _ => Ok(false),
        }
    }

    /// Lets a clock tick in this iteration of event mode, one that is an input.
    ///
    /// # Errors
    /// As [`Instance::clock`], and [`Fault::Call`] for a clock that can't be set.
    pub fn set_clock(&mut self, reference: u32, ticks: bool) -> Result<(), Fault> {
        let source = self.settable(reference, Kind::Clock)?;
        self.expect(&[State::Event], "event mode")?;
        if let Source::TxClock(index) = source
            && let Some(terminal) = self.terminal(index)?
        {
            terminal.tick(ticks);
        }
        Ok(())
    }

    /// Returns the interval until a countdown clock ticks next.
    ///
    /// # Errors
    /// As [`Instance::clock`]; [`Fault::Call`] for another clock.
    pub fn interval(&mut self, reference: u32) -> Result<Interval, Fault> {
        let Variable { source, causality, .. } = self.variable(reference, Kind::Clock)?;
        let (Source::TxClock(index), Causality::Input) = (*source, *causality) else {
            return Err(WrongCall::NotOffered { why: "the clock is not a countdown clock" }.into());
        };
        self.expect(&[State::Initialization, State::Event], "initialization mode and event mode")?;
        let is_event = self.state == State::Event;
        let model = self.model()?;
        if is_event {
            model.before_interval();
        }
        Ok(model.terminal(index).map_or(Interval::Unknown, |terminal| terminal.interval()))
    }

    fn terminal(&mut self, index: usize) -> Result<Option<&mut Terminal>, Fault> {
        Ok(self.model()?.terminal(index))
    }

    /// Checks that the variable may be set now.
    fn settable(&self, reference: u32, kind: Kind) -> Result<Source, Fault> {
        let Variable { name, source, causality, .. } = self.variable(reference, kind)?;
        let refused = |why| Err(WrongCall::NotSettable { name: name.clone(), state: self.state, why }.into());
        match causality {
            Causality::Input if ALIVE.contains(&self.state) => Ok(*source),
            Causality::Parameter if BEFORE.contains(&self.state) => Ok(*source),
            Causality::Input => refused("inputs can be set until the simulation ends"),
            Causality::Parameter => refused("parameters are fixed once initialization mode is left"),
            // What is calculated can be set in no state.
            Causality::Output | Causality::Independent => refused("it is calculated"),
        }
    }

    /// Sets a variable of the type of `value`.
    ///
    /// # Errors
    /// [`Fault::Call`] for no variable of this type that can be set now, [`Fault::Value`].
    pub fn set(&mut self, reference: u32, value: Value) -> Result<(), Fault> {
        let kind = match value {
            Value::Float64(_) => Kind::Float64,
            Value::UInt64(_) => Kind::UInt64,
            Value::Boolean(_) => Kind::Boolean,
        };
        let source = self.settable(reference, kind)?;
        if let Value::Float64(got) = value
            && !got.is_finite()
        {
            return Err(Fault::Value { name: self.variables[reference as usize].name.clone(), got });
        }
        match (source, value) {
            (Source::Load(index), Value::Float64(load)) => {
                self.inputs[index] = load;
                return Ok(());
            }
            (Source::LinkAngle(index), Value::Float64(angle_deg)) => self.parameters.angles_deg[index] = angle_deg,
            (Source::Seed, Value::UInt64(seed)) => self.parameters.seed = seed,
            (Source::Noise, Value::Boolean(noise)) => self.parameters.noise = noise,
            (Source::Overwrite, Value::Boolean(overwrite)) => self.parameters.overwrite = overwrite,
            _ => {}
        }
        // The model was built from the old parameters; it is built again when it is needed next.
        self.model = None;
        Ok(())
    }

    /// Sets a variable of the type String.
    ///
    /// # Errors
    /// As [`Instance::set`].
    pub fn set_string(&mut self, reference: u32, text: &str) -> Result<(), Fault> {
        self.settable(reference, Kind::String)?;
        self.parameters.recording = text.to_string();
        self.model = None;
        Ok(())
    }
}
