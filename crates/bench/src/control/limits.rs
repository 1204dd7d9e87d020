//! Limits that end a run in good order: the plant is disarmed, whatever state the controller is in.

use alloc::boxed::Box;

use serde::{Deserialize, Serialize};

use super::{Abort, Answer, Controller, Length, LoadKind, ResponsePoint, SetPoint};
use crate::rig::Load;
use crate::rig::Measurement;

const CHANNELS: usize = Measurement::CHANNELS;

/// Limits as a scenario states them. Limits that are not stated are not checked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LimitsSpec {
    /// Largest force along an axis, as the controller commands it and as the impedance head reads it, N, positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_n: Option<f64>,
    /// Largest torque at a joint, as the controller commands it, N·m, positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_nm: Option<f64>,
    /// Largest acceleration along an axis that an accelerometer reads, m/s², positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration_m_s2: Option<f64>,
    /// Largest distortion of the force of a response: harmonics 2 and 3 over the fundamental, positive; checked
    /// with a control law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distortion: Option<f64>,
    /// Number of samples in a row after which a clipped axis ends the run, at least 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clipped_samples: Option<u32>,
    /// Number of equal samples in a row under load after which an axis counts as stuck or dropped out, at least
    /// 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stuck_samples: Option<u32>,
    /// Commanded force, N, above which a sample counts as under load; `None` is 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stuck_above_n: Option<f64>,
    /// Commanded torque, N·m, above which a sample counts as under load; `None` is 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stuck_above_nm: Option<f64>,
}

/// Words for the axes: instrument, direction, unit, and key of the range.
const AXES: [[&str; 4]; CHANNELS] = [
    ["the impedance head", "x", "N", "rig.head.range_n"],
    ["the impedance head", "y", "N", "rig.head.range_n"],
    ["the accelerometer at B", "x", "m/s\u{b2}", "rig.sensors.b.range_m_s2"],
    ["the accelerometer at B", "y", "m/s\u{b2}", "rig.sensors.b.range_m_s2"],
    ["the accelerometer at C", "x", "m/s\u{b2}", "rig.sensors.c.range_m_s2"],
    ["the accelerometer at C", "y", "m/s\u{b2}", "rig.sensors.c.range_m_s2"],
];

/// Recent history of one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Watched {
    /// Last reading; the next field is the number of samples under load that repeat it.
    last: Option<f64>,
    same: u32,
    /// Number of clipped samples in a row.
    clipped: u32,
}

/// A controller with limits, which aborts in place of the inner controller when one is exceeded.
///
/// Readings are checked before the inner controller sees them, commands before they are sent, and the
/// distortion of a response as soon as it has been read.
#[derive(Debug)]
pub struct Limited {
    inner: Box<dyn Controller>,
    spec: LimitsSpec,
    rate_hz: f64,
    axes: [Watched; CHANNELS],
    held: Load,
    /// Time of the last answered sample, s.
    time_s: f64,
    response: Option<ResponsePoint>,
    abort: Option<Abort>,
}

impl Limited {
    /// Returns `inner` with the limits of `spec`, at `rate_hz` samples per second.
    pub fn new(inner: Box<dyn Controller>, spec: LimitsSpec, rate_hz: f64) -> Limited {
        let (axes, held) = ([Watched::default(); CHANNELS], Load::default());
        Limited { inner, spec, rate_hz, axes, held, time_s: 0.0, response: None, abort: None }
    }

    /// Returns whether the acting load is large enough for every axis to move.
    fn is_loaded(&self) -> bool {
        self.held.force_n.amax() > self.spec.stuck_above_n.unwrap_or(0.0)
            || self.held.torque_nm.amax() > self.spec.stuck_above_nm.unwrap_or(0.0)
    }

