//! Elements in time: against motions between switches in closed form, against tiny steps of another method, and by
//! their energy.

use core::f64::consts::TAU;

use super::*;
use crate::integrate::Scheme;

/// A stepper of the two modes at 1 kHz, driven at the tip.
fn stepper(assembly: &Assembly, rate_hz: f64) -> Stepper {
    Stepper::new(assembly, &[assembly.dof("tip.x").unwrap()], Scheme::Exponential8, rate_hz).unwrap()
}

fn element_of(case: &Value) -> ElementSpec {
    let number = |name: &str| case[name].as_f64().unwrap();
    let place = |name: &str| case[name].as_str().map(|point| along(point, Axis::X));
    let side = if case["side"].as_f64() == Some(-1.0) { Side::Negative } else { Side::Positive };
    let law = match case["kind"].as_str().unwrap() {
        "gap" => Law::Gap { stiffness: number("stiffness"), gap: number("gap"), preload: 0.0 },
        "friction" => Law::Friction { stiffness: number("stiffness"), slip: number("slip") },
        _ => Law::KelvinVoigt {
            stiffness: number("stiffness"),
            damping: number("damping"),
            gap: number("gap"),
            side,
            preload: 0.0,
        },
    };
    ElementSpec::Point { at: place("at").unwrap(), to: place("to"), law }
}

#[test]
fn switched_motions_are_those_in_closed_form() {
    let file: Value = serde_json::from_str(include_str!("../../../../../tests/oracles/switches.json")).unwrap();
    let number = |name: &str| file[name].as_f64().unwrap();
    for case in file["cases"].as_array().unwrap() {
        let assembly = two_modes(case["elements"].as_array().unwrap().iter().map(element_of).collect());
        let mut stepper = stepper(&assembly, number("rate_hz"));
        let (mut worst, mut states) = (0.0_f64, case["every_50_samples"].as_array().unwrap().iter());
        for k in 0..250 {
            let t_s = f64::from(k) / 1000.0;
            stepper.advance(t_s, &[number("force_n") * libm::sin(TAU * number("frequency_hz") * t_s)]).unwrap();
            if (k + 1) % 50 == 0 {
                let expected = numbers(states.next().unwrap());
                for i in 0..2 {
                    worst = worst.max((stepper.position()[i] - expected[i]).abs());
                    worst = worst.max((stepper.velocity()[i] - expected[2 + i]).abs() / 100.0);
                }
            }
        }
        assert!(worst < 1e-12, "{}: {worst:e}", case["elements"]);
        assert_eq!([stepper.events(), stepper.fallbacks()], [case["switches"].as_u64().unwrap(), 0]);
    }
}

/// One mode of 20 Hz without damping, at `tip`, and an element there.
fn one_mode(law: Law) -> Assembly {
    let modes = vec![ModeSpec { frequency_hz: 20.0, damping_ratio: 0.0 }];
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![0.5] }];
    assembly(BodySpec::Modal(ModalSpec { modes, shapes }), vec![grounded(along("tip", Axis::X), law)])
}

/// The motion of that mode after 0.15 s under 30 N from rest by the classical method in 600 000 steps. `law` is the
/// force and ż at x, v and z.
fn by_tiny_steps(law: impl Fn(f64, f64, f64) -> [f64; 2]) -> [f64; 2] {
    let (steps, omega) = (600_000, TAU * 20.0);
    let h = 0.15 / f64::from(steps);
    let rate = |y: [f64; 3]| {
        let [force, z] = law(0.5 * y[0], 0.5 * y[1], y[2]);
        [y[1], 0.5 * (30.0 - force) - omega * omega * y[0], z]
    };
    let moved = |y: [f64; 3], h: f64, by: [f64; 3]| [0, 1, 2].map(|i| y[i] + h * by[i]);
    let mut y = [0.0; 3];
    for _ in 0..steps {
        let first = rate(y);
        let second = rate(moved(y, 0.5 * h, first));
        let third = rate(moved(y, 0.5 * h, second));
        let fourth = rate(moved(y, h, third));
        y = [0, 1, 2].map(|i| y[i] + h / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]));
    }
    [y[0], y[1]]
}

