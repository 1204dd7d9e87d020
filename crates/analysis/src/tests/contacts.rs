//! Folds of a contact against a closed form.

use nalgebra::{Complex, Matrix3, Vector3};

use super::*;

/// An oscillator under A sin Ωt that touches a stop once a period. With the natural frequency and the gap as units,
///
/// ```text
/// ẍ + 2ζẋ + x = A sin rτ − κ max(0, δ + γ δ̇),     δ = x − 1 > 0
/// ```
///
/// which has closed solutions between the instants at which the contact closes and opens.
struct Stop {
    zeta: f64,
    stiffness: f64,
    lag: f64,
    amplitude: f64,
}

/// A response: the phase at which it closes, the phase for which it stays closed, and its frequency r.
type Contact = Vector3<f64>;

impl Stop {
    /// Returns x and ẋ after a time, closed or open, from those at a phase of the load.
    fn moved(&self, is_closed: bool, rate: f64, phase_rad: f64, [x, v]: [f64; 2], time: f64) -> [f64; 2] {
        let added = if is_closed { self.stiffness } else { 0.0 };
        let (damping, stiffness) = (2.0 * self.zeta + added * self.lag, 1.0 + added);
        let rest = added / stiffness;
        let line = Complex::new(self.amplitude, 0.0) / Complex::new(stiffness - rate * rate, damping * rate);
        let forced = |phase: f64| {
            let turned = line * Complex::new(libm::cos(phase), libm::sin(phase));
            [turned.im, rate * turned.re]
        };
        let [from, to] = [forced(phase_rad), forced(phase_rad + rate * time)];
        let (x, v, decay) = (x - rest - from[0], v - from[1], 0.5 * damping);
        let free = libm::sqrt(stiffness - decay * decay);
        let (s, c) = libm::sincos(free * time);
        let (envelope, slope) = (libm::exp(-decay * time), (v + decay * x) / free);
        let (position, rate) = (x * c + slope * s, slope * free * c - x * free * s);
        [rest + to[0] + envelope * position, to[1] + envelope * (rate - decay * position)]
    }

    /// Returns what must vanish of a response that closes at the velocity w: the force where it opens, and the change of x
    /// and ẋ over the period.
    fn residual(&self, of: &Contact, w: f64) -> Vector3<f64> {
        let (phase, closed, rate) = (of[0], of[1], of[2]);
        let opens = self.moved(true, rate, phase, [1.0, w], closed / rate);
        let end = self.moved(false, rate, phase + closed, opens, (TAU - closed) / rate);
        Vector3::new(opens[0] - 1.0 + self.lag * opens[1], end[0] - 1.0, end[1] - w)
    }

    /// Solves for the response that closes at the velocity w, and returns it with dr/dw.
    fn solved(&self, start: Contact, w: f64) -> (Contact, f64) {
        let (mut of, h) = (start, 1e-6);
        for _ in 0..20 {
            let mut matrix = Matrix3::zeros();
            for i in 0..3 {
                let mut step = Vector3::zeros();
                step[i] = h;
                matrix.set_column(i, &((self.residual(&(of + step), w) - self.residual(&(of - step), w)) / (2.0 * h)));
            }
            let inverse = matrix.try_inverse().unwrap();
            let step = inverse * self.residual(&of, w);
            of -= step;
            if step.amax() < 1e-12 {
                let by_w = (self.residual(&of, w + h) - self.residual(&of, w - h)) / (2.0 * h);
                return (of, -(inverse * by_w)[2]);
            }
        }
        panic!("no response near {start:?} at {w}")
    }

    /// Returns r at the fold near a response, dr/dw = 0, by the secant rule.
    fn fold(&self, start: Contact, w: f64) -> f64 {
        let (mut before, mut of) = (self.solved(start, w), start);
        let (mut at_before, mut at) = (w, w * (1.0 + 1e-4));
        for _ in 0..30 {
            let here = self.solved(before.0, at);
            let step = here.1 * (at - at_before) / (here.1 - before.1);
            (at_before, before, of) = (at, here, here.0);
            at -= step;
            if step.abs() < 1e-7 * w {
                return of[2];
            }
        }
        panic!("no fold near {of:?}")
    }
}

/// x over the gap and its rate, in these units, at a phase of a response of the stop's place alone.
fn at_phase(fold: &Orbit, gap_m: f64, rate: f64, phase_rad: f64) -> [f64; 2] {
    let mut of = [fold.coefficients[0] / gap_m, 0.0];
    for (k, pair) in (1..).zip(fold.coefficients[1..].chunks_exact(2)) {
        let (k, (s, c)) = (f64::from(k), libm::sincos(f64::from(k) * phase_rad));
        of[0] += (pair[0] * c + pair[1] * s) / gap_m;
        of[1] += k * rate * (pair[1] * c - pair[0] * s) / gap_m;
    }
    of
}

