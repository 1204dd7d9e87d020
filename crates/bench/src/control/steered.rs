//! A sine whose load, frequency and phase are set while it plays.
//!
//! At sample n, with f the set frequency and r the sample rate,
//!
//! ```text
//! held: d A(n) sin 2π(θ(n) + p(n)),   θ(n + 1) = θ(n) + f/r
//! ```
//!
//! so that the sine continues without a jump when f changes. A approaches the set load by at most the limit per second,
//! p the set phase by at most one turn per second. Once nothing has changed for two seconds, the response is read,
//! second by second, until it has settled.

use core::f64::consts::TAU;

use super::response::{Reading, ResponsePoint};
use super::{Answer, Controller, Length, LoadKind, SetPoint};
use crate::excitation::Window;
use crate::rig::{Load, Measurement, Sampling};

/// Time for which the set-point must be held before a response is read, s.
const SETTLE_S: f64 = 2.0;
/// Duration of a reading, s; at least eight periods are read.
const READ_S: f64 = 1.0;

/// Plays a sine along one direction, following the set-point.
#[derive(Clone, Debug)]
pub struct Steered {
    /// Load of size 1 in the direction of the sine.
    direction: Load,
    kind: LoadKind,
    limit: f64,
    sampling: Sampling,
    begin: SetPoint,
    set: SetPoint,
    /// Present load A, N or N·m.
    load: f64,
    /// Phase θ of the sine and, in the next field, its shift p, cycles.
    cycles: f64,
    shift: f64,
    /// Last sample that was answered.
    last: Option<u64>,
    /// First sample at which the set-point was held.
    stands_since: Option<u64>,
    reading: Option<Reading>,
    is_read: bool,
    response: Option<ResponsePoint>,
}

impl Steered {
    /// Returns a sine along `direction`, a load of size 1, of at most `limit`, N or N·m, with readings at this
    /// `sampling`. It begins without load at `frequency_hz`.
    pub fn new(direction: Load, limit: f64, sampling: Sampling, frequency_hz: f64) -> Steered {
        let kind = if direction.torque_nm.amax() > 0.0 { LoadKind::Torque } else { LoadKind::Force };
        let begin = SetPoint { load: 0.0, frequency_hz, phase_deg: 0.0 };
        Steered {
            direction,
            kind,
            limit,
            sampling,
            begin,
            set: begin,
            load: 0.0,
            cycles: 0.0,
            shift: 0.0,
            last: None,
            stands_since: None,
            reading: None,
            is_read: true,
            response: None,
        }
    }

    /// Returns the largest load that can be set, N or N·m.
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// Returns the present set-point.
    pub fn set_point(&self) -> SetPoint {
        self.set
    }

    /// Moves the held values by `passed` samples towards the set-point. Returns whether they have reached it.
    fn approach(&mut self, passed: f64) -> bool {
        let most = passed / self.sampling.rate_hz;
        // The clamp lets the last step end exactly at the target, so that the comparison below can be exact.
        let near = |value: f64, wanted: f64, step: f64| value + (wanted - value).clamp(-step, step);
        self.load = near(self.load, self.set.load, most * self.limit);
        self.shift = near(self.shift, self.set.phase_deg / 360.0, most);
        self.load == self.set.load && self.shift == self.set.phase_deg / 360.0
    }

    /// Reads the response once the set-point has been held for long enough.
    fn read(&mut self, sample: &Measurement, stands: bool) {
        let n = sample.sample;
        // Without a load there is no response, and a response is read once per set-point.
        if !stands || self.is_read || self.load == 0.0 {
            self.stands_since = None;
            self.reading = None;
            return;
        }
        let since = *self.stands_since.get_or_insert(n);
        // A held sine lags by half a sample, and the converter delays the reading.
        let late = self.sampling.converter.delay_samples() + 0.5;
        let phase_cycles = self.cycles + self.shift - late * self.set.frequency_hz / self.sampling.rate_hz;
        match &mut self.reading {
            None if n >= since + (SETTLE_S * self.sampling.rate_hz) as u64 => {
                let frequency_hz = self.set.frequency_hz;
                let length = (READ_S.max(8.0 / frequency_hz) * self.sampling.rate_hz) as u64;
                let load = self.load * self.sampling.hold(frequency_hz);
                let window = Window { frequency_hz, first: n, end: n + length };
                let mut reading = Reading::new(window, load, self.sampling);
                reading.add(sample, phase_cycles);
                self.reading = Some(reading);
            }
            None => {}
            Some(reading) if n < reading.window.end => reading.add(sample, phase_cycles),
            Some(reading) => {
                let response = reading.finish();
                self.response = response.map(|point| ResponsePoint { load_kind: self.kind, ..point });
                // A response that has not settled is read again, until it has.
                self.is_read = self.response.is_some_and(|response| response.settled);
                self.reading = None;
            }
        }
    }
}

impl Controller for Steered {
    fn load_kind(&self) -> LoadKind {
        self.kind
    }

