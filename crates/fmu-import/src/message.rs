//! Messages between a process that uses an FMU and the process in which its library runs, over two pipes.
//!
//! Both ends are one program, so numbers are in the machine's order of bytes. A request has a fixed length, as both ends
//! know how many values are set; an answer states its kind and its length.

use std::io::{Error, ErrorKind, PipeWriter, Read, Result, Write};
use std::sync::{Mutex, PoisonError};

/// The longest answer that is read, bytes: an array of a million numbers has 8 MB.
const MOST_LENGTH: u32 = 1 << 26;

/// A request to the process of an FMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Request {
    /// A communication step, before which the inputs are set if they have changed.
    Step { from_s: f64, step_s: f64, sets: bool },
    /// The end: the instance is freed, and the library unloaded.
    End,
}

impl Request {
    /// The bytes in front of the values of the inputs: the kind, and two times of eight bytes.
    const HEAD: usize = 17;

    /// The length of a request with so many values of inputs.
    pub const fn length(values: usize) -> usize {
        Request::HEAD + 8 * values
    }

    /// Writes the request with the values of the inputs.
    pub fn write(self, values: &[f64], bytes: &mut Vec<u8>) {
        let (kind, from_s, step_s) = match self {
            Request::Step { from_s, step_s, sets } => (u8::from(sets), from_s, step_s),
            Request::End => (2, 0.0, 0.0),
        };
        bytes.clear();
        bytes.push(kind);
        bytes.extend([from_s, step_s].iter().chain(values).flat_map(|number| number.to_ne_bytes()));
    }

    /// Reads a request, and its values into `values`; `None` if it is none.
    pub fn read(bytes: &[u8], values: &mut [f64]) -> Option<Request> {
        let (kind, numbers) = bytes.split_first()?;
        let mut times = [0.0; 2];
        let (head, rest) = numbers.split_at_checked(Request::HEAD - 1)?;
        (read_numbers(head, &mut times) && read_numbers(rest, values)).then_some(())?;
        let [from_s, step_s] = times;
        match kind {
            0 | 1 => Some(Request::Step { from_s, step_s, sets: *kind == 1 }),
            2 => Some(Request::End),
            _ => None,
        }
    }
}

/// The function of an FMU that a step called last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StepCall {
    Set,
    Step,
    Get,
}

/// How a step went: the function that was called last with its status, and what the step itself told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stepped {
    pub call: StepCall,
    pub status: i32,
    pub terminates: bool,
    pub reached_s: Option<f64>,
}

/// An answer of the process of an FMU, or of the one that watches it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Answer {
    /// The FMU says something, with a status as the standards number them.
    Says { status: i32, text: String },
    /// The simulation has begun. The values that are read follow.
    Started,
    /// The library can't be loaded.
    NotLoaded { reason: String },
    /// The library lacks a function.
    NoFunction { name: String },
    /// A function returned a bad status before the simulation began; `None` for an instance that is NULL.
    Refused { function: String, status: Option<i32> },
    /// A step was made. The values that are read follow if it succeeded.
    Stepped(Stepped),
    /// The instance is freed, and the library unloaded.
    Freed,
    /// The process has ended, with a status of waitpid(2).
    Ended { status: i32 },
}

/// Returns the error for an answer that breaks the protocol.
fn invalid() -> Error {
    Error::from(ErrorKind::InvalidData)
}

/// Reads as many numbers as there is place for; `false` if the bytes are of another number of them.
fn read_numbers(bytes: &[u8], numbers: &mut [f64]) -> bool {
    let (all, rest) = bytes.as_chunks::<8>();
    numbers.iter_mut().zip(all).for_each(|(number, bytes)| *number = f64::from_ne_bytes(*bytes));
    all.len() == numbers.len() && rest.is_empty()
}

impl Answer {
    const SAYS: u8 = 1;
    const STARTED: u8 = 2;
    const NOT_LOADED: u8 = 3;
    const NO_FUNCTION: u8 = 4;
    const REFUSED: u8 = 5;
    const STEPPED: u8 = 6;
    const FREED: u8 = 7;
    const ENDED: u8 = 8;

    fn bytes(&self, values: &[f64]) -> Vec<u8> {
        let values = || values.iter().flat_map(|value| value.to_ne_bytes());
        // In front of a text stands its status: one byte says whether there is one, four bytes hold it.
        let text = |status: Option<i32>, text: &str| {
            let status = status.map_or([0; 5], |status| {
                let [a, b, c, d] = status.to_ne_bytes();
                [1, a, b, c, d]
            });
            status.into_iter().chain(text.bytes()).collect()
        };
        let (kind, body): (u8, Vec<u8>) = match self {
            Answer::Says { status, text: said } => (Answer::SAYS, text(Some(*status), said)),
            Answer::Started => (Answer::STARTED, values().collect()),
            Answer::NotLoaded { reason } => (Answer::NOT_LOADED, text(None, reason)),
            Answer::NoFunction { name } => (Answer::NO_FUNCTION, text(None, name)),
            Answer::Refused { function, status } => (Answer::REFUSED, text(*status, function)),
            Answer::Stepped(stepped) => {
                let mut body =
                    vec![stepped.call as u8, u8::from(stepped.terminates), u8::from(stepped.reached_s.is_some())];
                body.extend(stepped.status.to_ne_bytes());
                body.extend(stepped.reached_s.unwrap_or_default().to_ne_bytes());
                body.extend(values());
                (Answer::STEPPED, body)
            }
            Answer::Freed => (Answer::FREED, Vec::new()),
            Answer::Ended { status } => (Answer::ENDED, text(Some(*status), "")),
        };
        let mut bytes = vec![kind];
        bytes.extend((body.len() as u32).to_ne_bytes());
        bytes.extend(body);
        bytes
    }

