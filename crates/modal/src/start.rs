//! Start of a fit: poles over rising orders, and clusters of them.
//!
//! P. Guillaume et al., "A Poly-Reference Implementation of the Least-Squares Complex Frequency-Domain Estimator", Proc. 21st
//! IMAC (2003); B. Peeters, H. Van der Auweraer, P. Guillaume, J. Leuridan, "The PolyMAX Frequency-Domain Method: A New Standard
//! for Modal Parameter Estimation?", Shock and Vibration 11 (2004). The responses of output o to all references are a row of
//! rational functions of Ω = e^(jωT),
//!
//! ```text
//! Hₒ(Ω) A(Ω) = Bₒ(Ω),   A = Σ Aᵣ Ωʳ,  Bₒ = Σ bₒᵣ Ωʳ,   r = 0 … n,   A₀ = 1
//! ```
//!
//! with real coefficients. Its linear residual is minimised over bₒ and then over A: with P the columns Ωʳ, Yₒ the columns
//! −Ωʳ Hₒᵢ, R = Re PᴴP, Sₒ = Re PᴴYₒ and Tₒ = Re YₒᴴYₒ, the matrix M = Σₒ Tₒ − SₒᵀR⁻¹Sₒ has M A = 0 below its first rows. With
//! A₀, the lowest coefficient, fixed, poles of the structure are stable and those that only describe noise are mostly not.
//!
//! Elements of R, S and T depend on the difference of their powers of Ω alone. The matrices of a lower order are leading blocks
//! of those of the highest one, and so are the factors of M.
//!
//! T is chosen so that the band lies in one of the intervals (z π … (z + 1) π) of the angle ωT and reaches its end: z = 0 for a
//! band that starts below half its end. A band that is narrow for its frequency would else fill a small part of the circle,
//! where powers of Ω hardly differ.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use nalgebra::Complex;
use resonarm_numeric::eigenvalues::eigenvalues;

use crate::cholesky::Cholesky;
use crate::columns::{LANES, Lane, gram, lanes, products};
use crate::complex::{log, magnitude};
use crate::noise::median;
use crate::pole::{damping_ratio, pole};
use crate::run::Band;

/// Damping ratios of poles that are taken as physical.
const PHYSICAL: core::ops::Range<f64> = 2e-5..0.3;
/// Lowest order whose poles count for clusters.
const LEAST_ORDER: usize = 4;
/// Radius of a cluster, as a part of |Re λ| of its centre and as a part of |λ|; the larger one counts.
const RADIUS: f64 = 0.35;
const LEAST_RADIUS: f64 = 2e-4;
/// Least part of the orders that have a pole in a cluster.
const SHARE: f64 = 0.35;
/// Rounds in which a centre moves to the median of its poles.
const ROUNDS: usize = 3;

/// Poles of one order of a stabilisation diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderPoles {
    /// Order n of the denominator: it has n times the number of references as many poles.
    pub order: usize,
    /// Poles λ in the band, rad/s, with damping ratios from 0.00002 to 0.3, by rising frequency.
    pub poles: Vec<Complex<f64>>,
}

/// Poles that come again over the orders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Median of the poles, rad/s.
    pub pole: Complex<f64>,
    /// Part of the orders from 4 on that have a pole in the cluster, 0.35 to 1.
    pub share: f64,
}

/// Returns the radius of a cluster about a pole.
fn radius(pole: Complex<f64>) -> f64 {
    (RADIUS * pole.re.abs()).max(LEAST_RADIUS * magnitude(pole))
}

impl Cluster {
    /// Returns whether a pole is in the cluster: within 0.35 |Re λ| of its centre, or 0.0002 |λ| if that is more.
    pub fn contains(&self, pole: Complex<f64>) -> bool {
        magnitude(pole - self.pole) < radius(self.pole)
    }
}

/// A stabilisation diagram: poles of all orders, and clusters of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stabilisation {
    /// Orders from 1 on.
    pub orders: Vec<OrderPoles>,
    /// Clusters by falling share. Two modes with nearly the same pole may be one cluster; the fit decides.
    pub clusters: Vec<Cluster>,
}

impl Stabilisation {
    /// Returns the poles of the frequency responses `[output][reference][line]` for orders up to `order`, and their clusters.
    pub(crate) fn of_responses(
        responses: &[Vec<Vec<Complex<f64>>>],
        frequency_hz: &[f64],
        order: usize,
        band: Band,
    ) -> Stabilisation {
        let orders = poles_of_orders(responses, frequency_hz, order, band);
        let clusters = clusters(&orders);
        Stabilisation { orders, clusters }
    }
}

/// Angles of the lines on the circle.
struct Circle {
    /// Length T of the record, s.
    period_s: f64,
    /// Number z of the interval.
    interval: f64,
}