fn after_steps(assembly: &Assembly, rate_hz: f64) -> [f64; 2] {
    let mut stepper = stepper(assembly, rate_hz);
    for k in 0..(0.15 * rate_hz) as u32 {
        stepper.advance(f64::from(k) / rate_hz, &[30.0]).unwrap();
    }
    [stepper.position()[0], stepper.velocity()[0]]
}

fn check_apart(what: &str, got: [f64; 2], expected: [f64; 2], most: f64) {
    let apart = (got[0] - expected[0]).abs().max((got[1] - expected[1]).abs() / 100.0);
    assert!(apart < most, "{what}: {apart:e}, {got:?} {expected:?}");
}

#[test]
fn hunt_crossley_is_that_of_tiny_steps() {
    let law = Law::HuntCrossley { stiffness: 3e6, damping: 0.8, gap: 0.0004, side: Side::Positive, preload: 0.0 };
    let expected = by_tiny_steps(|x, v, _| {
        let depth: f64 = x - 0.0004;
        [if depth > 0.0 { 3e6 * depth * libm::sqrt(depth) * (1.0 + 0.8 * v).max(0.0) } else { 0.0 }, 0.0]
    });
    check_apart("hunt-crossley", after_steps(&one_mode(law), 1000.0), expected, 1e-10);
}

#[test]
fn lugre_is_that_of_tiny_steps() {
    let law = Law::Lugre {
        bristle_stiffness: 2e4,
        bristle_damping: 15.0,
        viscous: 4.0,
        coulomb: 3.0,
        breakaway: 5.0,
        stribeck: 0.02,
    };
    let expected = by_tiny_steps(|_, v, z| {
        let g = 3.0 + 2.0 * libm::exp(-(v / 0.02) * (v / 0.02));
        let rate = v - 2e4 * v.abs() / g * z;
        [2e4 * z + 15.0 * rate + 4.0 * v, rate]
    });
    check_apart("lugre", after_steps(&one_mode(law), 1000.0), expected, 1e-13);
}

#[test]
fn smooth_elements_are_those_of_tiny_steps() {
    let law = Law::Cubic { stiffness3: 3e9, stiffness5: 1e13 };
    let expected = by_tiny_steps(|x, _, _| [x * x * x * (3e9 + 1e13 * x * x), 0.0]);
    check_apart("cubic", after_steps(&one_mode(law), 1000.0), expected, 1e-13);
    let expected = by_tiny_steps(|x, v, _| [3e4 * x + 7.0 * v, 0.0]);
    let law = Law::Linear { stiffness: 3e4, damping: 7.0 };
    check_apart("linear", after_steps(&one_mode(law), 1000.0), expected, 1e-13);
    let expected = by_tiny_steps(|_, v, _| [3.0 * libm::tanh(v / 0.02), 0.0]);
    check_apart("tanh", after_steps(&one_mode(Law::Tanh { slip: 3.0, velocity: 0.02 }), 1000.0), expected, 1e-13);
}

/// Steps of 1/8000 s and of every half of it, to sum a loss over steps in which elements switch.
struct Halves {
    steppers: Vec<Stepper>,
}

impl Halves {
    fn new(assembly: &Assembly) -> Halves {
        Halves { steppers: (0..26).map(|level| stepper(assembly, 8000.0 * libm::exp2(f64::from(level)))).collect() }
    }

    fn loss_w(&self, level: usize) -> f64 {
        let stepper = &self.steppers[level];
        let (assembly, q, v) = (stepper.assembly(), stepper.position(), stepper.velocity());
        loss_w(assembly, q, v, stepper.element_states())
    }

