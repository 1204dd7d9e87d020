//! The computed branch of points that were measured at one load: the place nearest to each, and how far off they are.

use serde::Serialize;

use crate::drive::Drive;
use crate::failure::Failure;
use crate::figures::branches::stretches;
use crate::measured_points::MeasuredPoint;
use crate::read_at::{ReadAt, dof, size};
use resonarm::analysis::{Branch, Coordinate, Distances, Nearest, Orbit, TraceOptions, nearest, trace};
use resonarm::structure::Assembly;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Marker, Panel, Series, Style, Subtitle};

/// Largest turn between two responses of the computed branch: with this it is straight between them, as far as measured
/// points go.
const STRAIGHT_RAD: f64 = 0.01;
/// Largest relative difference between the loads of points on a single branch.
pub(crate) const SAME_LOAD: f64 = 0.02;
/// The part of the points' frequencies by which the computed branch extends beyond them.
const MARGIN: f64 = 0.02;
/// The label of points that come from clipped readings in figures.
pub(crate) const CLIPPED: &str = "from clipped readings";

/// The computed branch at the load of measured points, around them.
pub(crate) struct ComputedBranch {
    branch: Branch,
    /// The degree of freedom whose fundamental is compared.
    pub at: ReadAt,
    /// The load of the branch.
    pub drive: Drive,
}

/// The largest deviations of points from the computed branch of the same load. Points that have not settled, and those
/// from clipped readings, don't count.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Score {
    /// The degree of freedom whose amplitude is compared.
    at: String,
    settled_points: usize,
    /// Points that lie where the computed response is unstable.
    unstable_points: usize,
    /// The largest relative deviation of the frequency.
    largest_frequency_deviation: f64,
    /// The largest relative deviation of the amplitude.
    largest_amplitude_deviation: f64,
}

/// Returns the least and the largest load of the points that have settled.
pub(crate) fn load_range(points: &[MeasuredPoint]) -> [f64; 2] {
    let loads = points.iter().filter(|point| point.settled).filter_map(|point| point.excitation);
    // Without points the range is empty, from ∞ to 0, which counts as one load.
    loads.fold([f64::INFINITY, 0.0], |[least, most], load| [least.min(load), most.max(load)])
}

/// Says whether the loads of the points that have settled are those of a single branch.
pub(crate) fn is_at_one_load(points: &[MeasuredPoint]) -> bool {
    let [least, most] = load_range(points);
    most <= least * (1.0 + SAME_LOAD)
}

/// Chooses the degree of freedom at which points are compared: of those whose readings of settled points are never
/// clipped, if there are any, the one with the largest displacement.
fn best_read(points: &[MeasuredPoint]) -> Option<&str> {
    let rank = |dof: &str| {
        let is_clipped = points.iter().any(|point| point.settled && point.is_clipped(dof));
        // Ordered by cleanliness first: a clipped amplitude may be off by some per cent, however large it is.
        (!is_clipped, points.iter().filter_map(|point| point.amplitude(dof)).fold(0.0, f64::max))
    };
    let dofs = points.first()?.readings.keys().map(String::as_str);
    dofs.max_by(|a, b| {
        let (clean_a, largest_a) = rank(a);
        let (clean_b, largest_b) = rank(b);
        clean_a.cmp(&clean_b).then(largest_a.total_cmp(&largest_b))
    })
}

impl ComputedBranch {
    /// Computes the branch at the mean load of settled points, or at `drive` if their loads differ, as on a backbone, or
    /// are not known; the points are compared at the degree of freedom `at`, or where they move most. `None` without
    /// points.
    ///
    /// # Errors
    /// If there is no such degree of freedom, or the branch can't be followed.
    pub fn new(
        assembly: &Assembly,
        drive: &Drive,
        points: &[MeasuredPoint],
        at: Option<&str>,
    ) -> Result<Option<ComputedBranch>, Failure> {
        let mut around = ComputedBranch::around(assembly, drive, points, at)?;
        if let Some(around) = &mut around {
            around.compute(assembly, points)?;
        }
        Ok(around)
    }

    /// Returns the branch around points before it is computed: without responses, it draws and scores the points alone.
    ///
    /// # Errors
    /// If there is no degree of freedom `at`.
    pub fn around(
        assembly: &Assembly,
        drive: &Drive,
        points: &[MeasuredPoint],
        at: Option<&str>,
    ) -> Result<Option<ComputedBranch>, Failure> {
        let Some(name) = at.or_else(|| best_read(points)) else { return Ok(None) };
        let at = ReadAt { dof: dof("--at", name, assembly)?, name: name.to_owned() };
        // The load that acted, as the head read it or a hold left it.
        let acting: Vec<f64> =
            points.iter().filter(|point| point.settled).filter_map(|point| point.excitation).collect();
        let drive = match acting.len() {
            count if count > 0 && is_at_one_load(points) => {
                // Points state one amplitude each. The ratio of the loads stays as commanded, and only their size is
                // set to the mean.
                drive.scaled(acting.iter().sum::<f64>() / count as f64 / drive.size())
            }
            _ => drive.clone(),
        };
        Ok(Some(ComputedBranch { branch: Branch::default(), at, drive }))
    }

