//! Gathers states and loads from the frames of CANopen drives.

use resonarm_bench::node::cia402::{Cia402Spec, DriveSpec};
use resonarm_protocol::{Frame, Id};
use resonarm_wire::canopen::dictionary::{Address, Value};
use resonarm_wire::canopen::listen::{Heard, Part, Sdo};

use super::SampleClock;
use super::index::{Anchor, FrameIndex, Numbering, Placed};
use super::loads::LoadChanges;
use super::rows::Rows;
use super::wire::{hold, state_record};
use super::wire_import::{Gaps, Missing, WireImport};
use crate::drives::Targets;
use crate::recording::{Direction, Record};
use resonarm_scenario::wire::Quantities;

/// Gathers states and loads frame by frame: angles and rates from PDOs, wherever the master maps them, torques from
/// targets. A sample needs the angle and the rate of every joint. Drives have no readings, which are accelerations and
/// forces.
#[derive(Debug)]
pub(super) struct DriveGatherer {
    targets: Targets,
    changes: LoadChanges,
    states: Rows,
    quantities: Quantities,
    clock: SampleClock,
    /// Indices by node and number of the PDO.
    indices: Vec<((u8, u16), FrameIndex)>,
    rate_hz: f64,
    last: Option<Anchor>,
    now: Option<u64>,
    /// One bit for each state that has arrived.
    came: u64,
    gaps: Gaps,
    found: WireImport,
}

impl DriveGatherer {
    /// Makes the gatherer of these drives, for a plant with these quantities.
    pub fn new(spec: &Cia402Spec, quantities: Quantities, rate_hz: f64, clock: SampleClock) -> DriveGatherer {
        let missing_readings =
            quantities.readings().iter().map(|channel| Missing { channel: channel.name, is_carried: false });
        let found = WireImport {
            missing_readings: missing_readings.collect(),
            is_placed_by_time: clock == SampleClock::TimeStamps,
            ..WireImport::default()
        };
        let count = quantities.moving().len();
        DriveGatherer {
            targets: Targets::new(spec),
            changes: LoadChanges::default(),
            states: Rows::new(count, (1 << count) - 1, hold(rate_hz)),
            quantities,
            clock,
            indices: Vec::new(),
            rate_hz,
            last: None,
            now: None,
            came: 0,
            gaps: Gaps::default(),
            found,
        }
    }

    /// Processes a frame. Returns its direction, if a drive or its master sends such frames, and its sample, if one is
    /// known.
    pub fn add(&mut self, frame: &Frame, time_ns: u64) -> (Option<Direction>, Option<u64>) {
        let heard = self.targets.hear(frame);
        let direction = heard.first().map(|(spec, heard)| direction(frame, spec, heard));
        if self.clock == SampleClock::Sync && heard.iter().any(|(_, heard)| matches!(heard, Heard::Sync(_))) {
            // The SYNC opens its sample, so frames before the first one belong to sample 0 as well.
            self.now = Some(self.now.map_or(0, |now| now + 1));
        }
        for (spec, heard) in &heard {
            match heard {
                Heard::Pdo { number, is_sent: true, values, missing: None } => {
                    self.read(spec, *number, values, time_ns);
                }
                Heard::Pdo { number, is_sent, missing: Some(_), .. } => {
                    let name = if *is_sent { "TPDO" } else { "RPDO" };
                    self.refuse(&format!("{name} {number} of node {}", spec.node_id));
                }
                Heard::Malformed { .. } => self.refuse(&format!("other frames of node {}", spec.node_id)),
                _ => {}
            }
        }
        if !heard.is_empty() {
            // Of several changes within a sample the last one is held, as by the drive.
            self.changes.insert(self.now.unwrap_or(0), self.targets.load());
        }
        (direction, self.now)
    }

    fn refuse(&mut self, message: &str) {
        *self.found.refused_frames.entry(message.to_string()).or_default() += 1;
    }

