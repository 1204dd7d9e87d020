//! Limits that end a run in good order: the plant is disarmed, whatever state the controller is in.

use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use super::abort::{Abort, InstrumentAxis, ReadingLimit};
use super::response::ResponsePoint;
use super::test_control::{ControlSpectrum, StopReason, TestProgress};
use super::{Answer, Controller, Length, LoadKind, NeededReading, SetPoint};
use crate::rig::{InstrumentName, Load, Measurement, RigSpec};
use crate::structure::{Channel, Point};

/// Limits as a scenario states them. Limits that are not stated are not checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    /// Largest magnitudes that sensors read along each of their axes, by name, in the unit of each sensor, positive. For
    /// B and C they replace `acceleration_m_s2`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub sensors: BTreeMap<InstrumentName, f64>,
}

/// An axis that is watched, with its recent history.
#[derive(Clone, Copy, Debug)]
struct Watched {
    reading: NeededReading,
    axis: InstrumentAxis,
    /// Key of the instrument's range.
    range_key: &'static str,
    limit: Option<(ReadingLimit, f64)>,
    /// Last reading; the next field is the number of samples under load that repeat it.
    last: Option<f64>,
    same: u32,
    /// Number of clipped samples in a row.
    clipped: u32,
}

impl Watched {
    /// Returns the axis of a channel of the plant, if it is watched: those of head, B and C are, and those of a sensor
    /// that has a limit of its own.
    fn new(spec: &LimitsSpec, rig: &RigSpec, (place, channel): (usize, &Channel)) -> Option<Watched> {
        let instrument = match (channel.point, place) {
            (Point::Sensor { name, .. }, _) => name,
            // The outputs begin with those of the arm's instruments: head, B and C, two axes each (`OUTPUTS`).
            (_, 0 | 1) => InstrumentName::HEAD,
            (_, 2 | 3) => InstrumentName::B,
            _ => InstrumentName::C,
        };
        let (_, sensor) = rig.instruments().find(|(name, _)| *name == instrument)?;
        let of_sensor = spec.sensors.get(&instrument).map(|limit| (ReadingLimit::Sensor(instrument), *limit));
        let limit = match instrument {
            InstrumentName::HEAD => spec.force_n.map(|limit| (ReadingLimit::Force, limit)),
            InstrumentName::B | InstrumentName::C => {
                of_sensor.or(spec.acceleration_m_s2.map(|limit| (ReadingLimit::Acceleration, limit)))
            }
            _ => Some(of_sensor?),
        };
        let axis = InstrumentAxis { instrument, axis: channel.axis, unit: channel.quantity.unit() };
        let reading = NeededReading { place, name: channel.name };
        let range_key = sensor.range_key();
        Some(Watched { reading, axis, range_key, limit, last: None, same: 0, clipped: 0 })
    }

    fn forget(&mut self) {
        self.last = None;
        self.same = 0;
        self.clipped = 0;
    }
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
    /// Watched axes, in the order of the plant's channels.
    axes: Vec<Watched>,
    held: Load,
    /// Time of the last answered sample, s.
    time_s: f64,
    response: Option<ResponsePoint>,
    abort: Option<Abort>,
}

impl Limited {
    /// Returns `inner` with the limits of `spec`, for a plant with these instruments and outputs, as
    /// [`Structure::outputs`](crate::structure::Structure::outputs) has them, at `rate_hz` samples per second.
    pub fn new(
        inner: Box<dyn Controller>,
        spec: LimitsSpec,
        (rig, outputs): (&RigSpec, &[Channel]),
        rate_hz: f64,
    ) -> Limited {
        let axes = outputs.iter().enumerate().filter_map(|output| Watched::new(&spec, rig, output)).collect();
        Limited { inner, spec, rate_hz, axes, held: Load::default(), time_s: 0.0, response: None, abort: None }
    }

    /// Returns whether the acting load is large enough for every axis to move.
    fn is_loaded(&self) -> bool {
        self.held.force_n.amax() > self.spec.stuck_above_n.unwrap_or(0.0)
            || self.held.torque_nm.amax() > self.spec.stuck_above_nm.unwrap_or(0.0)
    }