    /// Computes the responses, at the frequencies of the points and a little beyond.
    ///
    /// # Errors
    /// If the branch can't be followed.
    pub fn compute(&mut self, assembly: &Assembly, points: &[MeasuredPoint]) -> Result<(), Failure> {
        let hz = points.iter().map(|point| point.frequency_hz);
        let [low_hz, high_hz] = hz.fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], hz| [low.min(hz), high.max(hz)]);
        let forced = self.drive.forced(assembly);
        let ends = [(1.0 - MARGIN) * low_hz, (1.0 + MARGIN) * high_hz];
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![self.at.dof]);
        // The distance of a point is measured to straight lines between orbits. Near a sharp peak the usual steps
        // would cut the corner by more than measured points deviate.
        options.branch.continuation.largest_turn_rad = STRAIGHT_RAD;
        self.branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options).map_err(|early| early.reason)?;
        Ok(())
    }

    /// Returns the place of the branch that is nearest to a point; `None` if the point was not measured there, or its
    /// reading is zero.
    pub fn nearest(&self, point: &MeasuredPoint) -> Option<Nearest> {
        let read = [point.frequency_hz, point.amplitude(&self.at.name).filter(|amplitude| *amplitude > 0.0)?];
        nearest(&self.branch.orbits, 0, read, Distances::default())
    }

    /// Measures how far the points that have settled without clipped readings are from the branch; `None` if there are
    /// no such points, or if their loads differ.
    pub fn score(&self, points: &[MeasuredPoint]) -> Option<Score> {
        let mut score = Score {
            at: self.at.name.clone(),
            settled_points: 0,
            unstable_points: 0,
            largest_frequency_deviation: 0.0,
            largest_amplitude_deviation: 0.0,
        };
        for point in points.iter().filter(|point| point.settled && !point.is_clipped(&self.at.name)) {
            let Some(place) = self.nearest(point) else { continue };
            score.settled_points += 1;
            score.unstable_points += usize::from(place.is_stable == Some(false));
            // Deviations have signs; the score states sizes.
            let largest = |most: f64, deviation: f64| most.max(deviation.abs());
            score.largest_frequency_deviation = largest(score.largest_frequency_deviation, place.frequency_deviation);
            score.largest_amplitude_deviation = largest(score.largest_amplitude_deviation, place.amplitude_deviation);
        }
        (score.settled_points > 0 && is_at_one_load(points)).then_some(score)
    }

    /// Draws the points over the branch: the amplitude of the fundamental over the frequency; unstable periodic
    /// responses dashed, and points from clipped readings crossed. `conditions` name the structure.
    pub fn figure(&self, title: &str, conditions: Subtitle, points: &[MeasuredPoint]) -> Figure {
        let ReadAt { name, .. } = &self.at;
        let amplitude = Axis::linear(format!("amplitude of {name} ({})", self.at.unit()));
        let mut panel = Panel::new(Axis::linear("frequency (Hz)"), amplitude);
        for (stretch, is_stable) in stretches(&self.branch) {
            let place = |orbit: &Orbit| {
                let Orbit { frequency_hz, readings, .. } = orbit;
                (*frequency_hz, readings.first().map_or(f64::NAN, |reading| size(reading.harmonic1)))
            };
            let (title, dash) = match is_stable {
                Some(false) => ("computed, unstable", Dash::Dashed),
                _ => ("computed", Dash::Solid),
            };
            let style = Style::Line { color: Color::Blue, width: 1.6, dash };
            panel.series.push(Series::line(title, Color::Blue, stretch.iter().map(place).collect()).style(style));
        }
        let places = |wanted: &dyn Fn(&MeasuredPoint) -> bool| {
            let read = points.iter().filter(|point| wanted(point));
            read.filter_map(|point| Some((point.frequency_hz, point.amplitude(name)?))).collect()
        };
        for (title, settled) in [("read, settled", true), ("read, not settled", false)] {
            let read = places(&|point| point.settled == settled);
            let markers = Series::markers(title, Color::Vermillion, Marker::Triangle, read);
            panel = panel.with_any(markers.marked(6.0, settled));
        }
        let clipped = Series::markers(CLIPPED, Color::Black, Marker::Cross, places(&|point| point.is_clipped(name)));
        panel = panel.with_any(clipped.marked(11.0, false));
        Figure::new(title).subtitle(conditions.and(self.drive.rounded_words())).with(panel)
    }
}

impl Score {
    /// States the score in a line.
    pub fn line(&self) -> String {
        let Score { at, settled_points, unstable_points, .. } = self;
        let frequency = self.largest_frequency_deviation;
        let amplitude = self.largest_amplitude_deviation;
        format!(
            "{settled_points} settled points on the computed branch of {at} within {frequency:.1e} of the frequency and \
             {amplitude:.1e} of the amplitude, {unstable_points} of them where it is unstable\n"
        )
    }
}