    /// Returns how many elements hold energy: it changes where a contact that no longer pushes opens, too.
    fn strained(&self, level: usize) -> usize {
        let stepper = &self.steppers[level];
        let (assembly, q, z) = (stepper.assembly(), stepper.position(), stepper.element_states());
        let at = assembly.at(q);
        let is_strained = |element: &&Element| {
            let (x, own) = (at.element_displacement(element), element.own(z));
            // The energy of an element with a preload is zero at rest alone; its spring has a slope where it is pressed.
            match element.law.seat() {
                None => element.law.energy_j(x, own) > 0.0,
                Some(_) => element.force(x, 0.0, own).by_position > 0.0,
            }
        };
        assembly.elements().iter().filter(is_strained).count()
    }

    /// Advances by a step of a level, and returns the energy lost in it, J: by the rule of G. Boole over its quarters
    /// if nothing switches in it, else half by half, the shortest by the trapezoidal rule.
    fn lost_j(&mut self, level: usize, saved: &mut [f64], force: f64) -> f64 {
        let last = self.steppers.len() - 1;
        self.steppers[level].restore(saved).unwrap();
        let before = (self.steppers[level].events(), self.strained(level));
        let (start_w, h_s) = (self.loss_w(level), self.steppers[level].step_s());
        self.steppers[level].advance(0.0, &[force]).unwrap();
        if (self.steppers[level].events(), self.strained(level)) != before && level + 2 < last {
            return self.lost_j(level + 1, saved, force) + self.lost_j(level + 1, saved, force);
        }
        let end_w = self.loss_w(level);
        if level + 2 >= last {
            self.steppers[level].save(saved).unwrap();
            return 0.5 * h_s * (start_w + end_w);
        }
        self.steppers[level + 2].restore(saved).unwrap();
        let inner_w = [0, 1, 2].map(|_| {
            self.steppers[level + 2].advance(0.0, &[force]).unwrap();
            self.loss_w(level + 2)
        });
        self.steppers[level].save(saved).unwrap();
        h_s / 90.0 * (7.0 * (start_w + end_w) + 32.0 * (inner_w[0] + inner_w[2]) + 12.0 * inner_w[1])
    }
}