    /// Checks the axes of a sample and returns the first violation.
    fn judge_readings(&mut self, sample: &Measurement) -> Option<Abort> {
        let is_loaded = self.is_loaded();
        let time_s = self.time_s;
        let LimitsSpec { clipped_samples, stuck_samples, .. } = self.spec;
        for watched in &mut self.axes {
            // The axes are judged in the order of the channels, and the first violation is reported: the report
            // is the same whatever else is wrong.
            let Some(reading) = sample.reading(watched.reading.place) else { continue };
            let Watched { axis, range_key, .. } = *watched;
            // A clipped reading repeats by nature, and counts as clipped and not as stuck.
            let is_new = reading.clipped || watched.last != Some(reading.value);
            watched.last = Some(reading.value);
            // The count of equal readings stands still without load: then a constant reading is no sign of a
            // defect.
            watched.same = if is_new { 0 } else { watched.same } + u32::from(is_loaded && !reading.clipped);
            watched.clipped = if reading.clipped { watched.clipped + 1 } else { 0 };
            if let Some((key, limit)) = watched.limit.filter(|(_, limit)| reading.value.abs() > *limit) {
                return Some(Abort::Reading { key, axis, got: reading.value, limit, time_s });
            }
            if let Some(samples) = clipped_samples.filter(|limit| watched.clipped >= *limit) {
                return Some(Abort::StaysClipped { axis, samples, range_key, time_s });
            }
            if let Some(samples) = stuck_samples.filter(|limit| watched.same >= *limit) {
                return Some(Abort::Stuck { axis, value: reading.value, samples, time_s });
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
        let frequency_hz = response.frequency_hz;
        let time_s = self.time_s;
        (got > limit).then_some(Abort::Distorted { got, limit, frequency_hz, time_s })
    }
}

impl Controller for Limited {
    fn load_kind(&self) -> LoadKind {
        self.inner.load_kind()
    }

    /// A limit of its own is stated for the sensor, so that a run that can't keep it is refused. The limits for all
    /// accelerometers or axes hold for those that the protocol carries.
    fn needs(&self) -> Vec<NeededReading> {
        let mut needs = self.inner.needs();
        let limited = self.axes.iter().filter(|axis| matches!(axis.limit, Some((ReadingLimit::Sensor(_), _))));
        for Watched { reading, .. } in limited {
            if !needs.contains(reading) {
                needs.push(*reading);
            }
        }
        needs
    }

    fn restart(&mut self) {
        self.inner.restart();
        self.axes.iter_mut().for_each(Watched::forget);
        self.held = Load::default();
        self.response = None;
        self.abort = None;
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

    fn test_progress(&self) -> Option<TestProgress> {
        self.inner.test_progress()
    }

    fn test_stop(&self) -> Option<StopReason> {
        self.inner.test_stop()
    }

    fn control_spectrum(&self) -> Option<ControlSpectrum<'_>> {
        self.inner.control_spectrum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{MOST_MORE, Measured, Reading, Readings, SensorSpec};
    use crate::structure::{Axis, OUTPUTS, sensor_channels};

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

    fn limited(spec: &LimitsSpec, force_n: f64) -> Limited {
        Limited::new(Box::new(Constant(force_n)), spec.clone(), (&RigSpec::default(), &OUTPUTS), 1000.0)
    }

    const STILL: Reading = Reading { value: 7.0, clipped: false };

    #[test]
    fn an_axis_that_repeats_its_reading_under_load_is_stuck() {
        let spec = LimitsSpec { stuck_samples: Some(10), stuck_above_n: Some(5.0), ..LimitsSpec::default() };
        assert_eq!(gives_up(&mut limited(&spec, 6.0), STILL), Some(10));
        assert_eq!(gives_up(&mut limited(&spec, -6.0), STILL), Some(10));
        assert_eq!(gives_up(&mut limited(&spec, 5.0), STILL), None);
        assert_eq!(gives_up(&mut limited(&spec, 6.0), Reading { clipped: true, ..STILL }), None);
        assert_eq!(gives_up(&mut limited(&LimitsSpec::default(), 6.0), STILL), None);
    }

    /// An abort persists until a restart, which forgets what was before.
    #[test]
    fn a_restart_forgets() {
        let spec = LimitsSpec { stuck_samples: Some(10), clipped_samples: Some(3), ..LimitsSpec::default() };
        let mut limited = limited(&spec, 6.0);
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
        let first = |force_n| limited(&spec, force_n).answer(&sample(0, STILL));
        assert_eq!(first(-200.0), Answer::Hold(Load::force_n(-200.0, 0.0)));
        assert!(matches!(first(-200.1), Answer::Aborted(Abort::Command { key: "force_n", got: 200.1, .. })));
    }

    /// A rig with the accelerometer m3 along y and z, the accelerometer m4 along x, and the encoder e of a joint.
    fn rig() -> (RigSpec, Vec<Channel>) {
        let named = |name: &str| InstrumentName::new(name).unwrap();
        let mut rig = RigSpec::default();
        let mut outputs = OUTPUTS.to_vec();
        for (name, measures, axes) in [
            ("e", Measured::Angle, &[Axis::AboutZ][..]),
            ("m3", Measured::Acceleration, &[Axis::Y, Axis::Z]),
            ("m4", Measured::Acceleration, &[Axis::X]),
        ] {
            rig.sensors.more.insert(named(name), SensorSpec::of(measures));
            let before = outputs.len() - OUTPUTS.len();
            outputs.extend(sensor_channels(named(name), measures, axes, 1, before));
        }
        (rig, outputs)
    }

    /// The reason to abort at samples with these readings of m3 along z and of e, the other axes moving.
    fn of_sensors(limits: &str, samples: u64, m3_z: Reading, e_rad: f64) -> Option<Abort> {
        let (rig, outputs) = rig();
        let spec = toml::from_str(limits).unwrap();
        let mut limited = Limited::new(Box::new(Constant(6.0)), spec, (&rig, &outputs), 1000.0);
        (0..samples).find_map(|n| {
            let moving = 1e-3 * n as f64;
            let more =
                Readings::new(&[e_rad + 1e-6 * n as f64, moving, m3_z.value, moving], u32::from(m3_z.clipped) << 2);
            let sample = Measurement { more: more.unwrap(), ..sample(n, Reading { value: moving, clipped: false }) };
            match limited.answer(&sample) {
                Answer::Aborted(abort) => Some(abort),
                _ => None,
            }
        })
    }

    #[test]
    fn a_sensor_has_the_limit_of_its_name_in_its_unit() {
        let still = Reading { value: -70.0, clipped: false };
        let says = |limits: &str, e_rad| {
            of_sensors(limits, 30, still, e_rad).map_or(String::new(), |abort| format!("{abort}"))
        };
        insta::assert_snapshot!(says("sensors.m3 = 65", 0.0), @"limits.sensors.m3: sensor m3 reads -70 m/s² along z after 0.000 s, beyond the limit of 65 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
        insta::assert_snapshot!(says("sensors.e = 0.5", 0.6), @"limits.sensors.e: sensor e reads 0.6 rad about z after 0.000 s, beyond the limit of 0.5 rad: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
        // Each limit is that of one sensor, and that of acceleration those of B and C.
        assert_eq!(says("acceleration_m_s2 = 65\nsensors.e = 0.5", 0.4), "");
        assert_eq!(says("sensors = { m3 = 75, m4 = 65 }", 0.6), "");
    }

    #[test]
    fn a_limit_of_b_or_c_replaces_that_of_all_accelerations() {
        let beyond = |limits: &str| {
            let spec: LimitsSpec = toml::from_str(limits).unwrap();
            let mut limited = limited(&spec, 1.0);
            (0..40).find_map(|n| match limited.answer(&sample(n, STILL)) {
                Answer::Aborted(abort) => Some((n, format!("{abort}"))),
                _ => None,
            })
        };
        // B reads n + 2.5 along y, and C 7 along x and n along y.
        let (n, reason) = beyond("acceleration_m_s2 = 20").unwrap();
        insta::assert_snapshot!(format!("{n}: {reason}"), @"18: limits.acceleration_m_s2: the accelerometer at B reads 20.5 m/s² along y after 0.018 s, beyond the limit of 20 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
        let (n, reason) = beyond("acceleration_m_s2 = 20\nsensors.b = 30").unwrap();
        insta::assert_snapshot!(format!("{n}: {reason}"), @"21: limits.acceleration_m_s2: the accelerometer at C reads 21 m/s² along y after 0.021 s, beyond the limit of 20 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
        let (n, reason) = beyond("acceleration_m_s2 = 20\nsensors.c = 5").unwrap();
        insta::assert_snapshot!(format!("{n}: {reason}"), @"0: limits.sensors.c: the accelerometer at C reads 7 m/s² along x after 0.000 s, beyond the limit of 5 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
    }

    #[test]
    fn a_sensor_with_a_limit_is_watched_for_clipped_and_equal_readings() {
        let axis = |clipped| Reading { value: 7.0, clipped };
        let says = |limits: &str, clipped| {
            of_sensors(limits, 30, axis(clipped), 0.0).map_or(String::new(), |abort| format!("{abort}"))
        };
        insta::assert_snapshot!(says("clipped_samples = 4\nsensors.m3 = 50", true), @"limits.clipped_samples: sensor m3 is clipped along z for 4 samples in a row, up to 0.003 s: reduce the excitation, or increase its range (`rig.sensors.m3.range_m_s2`)");
        insta::assert_snapshot!(says("stuck_samples = 9\nsensors.m3 = 50", false), @"limits.stuck_samples: sensor m3 reads exactly 7 m/s² along z for 9 samples under load, up to 0.009 s: check sensor and cable, or raise the number of samples if the axis has nothing to measure");
        assert_eq!((says("clipped_samples = 4", true), says("stuck_samples = 9", false)), Default::default());
    }

    /// What a run must give it: what its own limits are of, once, and what the inner controller needs.
    #[test]
    fn it_needs_the_sensors_that_have_limits_of_their_own() {
        let (rig, outputs) = rig();
        let needs = |limits: &str| {
            let spec = toml::from_str(limits).unwrap();
            let limited = Limited::new(Box::new(Constant(6.0)), spec, (&rig, &outputs), 1000.0);
            limited.needs().iter().map(|needed| (needed.place, needed.name.as_str().to_owned())).collect::<Vec<_>>()
        };
        assert_eq!(needs("acceleration_m_s2 = 20\nforce_n = 10\nclipped_samples = 3"), []);
        let named = |place, name: &str| (place, name.to_owned());
        assert_eq!(
            needs("sensors = { c = 20, m3 = 20 }"),
            [
                named(4, "acceleration_c_x_m_s2"),
                named(5, "acceleration_c_y_m_s2"),
                named(7, "acceleration_m3_y_m_s2"),
                named(8, "acceleration_m3_z_m_s2"),
            ]
        );
        assert!(outputs.len() - OUTPUTS.len() <= MOST_MORE);
    }
}
