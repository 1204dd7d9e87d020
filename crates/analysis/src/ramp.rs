//! A force that is zero up to a limit and rises from there, as its mean over the interval around a sample.

/// The mean of max(δ + δ̇ t, 0) for |t| < h/2, and its derivatives: with r = |δ̇| h/2 it is (δ + r)²/(4r) for |δ| < r.
pub(super) struct Ramp {
    pub mean: f64,
    pub by_position: f64,
    pub by_velocity: f64,
}

impl Ramp {
    pub fn new(depth: f64, rate: f64, step_s: f64) -> Ramp {
        let reach = 0.5 * rate.abs() * step_s;
        if depth <= -reach {
            return Ramp { mean: 0.0, by_position: 0.0, by_velocity: 0.0 };
        }
        if depth >= reach {
            return Ramp { mean: depth, by_position: 1.0, by_velocity: 0.0 };
        }
        // The mean is a triangle of height δ + r over this share of the interval, p = (δ + r)/2r.
        let part = 0.5 * (depth + reach) / reach;
        Ramp {
            mean: 0.5 * (depth + reach) * part,
            by_position: part,
            // d/dr (δ + r)²/4r = (r + δ)(r − δ)/4r² = p (1 − p), and dr/dδ̇ = ±h/2.
            by_velocity: 0.5 * part * (1.0 - part) * rate.signum() * step_s,
        }
    }
}
