//! The plant by its signals: loads in, readings and states out.
//!
//! ```text
//! sample k:  measure once, as it draws noise  →  hold the load set at the first step from here on  →  advance to k + 1
//! ```
//!
//! A step of the importer may have many samples or be a part of one. Samples are counted, t_k = start + k/rate, so that
//! the steps change no bit.

use crate::fault::Fault;
use crate::model::{Inputs, Model, Span, TOLERANCE_SAMPLES, reached};
use crate::model_state::{Measured, Saved, SavedSignals, of_other_interface};
use crate::tape::Tape;
use crate::variables::Source;
use resonarm_bench::rig::{Load, MOST_CHANNELS};
use resonarm_bus::Statistics;
use resonarm_files::recording::Record;
use resonarm_session::run::{Session, sample_record, state_record};

/// The plant with its recording.
pub(crate) struct Signals {
    session: Session,
    rate_hz: f64,
    now: Measured,
    tape: Option<Tape>,
}

impl Signals {
    pub fn new(session: Session) -> Signals {
        let mut plant = session.plant_at_start();
        // Sample 0 is measured at once: the importer may read its outputs in initialization mode already.
        let measurement = plant.measure();
        let rate_hz = session.scenario().simulation.rate_hz;
        Signals { rate_hz, now: Measured { plant, measurement, held: None }, tape: None, session }
    }

    fn record(&mut self, record: impl FnOnce(&Measured) -> Record) {
        if let Some(tape) = &mut self.tape {
            tape.push(record(&self.now));
        }
    }

    fn record_sample(&mut self) {
        self.record(|now| Record::Sample(sample_record(&now.measurement)));
    }

    /// The load that is held from the sample on: the one that is set now, if its hold begins now.
    fn hold(&mut self, inputs: &Inputs) -> Result<Load, Fault> {
        if let Some(held) = self.now.held {
            return Ok(held);
        }
        let load = Load::from_parts(inputs);
        let exciter = self.now.plant.exciter();
        if !exciter.can_produce(&load) {
            let (limit_n, limit_nm) = exciter.limits();
            return Err(Fault::Load { load, limit_n, limit_nm });
        }
        self.now.held = Some(load);
        Ok(load)
    }

    /// Advances to the next sample and measures it.
    fn advance(&mut self, load: Load) -> Result<(), Fault> {
        // Taken before the plant advances, but recorded only if it does: a hold that fails is not in the recording.
        let before = state_record(&self.now.plant, &load, false);
        self.now.plant.advance(&load)?;
        self.record(|_| before);
        self.now.measurement = self.now.plant.measure();
        self.now.held = None;
        self.record_sample();
        Ok(())
    }
}

impl Model for Signals {
    fn begin(&mut self) -> Result<(), Fault> {
        self.tape = Tape::open(&self.session, "fmu")?;
        self.record_sample();
        Ok(())
    }

    fn step(&mut self, span: Span, inputs: &Inputs) -> Result<bool, Fault> {
        let last = reached(span.to_s, self.rate_hz);
        while self.now.plant.sample() < last {
            let load = self.hold(inputs)?;
            self.advance(load)?;
        }
        // A step that ends at a sample does not begin its hold.
        if self.now.plant.sample() == last && span.to_s * self.rate_hz > last as f64 + TOLERANCE_SAMPLES {
            self.hold(inputs)?;
        }
        if let Some(tape) = &mut self.tape {
            tape.flush()?;
        }
        Ok(false)
    }

    fn number(&self, source: Source) -> f64 {
        let reading = |index: usize| self.now.measurement.reading(index).unwrap_or_default();
        match source {
            Source::Reading(index) => reading(index).value,
            Source::Clipped(index) => f64::from(u8::from(reading(index).clipped)),
            Source::Sampled(index) => {
                let mut sampled = [0.0; MOST_CHANNELS];
                self.now.plant.structure().sense(&mut sampled);
                sampled.get(index).copied().unwrap_or(f64::NAN)
            }
            Source::State(index) => self.now.plant.states().get(index).copied().unwrap_or(f64::NAN),
            _ => f64::NAN,
        }
    }

    fn count(&self, _source: Source) -> u64 {
        self.now.plant.sample()
    }

    fn save(&mut self) -> Result<Saved, Fault> {
        let mark = self.tape.as_mut().map(Tape::mark);
        Ok(Saved::Signals(Box::new(SavedSignals { now: self.now.clone(), mark })))
    }

    fn restore(&mut self, saved: &Saved) -> Result<(), Fault> {
        let Saved::Signals(saved) = saved else { return Err(of_other_interface()) };
        if let Some(tape) = &mut self.tape {
            tape.rewind(saved.mark.as_deref(), saved.now.plant.sample())?;
        }
        self.now = saved.now.clone();
        Ok(())
    }

    fn end(&mut self) -> Result<(), Fault> {
        self.record(|now| state_record(&now.plant, &Load::default(), true));
        match self.tape.take() {
            Some(tape) => Ok(tape.finish(&self.session, self.now.plant.sample(), Statistics::default())?),
            None => Ok(()),
        }
    }
}
