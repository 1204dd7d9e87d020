//! Ticks: their positions and labels.

use super::axis::AxisMap;
use super::{Axis, Scale};

/// The ticks of an axis.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Ticks {
    /// Values with their labels.
    pub labelled: Vec<(f64, String)>,
    /// Values of minor ticks, between those with labels.
    pub minor: Vec<f64>,
    /// The power of ten common to all labels, for example `×10⁻³`.
    pub factor: Option<String>,
}

/// Smallest distance of minor ticks; px.
const MINOR_APART: f64 = 6.0;

/// The ticks of an axis on the page: those of its numbers, or as many of its names as fit.
pub(super) fn of_axis(axis: &Axis, map: &AxisMap, room: &dyn Fn(&str) -> f64) -> Ticks {
    if axis.names.is_empty() {
        return ticks(map, room);
    }
    let widest = axis.names.iter().map(|name| room(name)).fold(0.0, f64::max);
    let every = libm::ceil(widest / (map.px(2.0) - map.px(1.0)).abs()).max(1.0) as usize;
    let labelled = axis.names.iter().zip(1..).step_by(every).map(|(name, place)| (f64::from(place), name.clone()));
    Ticks { labelled: labelled.collect(), ..Ticks::default() }
}

/// The ticks of `axis`: as many as fit, where a label needs `room(label)` px along the axis.
pub(super) fn ticks(axis: &AxisMap, room: &dyn Fn(&str) -> f64) -> Ticks {
    match axis.scale {
        // Within a factor of three a logarithmic axis is nearly linear, and has no two powers of ten.
        Scale::Log if axis.high / axis.low >= 3.0 => log_ticks(axis, room),
        Scale::Linear | Scale::Log => linear_ticks(axis, room, decimal_steps(axis.high - axis.low)),
        Scale::Degrees if axis.high - axis.low >= 60.0 => linear_ticks(axis, room, degree_steps()),
        Scale::Degrees => linear_ticks(axis, room, decimal_steps(axis.high - axis.low)),
    }
}

/// A distance of ticks: `mantissa` · 10^`exponent`, divided into `parts` by minor ticks.
#[derive(Clone, Copy)]
struct Step {
    mantissa: i64,
    exponent: i32,
    parts: i64,
}

/// 1, 2 and 5 times powers of ten, from far too dense for `span` upwards.
fn decimal_steps(span: f64) -> Vec<Step> {
    // From at most a hundredth of the span, over four powers of ten, to more than the span.
    let first = libm::floor(libm::log10(span)) as i32 - 2;
    (first..first + 4)
        // Minor ticks then are at 0.2, 0.5 and 1 of the same power, which are round, too.
        .flat_map(|exponent| [(1, 5), (2, 4), (5, 5)].map(|(mantissa, parts)| Step { mantissa, exponent, parts }))
        .collect()
}

fn degree_steps() -> Vec<Step> {
    // Each is divided into parts that are fractions of a turn, too.
    let steps = [(15, 3), (30, 2), (45, 3), (90, 2), (180, 2), (360, 4), (720, 2), (3600, 5)];
    steps.map(|(mantissa, parts)| Step { mantissa, exponent: 0, parts }).to_vec()
}

/// The densest of `steps`, given in ascending order, whose labels fit; if none, the last that gives two labels.
fn linear_ticks(axis: &AxisMap, room: &dyn Fn(&str) -> f64, steps: Vec<Step>) -> Ticks {
    let mut best = Ticks::default();
    for step in steps {
        let candidate = linear_ticks_at(axis, step);
        // One label alone gives no scale: two that crowd are better.
        if candidate.labelled.len() < 2 && best.labelled.len() >= 2 {
            break;
        }
        let fits = have_room(axis, &candidate.labelled, room);
        best = candidate;
        if fits {
            break;
        }
    }
    best
}

