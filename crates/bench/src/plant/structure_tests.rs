//! Structures behind the trait.

use super::tests::{ANGLES_DEG, SHAKER, plant, preset, shaken};
use super::*;
use crate::rig::{Amplifier, Converter, ShakerSpec};
use crate::structure::Channel;
use alloc::vec;
use alloc::vec::Vec;

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|number| number.to_bits()).collect()
}

fn saved(structure: &dyn Structure) -> Vec<f64> {
    let mut saved = vec![0.0; structure.saved_len()];
    structure.save(&mut saved);
    saved
}

#[test]
fn a_saved_chain_continues_with_the_same_bits() {
    let voltage = ShakerSpec { amplifier: Amplifier::Voltage, ..SHAKER };
    for (shaker, states) in [(None, 4), (Some(SHAKER), 5), (Some(voltage), 5)] {
        for converter in Converter::ALL {
            let mut spec = shaken(SHAKER);
            (spec.rig.shaker, spec.rig.converter) = (shaker, converter);
            let load = |n: u64| Load::force_n(10.0 * libm::sin(0.14 * n as f64), 0.0);
            let mut plant = plant(&spec);
            (0..37).for_each(|n| plant.advance(&load(n)).unwrap());
            assert_eq!(plant.structure().states().len(), states);
            let mut again = self::plant(&spec).at(37, &saved(plant.structure())).unwrap();
            for n in 37..60 {
                assert_eq!(
                    bits(&saved(again.structure())),
                    bits(&saved(plant.structure())),
                    "{shaker:?}, {converter:?}"
                );
                plant.advance(&load(n)).unwrap();
                again.advance(&load(n)).unwrap();
            }
        }
    }
}

/// Filters, delays, faults that act, have acted or are still to act, clipped and stuck readings.
#[test]
fn a_saved_plant_reads_on_with_the_same_bits() {
    let spec = PlantSpec { rig: toml::from_str(RIG).unwrap(), ..shaken(SHAKER) };
    let load = |n: u64| Load::force_n(40.0 * libm::sin(0.14 * n as f64), 0.0);
    let mut plant = plant(&spec);
    let mut clipped = false;
    for n in 0..260 {
        let mut again = self::plant(&spec).restored(n, &plant.save()).unwrap();
        let (mut ahead, mut n) = (plant.clone(), n);
        for _ in 0..12 {
            assert_eq!(again.measure(), ahead.measure(), "sample {n}");
            again.advance(&load(n)).unwrap();
            ahead.advance(&load(n)).unwrap();
            n += 1;
        }
        assert_eq!(bits(&again.save()), bits(&ahead.save()));
        clipped |= plant.measure().readings().iter().any(|reading| reading.clipped);
        plant.advance(&load(plant.sample())).unwrap();
    }
    assert!(clipped);
    let other = Plant::new(&shaken(SHAKER), &preset(ANGLES_DEG)).unwrap().restored(260, &plant.save()).unwrap_err();
    insta::assert_snapshot!(other, @"a saved state of 84 numbers: the instruments of this plant have gathered more or fewer");
}

const RIG: &str = "converter = 'sinc3'
sensors.b = { highpass_hz = 1.0, lowpass_hz = 200.0, delay_samples = 5, range_m_s2 = 1.0 }
sensors.c = { lowpass_hz = 300.0, transverse = 0.02 }
head = { highpass_hz = 0.5, delay_samples = 3 }
[[faults]]
instrument = 'c'
kind = 'noise'
rms_m_s2 = 0.3
from_s = 0.05
to_s = 0.15
[[faults]]
instrument = 'head'
kind = 'stuck'
axis = 'x'
from_s = 0.1
to_s = 0.2
";

#[test]
fn names_its_channels_with_their_units() {
    let names =
        |channels: &[Channel]| channels.iter().map(|channel| channel.name.as_str()).collect::<Vec<_>>().join(" ");
    let plant = plant(&shaken(SHAKER));
    let structure = plant.structure();
    assert_eq!(names(&structure.inputs().channels()), "torque1_nm torque2_nm force_x_n force_y_n");
    assert_eq!(names(structure.states()), "alpha1_rad alpha2_rad alpha1_dot_rad_s alpha2_dot_rad_s coil_current_a");
    assert_eq!(
        names(structure.outputs()),
        "head_force_x_n head_force_y_n acceleration_b_x_m_s2 acceleration_b_y_m_s2 acceleration_c_x_m_s2 \
         acceleration_c_y_m_s2"
    );
}

