//! Search for the time at which a margin becomes negative inside a part of a step.

/// The most trials: the bracket shrinks by more than half in every three, so that it then is rounding.
const MOST_TRIALS: u32 = 160;
/// The bracket, relative to the part, at which the switch is located.
const RELATIVE_BRACKET: f64 = 4.0 * f64::EPSILON;

/// The end of a part, with the state S there.
pub(super) struct Located<S> {
    pub state: S,
    /// Length of the part, s.
    pub after_s: f64,
}

/// The whole part of `h_s`, if the margin is not negative at its end; else up to just behind the first change of sign
/// that the false position finds. `before` is the margin at the start, not negative; `trial` makes a part of a length
/// and returns the margin at its end.
///
/// False position with the ordinate of an end that stays halved (M. Dowell, P. Jarratt, "A Modified Regula Falsi Method
/// for Computing the Root of an Equation", BIT 11 (1971), who call it the Illinois algorithm); a step that doesn't
/// halve the bracket in three trials bisects.
pub(super) fn locate<S>(h_s: f64, before: f64, trial: impl Fn(f64) -> (S, f64)) -> Located<S> {
    let (mut state, margin) = trial(h_s);
    let mut low = (0.0, before);
    let mut high = (h_s, margin);
    if margin >= 0.0 || !margin.is_finite() {
        return Located { state, after_s: h_s };
    }
    let mut last_low = None;
    let mut checkpoint = (0, h_s);
    for count in 0..MOST_TRIALS {
        let width = high.0 - low.0;
        if width <= RELATIVE_BRACKET * h_s {
            break;
        }
        // Near a multiple root the false position creeps, and halving the bracket is faster.
        let slow = count - checkpoint.0 >= 3 && width > 0.5 * checkpoint.1;
        if count - checkpoint.0 >= 3 {
            checkpoint = (count, width);
        }
        let secant = low.0 + width * (low.1 / (low.1 - high.1));
        let at = if slow || !(secant > low.0 && secant < high.0) { low.0 + 0.5 * width } else { secant };
        // The ends are neighbours: no number is left between them.
        if at <= low.0 || at >= high.0 {
            break;
        }
        let (next, margin) = trial(at);
        let is_low = margin >= 0.0;
        if is_low {
            low = (at, margin);
            // The end that stays for the second time counts for half, or it would never move.
            high.1 *= if last_low == Some(true) { 0.5 } else { 1.0 };
        } else {
            high = (at, margin);
            state = next;
            low.1 *= if last_low == Some(false) { 0.5 } else { 1.0 };
        }
        last_low = Some(is_low);
    }
    Located { state, after_s: high.0 }
}
