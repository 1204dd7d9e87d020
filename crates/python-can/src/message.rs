//! Conversion between frames and `can.Message`.

use pyo3::intern;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict, PyList};
use resonarm_protocol::{Frame, FrameFormat, Id};

use resonarm_bus::socketcan::{ControllerReports, ErrorFrame};
use resonarm_bus::{Filter, Received};

/// Timestamps before this (September 2001), in seconds of the UNIX epoch, are taken for an adapter's clock.
const EARLIEST_EPOCH_S: f64 = 1e9;

/// `frame` as a `can.Message`; `class` is `can.Message` itself.
pub(super) fn from_frame<'py>(class: &Bound<'py, PyAny>, frame: &Frame) -> PyResult<Bound<'py, PyAny>> {
    let py = class.py();
    let (is_fd, bitrate_switch, error_state_indicator) = match frame.format() {
        FrameFormat::Fd { bit_rate_switch, error_state_indicator } => (true, bit_rate_switch, error_state_indicator),
        FrameFormat::Classic | FrameFormat::Remote => (false, false, false),
    };
    let arguments = PyDict::new(py);
    arguments.set_item(intern!(py, "arbitration_id"), frame.id().raw())?;
    arguments.set_item(intern!(py, "is_extended_id"), matches!(frame.id(), Id::Extended(_)))?;
    arguments.set_item(intern!(py, "is_remote_frame"), frame.format() == FrameFormat::Remote)?;
    arguments.set_item(intern!(py, "is_fd"), is_fd)?;
    arguments.set_item(intern!(py, "bitrate_switch"), bitrate_switch)?;
    arguments.set_item(intern!(py, "error_state_indicator"), error_state_indicator)?;
    arguments.set_item(intern!(py, "is_rx"), false)?;
    // A remote frame asks for so many bytes and has none, so its length does not follow from the data.
    arguments.set_item(intern!(py, "dlc"), frame.len())?;
    arguments.set_item(intern!(py, "data"), PyBytes::new(py, frame.data()))?;
    class.call((), Some(&arguments))
}

/// The content of an interface's error frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ErrorFrames {
    /// The classes of `linux/can/error.h` as identifier, and its content.
    Linux,
    /// Up to the maker.
    Other,
}

impl ErrorFrames {
    /// Returns the error frames of an interface: `socketcan` has them from the kernel, `gs_usb` from firmware, which
    /// the kernel's driver passes on unchanged.
    pub(super) fn of(interface: &str) -> ErrorFrames {
        match interface {
            "socketcan" | "gs_usb" => ErrorFrames::Linux,
            _ => ErrorFrames::Other,
        }
    }
}

/// A message that python-can has received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Incoming {
    /// A data or remote frame with its time stamp.
    Frame(Received),
    /// An error frame, with its content where that is known.
    Error(Option<ErrorFrame>),
}

impl Incoming {
    /// Whether the controller has left the bus.
    pub(super) fn is_bus_off(&self) -> bool {
        matches!(self, Incoming::Error(Some(error)) if error.is_bus_off())
    }

    /// Whether it comes out of [`Bus::receive`](resonarm_bus::Bus::receive); other error frames are only counted.
    pub(super) fn is_given_out(&self) -> bool {
        matches!(self, Incoming::Frame(_)) || self.is_bus_off()
    }

    /// Counts it, if it is an error frame.
    pub(super) fn note(&self, reports: &mut ControllerReports) {
        match self {
            Incoming::Frame(_) => {}
            Incoming::Error(Some(error)) => reports.note(*error),
            Incoming::Error(None) => reports.errors.other += 1,
        }
    }
}