    /// Checks the axes of a sample and returns the first violation.
    fn judge_readings(&mut self, sample: &Measurement) -> Option<Abort> {
        let (is_loaded, time_s) = (self.is_loaded(), self.time_s);
        let LimitsSpec { force_n, acceleration_m_s2, clipped_samples, stuck_samples, .. } = self.spec;
        for (index, reading) in sample.readings().iter().enumerate() {
            // The axes are judged in the order of the channels, and the first violation is reported: the report
            // is the same whatever else is wrong.
            let ([who, axis, unit, range_key], watched) = (AXES[index], &mut self.axes[index]);
            // A clipped reading repeats by nature, and counts as clipped and not as stuck.
            let is_new = reading.clipped || watched.last != Some(reading.value);
            watched.last = Some(reading.value);
            // The count of equal readings stands still without load: then a constant reading is no sign of a
            // defect.
            watched.same = if is_new { 0 } else { watched.same } + u32::from(is_loaded && !reading.clipped);
            watched.clipped = if reading.clipped { watched.clipped + 1 } else { 0 };
            let (key, limit) = if index < 2 { ("force_n", force_n) } else { ("acceleration_m_s2", acceleration_m_s2) };
            if let Some(limit) = limit.filter(|limit| reading.value.abs() > *limit) {
                return Some(Abort::Reading { key, who, got: reading.value, limit, unit, axis, time_s });
            }
            if let Some(samples) = clipped_samples.filter(|limit| watched.clipped >= *limit) {
                return Some(Abort::StaysClipped { who, axis, samples, range_key, time_s });
            }
            if let Some(samples) = stuck_samples.filter(|limit| watched.same >= *limit) {
                return Some(Abort::Stuck { who, value: reading.value, unit, axis, samples, time_s });
            }
        }
        None
    }

    /// Returns the limit that a command would exceed, if there is one.
    fn judge_command(&self, load: &Load) -> Option<Abort> {
        let time_s = self.time_s;
        let beyond = |key, got: f64, limit: Option<f64>, unit| {
            let limit = limit.filter(|limit| got > *limit)?;
            Some(Abort::Command { key, got, limit, unit, time_s })
        };
        beyond("force_n", load.force_n.amax(), self.spec.force_n, "N")
            .or_else(|| beyond("torque_nm", load.torque_nm.amax(), self.spec.torque_nm, "N\u{b7}m"))
    }

    /// Takes the next response from the inner controller, if there is room, and checks it.
    fn fetch_response(&mut self) {
        // One response is held here at a time, so none is lost while the caller has not fetched the last.
        if self.response.is_none() {
            self.response = self.inner.poll_response();
            let abort = self.response.as_ref().and_then(|response| self.judge_response(response));
            self.abort = self.abort.or(abort);
        }
    }

    fn judge_response(&self, response: &ResponsePoint) -> Option<Abort> {
        let (limit, got) = self.spec.distortion.zip(response.distortion())?;
        let (frequency_hz, time_s) = (response.frequency_hz, self.time_s);
        (got > limit).then_some(Abort::Distorted { got, limit, frequency_hz, time_s })
    }
}

impl Controller for Limited {
    fn load_kind(&self) -> LoadKind {
        self.inner.load_kind()
    }

    fn needs(&self) -> [bool; CHANNELS] {
        self.inner.needs()
    }

    fn restart(&mut self) {
        self.inner.restart();
        self.axes = [Watched::default(); CHANNELS];
        (self.held, self.response, self.abort) = (Load::default(), None, None);
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        self.time_s = sample.sample as f64 / self.rate_hz;
        self.abort = self.abort.or_else(|| self.judge_readings(sample));
        if let Some(abort) = self.abort {
            return Answer::Aborted(abort);
        }
        // The inner controller sees only samples that have passed, so it can't act on a reading beyond a limit.
        let answer = self.inner.answer(sample);
        self.fetch_response();
        if let Answer::Hold(load) = answer {
            self.abort = self.abort.or_else(|| self.judge_command(&load));
            self.held = load;
        }
        self.abort.map_or(answer, Answer::Aborted)
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        let response = self.response.take();
        self.fetch_response();
        response
    }

