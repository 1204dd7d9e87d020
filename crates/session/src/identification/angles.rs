//! The joints' angles over time from the accelerometers in a recording.

use super::IdentificationError;
use resonarm_bench::identify::{AngleHistory, AngleSettings, CHANNELS, IdentifyError, Integration, joint_angles};
use resonarm_bench::plant::TestedAssembly;
use resonarm_bench::rig::InstrumentName;
use resonarm_files::recording::Recording;
use resonarm_scenario::Scenario;

/// The default lower corner over the lowest natural frequency: at half of the natural frequency the gain is 0.9998.
const CORNER_PART: f64 = 0.25;
/// A residual that exceeds both limits, over the noise and over the displacements, contradicts rigid links. The effect
/// of finite mean angles is smaller.
const CONTRADICTION: [f64; 2] = [3.0, 0.02];

/// The angles computed from a recording.
#[derive(Clone, Debug)]
pub struct RecordedAngles {
    /// The angles from the beginning of the run, with their deviations.
    pub history: AngleHistory,
    /// The lower corner, Hz.
    pub from_hz: f64,
    /// Samples a second, Hz.
    rate_hz: f64,
    /// The sample of the first reading.
    first_sample: u64,
    /// Delay of the readings, samples.
    delay: f64,
}

/// The accelerations in a recording.
struct Readings {
    accelerations_m_s2: Vec<[f64; CHANNELS]>,
    /// Index of the first sample in it.
    first_sample: u64,
}

impl RecordedAngles {
    /// Integrates the accelerations of a recording of `scenario` twice, above a corner frequency, Hz; the default is a
    /// quarter of the structure's lowest natural frequency.
    ///
    /// # Errors
    /// [`IdentificationError`] if the recording can't be read, a reading is clipped, or the angles can't be found.
    pub fn new(
        recording: &Recording,
        scenario: &Scenario,
        integration: Integration,
        from_hz: Option<f64>,
    ) -> Result<RecordedAngles, IdentificationError> {
        let rate_hz = 1.0 / recording.origin().dt_s;
        let tested = scenario.under_test()?;
        let links_m = tested.measured_links_m().ok_or(IdentificationError::NoAngles)?;
        let first_hz = tested.assembly.modes().first().map_or(0.0, |mode| mode.frequency_hz);
        let Readings { accelerations_m_s2, first_sample } = read(recording)?;
        let from_hz = from_hz.unwrap_or(CORNER_PART * first_hz);
        let starts_at_rest = starts_at_rest(scenario, &tested, first_sample);
        let settings = AngleSettings { integration, from_hz, starts_at_rest };
        let mut history = joint_angles(&links_m, rate_hz, &scenario.rig, &accelerations_m_s2, settings)?;
        let delay = recording.origin().reading_delay_samples;
        // The first readings belong to the time before the run.
        let before_run = (libm::ceil(delay) as usize).saturating_sub(first_sample as usize + history.first);
        history.leave_out(before_run);
        Ok(RecordedAngles { history, from_hz, rate_hz, first_sample, delay })
    }

    /// Returns the time of a row, s: that of the readings, earlier than their samples by the converters' delay.
    pub fn time_s(&self, row: usize) -> f64 {
        (self.first_sample as f64 + (self.history.first + row) as f64 - self.delay) / self.rate_hz
    }

    /// Returns the ratio of the points' displacement along the links to that across them, if no angles explain it. An
    /// accelerometer then has a fault, another sensitivity than stated, or a filter.
    pub fn contradiction(&self) -> Option<f64> {
        let residual = &self.history.residual;
        // Ideal instruments have no noise to compare with. The residual over the displacement then decides alone.
        let exceeds = residual.over_noise.unwrap_or(f64::INFINITY) > CONTRADICTION[0];
        Some(residual.over_displacement).filter(|over| exceeds && *over > CONTRADICTION[1])
    }
}

/// Says whether the scenario gives an accelerometer a fault.
pub fn has_faulty_accelerometer(scenario: &Scenario) -> bool {
    scenario.rig.faults.iter().any(|fault| fault.instrument != InstrumentName::HEAD)
}

/// Returns the readings from sample 1 on: those of sample 0 only show the initial state.
fn read(recording: &Recording) -> Result<Readings, IdentificationError> {
    let mut readings = Readings { accelerations_m_s2: Vec::new(), first_sample: 0 };
    let mut clipped = 0;
    super::check_readings(recording)?;
    for sample in recording.samples()? {
        let sample = sample?;
        if sample.sample == 0 {
            continue;
        }
        if readings.accelerations_m_s2.is_empty() {
            readings.first_sample = sample.sample;
        }
        // The head's force is not used.
        let marks = (sample.clipped.acceleration_b, sample.clipped.acceleration_c);
        clipped += usize::from(marks != Default::default());
        let [bx, by] = sample.acceleration_b_m_s2;
        let [cx, cy] = sample.acceleration_c_m_s2;
        readings.accelerations_m_s2.push([bx, by, cx, cy]);
    }
    if clipped > 0 {
        return Err(IdentifyError::Clipped { samples: clipped }.into());
    }
    Ok(readings)
}

/// Says whether nothing moved before the first reading, and the accelerometers read zero then.
fn starts_at_rest(scenario: &Scenario, tested: &TestedAssembly, first_sample: u64) -> bool {
    let reads_gravity = [&scenario.rig.sensors.b, &scenario.rig.sensors.c]
        .iter()
        .any(|sensor| sensor.gravity_m_s2.is_some_and(|gravity| gravity != 0.0));
    first_sample == 1 && tested.initial.iter().all(|value| *value == 0.0) && !reads_gravity
}
