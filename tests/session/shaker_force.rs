//! The force that a shaker applies to the arm, as its controller reads it, against the continuous force: arm, armature
//! and coil integrated by equations and a method of this file's own, under the same held commands.

use core::f64::consts::TAU;
use std::path::Path;

use resonarm::control::{Answer, ResponsePoint};
use resonarm::rig::{Converter, ShakerSpec};
use resonarm::scenario::Scenario;
use resonarm::structure::{BodySpec, Link};

/// Instants a sample at which the force is known where it is compared. It has a kink at every sample, and sums over its
/// values have an error of 10⁻⁴ of it with so many.
const FINE: u32 = 80;
/// Steps of the integration a sample where no force is compared: a third of the coil's time constant each.
const COARSE: u32 = 20;
/// Least length of a controller's reading, s: that of a step less what it waits.
const READ_S: f64 = 1.0;

/// Arm, armature and coil.
struct Rig {
    links: [Link; 2],
    shaker: ShakerSpec,
    /// Position of the tip along x with the joints at rest, m.
    rest_m: f64,
}

/// α1, α2, α̇1, α̇2, and the current, A.
type State = [f64; 5];

impl Rig {
    fn new(links: [Link; 2], shaker: ShakerSpec) -> Rig {
        let [one, two] = &links;
        let [first, second] = [one.angle_deg, one.angle_deg + two.angle_deg].map(f64::to_radians);
        let rest_m = one.length_m * libm::cos(first) + two.length_m * libm::cos(second);
        Rig { links, shaker, rest_m }
    }

    /// Rates of the state, and the force in the head, N, under a voltage, V.
    ///
    /// M α̈ + C α̇ + D α̇ + K α = Jᵀe H with H = Bl i − m s̈ − c ṡ − k s (Gierlak, Warmiński 2023, Eq. 3), and
    /// L di/dt = V − R i − Bl ṡ.
    fn rates(&self, [x1, x2, v1, v2, current_a]: State, voltage_v: f64) -> (State, f64) {
        let ([one, two], shaker) = (&self.links, &self.shaker);
        let (l1, l2, centre1, centre2) = (one.length_m, two.length_m, one.centre_of_mass_m, two.centre_of_mass_m);
        let beta_rad = [one, two].map(|link| link.angle_deg.to_radians());
        let (a2, a3) = (two.mass_kg * l1 * centre2, two.inertia_kg_m2 + two.mass_kg * centre2 * centre2);
        let a1 = one.inertia_kg_m2 + one.mass_kg * centre1 * centre1 + a3 + two.mass_kg * l1 * l1;
        let [q1, q12] = [beta_rad[0] + x1, beta_rad[0] + beta_rad[1] + x1 + x2];
        let ((s1, c1), (s12, c12)) = (libm::sincos(q1), libm::sincos(q12));
        // Sine and cosine of the second joint's angle, which is the difference of these two angles.
        let (s, c) = (s12 * c1 - c12 * s1, c12 * c1 + s12 * s1);
        let coriolis = [-a2 * s * (v2 * v1 + (v1 + v2) * v2), a2 * s * v1 * v1];
        let springs =
            [(one, x1, v1), (two, x2, v2)].map(|(link, x, v)| link.damping_nm_s_rad * v + link.stiffness_nm_rad * x);
        // The shaker pushes along x: s is the displacement of the tip.
        let [j1, j2] = [-l1 * s1 - l2 * s12, -l2 * s12];
        let centripetal = -l1 * c1 * v1 * v1 - l2 * c12 * (v1 + v2) * (v1 + v2);
        let displacement_m = l1 * c1 + l2 * c12 - self.rest_m;
        let velocity_m_s = j1 * v1 + j2 * v2;
        let pushed_n = shaker.force_factor_n_a * current_a
            - shaker.damping_n_s_m * velocity_m_s
            - shaker.stiffness_n_m * displacement_m;
        let armature_kg = shaker.moving_mass_kg;
        let m11 = a1 + 2.0 * a2 * c + armature_kg * j1 * j1;
        let m12 = a3 + a2 * c + armature_kg * j1 * j2;
        let m22 = a3 + armature_kg * j2 * j2;
        let along_n = pushed_n - armature_kg * centripetal;
        let [f1, f2] = [j1 * along_n - coriolis[0] - springs[0], j2 * along_n - coriolis[1] - springs[1]];
        let determinant = m11 * m22 - m12 * m12;
        let [w1, w2] = [(m22 * f1 - m12 * f2) / determinant, (m11 * f2 - m12 * f1) / determinant];
        let head_n = pushed_n - armature_kg * (j1 * w1 + j2 * w2 + centripetal);
        let back_v = shaker.force_factor_n_a * velocity_m_s;
        let current_rate = (voltage_v - shaker.resistance_ohm * current_a - back_v) / shaker.inductance_h;
        ([v1, v2, w1, w2, current_rate], head_n)
    }

