//! Recordings: their summaries, their records as rows, and their runs simulated again.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::export::RecordingPart;
use resonarm::protocol::{FrameFormat, Id};
use resonarm::realtime::OverrunCause;
use resonarm::recording::{self, Direction, Integrity, Origin, Record, RecordingError, Records};
use resonarm::replay;
use resonarm::scenario::Scenario;
use resonarm::structure::{READINGS, known_states};

use crate::errors;
use crate::rows::Rows;
use crate::structure::{self, Vector};
use crate::values;

/// The recording of `resonarm.Recording`.
#[pyclass(frozen, subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Recording {
    /// The recording of the library.
    pub inner: recording::Recording,
}

/// The records of one part of a recording, read from the file on request.
#[pyclass(frozen, module = "resonarm._resonarm")]
pub struct Reader {
    records: Mutex<AnyRecords>,
    from_sample: u64,
    to_sample: u64,
    origin: Origin,
}

#[pymethods]
impl Recording {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Recording> {
        let inner = py.detach(|| recording::Recording::open(path)).map_err(errors::recording)?;
        Ok(Recording { inner })
    }

    /// File of the recording.
    #[getter]
    fn path(&self) -> PathBuf {
        self.inner.path().to_path_buf()
    }

    /// The document of `resonarm inspect --json`, without the values that need a pass over all records.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::document(py, &self.inner.summary())
    }

    /// Time from one sample to the next, s.
    #[getter]
    fn dt_s(&self) -> f64 {
        self.inner.origin().dt_s
    }

    /// The number of records of a part.
    fn count(&self, part: &str) -> PyResult<u64> {
        let part = self::part(part)?;
        Ok(self.inner.summary().topics.get(part.topic().name()).map_or(0, |topic| topic.records))
    }

    /// Reason why the recording is not whole, in words; `None` if it is whole.
    #[getter]
    fn damage(&self) -> Option<String> {
        let (state, more) = match self.inner.integrity() {
            Integrity::Complete => return None,
            Integrity::Unfinished => return Some(String::from("recovered from a truncated or damaged one")),
            Integrity::Incomplete { cause } => return Some(errors::printable(format!("not whole: {cause}"))),
            Integrity::Truncated { readable_bytes, file_bytes, last_sample } => {
                (String::from("truncated"), (readable_bytes, file_bytes, last_sample))
            }
            Integrity::Damaged { readable_bytes, file_bytes, last_sample, cause } => {
                (format!("damaged ({cause})"), (readable_bytes, file_bytes, last_sample))
            }
        };
        let (readable_bytes, file_bytes, last_sample) = more;
        let last = last_sample.map_or(String::from("no sample"), |last| format!("samples up to {last}"));
        Some(errors::printable(format!("{state}: {readable_bytes} of {file_bytes} bytes can be read, {last}")))
    }

    /// The scenario of the run as TOML. Where an FMU is is left out: a recording is data, and an FMU that it names is not
    /// loaded.
    fn scenario_toml(&self) -> PyResult<String> {
        let mut scenario = Scenario::from_configuration(self.inner.configuration()).map_err(errors::scenario)?;
        if scenario.structure.is_recorded {
            scenario.structure.file = None;
        }
        scenario.to_toml().map_err(errors::scenario)
    }

    /// The run simulated again from its recorded loads: the document of `resonarm resim --json`. An FMU is loaded from
    /// the file `fmu` alone.
    #[pyo3(signature = (*, fmu = None))]
    fn resim<'py>(&self, py: Python<'py>, fmu: Option<PathBuf>) -> PyResult<Bound<'py, PyAny>> {
        let recording = match fmu {
            Some(fmu) => self.inner.clone().allow_fmu(fmu),
            None => self.inner.clone(),
        };
        let verdict = py.detach(|| replay::resimulate(&recording)).map_err(errors::replay)?;
        values::document(py, &verdict)
    }

    /// The vectors of numbers in the rows of a part: name, and names of the components.
    fn channels(&self, part: &str) -> PyResult<Vec<Vector>> {
        Ok(structure::vectors(self.inner.channels().of(self::part(part)?.topic())))
    }

    /// Reads a part: states, samples, frames, ticks or events, from one sample to another, both included.
    fn reader(&self, part: &str, from_sample: u64, to_sample: u64) -> PyResult<Reader> {
        let part = self::part(part)?;
        let records = match part {
            RecordingPart::States => boxed(self.inner.states(), Record::State),
            RecordingPart::Samples => boxed(self.inner.samples(), Record::Sample),
            RecordingPart::Frames => boxed(self.inner.frames(), Record::Frame),
            RecordingPart::Ticks => boxed(self.inner.ticks(), Record::Tick),
            RecordingPart::Events => boxed(self.inner.events(), Record::Event),
        };
        let records = records.map_err(errors::recording)?;
        Ok(Reader { records: Mutex::new(records), from_sample, to_sample, origin: self.inner.origin().clone() })
    }
}