/// Ticks are whole multiples n of the step, so labels are exact: n · mantissa · 10^(exponent − common).
fn linear_ticks_at(axis: &AxisMap, step: Step) -> Ticks {
    let size = step.mantissa as f64 * power_of_ten(step.exponent);
    let inside = |n: i64| n as f64 * size;
    // A tick at the very end of the axis counts, though its quotient may be a rounding error off.
    let first = libm::ceil(axis.low / size - 1e-9) as i64;
    let last = libm::floor(axis.high / size + 1e-9) as i64;
    let largest = axis.low.abs().max(axis.high.abs());
    let magnitude = libm::floor(libm::log10(largest)) as i32;
    // The common power: a multiple of three, used if plain numbers would be long.
    // Rounded down below zero as well, so that the largest label is from 1 to 1000.
    let common = if (-2..5).contains(&magnitude) { 0 } else { magnitude.div_euclid(3) * 3 };
    let digits = (common - step.exponent).max(0) as usize;
    let scaled = power_of_ten(step.exponent - common);
    let label = |n: i64| minus(&format!("{:.digits$}", (n * step.mantissa) as f64 * scaled));
    let minor_size = size / step.parts as f64;
    let apart = (axis.px(axis.low + minor_size) - axis.px(axis.low)).abs();
    let parts = if axis.scale == Scale::Log || apart >= MINOR_APART { step.parts } else { 1 };
    // Also before the first label and after the last, up to the ends of the axis.
    let minor = (first * parts - parts + 1..(last + 1) * parts)
        .filter(|n| n.rem_euclid(parts) != 0)
        .map(|n| n as f64 * minor_size)
        .filter(|value| (axis.low..=axis.high).contains(value));
    Ticks {
        labelled: (first..=last).map(|n| (inside(n), label(n))).collect(),
        minor: minor.collect(),
        factor: (common != 0).then(|| format!("×10{}", superscript(common))),
    }
}

/// Powers of ten: every one, or every second, third … if they do not fit; over few decades also multiples of them, as
/// many as fit.
fn log_ticks(axis: &AxisMap, room: &dyn Fn(&str) -> f64) -> Ticks {
    let decades = libm::log10(axis.high / axis.low);
    let first = libm::floor(libm::log10(axis.low)) as i32;
    let last = libm::ceil(libm::log10(axis.high)) as i32;
    let inside = |value: &f64| (axis.low * (1.0 - 1e-9)..=axis.high * (1.0 + 1e-9)).contains(value);
    // From 0.001 to 10000 plain numbers are short enough; beyond, powers are shorter.
    let plain = first >= -3 && last <= 4;
    let choose = |multiples: &[i32], stride: i32| -> Vec<(f64, String)> {
        let powers = (first..=last).filter(|exponent| exponent.rem_euclid(stride) == 0);
        powers
            .flat_map(|exponent| multiples.iter().map(move |multiple| (*multiple, exponent)))
            .map(|(multiple, exponent)| {
                (f64::from(multiple) * power_of_ten(exponent), log_label(multiple, exponent, plain))
            })
            .filter(|(value, _)| inside(value))
            .collect()
    };
    let mut candidates: Vec<(&[i32], i32)> = Vec::new();
    // Over few decades the powers of ten alone would leave most of the axis without labels.
    if decades < 2.3 {
        candidates.extend([
            (&[1, 2, 3, 4, 5, 6, 7, 8, 9][..], 1),
            (&[1, 2, 3, 5, 7], 1),
            (&[1, 2, 5], 1),
            (&[1, 3], 1),
        ]);
    }
    candidates.extend((1..=last - first).map(|stride| (&[1][..], stride)));
    let mut labelled = choose(&[1, 2, 5], 1);
    for (multiples, stride) in candidates {
        let candidate = choose(multiples, stride);
        if candidate.len() < 2 {
            break;
        }
        labelled = candidate;
        if have_room(axis, &labelled, room) {
            break;
        }
    }
    // Relative to the value, since the axis spans powers of ten.
    let is_labelled = |value: f64| labelled.iter().any(|(labelled, _)| (labelled / value - 1.0).abs() < 1e-9);
    // Over many decades the ticks between the powers would merge into a band.
    let between: &[i32] = if decades > 8.0 { &[1] } else { &[1, 2, 3, 4, 5, 6, 7, 8, 9] };
    let minor = (first..=last)
        .flat_map(|exponent| between.iter().map(move |multiple| f64::from(*multiple) * power_of_ten(exponent)))
        .filter(|value| inside(value) && !is_labelled(*value));
    Ticks { minor: minor.collect(), labelled, factor: None }
}

fn log_label(multiple: i32, exponent: i32, plain: bool) -> String {
    match (plain, multiple) {
        (true, _) => format!("{:.*}", (-exponent).max(0) as usize, f64::from(multiple) * power_of_ten(exponent)),
        (false, 1) => format!("10{}", superscript(exponent)),
        (false, _) => format!("{multiple}·10{}", superscript(exponent)),
    }
}

/// Says whether neighbouring labels do not overlap.
fn have_room(axis: &AxisMap, labelled: &[(f64, String)], room: &dyn Fn(&str) -> f64) -> bool {
    labelled.windows(2).all(|pair| {
        let apart = (axis.px(pair[1].0) - axis.px(pair[0].0)).abs();
        apart >= (room(&pair[0].1) + room(&pair[1].1)) / 2.0
    })
}

