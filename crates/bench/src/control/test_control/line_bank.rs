//! Lines that share a period: a sum of sines at multiples of 1/T, played and read sample by sample.
//!
//! With the period of N samples, line k turns by e^(2πik/N) from sample to sample. A sum of lines with the complex amplitudes
//! u(k) is Re Σ u(k) e^(2πikn/N), and the lines of a signal are c(k) = 2/N Σ c(n) e^(−2πikn/N) over a whole period. Both cost
//! each sample the same few operations per line, where a fast transform would put all the work into one sample.
//!
//! A structure that has played the period before is in its periodic response, in which c(k) = H(k) u(k) exactly: no window, no
//! leakage. Only noise is left, which falls with the number of periods.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;

const ZERO: Complex<f64> = Complex::new(0.0, 0.0);

/// Lines from a first one on, at the present sample of the period.
#[derive(Clone, Debug)]
pub(super) struct LineBank {
    /// Number of samples of the period.
    pub period: usize,
    /// Index of the first line.
    pub first: usize,
    /// e^(2πikn/N) at the present sample n, and e^(2πik/N).
    turned: Vec<Complex<f64>>,
    turn: Vec<Complex<f64>>,
    /// Index n of the present sample, from the begin of the signal.
    pub sample: usize,
}

impl LineBank {
    /// Returns the lines within a band of a period of `period` samples.
    pub fn new(period: usize, rate_hz: f64, [from_hz, to_hz]: [f64; 2]) -> LineBank {
        let line_hz = rate_hz / period as f64;
        // Line 0 is a constant, which no exciter can hold, and the lines end below half the sample rate, where a line
        // has no phase.
        let first = (libm::floor(from_hz / line_hz) as usize).max(1);
        let last = (libm::ceil(to_hz / line_hz) as usize).clamp(first, (period - 1) / 2);
        let turn = |k: usize| {
            let (sine, cosine) = libm::sincos(TAU * k as f64 / period as f64);
            Complex::new(cosine, sine)
        };
        let turn: Vec<Complex<f64>> = (first..=last).map(turn).collect();
        LineBank { period, first, turned: vec![Complex::new(1.0, 0.0); turn.len()], turn, sample: 0 }
    }

    /// Returns the number of lines.
    pub fn lines(&self) -> usize {
        self.turn.len()
    }

    /// Goes back to sample 0 of the period.
    pub fn restart(&mut self) {
        self.turned.fill(Complex::new(1.0, 0.0));
        self.sample = 0;
    }

    /// Goes on to the next sample. Returns whether a period has ended.
    pub fn advance(&mut self) -> bool {
        self.sample += 1;
        if self.sample == self.period {
            // The products of a period are 1 but for rounding, which must not add up over periods.
            self.restart();
            return true;
        }
        self.turned.iter_mut().zip(&self.turn).for_each(|(turned, turn)| *turned *= turn);
        false
    }

    /// Returns the sum of the lines with these amplitudes at the present sample.
    pub fn sum(&self, amplitudes: &[Complex<f64>]) -> f64 {
        self.turned.iter().zip(amplitudes).map(|(turned, u)| turned.re * u.re - turned.im * u.im).sum()
    }

    /// Adds a value of the present sample to the lines of a signal.
    pub fn read(&self, lines: &mut [Complex<f64>], value: f64) {
        let value = value * 2.0 / self.period as f64;
        for (line, turned) in lines.iter_mut().zip(&self.turned) {
            *line += turned.conj() * value;
        }
    }

    /// Returns the lines of a signal of one period.
    pub fn lines_of(&mut self, values: impl Iterator<Item = f64>) -> Vec<Complex<f64>> {
        let mut lines = vec![ZERO; self.lines()];
        self.restart();
        for value in values.take(self.period) {
            self.read(&mut lines, value);
            self.advance();
        }
        self.restart();
        lines
    }
}

/// Periods in which the response settles, and over which it is read, in the first and in the second pass.
const SETTLED_PERIODS: [u32; 2] = [1, 2];
const READ_PERIODS: [u32; 2] = [1, 4];
/// Peak of a multisine over its rms, with room for lines that are not equal.
const CREST: f64 = 4.5;