/// A `can.Message` as a frame, or `None` if ISO 11898-1 has no such frame.
pub(super) fn to_incoming(message: &Bound<'_, PyAny>, error_frames: ErrorFrames) -> PyResult<Option<Incoming>> {
    let py = message.py();
    let flag = |name| -> PyResult<bool> { message.getattr(name)?.is_truthy() };
    if flag(intern!(py, "is_error_frame"))? {
        return Ok(Some(Incoming::Error(match error_frames {
            ErrorFrames::Linux => Some(linux_error(message)?),
            ErrorFrames::Other => None,
        })));
    }
    let number: u32 = message.getattr(intern!(py, "arbitration_id"))?.extract()?;
    let id = match (flag(intern!(py, "is_extended_id"))?, u16::try_from(number)) {
        (true, _) => Id::Extended(number),
        (false, Ok(number)) => Id::Standard(number),
        (false, Err(_)) => return Ok(None),
    };
    let frame = if flag(intern!(py, "is_remote_frame"))? {
        let length: usize = message.getattr(intern!(py, "dlc"))?.extract()?;
        // A remote frame can't ask for more than 8 bytes, so a message that does has no frame.
        [0; 8].get(..length).map(|data| Frame::new(id, FrameFormat::Remote, data))
    } else {
        let format = match flag(intern!(py, "is_fd"))? {
            false => FrameFormat::Classic,
            true => FrameFormat::Fd {
                bit_rate_switch: flag(intern!(py, "bitrate_switch"))?,
                error_state_indicator: flag(intern!(py, "error_state_indicator"))?,
            },
        };
        let data: PyBackedBytes = message.getattr(intern!(py, "data"))?.extract()?;
        Some(Frame::new(id, format, &data))
    };
    let timestamp_s: f64 = message.getattr(intern!(py, "timestamp"))?.extract()?;
    let frame = frame.and_then(Result::ok);
    Ok(frame.map(|frame| Incoming::Frame(Received { frame, timestamp_ns: epoch_ns(timestamp_s) })))
}

/// The identifier lacks the flag of error frames here, and has the classes.
fn linux_error(message: &Bound<'_, PyAny>) -> PyResult<ErrorFrame> {
    let class: u32 = message.getattr(intern!(message.py(), "arbitration_id"))?.extract()?;
    let content: PyBackedBytes = message.getattr(intern!(message.py(), "data"))?.extract()?;
    Ok(ErrorFrame::new(class, &content))
}

/// Seconds of the UNIX epoch, as python-can gives them, in nanoseconds. An f64 resolves 0.24 µs here. Adapters that
/// count from their own start, or not at all, stay below [`EARLIEST_EPOCH_S`] and give `None`.
fn epoch_ns(timestamp_s: f64) -> Option<u64> {
    // Whole and fractional seconds separately: the product of both would round once more.
    let whole_s = libm::floor(timestamp_s);
    let known = (EARLIEST_EPOCH_S..u64::MAX as f64 / 1e9).contains(&timestamp_s);
    known.then(|| whole_s as u64 * 1_000_000_000 + libm::rint((timestamp_s - whole_s) * 1e9) as u64)
}

/// The list of dictionaries that `bus.set_filters` takes.
pub(super) fn filter_list<'py>(py: Python<'py>, filters: &[Filter]) -> PyResult<Bound<'py, PyAny>> {
    let dictionaries = filters.iter().map(|filter| {
        let dictionary = PyDict::new(py);
        dictionary.set_item(intern!(py, "can_id"), filter.id.raw())?;
        dictionary.set_item(intern!(py, "can_mask"), filter.mask)?;
        dictionary.set_item(intern!(py, "extended"), matches!(filter.id, Id::Extended(_)))?;
        Ok(dictionary)
    });
    let dictionaries = dictionaries.collect::<PyResult<Vec<_>>>()?;
    Ok(PyList::new(py, dictionaries)?.into_any())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knows_whose_error_frames_are_those_of_linux() {
        for (interface, expected) in [
            ("socketcan", ErrorFrames::Linux),
            ("gs_usb", ErrorFrames::Linux),
            ("virtual", ErrorFrames::Other),
            ("pcan", ErrorFrames::Other),
        ] {
            assert_eq!(ErrorFrames::of(interface), expected, "{interface}");
        }
    }

    #[test]
    fn takes_only_the_unix_epoch_for_a_time() {
        assert_eq!(epoch_ns(1_700_000_000.25), Some(1_700_000_000_250_000_000));
        for other in [0.0, -1.0, 12.5, f64::NAN, f64::INFINITY, 1e300] {
            assert_eq!(epoch_ns(other), None, "{other}");
        }
    }
}