    /// Reads the states that a PDO carries. A value at the limit of 32 bits is none, since the drive clips to it.
    fn read(&mut self, spec: &DriveSpec, number: u16, values: &[(Address, Value)], time_ns: u64) {
        let joints = self.quantities.moving().len() / 2;
        let states = values.iter().filter_map(|(address, value)| {
            let place = match address.index {
                0x6064 => spec.joint,
                0x606C => joints + spec.joint,
                _ => return None,
            };
            Some((place, value.number()?))
        });
        let states: Vec<(usize, i64)> = states.collect();
        if states.is_empty() {
            return;
        }
        if states.iter().any(|(_, count)| [i64::from(i32::MIN), i64::from(i32::MAX)].contains(count)) {
            return self.refuse(&format!("TPDO {number} of node {}", spec.node_id));
        }
        let sample = match self.clock {
            SampleClock::Sync => self.now.unwrap_or(0),
            SampleClock::TimeStamps => match self.place((spec.node_id, number), time_ns) {
                Some(sample) => sample,
                None => {
                    self.found.repeated_frames += 1;
                    return;
                }
            },
        };
        for (place, count) in states {
            let bit = place as u32;
            self.came |= 1 << bit;
            self.states.add(sample, bit, |row| row.values[place] = count as f64 / spec.counts_per_rad());
        }
    }

    /// Returns the sample of a PDO by its time stamp; `None` if it is before the beginning.
    fn place(&mut self, pdo: (u8, u16), time_ns: u64) -> Option<u64> {
        let order = match self.indices.iter().position(|(other, _)| *other == pdo) {
            Some(order) => order,
            None => {
                let order = self.indices.len();
                self.indices.push((pdo, FrameIndex::new(order, Numbering::Time, self.rate_hz)));
                order
            }
        };
        let index = &mut self.indices[order].1;
        let Placed::At(sample) = index.place(None, None, time_ns, self.last) else { return None };
        if self.last.is_none_or(|last| sample >= last.sample) {
            self.last = index.last;
        }
        self.now = self.now.max(Some(sample));
        Some(sample)
    }

    /// Returns the next record; `is_end` after the last frame.
    pub fn next(&mut self, is_end: bool) -> Option<Record> {
        let (sample, row) = self.states.next(is_end)?;
        self.found.states += 1;
        self.gaps.count(sample, &mut self.found);
        Some(Record::State(state_record(sample, &row, (self.changes.at(sample), self.quantities.loads()))))
    }

    /// Returns the data gathered from all frames.
    pub fn finish(self) -> WireImport {
        let mut found = self.found;
        let missing = self.quantities.moving().iter().enumerate().filter(|(place, _)| self.came >> place & 1 == 0);
        found.missing_states =
            missing.map(|(_, channel)| Missing { channel: channel.name, is_carried: false }).collect();
        found.incomplete_samples = self.states.incomplete;
        found.repeated_frames += self.states.too_late;
        found
    }
}

