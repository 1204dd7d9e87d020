//! The cases in which a statement is judged.

use super::survey::{Driven, Seen, Survey, forces_n, heights_m, own_torque_nm, torques_nm};
use super::{Case, Number, Verdict};

/// A statement judged in all its cases.
pub(super) struct Judgement {
    /// The quantity that varies between the cases.
    pub over: &'static str,
    /// The case of the figures.
    pub own: usize,
    pub cases: Vec<Case>,
}

/// A statement judged in one case.
pub(super) struct Opinion {
    pub holds: bool,
    pub value: String,
    pub numbers: Vec<Number>,
}

impl Opinion {
    pub fn new(holds: bool, value: impl Into<String>, numbers: Vec<Number>) -> Opinion {
        Opinion { holds, value: value.into(), numbers }
    }

    /// Makes it a case, labelled `at`.
    fn case(at: String, opinion: Seen<Opinion>) -> Case {
        match opinion {
            Ok(Opinion { holds, value, numbers }) => {
                let verdict = if holds { Verdict::Holds } else { Verdict::DoesNotHold };
                Case { at, verdict, value, numbers }
            }
            Err(why) => Case { at, verdict: Verdict::NotComputed, value: why, numbers: Vec::new() },
        }
    }
}

pub(super) fn number(of: impl Into<String>, value: f64, unit: &'static str) -> Number {
    Number { of: of.into(), value, unit }
}

/// Returns a number as text with a typographic minus sign.
pub(super) fn signed(value: f64) -> String {
    value.to_string().replace('-', "−")
}

/// Says whether all parts hold, if that is known: one that doesn't is enough for `false`.
pub(super) fn all_hold(parts: impl Iterator<Item = Seen<bool>>) -> Seen<bool> {
    let mut unknown = None;
    let mut holds = true;
    // All parts are asked: a later one that does not hold settles the matter.
    for part in parts {
        match part {
            Ok(part) => holds &= part,
            Err(why) => unknown = Some(why),
        }
    }
    match unknown {
        Some(why) if holds => Err(why),
        _ => Ok(holds),
    }
}

/// A statement without a varied parameter.
pub(super) fn once(opinion: Seen<Opinion>) -> Judgement {
    Judgement { over: "", own: 0, cases: vec![Opinion::case(String::new(), opinion)] }
}

/// Judges a statement for each value of a parameter, of which `own` is that of the figures.
pub(super) fn over<T: Copy + PartialEq>(
    over: &'static str,
    own: T,
    values: impl IntoIterator<Item = T>,
    (words, judge): (impl Fn(T) -> String, impl Fn(T) -> Seen<Opinion>),
) -> Judgement {
    let values: Vec<T> = values.into_iter().collect();
    // A NaN is no case's own: then the first case stands for the figures.
    let own = values.iter().position(|value| *value == own).unwrap_or(0);
    Judgement { over, own, cases: values.into_iter().map(|value| Opinion::case(words(value), judge(value))).collect() }
}

impl Survey<'_> {
    /// Judges a case for each torque of Fig. 4, the figure's own being that of the zone of a mode.
    pub fn over_torques(&self, mode: usize, judge: impl Fn(Driven) -> Seen<Opinion>) -> Judgement {
        let settings = self.settings;
        let preset = self.subject.preset;
        let judge = |nm| judge(Driven::Torque { nm });
        let own = own_torque_nm(settings, preset, mode);
        let torques = torques_nm(settings, preset, mode);
        over("torques", own, torques, (|nm| format!("{nm} N·m"), judge))
    }

    /// Judges a case for each height of the line and each force at the tip, the figure's own being this force.
    pub fn over_heights_and_forces(&self, own_n: f64, judge: impl Fn(Driven) -> Seen<Opinion>) -> Judgement {
        let forces = forces_n(self.settings);
        let pairs = heights_m(self.settings).into_iter();
        let pairs = pairs.flat_map(|height_m| forces.iter().map(move |n| (height_m, *n)));
        let words = |(height_m, n): (f64, f64)| format!("{} m, {n} N", signed(height_m));
        let judge = |(height_m, n)| judge(Driven::Force { n, height_m });
        over("heights and forces", (self.settings.line.height_m, own_n), pairs, (words, judge))
    }

    /// Judges a case for each height of the line.
    pub fn over_heights(&self, judge: impl Fn(f64) -> Seen<Opinion>) -> Judgement {
        let words = |height_m: f64| format!("{} m", signed(height_m));
        over("heights", self.settings.line.height_m, heights_m(self.settings), (words, judge))
    }
}