/// The energy that the force puts in is in the motion and the elements, or was lost: of each kind of element alone, and
/// all at once.
#[test]
fn energy_is_balanced() {
    let at = |law: Law| grounded(along("tip", Axis::X), law);
    let damper = at(Law::Linear { stiffness: 0.0, damping: 2.0 });
    let between = |law: Law| ElementSpec::Point { at: along("mid", Axis::X), to: Some(along("tip", Axis::X)), law };
    let lugre = Law::Lugre {
        bristle_stiffness: 2e4,
        bristle_damping: 15.0,
        viscous: 4.0,
        coulomb: 3.0,
        breakaway: 5.0,
        stribeck: 0.05,
    };
    let all = [
        at(Law::Cubic { stiffness3: 3e9, stiffness5: 1e13 }),
        between(Law::Gap { stiffness: 1e5, gap: 0.0003, preload: 0.0 }),
        at(Law::KelvinVoigt { stiffness: 1e5, damping: 20.0, gap: 0.0002, side: Side::Negative, preload: 0.0 }),
        at(Law::HuntCrossley { stiffness: 3e6, damping: 0.8, gap: 0.0002, side: Side::Positive, preload: 0.0 }),
        between(Law::Friction { stiffness: 4e4, slip: 9.0 }),
        at(lugre),
        between(Law::Linear { stiffness: 2e3, damping: 5.0 }),
        at(Law::Tanh { slip: 3.0, velocity: 0.05 }),
    ];
    let places = [along("mid", Axis::X), along("tip", Axis::X)];
    let terms: [(&[u8], f64); 4] = [(&[2, 1], 1e6), (&[0, 3], -2e6), (&[2, 2], 2e9), (&[0, 4], 3e9)];
    let over_both = polynomial(&places, &terms);
    let alone = all.iter().map(|element| vec![element.clone()]);
    let with_polynomial = [vec![over_both.clone()], vec![over_both.clone(), damper]];
    let pressed = [
        vec![between(Law::Gap { stiffness: 1e5, gap: 0.0003, preload: -4.0 })],
        vec![at(Law::KelvinVoigt { stiffness: 1e5, damping: 20.0, gap: 0.0, side: Side::Negative, preload: 6.0 })],
    ];
    let round = at(Law::HuntCrossley { stiffness: 3e6, damping: 0.8, gap: 0.0, side: Side::Positive, preload: 6.0 });
    let all_at_once = [&all[..], &[over_both]].concat();
    let each = alone.chain(with_polynomial).chain(pressed).chain([all_at_once]).map(|elements| (elements, 1e-9));
    // The loss of a round contact goes with the time to the power 1.5 behind each switch, which the rule of Boole sums less
    // exactly, and with a preload it opens and closes in every period.
    for (elements, most) in each.chain([(vec![round], 1e-8)]) {
        let names = format!("{elements:?}");
        let assembly = two_modes(elements);
        let tip = assembly.dof("tip.x").unwrap();
        let mut halves = Halves::new(&assembly);
        let mut saved = vec![0.0; halves.steppers[0].saved_len()];
        halves.steppers[0].save(&mut saved).unwrap();
        let (mut work, mut lost, mut start_m) = (0.0, 0.0, 0.0);
        for k in 0..1600 {
            let force = 40.0 * libm::sin(0.02 * f64::from(k));
            lost += halves.lost_j(0, &mut saved, force);
            let end_m = assembly.displacement(tip, &saved[..2]);
            work += force * (end_m - start_m);
            start_m = end_m;
        }
        let (q, v, z) = (&saved[..2], &saved[2..4], &saved[4..4 + assembly.element_states()]);
        let stored = assembly.energy_j(q, v) + assembly.element_energy_j(q, z);
        let defect = (stored - work + lost).abs() / (work.abs() + lost);
        assert!(lost > 0.0 && defect < most, "{names} {stored} {work} {lost}");
    }
}

/// A chain of three links whose tip meets a wall, with friction in a joint.
fn touching_chain() -> Assembly {
    let wall = Law::KelvinVoigt { stiffness: 2e5, damping: 50.0, gap: 0.0005, side: Side::Negative, preload: 0.0 };
    let friction = Law::Friction { stiffness: 2e4, slip: 6.0 };
    let elements = vec![grounded(along("tip", Axis::Y), wall), grounded(Place::Joint(3), friction)];
    assembly(BodySpec::Chain(chain_of(&oracles("chains")[2])), elements)
}

/// Steps a chain from a state with rest branches for 60 ms.
fn chain_after(rate_hz: f64) -> (Vec<f64>, u64) {
    let assembly = touching_chain();
    let tip = assembly.dof("tip.y").unwrap();
    let mut stepper = Stepper::new(&assembly, &[tip], Scheme::Exponential8, rate_hz).unwrap();
    stepper.restore(&[0.0; 7]).unwrap();
    for k in 0..(0.06 * rate_hz) as u32 {
        stepper.advance(f64::from(k) / rate_hz, &[-400.0]).unwrap();
    }
    let mut saved = vec![0.0; stepper.states()];
    saved[..3].copy_from_slice(stepper.position());
    saved[3..6].copy_from_slice(stepper.velocity());
    saved[6..].copy_from_slice(stepper.element_states());
    (saved, stepper.events())
}