/// 10^exponent, as exact as an `f64` can be: the powers up to 10^22 are exact, and so is one rounding of their
/// quotient.
fn power_of_ten(exponent: i32) -> f64 {
    match exponent {
        0..=22 => (0..exponent).fold(1.0, |power, _| power * 10.0),
        -22..0 => 1.0 / power_of_ten(-exponent),
        _ => libm::exp10(exponent.into()),
    }
}

/// `number` with a typographic minus sign; no sign before zero.
fn minus(number: &str) -> String {
    match number.strip_prefix('-') {
        Some(digits) if digits.contains(|c: char| ('1'..='9').contains(&c)) => format!("−{digits}"),
        Some(digits) => digits.to_owned(),
        None => number.to_owned(),
    }
}

fn superscript(exponent: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| c.to_digit(10).map_or('⁻', |digit| RAISED[digit as usize]);
    exponent.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The labels of a 400 px axis whose labels are 8 px a character and 12 px apart, then the factor.
    fn labels(scale: Scale, low: f64, high: f64) -> String {
        let axis = AxisMap { scale, low, high, from: 0.0, to: 400.0 };
        let ticks = ticks(&axis, &|label| 8.0 * label.chars().count() as f64 + 12.0);
        for value in ticks.labelled.iter().map(|(value, _)| value).chain(&ticks.minor) {
            assert!((-1e-6..=400.0 + 1e-6).contains(&axis.px(*value)), "{value} is off the axis");
        }
        let labels: Vec<_> = ticks.labelled.into_iter().map(|(_, label)| label).chain(ticks.factor).collect();
        labels.join(" ")
    }

    #[test]
    fn linear_ticks_are_at_1_2_5() {
        insta::assert_snapshot!(labels(Scale::Linear, 0.0, 80.0), @"0 10 20 30 40 50 60 70 80");
        insta::assert_snapshot!(labels(Scale::Linear, -0.013, 0.041), @"−0.01 0.00 0.01 0.02 0.03 0.04");
        insta::assert_snapshot!(labels(Scale::Linear, 20.4, 20.9), @"20.4 20.5 20.6 20.7 20.8 20.9");
        insta::assert_snapshot!(labels(Scale::Linear, 46.0698, 46.0714), @"46.0700 46.0705 46.0710");
        insta::assert_snapshot!(labels(Scale::Linear, -3.0, 3.0), @"−3 −2 −1 0 1 2 3");
    }

    #[test]
    fn long_numbers_share_a_power_of_ten() {
        insta::assert_snapshot!(labels(Scale::Linear, 0.0, 3.7e-5), @"0 5 10 15 20 25 30 35 ×10⁻⁶");
        insta::assert_snapshot!(labels(Scale::Linear, -2.5e6, 1e6), @"−2.5 −2.0 −1.5 −1.0 −0.5 0.0 0.5 1.0 ×10⁶");
    }

    #[test]
    fn degree_ticks_are_at_fractions_of_a_turn() {
        insta::assert_snapshot!(labels(Scale::Degrees, -180.0, 180.0), @"−180 −135 −90 −45 0 45 90 135 180");
        insta::assert_snapshot!(labels(Scale::Degrees, -5.0, 95.0), @"0 15 30 45 60 75 90");
        insta::assert_snapshot!(labels(Scale::Degrees, 0.0, 8.0), @"0 1 2 3 4 5 6 7 8");
    }

    #[test]
    fn log_ticks_are_at_decades() {
        insta::assert_snapshot!(labels(Scale::Log, 1.0, 1000.0), @"1 10 100 1000");
        insta::assert_snapshot!(labels(Scale::Log, 3e-7, 2e-2), @"10⁻⁶ 10⁻⁵ 10⁻⁴ 10⁻³ 10⁻²");
        insta::assert_snapshot!(labels(Scale::Log, 1e-18, 1e3), @"10⁻¹⁸ 10⁻¹⁵ 10⁻¹² 10⁻⁹ 10⁻⁶ 10⁻³ 10⁰ 10³");
    }

    #[test]
    fn short_log_axes_get_more_than_decades() {
        insta::assert_snapshot!(labels(Scale::Log, 5.0, 80.0), @"5 7 10 20 30 50 70");
        insta::assert_snapshot!(labels(Scale::Log, 2e-6, 9e-5), @"2·10⁻⁶ 5·10⁻⁶ 10⁻⁵ 2·10⁻⁵ 5·10⁻⁵");
        insta::assert_snapshot!(labels(Scale::Log, 41.0, 43.0), @"41.0 41.5 42.0 42.5 43.0");
    }

    #[test]
    fn a_narrow_axis_still_has_two_labels() {
        let axis = AxisMap { scale: Scale::Linear, low: 0.0, high: 1.0, from: 0.0, to: 10.0 };
        assert!(ticks(&axis, &|_| 50.0).labelled.len() >= 2);
    }
}