/// Identification of the responses of several channels by a multisine, in two passes.
///
/// In the first pass all lines of the drive are equal. A line at which the structure responds little is then lost in the noise, and
/// a test needs a large drive just there. So the lines of the second pass are those for which the control channel has the lines that
/// the test asks for, as far as the first pass shows.
#[derive(Clone, Debug)]
pub(super) struct Identification {
    pub bank: LineBank,
    rate_hz: f64,
    /// Largest rms of the drive, N.
    most_n: f64,
    /// Lines of the drive, N.
    drive: Vec<Complex<f64>>,
    /// Lines of each channel: first their sums, in the end the responses, (m/s²)/N.
    pub responses: Vec<Vec<Complex<f64>>>,
    /// Present pass, 0 or 1, and its periods that have ended.
    pass: usize,
    periods: u32,
}

/// What the identification knows after a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    /// Nothing new: the signal goes on.
    Nothing,
    /// The responses of the first pass: the second one must be shaped.
    Roughly,
    /// The responses are identified, and are good enough.
    Well,
}

impl Identification {
    /// Returns an identification of `channels` channels over the lines of a bank, with a drive of at most `peak_n`.
    pub fn new(bank: LineBank, channels: usize, rate_hz: f64, peak_n: f64) -> Identification {
        let responses = vec![vec![ZERO; bank.lines()]; channels];
        let drive = vec![ZERO; bank.lines()];
        Identification { bank, rate_hz, most_n: peak_n / CREST, drive, responses, pass: 0, periods: 0 }
    }

    /// Begins the first pass, with a drive of this rms if it is not too large.
    pub fn begin(&mut self, rms_n: f64) {
        let size = rms_n.min(self.most_n) * libm::sqrt(2.0 / self.drive.len() as f64);
        self.drive.fill(Complex::new(size, 0.0));
        self.spread(|_| 1.0);
        self.pass = 0;
        self.restart();
    }

    /// Begins the second pass. The lines of the drive are those for which the control channel has lines of the sizes `wanted`, but
    /// not smaller than `least` of the largest one; the response has the rms `rms_m_s2`. The channel's noise has the density
    /// `noise`, (m/s²)²/Hz.
    pub fn shape(&mut self, wanted: impl Fn(usize) -> f64, least: f64, rms_m_s2: f64, noise: f64) {
        // A response in the noise is not smaller than its deviation.
        for k in 0..self.drive.len() {
            let power = self.responses[0][k].norm_sqr() + self.variance(k, noise);
            self.drive[k].re = wanted(k) / libm::sqrt(power.max(f64::MIN_POSITIVE));
            self.drive[k].im = 0.0;
        }
        let largest = self.drive.iter().fold(0.0_f64, |largest, line| largest.max(line.re));
        let mut response = 0.0;
        let mut force = 0.0;
        for (line, h) in self.drive.iter_mut().zip(&self.responses[0]) {
            line.re = line.re.max(least * largest);
            force += 0.5 * line.re * line.re;
            response += 0.5 * line.re * line.re * h.norm_sqr();
        }
        let scale = (rms_m_s2 / libm::sqrt(response)).min(self.most_n / libm::sqrt(force));
        self.drive.iter_mut().for_each(|line| line.re *= scale);
        // Taken out for the closure, which reads the responses while `spread` changes the drive.
        let responses = core::mem::take(&mut self.responses);
        self.spread(|k| responses[0][k].norm_sqr());
        self.responses = responses;
        self.pass = 1;
        self.restart();
    }

    /// Turns the lines of the drive, which are real, so that their sum is spread over the period: the peak of equal lines is about
    /// 1.7 times their rms. `gain` is |H|² of a line.
    ///
    /// M. R. Schroeder, "Synthesis of low-peak-factor signals and binary sequences with low autocorrelation", IEEE Trans. Inf.
    /// Theory 16 (1970): line k has the phase −2π Σ (k − j) p(j) over the lines j below it, with their shares p of the power. The
    /// sum is a sweep that passes each line in its share of the period. With the shares of the drive alone it would stay at an
    /// antiresonance, and pass all other lines in a burst of the response; so p is the mean of the shares in drive and response,
    /// and neither has more than twice the power of an even spread at any time.
    fn spread(&mut self, gain: impl Fn(usize) -> f64) {
        let mut force = 0.0;
        let mut response = 0.0;
        for (k, line) in self.drive.iter().enumerate() {
            force += line.re * line.re;
            response += line.re * line.re * gain(k);
        }
        let mut cycles = 0.0;
        let mut below = 0.0;
        for (k, line) in self.drive.iter_mut().enumerate() {
            cycles -= below;
            cycles -= libm::floor(cycles);
            below += 0.5 * line.re * line.re * (1.0 / force + gain(k) / response);
            let (sine, cosine) = libm::sincos(TAU * cycles);
            *line = Complex::new(cosine, sine) * line.re;
        }
    }