impl Circle {
    fn new(band: Band) -> Circle {
        let interval = libm::floor(band.from_hz / (band.to_hz - band.from_hz));
        Circle { period_s: (interval + 1.0) / (2.0 * band.to_hz), interval }
    }

    /// The pole λ of an eigenvalue z = e^(λT), of a pair z, z̄ with angles of either sign.
    fn pole(&self, z: Complex<f64>) -> Complex<f64> {
        let log = log(z);
        let angle = log.im.abs();
        let even = libm::fmod(self.interval, 2.0) == 0.0;
        let unwrapped = if even { self.interval * PI + angle } else { (self.interval + 1.0) * PI - angle };
        Complex::new(log.re, unwrapped) / self.period_s
    }
}

fn poles_of_orders(
    responses: &[Vec<Vec<Complex<f64>>>],
    frequency_hz: &[f64],
    order: usize,
    band: Band,
) -> Vec<OrderPoles> {
    let inputs = responses.first().map_or(0, Vec::len);
    let circle = Circle::new(band);
    let size = (order + 1) * inputs;
    let matrix = reduced_matrix(responses, frequency_hz, order, &circle);
    // M A = 0 below the first rows: M' X = −M₀ with M' the rest of M.
    let rest = size - inputs;
    let factor = Cholesky::new(rest, &matrix[inputs * size + inputs..], size);
    let forward: Vec<Vec<f64>> = (0..inputs)
        .map(|column| {
            let mut right: Vec<f64> = (0..rest).map(|row| -matrix[(inputs + row) * size + column]).collect();
            factor.forward(&mut right);
            right
        })
        .collect();
    let mut orders = Vec::new();
    for n in 1..=order {
        let unknowns = n * inputs;
        let coefficients: Vec<Vec<f64>> = forward
            .iter()
            .map(|column| {
                let mut solved = column[..unknowns].to_vec();
                factor.backward(unknowns, &mut solved);
                solved
            })
            .collect();
        // With w = 1/z, (wⁿ + Σᵣ Aᵣᵀ wⁿ⁻ʳ) v = 0: the companion matrix has −Aᵣᵀ in its first rows.
        let mut companion = vec![0.0; unknowns * unknowns];
        for (row, column) in coefficients.iter().enumerate() {
            (0..unknowns).for_each(|k| companion[row * unknowns + k] = -column[k]);
        }
        (inputs..unknowns).for_each(|row| companion[row * unknowns + row - inputs] = 1.0);
        let found = eigenvalues(unknowns, &mut companion).unwrap_or_default();
        let mut poles: Vec<Complex<f64>> = found
            .into_iter()
            // One of each pair: real eigenvalues are no vibration.
            .filter(|w| w.im > 0.0)
            .map(|w| circle.pole(w.inv()))
            .filter(|pole| is_physical(*pole, band))
            .collect();
        poles.sort_by(|a, b| a.im.total_cmp(&b.im));
        orders.push(OrderPoles { order: n, poles });
    }
    orders
}

fn is_physical(pole: Complex<f64>, band: Band) -> bool {
    PHYSICAL.contains(&damping_ratio(pole)) && (band.from_hz..band.to_hz).contains(&(pole.im / TAU))
}