/// The part of this name.
fn part(name: &str) -> PyResult<RecordingPart> {
    name.parse().map_err(|unknown| errors::value(format!("part is `{name}`: {unknown}")))
}

/// The vectors of all states and readings that a recording can have: name, and names of the components.
#[pyfunction]
pub fn known_vectors() -> Vec<Vector> {
    structure::vectors(&[known_states(), READINGS.to_vec()].concat())
}

/// Causes of overruns by their number in the rows of ticks, from 1 on; 0 is none.
#[pyfunction]
pub fn overrun_causes() -> [&'static str; 3] {
    OverrunCause::ALL.map(OverrunCause::name)
}

type AnyRecords = Box<dyn Iterator<Item = Result<Record<String>, RecordingError>> + Send>;

fn boxed<T: Send + 'static>(
    records: Result<Records<T>, RecordingError>,
    wrap: fn(T) -> Record<String>,
) -> Result<AnyRecords, RecordingError> {
    Ok(Box::new(records?.map(move |record| record.map(wrap))))
}

#[pymethods]
impl Reader {
    /// Returns at most this many of the next rows, and the names of events; no rows at the end.
    fn read<'py>(&self, py: Python<'py>, most_rows: usize) -> PyResult<(Bound<'py, PyByteArray>, Vec<String>)> {
        let (rows, names, _count) = self.gather(py, most_rows)?;
        Ok((rows.into_bytes(py)?, names))
    }

    /// The same column by column, with the number of rows.
    fn read_columns<'py>(
        &self,
        py: Python<'py>,
        most_rows: usize,
    ) -> PyResult<(Bound<'py, PyByteArray>, Vec<String>, usize)> {
        let (rows, names, count) = self.gather(py, most_rows)?;
        Ok((rows.into_columns(py, count)?, names, count))
    }
}

impl Reader {
    /// The next rows, the names of events in them, and the number of rows.
    fn gather(&self, py: Python<'_>, most_rows: usize) -> PyResult<(Rows, Vec<String>, usize)> {
        let mut rows = Rows::default();
        let mut names = Vec::new();
        let mut count = 0;
        py.detach(|| {
            let mut records = self.records.lock().unwrap_or_else(PoisonError::into_inner);
            // The file is read without the lock of the interpreter, in which other threads of Python run.
            while count < most_rows {
                let Some(record) = records.next().transpose()? else { break };
                // Frames and events need not be in the order of their samples, so they are read to the end.
                if record.sample() > self.to_sample && !matches!(record, Record::Frame(_) | Record::Event(_)) {
                    break;
                }
                if (self.from_sample..=self.to_sample).contains(&record.sample()) {
                    push(&mut rows, &mut names, record, &self.origin);
                    count += 1;
                }
            }
            Ok(())
        })
        .map_err(errors::recording)?;
        Ok((rows, names, count))
    }
}

fn push(rows: &mut Rows, names: &mut Vec<String>, record: Record<String>, origin: &Origin) {
    rows.word(record.sample());
    let time_s = record.sample() as f64 * origin.dt_s;
    match record {
        Record::State(state) => {
            rows.numbers(&[time_s]);
            rows.numbers(&state.values());
            rows.word(state.is_end);
        }
        Record::Sample(sample) => {
            // A reading has the time of the motion that it shows, which is earlier than its sample by the delay of
            // the instruments.
            rows.numbers(&[(sample.sample as f64 - origin.reading_delay_samples) * origin.dt_s]);
            rows.numbers(&sample.values());
            rows.word(sample.clipped_bits());
        }
        Record::Frame(frame) => push_frame(rows, &frame),
        Record::Tick(tick) => {
            rows.word(tick.wakeup_ns);
            rows.word(tick.exec_ns);
            rows.word(tick.overruns);
            let number =
                |cause| OverrunCause::ALL.iter().position(|of| *of == cause).map_or(0, |place| place as u64 + 1);
            // 0 is no overrun, so the causes count from 1.
            rows.word(tick.cause.map_or(0, number));
        }
        Record::Event(event) => {
            rows.word(event.time_ns);
            rows.word(event.value as u64);
            names.push(event.name);
        }
    }
}

fn push_frame(rows: &mut Rows, record: &recording::FrameRecord) {
    let frame = &record.frame;
    let (fd, bit_rate_switch, error_state) = match frame.format() {
        FrameFormat::Fd { bit_rate_switch, error_state_indicator } => (true, bit_rate_switch, error_state_indicator),
        FrameFormat::Classic | FrameFormat::Remote => (false, false, false),
    };
    rows.word(record.time_ns);
    rows.word(record.bus_timestamp_ns.unwrap_or(0));
    rows.word(record.direction == Direction::Received);
    rows.word(frame.id().raw());
    rows.word(matches!(frame.id(), Id::Extended(_)));
    for flag in [frame.format() == FrameFormat::Remote, fd, bit_rate_switch, error_state] {
        rows.word(flag);
    }
    rows.word(frame.len() as u64);
    let mut data = [0; 64];
    data[..frame.data().len()].copy_from_slice(frame.data());
    rows.bytes(&data);
}
