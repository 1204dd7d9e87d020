//! Two independent methods: stepped sweeps in time, and branches continued by harmonic balance. A sweep must settle on
//! the stable stretch that its history implies, and jump where that stretch ends in a fold.

use nalgebra::Normed as _;
use resonarm::analysis::BifurcationKind;
use resonarm::analysis::time_domain::{Direction, Grid, SettleOptions};
use resonarm::analysis::time_domain::{Settled, StroboscopicMap, settle};
use resonarm::analysis::{Branch, Coordinate, Forced, Orbit, TraceOptions, trace};
use resonarm::structure::{Assembly, BodySpec, Dof, Preset, StructureSpec};
use serde_json::Value;

/// The largest relative difference of a settled amplitude from the branch's.
const TOLERANCE: f64 = 1e-6;

struct Case {
    /// The arm as a chain under its drive, of amplitude 1.
    forced: Forced,
    joints: [Dof; 2],
    /// Ends and number of values of the sweep's parts, upwards: coarse, fine around the folds, coarse.
    parts: [(f64, f64, u32); 3],
}

impl Case {
    fn new(angles_deg: [f64; 2], drive: &str, amplitude: f64, parts: [(f64, f64, u32); 3]) -> Case {
        let chain = Preset::Irb1600Fitted.chain().unwrap().at_angles_deg(&angles_deg);
        let spec = StructureSpec { body: BodySpec::Chain(chain), elements: vec![] };
        let assembly = Assembly::new(&spec).unwrap();
        let [drive, joint1, joint2] = [drive, "joint1", "joint2"].map(|name| assembly.dof(name).unwrap());
        Case { forced: Forced::new(assembly, drive, amplitude), joints: [joint1, joint2], parts }
    }

    /// The settled responses in order: each starts where the one before ended, the first from rest.
    fn swept(&self, direction: Direction) -> Vec<(f64, Settled)> {
        let mut parts = self.parts;
        if direction == Direction::Down {
            parts.reverse();
        }
        let (mut state, mut points) = (vec![0.0; 4], Vec::new());
        for (from, to, count) in parts {
            for frequency_hz in Grid::new(from, to, count).unwrap().in_order(direction) {
                let map = StroboscopicMap::new(&self.forced, frequency_hz).unwrap();
                let settled = settle(&map, &self.joints, &state, &SettleOptions::default(), &|| false).unwrap();
                state.clone_from(&settled.end);
                points.push((frequency_hz, settled));
            }
        }
        points
    }

    fn branch(&self, from_hz: f64, to_hz: f64) -> Branch {
        let ends = [from_hz, to_hz];
        let options = TraceOptions::new(&self.forced, Coordinate::FrequencyHz, ends, self.joints.to_vec());
        trace(&self.forced, from_hz, Coordinate::FrequencyHz, &options).unwrap()
    }

    /// The response at which the branch that begins at `from_hz` first meets a frequency. A fold turns the branch back,
    /// so this is a response before the fold if there is one, otherwise one of the remaining stretch.
    fn implied(&self, from_hz: f64, frequency_hz: f64) -> Orbit {
        self.branch(from_hz, frequency_hz).orbits.pop().unwrap()
    }

    fn folds(&self, from_hz: f64, to_hz: f64) -> Vec<f64> {
        let branch = self.branch(from_hz, to_hz);
        let folds = branch.bifurcations.iter().filter(|event| event.kind == BifurcationKind::Fold);
        folds.map(|fold| fold.orbit.frequency_hz).collect()
    }

    /// Sweeps one way. Returns the first fold on the way, between whose neighbours the sweep jumps, and the largest
    /// difference.
    fn compare(&self, direction: Direction) -> (f64, f64) {
        let points = self.swept(direction);
        // The branch begins beside the first point: to its own start it would have no interval.
        let (from_hz, to_hz) = (points[0].0 - 0.1 * direction_sign(direction), points[points.len() - 1].0);
        let fold = self.folds(from_hz, to_hz)[0];
        let mut largest = 0.0_f64;
        for (frequency_hz, settled) in &points {
            let implied = self.implied(from_hz, *frequency_hz);
            assert!(implied.is_stable() == Some(true) && settled.period == Some(1), "{frequency_hz} Hz: {settled:?}");
            for (joint, (settled, implied)) in settled.readings.iter().zip(&implied.readings).enumerate() {
                let differences = [
                    settled.largest / implied.largest - 1.0,
                    settled.harmonic1.norm() / implied.harmonic1.norm() - 1.0,
                ];
                for difference in differences {
                    assert!(difference.abs() < TOLERANCE, "{frequency_hz} Hz, joint {}: {difference}", joint + 1);
                    largest = largest.max(difference.abs());
                }
            }
        }
        let beyond = |frequency_hz: f64| (frequency_hz - fold) * direction_sign(direction) > 0.0;
        let at = points.windows(2).find(|pair| !beyond(pair[0].0) && beyond(pair[1].0)).unwrap();
        // Around the folds the sweep has steps of 2 mHz, so that the jump lies between two such neighbours.
        let ratio = at[1].1.readings[0].largest / at[0].1.readings[0].largest;
        assert!((at[1].0 - at[0].0).abs() < 2.1e-3 && !(0.7..1.4).contains(&ratio), "{fold} Hz: {ratio}");
        (fold, largest)
    }
}

fn direction_sign(direction: Direction) -> f64 {
    match direction {
        Direction::Up => 1.0,
        Direction::Down => -1.0,
    }
}

/// The first zone, soft: 60 N·m at joint 1, β2 = 60°. The folds are those of `tests/oracles/oracles.json`.
#[test]
fn sweeps_land_on_the_branches_of_the_first_zone() {
    let angles_deg = [0.0, 60.0];
    let case = Case::new(angles_deg, "joint1", 60.0, [(21.0, 22.04, 21), (22.042, 22.2, 80), (22.23, 23.5, 26)]);
    let oracles: Value = serde_json::from_str(include_str!("../oracles/oracles.json")).unwrap();
    let oracle = &oracles["branches"][0];
    assert_eq!((oracle["beta2_deg"].as_f64(), oracle["torque1_nm"].as_f64()), (Some(60.0), Some(60.0)));
    for (direction, expected) in [Direction::Up, Direction::Down].into_iter().zip(oracle["folds"].as_array().unwrap()) {
        let (fold, largest) = case.compare(direction);
        assert!((fold / expected["frequency_hz"].as_f64().unwrap() - 1.0).abs() < 1e-9, "{fold} {expected}");
        println!("{direction:?}: jumps at {fold} Hz, amplitudes within {largest:.1e}");
    }
}

/// The second zone, stiff: 200 N at the tip, β1 = 30°, β2 = 120°. Stepped up, the response falls off the
/// upper stretch; stepped down, it jumps up.
#[test]
fn sweeps_land_on_the_branches_of_the_second_zone() {
    let angles_deg = [30.0, 120.0];
    let case = Case::new(angles_deg, "tip.x", 200.0, [(39.5, 40.44, 24), (40.442, 40.51, 35), (40.53, 41.5, 21)]);
    let (up, down) = (case.compare(Direction::Up), case.compare(Direction::Down));
    assert!(up.0 > down.0 + 0.03, "{up:?} {down:?}");
    println!("jumps up at {} Hz, down at {} Hz, amplitudes within {:.1e}", up.0, down.0, up.1.max(down.1));
}