    /// A step of the classical Runge–Kutta method.
    fn step(&self, state: State, voltage_v: f64, h: f64) -> State {
        let moved = |rates: State, h: f64| core::array::from_fn(|i| state[i] + h * rates[i]);
        let a = self.rates(state, voltage_v).0;
        let b = self.rates(moved(a, 0.5 * h), voltage_v).0;
        let c = self.rates(moved(b, 0.5 * h), voltage_v).0;
        let d = self.rates(moved(c, h), voltage_v).0;
        core::array::from_fn(|i| state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]))
    }

    /// The force in the head over the commands held, N, [`FINE`] instants a sample; NaN in samples that `is_compared`
    /// leaves out.
    fn head_n(&self, commands_n: &[f64], rate_hz: f64, is_compared: impl Fn(usize) -> bool) -> Vec<f64> {
        let (mut state, mut head_n) = ([0.0; 5], Vec::new());
        for (sample, command_n) in commands_n.iter().enumerate() {
            let voltage_v = command_n / self.shaker.force_factor_n_a * self.shaker.resistance_ohm;
            let steps = if is_compared(sample) { FINE } else { COARSE };
            for _ in 0..steps {
                if steps == FINE {
                    head_n.push(self.rates(state, voltage_v).1);
                }
                state = self.step(state, voltage_v, 1.0 / (rate_hz * f64::from(steps)));
            }
            head_n.resize((sample + 1) * FINE as usize, f64::NAN);
        }
        head_n
    }
}

/// Amplitude of the fundamental of whole periods.
fn amplitude(values: &[f64], cycles: f64) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (k, value) in values.iter().enumerate() {
        let (sine, cosine) = libm::sincos(TAU * cycles * k as f64);
        (re, im) = (re + value * cosine, im + value * sine);
    }
    2.0 * libm::hypot(re, im) / values.len() as f64
}

/// Runs the scenario's controller; what it read at the end of each window, with the sample, and all that it commanded,
/// N.
fn run(scenario: &Scenario) -> (Vec<(usize, ResponsePoint)>, Vec<f64>) {
    let mut plant = scenario.plant().unwrap();
    let mut controller = scenario.controller().unwrap();
    let (mut points, mut commands_n) = (Vec::new(), Vec::new());
    loop {
        let answer = controller.answer(&plant.measure());
        points.extend(controller.poll_response().map(|point| (commands_n.len(), point)));
        match answer {
            Answer::Hold(load) => {
                commands_n.push(load.force_n.x);
                plant.advance(&load).unwrap();
            }
            _ => return (points, commands_n),
        }
    }
}

/// A force as it was read, and the continuous one, N.
#[derive(Debug)]
struct Compared {
    _frequency_hz: f64,
    read_n: f64,
    continuous_n: f64,
}

/// The scenario with a converter, run, and each force that its controller read.
fn compared(converter: Converter) -> Vec<Compared> {
    let mut scenario = Scenario::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/shaker.toml")).unwrap();
    scenario.rig.converter = converter;
    // An ideal head: its noise and counts alone are 0.1 % of 2 N.
    scenario.rig.head.noise_rms = Some(0.0);
    scenario.rig.head.resolution = Some(0.0);
    let rate_hz = scenario.simulation.rate_hz;
    let (points, commands_n) = run(&scenario);
    assert_eq!(points.len(), 9);
    let tested = scenario.under_test().unwrap();
    let BodySpec::Chain(chain) = &tested.assembly.spec().body else { panic!("{tested:?}") };
    let rig = Rig::new(chain.links[..].try_into().unwrap(), scenario.rig.shaker.unwrap());
    let fine = f64::from(FINE);
    // Whole periods, as the controller reads them; it answers one sample after the last, which is of 2.5 samples before.
    let read = |(sample, point): &(usize, ResponsePoint)| {
        let periods = libm::ceil(READ_S * point.frequency_hz);
        let length = libm::round(periods / point.frequency_hz * rate_hz * fine) as usize;
        let end = ((*sample as f64 - 3.5) * fine) as usize;
        end - length..end
    };
    let windows: Vec<_> = points.iter().map(read).collect();
    let is_compared = |sample: usize| {
        let instants = sample * FINE as usize..(sample + 1) * FINE as usize;
        windows.iter().any(|window| window.start < instants.end && instants.start < window.end)
    };
    let head_n = rig.head_n(&commands_n, rate_hz, is_compared);
    let compare = |((_, point), window): (&(usize, ResponsePoint), &core::ops::Range<usize>)| Compared {
        _frequency_hz: point.frequency_hz,
        read_n: point.load,
        continuous_n: amplitude(&head_n[window.clone()], point.frequency_hz / (rate_hz * fine)),
    };
    points.iter().zip(&windows).map(compare).collect()
}

fn largest_error(compared: &[Compared]) -> f64 {
    compared.iter().map(|c| (c.read_n / c.continuous_n - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn the_force_that_is_read_is_the_force_that_acts() {
    for converter in [Converter::default(), Converter::Sinc3] {
        let compared = compared(converter);
        assert!(largest_error(&compared) < 3e-4, "{converter:?}: {compared:#?}");
    }
    // An instant of a force that is not held has images of the command in it.
    let instants = compared(Converter::Instant);
    assert!(largest_error(&instants) > 0.02, "{instants:#?}");
}