    /// Reads an answer; what was read of the FMU's variables goes into `values`.
    ///
    /// # Errors
    /// That of the pipe, [`ErrorKind::UnexpectedEof`] at its end, and [`ErrorKind::InvalidData`].
    pub fn read(pipe: &mut impl Read, body: &mut Vec<u8>, values: &mut [f64]) -> Result<Answer> {
        let mut head = [0; 5];
        pipe.read_exact(&mut head)?;
        let [kind, length @ ..] = head;
        let length = u32::from_ne_bytes(length);
        if length > MOST_LENGTH {
            return Err(invalid());
        }
        body.resize(length as usize, 0);
        pipe.read_exact(body)?;
        Answer::parse(kind, body, values).ok_or_else(invalid)
    }

    fn parse(kind: u8, body: &[u8], values: &mut [f64]) -> Option<Answer> {
        let text = || {
            let ([has_status, status @ ..], text) = body.split_first_chunk::<5>()?;
            let status = (*has_status == 1).then_some(i32::from_ne_bytes(*status));
            Some((status, String::from_utf8_lossy(text).into_owned()))
        };
        Some(match kind {
            Answer::SAYS => {
                let (status, text) = text()?;
                Answer::Says { status: status?, text }
            }
            Answer::STARTED => read_numbers(body, values).then_some(Answer::Started)?,
            Answer::NOT_LOADED => Answer::NotLoaded { reason: text()?.1 },
            Answer::NO_FUNCTION => Answer::NoFunction { name: text()?.1 },
            Answer::REFUSED => {
                let (status, function) = text()?;
                Answer::Refused { function, status }
            }
            Answer::STEPPED => {
                let ([call, terminates, has_reached], body) = body.split_first_chunk::<3>()?;
                let (status, body) = body.split_first_chunk::<4>()?;
                let (reached_s, read) = body.split_first_chunk::<8>()?;
                let call = match call {
                    0 => StepCall::Set,
                    1 => StepCall::Step,
                    2 => StepCall::Get,
                    _ => return None,
                };
                if !read.is_empty() {
                    read_numbers(read, values).then_some(())?;
                }
                let reached_s = (*has_reached == 1).then_some(f64::from_ne_bytes(*reached_s));
                let status = i32::from_ne_bytes(*status);
                Answer::Stepped(Stepped { call, status, terminates: *terminates == 1, reached_s })
            }
            Answer::FREED => Answer::Freed,
            Answer::ENDED => Answer::Ended { status: text()?.0? },
            _ => return None,
        })
    }
}

/// The end of the pipe at which answers are written, by any thread of the FMU.
#[derive(Debug)]
pub(crate) struct Answers(Mutex<PipeWriter>);

impl Answers {
    pub fn new(pipe: PipeWriter) -> Answers {
        Answers(Mutex::new(pipe))
    }

    /// Sends an answer, with what was read of the FMU's variables.
    ///
    /// # Errors
    /// That of the pipe.
    pub fn send(&self, answer: &Answer, values: &[f64]) -> Result<()> {
        let bytes = answer.bytes(values);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write_all(&bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_and_answers_come_as_they_went() {
        let mut bytes = Vec::new();
        for request in [
            Request::Step { from_s: 0.25, step_s: 5e-4, sets: true },
            Request::Step { from_s: 0.25, step_s: 5e-4, sets: false },
            Request::End,
        ] {
            request.write(&[1.5, -2.5], &mut bytes);
            let mut values = [0.0; 2];
            assert_eq!((bytes.len(), Request::read(&bytes, &mut values)), (Request::length(2), Some(request)));
            assert_eq!(values, [1.5, -2.5]);
        }
        let stepped = Stepped { call: StepCall::Get, status: 3, terminates: true, reached_s: Some(0.5) };
        for answer in [
            Answer::Says { status: 2, text: "an error\nof two lines".into() },
            Answer::Started,
            Answer::NotLoaded { reason: "no such file".into() },
            Answer::NoFunction { name: "fmi3DoStep".into() },
            Answer::Refused { function: "fmi3DoStep".into(), status: Some(-1) },
            Answer::Refused { function: "fmi3Instantiate".into(), status: None },
            Answer::Stepped(stepped),
            Answer::Stepped(Stepped { reached_s: None, terminates: false, ..stepped }),
            Answer::Freed,
            Answer::Ended { status: 0x8B },
        ] {
            let bytes = answer.bytes(&[7.0, f64::NEG_INFINITY]);
            let mut values = [0.0; 2];
            let read = Answer::read(&mut &bytes[..], &mut Vec::new(), &mut values);
            assert_eq!(read.ok().as_ref(), Some(&answer));
            let is_with_values = matches!(answer, Answer::Started | Answer::Stepped(_));
            assert_eq!(values, if is_with_values { [7.0, f64::NEG_INFINITY] } else { [0.0; 2] });
            // A library may write what it likes to the pipe.
            for end in 0..bytes.len() {
                assert!(Answer::read(&mut &bytes[..end], &mut Vec::new(), &mut values).is_err());
            }
        }
        let long = [&[Answer::SAYS][..], &u32::MAX.to_ne_bytes()].concat();
        assert_eq!(Answer::read(&mut &long[..], &mut Vec::new(), &mut []).unwrap_err().kind(), ErrorKind::InvalidData);
    }
}
