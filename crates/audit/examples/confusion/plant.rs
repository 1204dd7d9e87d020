//! Structures with known modes.

use core::f64::consts::TAU;

/// Samples a second, and in a frame of random signals: a power of two.
pub const RATE: usize = 1024;

/// A structure with what a test of it asks for.
#[derive(Clone, Copy, Debug)]
pub struct Structure {
    pub name: &'static str,
    /// Acceleration of the structure as a whole by a force, 1/kg, at the control channel, where the force acts, and at the
    /// channel whose response can have a limit.
    pub body_1_kg: [f64; 2],
    pub modes: &'static [ModeSpec],
    /// Sweep of a sine: its rate is one at which a loop can follow the modes, whose η/π is below a tenth.
    pub sweep: Sweep,
}

/// A mode of a structure.
#[derive(Clone, Copy, Debug)]
pub struct ModeSpec {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// Products of its shape at the force and at the two channels for unit modal mass, 1/kg.
    pub gains_1_kg: [f64; 2],
}

/// A swept sine as a specification states it, and the gain of an amplitude loop that follows the modes.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    pub band_hz: [f64; 2],
    pub rate_oct_min: f64,
    pub gain_1_s: f64,
    /// Bandwidth of the filters of judge and loop over the frequency. At an antiresonance the sidebands of the amplitude are
    /// large at the mode beside it, so that the filter must be narrower than the distance.
    pub tracking: f64,
}

const fn mode(frequency_hz: f64, damping_ratio: f64, gains_1_kg: [f64; 2]) -> ModeSpec {
    ModeSpec { frequency_hz, damping_ratio, gains_1_kg }
}

/// A free structure is its own mass above its modes, so that each has an antiresonance at the driving point below it.
pub const STRUCTURES: [Structure; 3] = [
    Structure {
        name: "two modes, ζ 2 %",
        body_1_kg: [1.0, 0.7],
        modes: &[mode(60.0, 0.02, [0.3, 0.2]), mode(130.0, 0.02, [0.3, -0.25])],
        sweep: Sweep { band_hz: [48.0, 72.0], rate_oct_min: 0.4, gain_1_s: 2.0, tracking: 0.05 },
    },
    Structure {
        name: "one mode, ζ 0.5 %",
        body_1_kg: [1.0, 0.7],
        modes: &[mode(80.0, 0.005, [0.15, -0.1])],
        sweep: Sweep { band_hz: [77.0, 84.0], rate_oct_min: 0.1, gain_1_s: 2.0, tracking: 0.03 },
    },
    Structure {
        name: "stiff plate",
        body_1_kg: [1.0, 0.9],
        modes: &[
            mode(95.0, 0.03, [0.04, 0.03]),
            mode(160.0, 0.03, [0.04, -0.04]),
            mode(260.0, 0.01, [0.05, 0.03]),
            mode(340.0, 0.01, [0.05, -0.03]),
        ],
        sweep: Sweep { band_hz: [20.0, 80.0], rate_oct_min: 4.0, gain_1_s: 6.0, tracking: 0.15 },
    },
];

/// A structure that moves.
#[derive(Clone, Debug)]
pub struct Plant {
    body_1_kg: [f64; 2],
    modes: Vec<(Oscillator, [f64; 2])>,
}

impl Plant {
    pub fn new(structure: &Structure) -> Plant {
        let modes = structure
            .modes
            .iter()
            .map(|mode| (Oscillator::new([mode.frequency_hz, mode.damping_ratio]), mode.gains_1_kg));
        Plant { body_1_kg: structure.body_1_kg, modes: modes.collect() }
    }

    /// The structure with another damping ratio of all modes.
    pub fn damped(structure: &Structure, damping_ratio: f64) -> Plant {
        let mut plant = Plant::new(structure);
        for ((oscillator, _), mode) in plant.modes.iter_mut().zip(structure.modes) {
            *oscillator = Oscillator::new([mode.frequency_hz, damping_ratio]);
        }
        plant
    }

    /// Returns the accelerations of the two channels in the middle of a sample with a force, N.
    pub fn step(&mut self, force: f64) -> [f64; 2] {
        let mut accelerations = self.body_1_kg.map(|gain| gain * force);
        for (oscillator, gains) in &mut self.modes {
            let own = oscillator.step(force);
            for (acceleration, gain) in accelerations.iter_mut().zip(gains) {
                *acceleration += *gain * own;
            }
        }
        accelerations
    }
}

/// An oscillator of 1 kg that is driven by a force on it; a mass alone at 0 Hz.
#[derive(Clone, Debug)]
pub struct Oscillator {
    omega: f64,
    damping_ratio: f64,
    /// What the free oscillator makes of its displacement and velocity in half a sample.
    turn: [[f64; 2]; 2],
    state: [f64; 2],
}

impl Oscillator {
    /// With the decay D = e^(−ζωt) and the damped frequency w, a free oscillator goes in the time t from x and v to
    /// x' = D ((cos wt + ζω/w sin wt) x + v/w sin wt) and v' = D ((cos wt − ζω/w sin wt) v − ω²/w sin wt x).
    pub fn new([natural_hz, damping_ratio]: [f64; 2]) -> Oscillator {
        let omega = TAU * natural_hz;
        let t_s = 0.5 / RATE as f64;
        let damped = omega * libm::sqrt(1.0 - damping_ratio * damping_ratio);
        let (sine, cosine) = libm::sincos(damped * t_s);
        let decay = libm::exp(-damping_ratio * omega * t_s);
        let by_damped = if damped == 0.0 { t_s } else { sine / damped };
        let lag = damping_ratio * omega * by_damped;
        let turn =
            [[decay * (cosine + lag), decay * by_damped], [-decay * omega * omega * by_damped, decay * (cosine - lag)]];
        Oscillator { omega, damping_ratio, turn, state: [0.0; 2] }
    }

    /// Returns the acceleration in the middle of a sample with a force, N. It is exact: a force that is held moves the rest position to
    /// F/ω².
    pub fn step(&mut self, force: f64) -> f64 {
        if self.omega == 0.0 {
            return force;
        }
        let rest = force / (self.omega * self.omega);
        let half = |[x, v]: [f64; 2]| self.turn.map(|[by_x, by_v]| by_x * x + by_v * v);
        let [x, v] = half([self.state[0] - rest, self.state[1]]);
        let end = half([x, v]);
        self.state = [end[0] + rest, end[1]];
        -2.0 * self.damping_ratio * self.omega * v - self.omega * self.omega * x
    }
}
