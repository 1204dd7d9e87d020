//! The plotting topics: states, loads and readings once more, every n-th sample, a message each.

use super::decimate::{Decimated, Decimator};
use super::schema::proto::{Command, Sensors, State};
use super::{SampleRecord, StateRecord};

/// What is ready for plotting.
pub enum Plot {
    State(State),
    Command(Command),
    Sensors(Sensors),
}

impl Plot {
    /// The sample for which it stands.
    pub fn sample(&self) -> u64 {
        match self {
            Plot::State(state) => state.step,
            Plot::Command(command) => command.step,
            Plot::Sensors(sensors) => sensors.step,
        }
    }
}

/// The value as it is plotted: what the filter made, which is good to 1e-4 of the amplitude, rounded to 24 bits, since
/// the bits below can't be compressed. A value of no filter stays as it is.
fn plotted(every: u64, value: f64) -> f64 {
    const DROPPED: u64 = (1 << 29) - 1;
    match value.is_finite() && every > 1 {
        true => f64::from_bits((value.to_bits() + (DROPPED >> 1) + 1) & !DROPPED),
        false => value,
    }
}

/// Gathers what is to be plotted.
pub struct Plots {
    /// Every how many samples something is plotted.
    every: u64,
    /// α1, α2, α̇1, α̇2, torques at joints 1 and 2, force along x and y.
    states: Decimator<8>,
    states_ready: Vec<Decimated<8>>,
    /// Acceleration of B and C and force in the head, x before y.
    readings: Decimator<6>,
    readings_ready: Vec<Decimated<6>>,
    /// The last load that was held.
    load: [f64; 4],
}

impl Plots {
    /// For every `every`-th sample; 0 is none.
    pub fn new(every: u64) -> Plots {
        Plots {
            every,
            states: Decimator::new(every),
            states_ready: Vec::new(),
            readings: Decimator::new(every),
            readings_ready: Vec::new(),
            load: [0.0; 4],
        }
    }

    /// Takes the next state and load. The end of a run, which has no load, goes on with the last.
    pub fn state(&mut self, record: &StateRecord) {
        let StateRecord { sample, alpha_rad: [a1, a2], alpha_dot_rad_s: [v1, v2], .. } = *record;
        if let ([t1, t2], [fx, fy], false) = (record.torque_nm, record.force_n, record.is_end) {
            self.load = [t1, t2, fx, fy];
        }
        let [t1, t2, fx, fy] = self.load;
        self.states.push(sample, [a1, a2, v1, v2, t1, t2, fx, fy], 0, &mut self.states_ready);
    }

    /// Takes the next readings.
    pub fn reading(&mut self, record: &SampleRecord) {
        let SampleRecord { sample, acceleration_b_m_s2: [bx, by], acceleration_c_m_s2: [cx, cy], .. } = *record;
        let [hx, hy] = record.head_force_n;
        let flags = record.clipped.bits();
        self.readings.push(sample, [bx, by, cx, cy, hx, hy], flags, &mut self.readings_ready);
    }

    /// Nothing more comes.
    pub fn end(&mut self) {
        self.states.end(&mut self.states_ready);
        self.readings.end(&mut self.readings_ready);
    }

    /// What is ready, in order within each topic.
    pub fn ready(&mut self) -> impl Iterator<Item = Plot> + use<> {
        let every = self.every;
        let states = core::mem::take(&mut self.states_ready).into_iter().flat_map(move |row| {
            let (
                step,
                [
                    alpha1_rad,
                    alpha2_rad,
                    alpha1_dot_rad_s,
                    alpha2_dot_rad_s,
                    torque1_nm,
                    torque2_nm,
                    force_x_n,
                    force_y_n,
                ],
            ) = (row.index, row.values.map(|value| plotted(every, value)));
            let state = State { step, alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s };
            [Plot::State(state), Plot::Command(Command { step, torque1_nm, torque2_nm, force_x_n, force_y_n })]
        });
        let readings = core::mem::take(&mut self.readings_ready).into_iter().map(move |row| {
            let [bx, by, cx, cy, hx, hy] = row.values.map(|value| plotted(every, value));
            Plot::Sensors(Sensors {
                step: row.index,
                acceleration_b_x_m_s2: bx,
                acceleration_b_y_m_s2: by,
                acceleration_c_x_m_s2: cx,
                acceleration_c_y_m_s2: cy,
                head_force_x_n: hx,
                head_force_y_n: hy,
                clipped: row.flags,
            })
        });
        states.chain(readings)
    }
}
