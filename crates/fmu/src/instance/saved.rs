//! States as bytes: little-endian numbers behind a head that names the FMU, the version and the length.

use crate::fault::Fault;
use crate::model::Parameters;
use crate::model_state::{Measured, Saved, SavedSignals};
use crate::state::State;
use resonarm_bench::plant::Plant;
use resonarm_bench::rig::{Load, MOST_MORE, Measurement, Reading, Readings};
use resonarm_bench::structure::LOADS;

use super::SavedInstance;

/// First bytes of a saved state: the name and version of the format.
const MAGIC: [u8; 8] = *b"rsnfmu\0\x03";

/// A state as bytes; `None` of a model that has no such form.
pub(crate) fn write(saved: &SavedInstance) -> Option<Vec<u8>> {
    let Saved::Signals(model) = &saved.model else { return None };
    let SavedSignals { now, .. } = &**model;
    let numbers = now.plant.clone().save();
    let mut bytes = MAGIC.to_vec();
    bytes.extend((saved.token.len() as u64).to_le_bytes());
    bytes.extend(saved.token.as_bytes());
    bytes.push(saved.state as u8);
    put(&mut bytes, &[saved.start_s, saved.time_s]);
    put(&mut bytes, &saved.inputs);
    let Parameters { angles_deg, seed, noise, recording, overwrite } = &saved.parameters;
    bytes.extend((angles_deg.len() as u64).to_le_bytes());
    put(&mut bytes, angles_deg);
    bytes.extend(seed.to_le_bytes());
    bytes.extend([u8::from(*noise), u8::from(*overwrite)]);
    bytes.extend((recording.len() as u64).to_le_bytes());
    bytes.extend(recording.as_bytes());
    bytes.extend(now.plant.sample().to_le_bytes());
    let held = now.held.map(|load| load.parts());
    bytes.push(u8::from(held.is_some()));
    put(&mut bytes, &held.unwrap_or_default());
    for reading in now.measurement.readings() {
        put(&mut bytes, &[reading.value]);
        bytes.push(u8::from(reading.clipped));
    }
    bytes.extend((now.measurement.more.values().len() as u64).to_le_bytes());
    bytes.extend(now.measurement.more.clipped().to_le_bytes());
    put(&mut bytes, now.measurement.more.values());
    bytes.extend((numbers.len() as u64).to_le_bytes());
    put(&mut bytes, &numbers);
    Some(bytes)
}

/// The state that `bytes` are, of the FMU with this token; `plant` makes the plant of the parameters at its start.
pub(crate) fn read(
    bytes: &[u8],
    token: &str,
    plant: impl FnOnce(&Parameters) -> Result<Plant, Fault>,
) -> Result<SavedInstance, Fault> {
    let mut rest = Rest { bytes };
    // The last of these bytes is the version of the layout, which changes with `write`.
    if rest.take::<8>()? != MAGIC {
        return Err(Fault::Saved("it does not begin as a state, or is of another version"));
    }
    if rest.text()? != token {
        return Err(Fault::Saved("its instantiation token is that of another FMU"));
    }
    let state = State::of(rest.byte()?).ok_or(Fault::Saved("its FMI state is unknown"))?;
    let [start_s, time_s] = rest.numbers()?;
    let inputs = rest.numbers::<{ LOADS.len() }>()?;
    let count = rest.length()?;
    let angles_deg = rest.list(count)?;
    let seed = u64::from_le_bytes(rest.take()?);
    let [noise, overwrite] = [rest.flag()?, rest.flag()?];
    let recording = rest.text()?.to_string();
    let parameters = Parameters { angles_deg, seed, noise, recording, overwrite };
    let sample = u64::from_le_bytes(rest.take()?);
    let held = rest.flag()?;
    let load = rest.numbers::<{ LOADS.len() }>()?;
    let head_force_n = [rest.reading()?, rest.reading()?];
    let acceleration_b_m_s2 = [rest.reading()?, rest.reading()?];
    let acceleration_c_m_s2 = [rest.reading()?, rest.reading()?];
    let others = rest.length()?;
    let clipped = u32::from_le_bytes(rest.take()?);
    let mut more = [0.0; MOST_MORE];
    let more = more.get_mut(..others).ok_or(Fault::Saved("it has more readings than a rig can have"))?;
    for value in more.iter_mut() {
        [*value] = rest.numbers()?;
    }
    // Refuses marks beyond the readings, which would be the clipping of sensors that this FMU does not have.
    let more = Readings::new(more, clipped).ok_or(Fault::Saved("a clipping mark belongs to no reading"))?;
    let count = rest.length()?;
    // Checked before the numbers are read: a damaged count can't ask for more than there are bytes.
    if rest.bytes.len() != count.saturating_mul(8) {
        return Err(Fault::Saved("it ends before its last number, or after it"));
    }
    let numbers = rest.list(count)?;
    let plant = plant(&parameters)?.restored_measured(sample, &numbers)?;
    let held = held.then(|| Load::from_parts(&load));
    let measurement = Measurement { sample, head_force_n, acceleration_b_m_s2, acceleration_c_m_s2, more };
    let now = Measured { plant, measurement, held };
    let model = Saved::Signals(Box::new(SavedSignals { now, mark: None }));
    Ok(SavedInstance { token: token.to_string(), state, start_s, time_s, parameters, inputs, model })
}

fn put(bytes: &mut Vec<u8>, numbers: &[f64]) {
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}

/// Bytes that are left to read.
struct Rest<'a> {
    bytes: &'a [u8],
}

impl<'a> Rest<'a> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let Some((head, rest)) = self.bytes.split_first_chunk() else { return Err(Fault::Saved("it ends early")) };
        self.bytes = rest;
        Ok(*head)
    }

    fn byte(&mut self) -> Result<u8, Fault> {
        Ok(self.take::<1>()?[0])
    }

    fn flag(&mut self) -> Result<bool, Fault> {
        match self.byte()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Fault::Saved("a truth value is neither 0 nor 1")),
        }
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], Fault> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.take()?);
        }
        Ok(numbers)
    }

    fn reading(&mut self) -> Result<Reading, Fault> {
        let [value] = self.numbers()?;
        Ok(Reading { value, clipped: self.flag()? })
    }

    fn list(&mut self, count: usize) -> Result<Vec<f64>, Fault> {
        (0..count).map(|_| Ok(self.numbers::<1>()?[0])).collect()
    }

    fn length(&mut self) -> Result<usize, Fault> {
        usize::try_from(u64::from_le_bytes(self.take()?)).map_err(|_| Fault::Saved("a length is too large"))
    }

    fn text(&mut self) -> Result<&'a str, Fault> {
        let length = self.length()?;
        let (head, rest) = self.bytes.split_at_checked(length).ok_or(Fault::Saved("it ends early"))?;
        self.bytes = rest;
        core::str::from_utf8(head).map_err(|_| Fault::Saved("a text is not UTF-8"))
    }
}