/// Returns the direction of a frame that a drive has heard: frames of a node are sent by the plant.
fn direction(frame: &Frame, spec: &DriveSpec, heard: &Heard) -> Direction {
    let answer = Id::Standard(resonarm_wire::canopen::SDO_ANSWER_BASE + u16::from(spec.node_id));
    let is_sent = match heard {
        Heard::Heartbeat(_) | Heard::Emergency { .. } | Heard::Pdo { is_sent: true, .. } => true,
        Heard::Sdo(Sdo::Given(..) | Sdo::Confirmed(_) | Sdo::SegmentTaken(_)) => true,
        Heard::Sdo(_) => frame.id() == answer,
        Heard::Malformed { of: Part::Emergency | Part::Heartbeat | Part::Answer, .. } => true,
        _ => false,
    };
    if is_sent { Direction::Sent } else { Direction::Received }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gatherer(clock: SampleClock) -> DriveGatherer {
        let drive = |node_id, joint| DriveSpec {
            node_id,
            joint,
            gear_ratio: 1.0,
            rated_torque_mnm: 1_000_000,
            encoder_counts_per_turn: 1000,
        };
        let drives = vec![drive(1, 0), drive(2, 1)];
        let quantities = Quantities::of_scenario(&resonarm_scenario::Scenario::default()).unwrap();
        DriveGatherer::new(&Cia402Spec { drives, timeout_ns: 1 }, quantities, 1000.0, clock)
    }

    /// Sample, angles in counts, torques of the states that the frames at these times (µs) give.
    fn states(gatherer: &mut DriveGatherer, frames: &[(u64, &str)]) -> Vec<(u64, [f64; 2], [f64; 2])> {
        let mut records = Vec::new();
        for (us, frame) in frames {
            gatherer.add(&frame.parse().unwrap(), us * 1000);
            records.extend(core::iter::from_fn(|| gatherer.next(false)));
        }
        records.extend(core::iter::from_fn(|| gatherer.next(true)));
        let counts = |rad: f64| (rad * 1000.0 / core::f64::consts::TAU).round();
        let of = |record| match record {
            Record::State(state) => (
                state.sample,
                [0, 1].map(|joint| counts(state.states.coordinates()[joint])),
                [0, 1].map(|joint| state.load.torque_nm[joint]),
            ),
            other => panic!("{other:?}"),
        };
        records.into_iter().map(of).collect()
    }

    const FRAMES: [(u64, &str); 15] = [
        (0, "601#2F6060000A000000"),
        (50, "581#6060600000000000"),
        (100, "201#06000000"),
        (200, "201#0F000000"),
        (1000, "080#"),
        (1100, "281#0300000001000000"),
        (1200, "282#FCFFFFFF02000000"),
        (1500, "201#0F000500"),
        (2000, "080#"),
        (2100, "281#0500000001000000"),
        (2200, "282#FAFFFFFF02000000"),
        (9000, "080#"),
        (9100, "281#0700000001000000"),
        (9150, "282#07000000"),
        (9200, "282#F8FFFFFF02000000"),
    ];

    #[test]
    fn states_come_from_the_pdos_and_loads_from_the_targets() {
        let mut by_sync = gatherer(SampleClock::Sync);
        let expected =
            |last| [(0, [3.0, -4.0], [5.0, 0.0]), (1, [5.0, -6.0], [5.0, 0.0]), (last, [7.0, -8.0], [5.0, 0.0])];
        assert_eq!(states(&mut by_sync, &FRAMES), expected(2));
        let found = by_sync.finish();
        assert_eq!((found.states, found.missing_states.len(), found.missing_readings.len(), found.gaps), (3, 0, 6, 0));
        assert_eq!(found.refused_frames.into_iter().collect::<Vec<_>>(), [(String::from("TPDO 2 of node 2"), 1)]);
        // Of the same frames by their times: seven periods are seven samples.
        let mut by_time = gatherer(SampleClock::TimeStamps);
        let of_time = states(&mut by_time, &FRAMES);
        let shift = of_time[0].0;
        let from_first: Vec<_> =
            of_time.iter().map(|(sample, angles, torques)| (sample - shift, *angles, *torques)).collect();
        assert_eq!(from_first, expected(8));
        let found = by_time.finish();
        assert_eq!((found.gaps, found.missing_samples, found.is_placed_by_time), (1, 6, true));
    }

    #[test]
    fn a_mapping_of_the_master_s_own_is_followed_and_what_never_comes_is_missing() {
        let mut one = gatherer(SampleClock::Sync);
        let frames = [
            (0, "601#2300180181010080"),
            (10, "581#6000180100000000"),
            (20, "601#2F001A0000000000"),
            (30, "581#60001A0000000000"),
            (40, "601#23001A0120006460"),
            (50, "581#60001A0100000000"),
            (60, "601#2F001A0001000000"),
            (70, "581#60001A0000000000"),
            (80, "601#2300180190010000"),
            (90, "581#6000180100000000"),
            (1000, "080#"),
            (1100, "190#03000000"),
        ];
        assert_eq!(states(&mut one, &frames), []);
        let found = one.finish();
        let missing: Vec<&str> = found.missing_states.iter().map(|missing| missing.channel.as_str()).collect();
        assert_eq!(missing, ["alpha2_rad", "alpha1_dot_rad_s", "alpha2_dot_rad_s"]);
        assert_eq!((found.states, found.incomplete_samples), (0, 1));
    }
}