    fn restart(&mut self) {
        *self = Steered {
            begin: self.begin,
            ..Steered::new(self.direction, self.limit, self.sampling, self.begin.frequency_hz)
        };
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let n = sample.sample;
        // Time goes by the index of the sample: where samples were lost, the sine and its ramps have gone on without
        // them.
        let passed = self.last.map_or(0, |last| n.saturating_sub(last)) as f64;
        self.last = Some(n);
        let cycles = self.cycles + passed * self.set.frequency_hz / self.sampling.rate_hz;
        // Only the fraction is kept: after hours the whole cycles would cost digits of the phase.
        self.cycles = cycles - libm::floor(cycles);
        let stands = self.approach(passed);
        self.read(sample, stands);
        Answer::Hold(self.direction.scaled(self.load * libm::sin(TAU * (self.cycles + self.shift))))
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        self.response.take()
    }

    fn steer(&mut self, set_point: &SetPoint) -> bool {
        let SetPoint { load, frequency_hz, phase_deg } = *set_point;
        // Limits are checked here and not corrected: the caller tells the user that the value is not possible.
        let is_possible = (0.0..=self.limit).contains(&load)
            && frequency_hz > 0.0
            && frequency_hz < 0.5 * self.sampling.rate_hz
            && phase_deg.abs() <= 360.0;
        if is_possible {
            self.set = *set_point;
            self.is_read = false;
            self.stands_since = None;
            self.reading = None;
        }
        is_possible
    }

    fn set_point(&self) -> Option<SetPoint> {
        Some(self.set)
    }

    fn length(&self) -> Length {
        Length::Unknown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Converter, Reading as Axis};

    const SAMPLING: Sampling = Sampling { rate_hz: 1000.0, converter: Converter::Instant };

    /// The force held at sample `n`; the controller gets a sample with accelerations that follow the force.
    fn held_n(steered: &mut Steered, n: u64, force_n: f64) -> f64 {
        let pair = |value: f64| [Axis { value, clipped: false }, Axis { value: 0.0, clipped: false }];
        let sample = Measurement {
            sample: n,
            head_force_n: pair(force_n),
            acceleration_b_m_s2: pair(force_n),
            acceleration_c_m_s2: pair(2.0 * force_n),
            ..Measurement::default()
        };
        match steered.answer(&sample) {
            Answer::Hold(load) => load.force_n.x,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn moves_to_the_set_point_without_a_jump_and_reads_the_response() {
        let mut steered = Steered::new(Load::force_n(1.0, 0.0), 100.0, SAMPLING, 10.0);
        assert!((0..100).all(|n| held_n(&mut steered, n, 0.0) == 0.0));
        let mut force_n = 0.0_f64;
        let mut responses = Vec::new();
        let mut largest_n = 0.0_f64;
        for n in 100..12_000_u64 {
            let set = match n {
                100 => Some((20.0, 10.0, 0.0)),
                6_000 => Some((20.0, 14.0, 90.0)),
                _ => None,
            };
            if let Some((load, frequency_hz, phase_deg)) = set {
                assert!(steered.steer(&SetPoint { load, frequency_hz, phase_deg }));
            }
            let next_n = held_n(&mut steered, n, force_n);
            // A sine of 20 N at 14 Hz and one turn a second changes by 2π·15·20/1000 = 1.9 N a sample at most.
            assert!((next_n - force_n).abs() < 1.95, "{n}: {force_n} to {next_n}");
            force_n = next_n;
            largest_n = largest_n.max(next_n);
            responses.extend(steered.poll_response());
        }
        assert!((largest_n - 20.0).abs() < 0.05, "{largest_n}");
        let read: Vec<_> = responses.iter().map(|point| (point.frequency_hz, point.settled)).collect();
        assert_eq!(read, [(10.0, true), (14.0, true)]);
        for point in &responses {
            let size = |axis: crate::excitation::Phasor| axis.norm_sqr().sqrt();
            assert!((size(point.acceleration_c_m_s2[0]) - 40.0).abs() < 0.01, "{point:?}");
        }
        steered.restart();
        assert_eq!(held_n(&mut steered, 0, 0.0), 0.0);
        assert_eq!(steered.set_point(), SetPoint { load: 0.0, frequency_hz: 10.0, phase_deg: 0.0 });
    }

    #[test]
    fn rejects_impossible_set_points() {
        let mut steered = Steered::new(Load::torque_nm(0.0, 1.0), 100.0, SAMPLING, 10.0);
        assert_eq!(steered.load_kind(), LoadKind::Torque);
        let good = SetPoint { load: 5.0, frequency_hz: 20.0, phase_deg: 0.0 };
        assert!(steered.steer(&good));
        for wrong in [
            SetPoint { load: 100.1, ..good },
            SetPoint { load: -1.0, ..good },
            SetPoint { load: f64::NAN, ..good },
            SetPoint { frequency_hz: 500.0, ..good },
            SetPoint { frequency_hz: 0.0, ..good },
            SetPoint { frequency_hz: f64::NAN, ..good },
            SetPoint { phase_deg: f64::INFINITY, ..good },
        ] {
            assert!(!steered.steer(&wrong), "{wrong:?}");
        }
        assert_eq!(steered.set_point(), good);
    }
}