/// A structure with modes of these frequencies, damping ratios and modal masses, kg, of shapes that are 1 at its tip, where it
/// has an element.
fn with_element(modes: &[(f64, f64, f64)], law: Law) -> Assembly {
    let body = ModalSpec {
        modes: modes.iter().map(|mode| ModeSpec { frequency_hz: mode.0, damping_ratio: mode.1 }).collect(),
        shapes: vec![ShapeSpec {
            point: "tip".into(),
            axis: Axis::X,
            by_mode: modes.iter().map(|mode| 1.0 / libm::sqrt(mode.2)).collect(),
        }],
    };
    let elements = vec![ElementSpec::Point { at: place("tip.x"), to: None, law }];
    Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap()
}

/// A contact with a damper has a force that jumps as it closes. The branch turns back twice: where the vibration first
/// touches the stop, and at its top, where the curve is steep. Both folds are those of the closed form, whatever the
/// tolerance and the steps, and there are no others.
#[test]
fn a_damped_contact_has_the_two_folds_of_its_closed_form() {
    let (natural_hz, zeta, mass_kg, gap) = (63.4, 4e-3, 2.5, 2e-4);
    let omega = TAU * natural_hz;
    let soft = (0..20_u32).map(|number| (5e5, 20.0, 2.7 + 3.3 * f64::from(number) / 19.0));
    // The short contact of a stiff one has more harmonics than the branch.
    for (number, (stiffness, damping, load_n)) in soft.chain([(2e7, 200.0, 4.0)]).enumerate() {
        let law = Law::KelvinVoigt { stiffness, damping, gap, side: Side::Positive, preload: 0.0 };
        let assembly = with_element(&[(natural_hz, zeta, mass_kg)], law);
        let tip = assembly.dof("tip.x").unwrap();
        let forced = Forced::new(assembly, tip, load_n);
        let scale = mass_kg * omega * omega;
        let stop = Stop {
            zeta,
            stiffness: stiffness / scale,
            lag: damping / stiffness * omega,
            amplitude: load_n / (scale * gap),
        };
        for truncation in [1e-5, 1e-6] {
            let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [60.0, 100.0], vec![tip]);
            options.branch.truncation = truncation;
            // Every other case has other steps, so that no fold depends on where a point happens to lie.
            options.branch.continuation.largest_step *= [1.0, 0.6][number % 2];
            options.assess = Assess::Nothing;
            let branch = super::super::trace(&forced, 60.0, Coordinate::FrequencyHz, &options).unwrap();
            let folds = of_kind(&branch, BifurcationKind::Fold);
            let found: Vec<f64> = folds.iter().map(|fold| fold.value).collect();
            assert_eq!(folds.len(), 2, "{stiffness:e} N/m, {load_n} N, {truncation:e}: {found:?}");
            // At its lower fold a stiff contact only touches.
            for fold in folds.into_iter().take(if stiffness == 5e5 { 2 } else { 1 }) {
                let rate = fold.value / natural_hz;
                let points = 2048;
                let phase = |j: usize| TAU * j as f64 / points as f64;
                let depth = |j: usize, lag: f64| {
                    let [x, v] = at_phase(fold, gap, rate, phase(j));
                    x - 1.0 + lag * v
                };
                let closes = (0..points).find(|&j| depth(j, 0.0) <= 0.0 && depth(j + 1, 0.0) > 0.0).unwrap();
                let opens = (closes + 1..closes + points).find(|&j| depth(j, stop.lag) <= 0.0).unwrap();
                let start = Vector3::new(phase(closes), phase(opens - closes), rate);
                let exact_hz = natural_hz * stop.fold(start, at_phase(fold, gap, rate, phase(closes))[1]);
                near(fold.value, exact_hz, if stiffness == 5e5 { 0.3 * truncation } else { 5e-5 });
            }
        }
    }
}

/// At a stiff stop the second mode makes the tip touch the stop again. There the branch turns back almost to where it came
/// from, within 1e-6 of the response, and goes on, wherever the steps begin.
#[test]
fn a_branch_passes_where_a_stiff_contact_is_touched_again() {
    let law = Law::KelvinVoigt { stiffness: 1e8, damping: 20.0, gap: 2e-4, side: Side::Positive, preload: 0.0 };
    let assembly = with_element(&[(63.4, 4e-3, 2.5), (212.25, 6e-3, 1.75)], law);
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, 4.0);
    let folds = [55.0, 63.0].map(|from_hz| {
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [from_hz, 85.0], vec![tip]);
        options.assess = Assess::Nothing;
        let traced = super::super::trace(&forced, from_hz, Coordinate::FrequencyHz, &options);
        let branch = traced.map_err(|early| early.reason).unwrap();
        let folds: Vec<f64> = of_kind(&branch, BifurcationKind::Fold).iter().map(|fold| fold.value).collect();
        assert_eq!((branch.end, folds.len()), (BranchEnd::AtEnd, 2), "{folds:?}");
        folds
    });
    folds[0].iter().zip(&folds[1]).for_each(|(one, other)| near(*one, *other, 1e-7));
}