    /// Starts the present pass over.
    pub fn restart(&mut self) {
        self.bank.restart();
        self.periods = 0;
        self.responses.iter_mut().for_each(|lines| lines.fill(ZERO));
    }

    /// Returns the variance of the response at a line by noise of a density: that of a line of N samples is 2 S fs/N.
    pub fn variance(&self, line: usize, noise: f64) -> f64 {
        let samples = f64::from(READ_PERIODS[self.pass]) * self.bank.period as f64;
        2.0 * noise * self.rate_hz / (samples * self.drive[line].norm_sqr())
    }

    /// Takes the readings of a sample. Returns the drive that answers it, N, and what is known.
    pub fn step(&mut self, readings: impl Iterator<Item = f64>) -> (f64, Known) {
        let drive_n = self.bank.sum(&self.drive);
        let settled = SETTLED_PERIODS[self.pass];
        let read = READ_PERIODS[self.pass];
        if self.periods >= settled {
            for (lines, value) in self.responses.iter_mut().zip(readings) {
                self.bank.read(lines, value);
            }
        }
        // The drive of this sample was summed before the step: readings and drive are of the same sample.
        let is_whole = self.bank.advance();
        self.periods += u32::from(is_whole);
        if !is_whole || self.periods != settled + read {
            return (drive_n, Known::Nothing);
        }
        for lines in &mut self.responses {
            for (line, u) in lines.iter_mut().zip(&self.drive) {
                *line = *line / *u / f64::from(read);
            }
        }
        (drive_n, if self.pass == 0 { Known::Roughly } else { Known::Well })
    }

    /// Continues the drive of the last pass, N.
    pub fn go_on(&mut self) -> f64 {
        let drive_n = self.bank.sum(&self.drive);
        self.bank.advance();
        drive_n
    }

    /// Returns the number of samples that it takes.
    pub fn samples(&self) -> u64 {
        let periods: u32 = SETTLED_PERIODS.iter().chain(&READ_PERIODS).sum();
        u64::from(periods) * self.bank.period as u64
    }
}