#[test]
fn says_what_is_not_a_state_of_the_structure() {
    let plant = plant(&shaken(SHAKER));
    let says = |saved: &[f64]| plant.clone().at(7, saved).unwrap_err().to_string();
    insta::assert_snapshot!(says(&[0.0; 4]), @"sample 7: a saved state of 4 finite numbers: the structure has 5, or 41 with its converters");
    insta::assert_snapshot!(says(&[0.0, 0.0, f64::NAN, 0.0, 0.0]), @"sample 7: a saved state of 2 finite numbers: the structure has 5, or 41 with its converters");
}

/// A mass of 2 kg on a spring along x, driven by the force alone; the rest of the outputs is zero.
#[derive(Clone, Debug)]
struct Mass {
    inputs: LoadSet,
    channels: [Vec<Channel>; 2],
    state: [f64; 2],
    force_n: f64,
}

const MASS_KG: f64 = 2.0;
const STIFFNESS_N_M: f64 = 800.0;
const PERIOD_S: f64 = 1e-3;

impl Structure for Mass {
    fn inputs(&self) -> LoadSet {
        self.inputs
    }

    fn outputs(&self) -> &[Channel] {
        &self.channels[0]
    }

    fn states(&self) -> &[Channel] {
        &self.channels[1]
    }

    fn saved_len(&self) -> usize {
        2
    }

    /// Exactly: x about the deflection under the force turns with ω.
    fn advance(&mut self, _time_s: f64, load: &Load) -> Result<(), StructureError> {
        let force_n = load.force_n.x;
        let (omega, rest) = (libm::sqrt(STIFFNESS_N_M / MASS_KG), force_n / STIFFNESS_N_M);
        let (sine, cosine) = libm::sincos(omega * PERIOD_S);
        let [x, v] = [self.state[0] - rest, self.state[1] / omega];
        self.state = [rest + x * cosine + v * sine, omega * (v * cosine - x * sine)];
        self.force_n = force_n;
        Ok(())
    }

    fn sense(&self, outputs: &mut [f64]) {
        let acceleration = (self.force_n - STIFFNESS_N_M * self.state[0]) / MASS_KG;
        outputs.copy_from_slice(&[self.force_n, 0.0, 0.0, 0.0, acceleration, 0.0]);
    }

    fn save(&self, saved: &mut [f64]) {
        saved.copy_from_slice(&self.state);
    }

    fn restore(&mut self, saved: &[f64]) -> Result<(), StructureError> {
        self.state = saved.try_into().map_err(|_| StructureError::Saved { got: saved.len(), states: 2, all: 2 })?;
        Ok(())
    }

    fn travel_m(&self) -> f64 {
        self.state[0].abs()
    }

    fn boxed_clone(&self) -> Box<dyn Structure> {
        Box::new(self.clone())
    }
}

/// Under a held force the mass swings between 0 and twice the deflection: x = F/k (1 − cos ωt), and the accelerometer
/// of the bench reads F/m cos ωt.
#[test]
fn any_structure_makes_a_plant() {
    let spec = super::tests::ideal_rig();
    let channels = [OUTPUTS.to_vec(), crate::structure::STATES[..2].to_vec()];
    let mass = Mass { inputs: LoadSet::NATIVE, channels, state: [0.0; 2], force_n: 0.0 };
    let rig = || Rig::new(&spec, &OUTPUTS, 1000.0, 1).unwrap();
    let mut other = mass.clone();
    other.channels[0].swap(0, 2);
    insta::assert_snapshot!(Plant::of(Box::new(other), rig(), 1000.0).unwrap_err(), @"the structure has 4 inputs, 6 outputs and 2 states: it must have the 4 loads and the 6 outputs of every rig, in this order, before any others, and at most 97 states");
    let mut plant = Plant::of(Box::new(mass), rig(), 1000.0).unwrap();
    let omega = libm::sqrt(STIFFNESS_N_M / MASS_KG);
    for sample in 1..2000 {
        plant.advance(&Load::force_n(12.0, 0.0)).unwrap();
        let expected = 6.0 * libm::cos(omega * plant.time_s());
        let reading = plant.measure();
        assert!((reading.acceleration_c_m_s2[0].value - expected).abs() < 1e-9, "sample {sample}");
        assert_eq!((reading.sample, reading.head_force_n[0].value), (sample, 12.0));
    }
    assert!(plant.travel_m() <= 0.03 && plant.clone().travel_m() == plant.travel_m());
}
