//! The χ² distribution and the binomial distribution.

/// Most terms of the series and of the continued fraction.
const TERMS: usize = 10_000;
/// Steps of the bisection, each of which halves the interval.
const STEPS: usize = 200;

/// Returns the value x that a χ²-distributed number of `freedom` degrees of freedom, positive, stays below with
/// `probability`, 0 to below 1.
///
/// The distribution is P(ν/2, x/2), P being the regularised incomplete gamma function. It is inverted by bisection, from
/// an interval that is doubled until it contains x.
pub fn chi_square_quantile(probability: f64, freedom: f64) -> f64 {
    let below = |x: f64| incomplete_gamma(0.5 * freedom, 0.5 * x)[0] < probability;
    let mut low = 0.0;
    let mut high = freedom.max(1.0);
    // Bounded, so that the search ends even if rounding keeps P below the probability at every x.
    while below(high) && high < f64::MAX / 4.0 {
        high *= 2.0;
    }
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Returns the probability that a χ²-distributed number of `freedom` degrees of freedom, positive, is at most x.
pub fn chi_square_probability(x: f64, freedom: f64) -> f64 {
    incomplete_gamma(0.5 * freedom, 0.5 * x)[0]
}

/// Returns the probability that a χ²-distributed number of `freedom` degrees of freedom, positive, exceeds x.
pub fn chi_square_survival(x: f64, freedom: f64) -> f64 {
    incomplete_gamma(0.5 * freedom, 0.5 * x)[1]
}

/// Returns P(a, x) = γ(a, x)/Γ(a) and Q = 1 − P for a > 0, x ≥ 0.
///
/// NIST Digital Library of Mathematical Functions: the series 8.7.1, γ(a, x) = xᵃ e⁻ˣ Σₙ xⁿ/(a (a + 1) … (a + n)), for
/// x < a + 1, and otherwise the continued fraction 8.9.2 of Γ(a, x), evaluated from the front by the method of Lentz (W. J.
/// Lentz, Appl. Opt. 15 (1976)).
fn incomplete_gamma(a: f64, x: f64) -> [f64; 2] {
    if x <= 0.0 {
        return [0.0, 1.0];
    }
    // xᵃ e⁻ˣ/Γ(a) by its logarithm: Γ(a) alone overflows from 344 degrees of freedom on.
    let scale = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let mut term = 1.0 / a;
        let mut sum = 1.0 / a;
        for n in 1..TERMS {
            term *= x / (a + n as f64);
            sum += term;
            if term <= f64::EPSILON * sum {
                break;
            }
        }
        return [scale * sum, 1.0 - scale * sum];
    }
    // Γ(a, x) = xᵃ e⁻ˣ / (b₀ + c₁/(b₁ + c₂/(b₂ + …))) with bₙ = x + 1 − a + 2n, cₙ = −n (n − a).
    let mut b = x + 1.0 - a;
    // Lentz starts with c = ∞, for which the largest number does: the first quotient by it vanishes.
    let mut c = f64::MAX;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for n in 1..TERMS {
        let n = n as f64;
        let numerator = -n * (n - a);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        let factor = c * d;
        fraction *= factor;
        if (factor - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    [1.0 - scale * fraction, scale * fraction]
}

/// Returns the probability that at least `count` of `trials` independent events occur, each of which has the probability
/// `probability`, 0 to 1: Σ C(n, k) pᵏ (1 − p)ⁿ⁻ᵏ over k from `count` on, from the smallest term to the largest.
pub fn binomial_survival(count: usize, trials: usize, probability: f64) -> f64 {
    if count == 0 {
        return 1.0;
    }
    if probability <= 0.0 || count > trials {
        return 0.0;
    }
    if probability >= 1.0 {
        return 1.0;
    }
    // `log1p` keeps the digits of a small probability, which 1 − p would round away.
    let happens = libm::log(probability);
    let fails = libm::log1p(-probability);
    let factorial = |k: usize| libm::lgamma(k as f64 + 1.0);
    let term = |k: usize| {
        let ways = factorial(trials) - factorial(k) - factorial(trials - k);
        libm::exp(ways + k as f64 * happens + (trials - k) as f64 * fails)
    };
    (count..=trials).rev().map(term).sum::<f64>().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `scipy.stats.binom.sf(count - 1, trials, probability)`.
    #[test]
    fn binomial_probabilities_are_those_of_scipy() {
        for (count, trials, probability, expected) in BINOMIAL {
            let found = binomial_survival(count, trials, probability);
            assert!((found / expected - 1.0).abs() < 1e-11, "{count} of {trials}: {found} {expected}");
        }
        assert_eq!([binomial_survival(0, 5, 0.3), binomial_survival(6, 5, 0.3)], [1.0, 0.0]);
        assert_eq!([binomial_survival(1, 5, 0.0), binomial_survival(5, 5, 1.0)], [0.0, 1.0]);
    }

    const BINOMIAL: [(usize, usize, f64, f64); 4] = [
        (3, 94, 0.008, 0.04010229934788652),
        (1, 94, 0.0005, 0.045923816608889216),
        (40, 187, 0.062, 5.410554384169915e-12),
        (30, 94, 0.062, 3.6750118936915796e-14),
    ];

    /// Values of `scipy.stats.chi2.ppf`.
    #[test]
    fn quantiles_are_those_of_scipy() {
        for (probability, freedom, expected) in [
            // From one degree of freedom, where the density is infinite at 0, to thousands, where factors of the series
            // overflow alone.
            (0.025, 1.0, 9.820_691_171_752_555e-4),
            (0.5, 2.0, 1.386_294_361_119_891),
            (0.975, 7.4, 16.625_954_522_300_542),
            (0.05, 20.0, 10.850_811_394_182_59),
            (0.999, 300.0, 381.425_248_520_411_5),
            (0.025, 5000.0, 4_805.904_730_862_248),
        ] {
            let found = chi_square_quantile(probability, freedom);
            assert!((found / expected - 1.0).abs() < 1e-11, "{probability} {freedom}: {found} {expected}");
            assert!((chi_square_survival(found, freedom) + probability - 1.0).abs() < 1e-11);
            assert!((chi_square_probability(found, freedom) / probability - 1.0).abs() < 1e-11);
        }
        // Far in the tail, where 1 − P has no digits left: `scipy.stats.chi2.sf`.
        let found = chi_square_survival(150.0, 20.0);
        assert!((found / 6.285681673933351e-22 - 1.0).abs() < 1e-11, "{found}");
    }
}