/// Between switches the method is of order 8, so the motion doesn't depend on the step; lost switches would show here.
#[test]
fn switches_of_a_chain_are_located_at_every_rate() {
    let (fine, fine_events) = chain_after(20_000.0);
    let (coarse, coarse_events) = chain_after(500.0);
    assert!(fine_events > 4 && fine_events == coarse_events, "{fine_events} {coarse_events}");
    for i in 0..7 {
        assert!(
            (fine[i] - coarse[i]).abs() < 1e-9 * if (3..6).contains(&i) { 10.0 } else { 1.0 },
            "{fine:?} {coarse:?}"
        );
    }
}

/// From a saved state the same steps have the same bits, also in the middle of slipping and touching.
#[test]
fn restored_steppers_step_bit_for_bit() {
    let assembly = touching_chain();
    let tip = assembly.dof("tip.y").unwrap();
    let mut first = Stepper::new(&assembly, &[tip], Scheme::Exponential8, 2000.0).unwrap();
    let mut second = first.clone();
    let mut saved = vec![0.0; first.saved_len()];
    for k in 0..200 {
        first.save(&mut saved).unwrap();
        second.restore(&saved).unwrap();
        let load = [-400.0 + 3.0 * f64::from(k)];
        first.advance(0.0, &load).unwrap();
        second.advance(0.0, &load).unwrap();
        let bits = |stepper: &Stepper| {
            let mut saved = vec![0.0; stepper.saved_len()];
            stepper.save(&mut saved).unwrap();
            saved.iter().map(|number| number.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(bits(&first), bits(&second));
    }
}

/// A mode that touches and leaves walls many times in one step: what is not located is counted, and the motion goes on.
#[test]
fn too_many_switches_are_counted() {
    let modes = vec![ModeSpec { frequency_hz: 300.0, damping_ratio: 0.0 }];
    let shape = |point: &str| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: vec![1.0] };
    let gap = |point: &str, gap: f64| grounded(along(point, Axis::X), Law::Gap { stiffness: 1e5, gap, preload: 0.0 });
    let body = BodySpec::Modal(ModalSpec { modes, shapes: vec![shape("tip"), shape("mid")] });
    let assembly = assembly(body, vec![gap("tip", 1e-6), gap("mid", 2e-6)]);
    let mut stepper = stepper(&assembly, 25.0);
    stepper.restore(&[1e-5, 0.0]).unwrap();
    let energy = |stepper: &Stepper| {
        assembly.energy_j(stepper.position(), stepper.velocity()) + assembly.element_energy_j(stepper.position(), &[])
    };
    let before = energy(&stepper);
    stepper.advance(0.0, &[0.0]).unwrap();
    assert_eq!(stepper.fallbacks(), 1);
    // The step of 40 ms holds 12 periods, in each of which both stops are met and left on both sides.
    assert!(stepper.events() > 64, "{}", stepper.events());
    assert!((energy(&stepper) / before - 1.0).abs() < 0.05, "{before} {}", energy(&stepper));
    // Enough steps locate them all.
    let mut fine = Stepper::new(&assembly, &[], Scheme::Exponential8, 1000.0).unwrap();
    fine.restore(&[1e-5, 0.0]).unwrap();
    (0..40).for_each(|_| fine.advance(0.0, &[]).unwrap());
    assert_eq!(fine.fallbacks(), 0);
    assert!((energy(&fine) / before - 1.0).abs() < 1e-8, "{before} {}", energy(&fine));
}

/// A touch of 22 µs, between two samples that are 1 ms apart, is not missed.
#[test]
fn touches_between_samples_are_found() {
    let wall = Law::Gap { stiffness: 1e5, gap: 1e-3 * (1.0 - 1e-6), preload: 0.0 };
    let assembly = one_mode(wall);
    let mut stepper = stepper(&assembly, 1000.0);
    // x = q/2; the period is 50 ms.
    stepper.restore(&[0.0, 2e-3 * TAU * 20.0]).unwrap();
    for _ in 0..200 {
        stepper.advance(0.0, &[0.0]).unwrap();
    }
    // Four periods, with a touch on either side, each of which begins and ends.
    assert_eq!(stepper.events(), 16);
}