/// M by rows: row r · inputs + i belongs to the power r and reference i.
fn reduced_matrix(
    responses: &[Vec<Vec<Complex<f64>>>],
    frequency_hz: &[f64],
    order: usize,
    circle: &Circle,
) -> Vec<f64> {
    let inputs = responses.first().map_or(0, Vec::len);
    let powers = order + 1;
    let size = (order + 1) * inputs;
    let lanes = |value: &dyn Fn(usize) -> f64| lanes(frequency_hz.len(), value);
    let angle = |power: usize, k: usize| TAU * frequency_hz[k] * circle.period_s * power as f64;
    let cosines: Vec<Vec<Lane>> = (0..powers).map(|power| lanes(&|k| libm::cos(angle(power, k)))).collect();
    let sines: Vec<Vec<Lane>> = (0..powers).map(|power| lanes(&|k| libm::sin(angle(power, k)))).collect();
    let [cosines, sines] = [&cosines, &sines].map(|table| table.iter().map(Vec::as_slice).collect::<Vec<_>>());
    // Re Σ h Ω^m for m = −order … order, at the place m + order.
    let lags = |h: &dyn Fn(usize) -> Complex<f64>| {
        let [re, im] = [lanes(&|k| h(k).re), lanes(&|k| h(k).im)];
        let [re, im] = [products(&[&re], &cosines), products(&[&im], &sines)];
        let lag = |place: usize| {
            let m = place.abs_diff(order);
            if place >= order { re[m] - im[m] } else { re[m] + im[m] }
        };
        (0..=2 * order).map(lag).collect::<Vec<f64>>()
    };
    let ones = lags(&|_| Complex::new(1.0, 0.0));
    let own: Vec<f64> = (0..powers * powers).map(|k| ones[order + k / powers - k % powers]).collect();
    let factor = Cholesky::new(powers, &own, powers);
    let mut matrix = vec![0.0; size * size];
    // L⁻¹ Sₒ of all outputs, one below the other.
    let per_output = powers.div_ceil(LANES);
    let mut explained = vec![vec![[0.0; LANES]; per_output * responses.len()]; size];
    for (output, of_output) in responses.iter().enumerate() {
        for i in 0..inputs {
            let cross = lags(&|k| of_output[i][k]);
            for r in 0..powers {
                let mut column: Vec<f64> = (0..powers).map(|k| -cross[order + r - k]).collect();
                factor.forward(&mut column);
                let target = &mut explained[r * inputs + i][output * per_output..];
                column.iter().enumerate().for_each(|(k, value)| target[k / LANES][k % LANES] = *value);
            }
            for j in i..inputs {
                let both = lags(&|k| of_output[i][k].conj() * of_output[j][k]);
                for k in 0..powers {
                    for l in 0..powers {
                        let row = k * inputs + i;
                        let column = l * inputs + j;
                        let value = both[order + l - k];
                        matrix[row * size + column] += value;
                        if i != j {
                            matrix[column * size + row] += value;
                        }
                    }
                }
            }
        }
    }
    let explained = gram(&explained.iter().map(Vec::as_slice).collect::<Vec<_>>(), None);
    matrix.iter_mut().zip(explained).for_each(|(value, explained)| *value -= explained);
    matrix
}

/// Clusters of the poles of all orders, by falling share.
///
/// The pole with the most others within its radius comes first. Its centre moves to the median of the poles around it that
/// are free, which then belong to it.
fn clusters(orders: &[OrderPoles]) -> Vec<Cluster> {
    let points: Vec<(usize, Complex<f64>)> = orders
        .iter()
        .filter(|order| order.order >= LEAST_ORDER)
        .flat_map(|order| order.poles.iter().map(|pole| (order.order, *pole)))
        .collect();
    let near = |centre: Complex<f64>, pole: Complex<f64>| {
        let radius = radius(centre);
        (pole - centre).norm_sqr() < radius * radius
    };
    let mut sequence: Vec<(usize, usize)> = points
        .iter()
        .enumerate()
        .map(|(index, (_, centre))| (points.iter().filter(|(_, pole)| near(*centre, *pole)).count(), index))
        .collect();
    sequence.sort_by_key(|(count, _)| core::cmp::Reverse(*count));
    let mut free = vec![true; points.len()];
    let mut found: Vec<(usize, Complex<f64>)> = Vec::new();
    for (_, first) in sequence {
        if !free[first] {
            continue;
        }
        let mut centre = points[first].1;
        for _ in 0..ROUNDS {
            let around = |part: fn(Complex<f64>) -> f64| {
                let members = points.iter().zip(&free).filter(|((_, pole), free)| **free && near(centre, *pole));
                median(&mut members.map(|((_, pole), _)| part(*pole)).collect::<Vec<_>>())
            };
            let [re, im] = [around(|pole| pole.re), around(|pole| pole.im)];
            // The median of nothing is 0: no pole around the centre is free any more.
            if im == 0.0 {
                break;
            }
            centre = Complex::new(re, im);
        }
        let mut with: Vec<usize> = Vec::new();
        for (index, (order, pole)) in points.iter().enumerate() {
            if index == first || (free[index] && near(centre, *pole)) {
                free[index] = false;
                with.push(*order);
            }
        }
        with.dedup();
        found.push((with.len(), centre));
    }
    let count = orders.iter().filter(|order| order.order >= LEAST_ORDER).count();
    found.retain(|(with, _)| *with as f64 >= SHARE * count as f64);
    found.sort_by_key(|(with, _)| core::cmp::Reverse(*with));
    found.into_iter().map(|(with, pole)| Cluster { pole, share: with as f64 / count as f64 }).collect()
}

/// Returns the pole of a weakly damped mode at the frequency of the largest response.
pub(crate) fn largest_peak(responses: &[Vec<Vec<Complex<f64>>>], frequencies: &[f64]) -> Option<Complex<f64>> {
    let power = |k: usize| responses.iter().flatten().map(|values| values[k].norm_sqr()).sum::<f64>();
    let largest = (0..frequencies.len()).max_by(|a, b| power(*a).total_cmp(&power(*b)))?;
    Some(pole(frequencies[largest], 0.01))
}