/// Returns the response at a frequency, given in lines from the first one on, between the lines.
///
/// Near a resonance 1/H is almost a polynomial of the frequency, and near an antiresonance H is: the one of both that is
/// straighter over the four lines about the frequency is interpolated.
pub(super) fn response_at(lines: &[Complex<f64>], place: f64) -> Complex<f64> {
    let last = lines.len().saturating_sub(1);
    if last == 0 {
        return lines.first().copied().unwrap_or(ZERO);
    }
    let at = |k: usize| lines[k.min(last)];
    let below = (libm::floor(place.max(0.0)) as usize).min(last - 1);
    let part = (place - below as f64).clamp(0.0, 1.0);
    let [before, low, high, after] = [at(below.saturating_sub(1)), at(below), at(below + 1), at(below + 2)];
    let size = |h: Complex<f64>| libm::sqrt(h.norm_sqr());
    let bend = |[a, b, c, d]: [Complex<f64>; 4]| size(a - b - c + d) / (size(b) + size(c));
    let inverse = [before, low, high, after].map(|h| 1.0 / h);
    let between = |a: Complex<f64>, b: Complex<f64>| a * (1.0 - part) + b * part;
    if bend(inverse) <= bend([before, low, high, after]) {
        1.0 / between(inverse[1], inverse[2])
    } else {
        between(low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Normed as _;

    /// A multisine through a delay of 3 samples and a gain that grows is identified exactly, and the response of the second pass is
    /// the one that is asked for.
    #[test]
    fn the_response_is_exact_in_the_periodic_state() {
        let mut found = Identification::new(LineBank::new(800, 100.0, [5.0, 40.0]), 1, 100.0, 1e3);
        found.begin(0.5);
        let mut past = [0.0; 4];
        let mut squares = 0.0;
        let mut count = 0;
        let mut peak = 0.0_f64;
        loop {
            // 2 (x(n − 3) − x(n − 4)).
            let reading = 2.0 * (past[2] - past[3]);
            let (drive_n, known) = found.step(core::iter::once(reading));
            past = [drive_n, past[0], past[1], past[2]];
            peak = peak.max(drive_n.abs());
            if found.pass == 1 && found.periods >= 1 {
                squares += reading * reading;
                count += 1;
            }
            match known {
                Known::Nothing => {}
                Known::Roughly => {
                    // Schroeder's phases keep the peak of equal lines low.
                    assert!(peak < 0.5 * 2.0, "{peak}");
                    found.shape(|_| 1.0, 0.0, 0.3, 0.0);
                }
                Known::Well => break,
            }
        }
        let rms = libm::sqrt(squares / f64::from(count));
        assert!((rms - 0.3).abs() < 1e-3, "{rms}");
        for (k, line) in found.responses[0].iter().enumerate() {
            let turn = |delay: f64| {
                let angle = TAU * delay * (found.bank.first + k) as f64 / 800.0;
                Complex::new(libm::cos(angle), -libm::sin(angle))
            };
            assert!((line - (turn(3.0) - turn(4.0)) * 2.0).norm() < 1e-9, "{k}: {line}");
        }
    }

    /// At an antiresonance, which takes 95 % of the drive's power, the multisine does not stay so long that it passes the other
    /// lines in a burst of the response.
    #[test]
    fn drive_and_response_are_spread_over_the_period() {
        let mut found = Identification::new(LineBank::new(800, 100.0, [5.0, 40.0]), 1, 100.0, 1e3);
        found.begin(0.5);
        let mut past = [0.0; 3];
        let mut squares = [0.0; 2];
        let mut peaks = [0.0_f64; 2];
        let mut count = 0;
        loop {
            // Zeros at 0.98 e^(±2πi 20/100).
            let reading = past[0] - 1.96 * libm::cos(TAU * 0.2) * past[1] + 0.98 * 0.98 * past[2];
            let (drive_n, known) = found.step(core::iter::once(reading));
            past = [drive_n, past[0], past[1]];
            if found.pass == 1 && found.periods >= 1 {
                count += 1;
                for ((square, peak), value) in squares.iter_mut().zip(&mut peaks).zip([drive_n, reading]) {
                    *square += value * value;
                    *peak = peak.max(value.abs());
                }
            }
            match known {
                Known::Nothing => {}
                Known::Roughly => found.shape(|_| 1.0, 0.0, 0.3, 0.0),
                Known::Well => break,
            }
        }
        let crests = [0, 1].map(|signal| peaks[signal] / libm::sqrt(squares[signal] / f64::from(count)));
        assert!(crests.iter().all(|crest| *crest < 3.0), "{crests:?}");
    }

    /// Between lines 0.5 Hz apart, a mode with a half-power bandwidth of 0.3 Hz is right to 2.1 %, where H itself, interpolated,
    /// is wrong by half.
    #[test]
    fn a_sharp_mode_is_interpolated_between_its_lines() {
        let h = |hz: f64| {
            let w = TAU * hz;
            let wn = TAU * 30.27;
            Complex::new(-w * w, 0.0) / Complex::new(wn * wn - w * w, 2.0 * 0.005 * w * wn)
        };
        let lines: Vec<Complex<f64>> = (0..100).map(|k| h(10.0 + 0.5 * k as f64)).collect();
        let mut worst = 0.0_f64;
        for k in 0..9000 {
            let hz = 10.5 + 0.005 * k as f64;
            let found = response_at(&lines, (hz - 10.0) / 0.5);
            let exact = h(hz);
            worst = worst.max((found / exact - 1.0).norm());
        }
        assert!(worst < 0.021, "{worst}");
        let plain = (lines[40] + lines[41]) * 0.5 / h(30.25) - 1.0;
        assert!(plain.norm() > 0.5, "{plain}");
    }
}
