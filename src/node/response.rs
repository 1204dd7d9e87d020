//! The exciter's reading of the response, window by window.

use resonarm_protocol::{Acceleration, ImpedanceHead};

use crate::excitation::{Phasor, Profile, SineFit, Window};

/// The channels: head x, y; B x, y; C x, y.
const CHANNELS: usize = 6;

/// The response at one frequency, as the controller reads it from the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponsePoint {
    /// Frequency of the drive, Hz.
    pub frequency_hz: f64,
    /// Force in the impedance head along x and y against the drive's phase, N.
    pub head_force_n: [Phasor; 2],
    /// Acceleration of B along x and y, m/s².
    pub acceleration_b_m_s2: [Phasor; 2],
    /// Acceleration of C along x and y, m/s².
    pub acceleration_c_m_s2: [Phasor; 2],
    /// How much the response still moved: the change from the first to the second half of the window, relative to the
    /// whole, in the channel with the largest acceleration.
    pub drift: f64,
    /// Whether any reading in the window was clipped.
    pub clipped: bool,
}

impl ResponsePoint {
    /// Above this drift a response is called not settled.
    pub const SETTLED_DRIFT: f64 = 0.02;

    /// Whether the response had settled: its drift is below 2 %.
    pub fn is_settled(&self) -> bool {
        self.drift < ResponsePoint::SETTLED_DRIFT
    }
}

/// Reads the responses of a profile as its samples come in.
#[derive(Clone, Debug)]
pub(super) struct ResponseReader {
    windows: alloc::vec::IntoIter<Window>,
    current: Option<Reading>,
}

#[derive(Clone, Debug)]
struct Reading {
    window: Window,
    whole: SineFit<CHANNELS>,
    halves: [SineFit<CHANNELS>; 2],
    clipped: bool,
}

impl Reading {
    fn new(window: Window) -> Reading {
        let samples = window.end - window.first;
        let half = samples / 2;
        let halves = [SineFit::new(half), SineFit::new(samples - half)];
        Reading { window, whole: SineFit::new(samples), halves, clipped: false }
    }

    fn add(&mut self, n: u64, phase_cycles: f64, values: &[f64; CHANNELS]) {
        let (k, half) = (n - self.window.first, (self.window.end - self.window.first) / 2);
        self.whole.add(k, phase_cycles, values);
        match k.checked_sub(half) {
            None => self.halves[0].add(k, phase_cycles, values),
            Some(k) => self.halves[1].add(k, phase_cycles, values),
        }
    }

    fn finish(&self) -> Option<ResponsePoint> {
        let whole = self.whole.finish()?;
        let [first, second] = [self.halves[0].finish()?, self.halves[1].finish()?];
        let (mut largest, mut drift) = (0.0, f64::INFINITY);
        for channel in 2..CHANNELS {
            let size = libm::hypot(whole[channel].re, whole[channel].im);
            if size > largest {
                let change = second[channel] - first[channel];
                (largest, drift) = (size, libm::hypot(change.re, change.im) / size);
            }
        }
        let [hx, hy, bx, by, cx, cy] = whole;
        Some(ResponsePoint {
            frequency_hz: self.window.frequency_hz,
            head_force_n: [hx, hy],
            acceleration_b_m_s2: [bx, by],
            acceleration_c_m_s2: [cx, cy],
            drift,
            clipped: self.clipped,
        })
    }
}

impl ResponseReader {
    pub fn new(profile: &Profile) -> ResponseReader {
        let windows: alloc::vec::Vec<_> = profile.windows().collect();
        let mut windows = windows.into_iter();
        let current = windows.next().map(Reading::new);
        ResponseReader { windows, current }
    }

    /// Takes in sample `n`; the response of a window that ended before it, if one did.
    pub fn add(
        &mut self,
        n: u64,
        phase_cycles: f64,
        head: &ImpedanceHead,
        b: &Acceleration,
        c: &Acceleration,
    ) -> Option<ResponsePoint> {
        let mut done = None;
        if self.current.as_ref().is_some_and(|reading| n >= reading.window.end) {
            done = self.current.take().and_then(|reading| reading.finish());
            self.current = self.windows.next().map(Reading::new);
        }
        if let Some(reading) = self.current.as_mut().filter(|reading| n >= reading.window.first) {
            let values = [
                head.force_x_n,
                head.force_y_n,
                b.acceleration_x_m_s2,
                b.acceleration_y_m_s2,
                c.acceleration_x_m_s2,
                c.acceleration_y_m_s2,
            ];
            reading.add(n, phase_cycles, &values);
            reading.clipped |= [head.x_saturated, head.y_saturated, b.x_saturated, b.y_saturated].contains(&true);
            reading.clipped |= c.x_saturated || c.y_saturated;
        }
        done
    }
}