    fn steer(&mut self, set_point: &SetPoint) -> bool {
        self.inner.steer(set_point)
    }

    fn set_point(&self) -> Option<SetPoint> {
        self.inner.set_point()
    }

    fn length(&self) -> Length {
        self.inner.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Reading;

    /// Always holds the same force.
    #[derive(Debug)]
    struct Constant(f64);

    impl Controller for Constant {
        fn load_kind(&self) -> LoadKind {
            LoadKind::Force
        }

        fn restart(&mut self) {}

        fn answer(&mut self, _sample: &Measurement) -> Answer {
            Answer::Hold(Load::force_n(self.0, 0.0))
        }

        fn poll_response(&mut self) -> Option<ResponsePoint> {
            None
        }

        fn length(&self) -> Length {
            Length::Unknown
        }
    }

    /// A sample in which every axis moves, except x of C.
    fn sample(n: u64, c_x: Reading) -> Measurement {
        let moving = |offset: f64| Reading { value: offset + n as f64, clipped: false };
        let pair = |offset: f64| [moving(offset), moving(offset + 0.5)];
        let acceleration_c_m_s2 = [c_x, moving(0.0)];
        Measurement {
            sample: n,
            head_force_n: pair(1.0),
            acceleration_b_m_s2: pair(2.0),
            acceleration_c_m_s2,
            ..Measurement::default()
        }
    }

    /// The first sample, of 100 with these readings of x of C, at which it aborts.
    fn gives_up(limited: &mut Limited, c_x: Reading) -> Option<u64> {
        (0..100).find(|n| matches!(limited.answer(&sample(*n, c_x)), Answer::Aborted(_)))
    }

    fn limited(spec: LimitsSpec, force_n: f64) -> Limited {
        Limited::new(Box::new(Constant(force_n)), spec, 1000.0)
    }

    const STILL: Reading = Reading { value: 7.0, clipped: false };

    #[test]
    fn an_axis_that_repeats_its_reading_under_load_is_stuck() {
        let spec = LimitsSpec { stuck_samples: Some(10), stuck_above_n: Some(5.0), ..LimitsSpec::default() };
        assert_eq!(gives_up(&mut limited(spec, 6.0), STILL), Some(10));
        assert_eq!(gives_up(&mut limited(spec, -6.0), STILL), Some(10));
        assert_eq!(gives_up(&mut limited(spec, 5.0), STILL), None);
        assert_eq!(gives_up(&mut limited(spec, 6.0), Reading { clipped: true, ..STILL }), None);
        assert_eq!(gives_up(&mut limited(LimitsSpec::default(), 6.0), STILL), None);
    }

    /// An abort persists until a restart, which forgets what was before.
    #[test]
    fn a_restart_forgets() {
        let spec = LimitsSpec { stuck_samples: Some(10), clipped_samples: Some(3), ..LimitsSpec::default() };
        let mut limited = limited(spec, 6.0);
        assert_eq!(gives_up(&mut limited, STILL), Some(10));
        assert_eq!(gives_up(&mut limited, STILL), Some(0));
        limited.restart();
        assert_eq!(gives_up(&mut limited, STILL), Some(10));
        limited.restart();
        assert_eq!(gives_up(&mut limited, Reading { clipped: true, ..STILL }), Some(2));
    }

    #[test]
    fn a_command_beyond_the_limit_is_not_given() {
        let spec = LimitsSpec { force_n: Some(200.0), ..LimitsSpec::default() };
        let first = |force_n| limited(spec, force_n).answer(&sample(0, STILL));
        assert_eq!(first(-200.0), Answer::Hold(Load::force_n(-200.0, 0.0)));
        assert!(matches!(first(-200.1), Answer::Aborted(Abort::Command { key: "force_n", got: 200.1, .. })));
    }
}
