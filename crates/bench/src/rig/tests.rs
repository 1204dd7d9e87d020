use super::chain::Instrument;
use super::*;
use crate::rig::Load;
use crate::structure::OUTPUTS;
use alloc::string::{String, ToString};
use resonarm_protocol::{CommandCheck, Limit};

const RATE_HZ: f64 = 1000.0;

fn quiet(range: f64, resolution: f64) -> SensorSpec {
    SensorSpec { range, noise_rms: Some(0.0), resolution: Some(resolution), ..SensorSpec::of(Measured::Acceleration) }
}

/// Practically without noise, counts or range: readings equal the input.
fn ideal() -> SensorSpec {
    quiet(1e6, 0.0)
}

/// The default rig with other sensors.
fn with_sensors(change: impl FnOnce(&mut SensorSpecs)) -> RigSpec {
    let mut rig = RigSpec::default();
    change(&mut rig.sensors);
    rig
}

fn instrument(spec: &SensorSpec) -> Instrument {
    Instrument::new(spec, &PLANE, RATE_HZ, 0, 0)
}

impl Instrument {
    fn read_x(&mut self, truth: f64) -> Reading {
        self.read(0, [truth, 0.0, 0.0])[0]
    }

    fn values(&mut self, truth: [f64; 2]) -> [f64; 2] {
        let [x, y, _] = self.read(0, super::truth(&truth)).map(|reading| reading.value);
        [x, y]
    }
}

#[test]
fn rounds_to_counts_and_marks_what_is_beyond_the_range() {
    let mut sensor = instrument(&quiet(10.0, 0.5));
    let cases = [(0.2, 0.0, false), (0.3, 0.5, false), (-9.9, -10.0, false), (10.1, 10.0, false), (10.3, 10.0, true)];
    for (truth, value, clipped) in cases.into_iter().chain([(-1e9, -10.0, true)]) {
        assert_eq!(sensor.read_x(truth), Reading { value, clipped }, "{truth}");
    }
}

#[test]
fn never_reads_more_than_its_range() {
    let read = |range, resolution, truth| instrument(&quiet(range, resolution)).read_x(truth);
    assert_eq!(read(10.3, 0.5, 11.0), Reading { value: 10.0, clipped: true });
    assert_eq!(read(10.3, 0.5, 10.2), Reading { value: 10.0, clipped: false });
    assert_eq!(read(10.3, 0.5, -10.3), Reading { value: -10.0, clipped: true });
    // A whole number of counts, though neither number is exact in binary.
    for (range, resolution) in [(1600.0, 0.05), (650.0, 0.02), (0.3, 0.1), (1e-3, 1e-6)] {
        let Reading { value, clipped } = read(range, resolution, 2.0 * range);
        assert!(clipped && (value - range).abs() < 1e-9 * range, "{range} {resolution}: {value}");
    }
    assert_eq!(read(10.3, 0.0, 11.0), Reading { value: 10.3, clipped: true });
}

#[test]
fn noise_that_goes_beyond_the_range_is_clipped() {
    let spec = SensorSpec { noise_rms: Some(1.0), ..quiet(1.0, 0.25) };
    let mut sensor = instrument(&spec);
    let readings: alloc::vec::Vec<_> = core::iter::repeat_with(|| sensor.read_x(0.0)).take(1000).collect();
    assert!(readings.iter().all(|reading| reading.value.abs() <= 1.0));
    assert!(readings.iter().all(|reading| !reading.clipped || reading.value.abs() == 1.0));
    // Beyond ±1.125 are 26 % of a standard normal; four standard errors are 5.5 %.
    let clipped = readings.iter().filter(|reading| reading.clipped).count();
    assert!((205..315).contains(&clipped), "{clipped}");
}

#[test]
fn noise_is_normal_and_seeded() {
    let spec = SensorSpec { noise_rms: Some(2.0), ..quiet(1e3, 0.0) };
    let draw = |seed, stream| {
        let mut sensor = Instrument::new(&spec, &PLANE, RATE_HZ, seed, stream);
        core::iter::repeat_with(move || sensor.read_x(5.0).value).take(40_000).collect::<alloc::vec::Vec<_>>()
    };
    let sample = draw(7, 1);
    assert_eq!(sample, draw(7, 1));
    assert_ne!(sample, draw(7, 2));
    assert_ne!(sample, draw(8, 1));
    let n = sample.len() as f64;
    let mean = sample.iter().sum::<f64>() / n;
    let moment = |p: i32| sample.iter().map(|x| ((x - mean) / 2.0).powi(p)).sum::<f64>() / n;
    // Four standard errors: of the mean 2/√n, of the second moment √(2/n), of the fourth √(96/n).
    assert!((mean - 5.0).abs() < 4.0 * 2.0 / n.sqrt());
    assert!((moment(2) - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
    assert!((moment(4) - 3.0).abs() < 4.0 * (96.0 / n).sqrt());
}

#[test]
fn says_what_is_wrong_with_an_instrument() {
    let says = |spec: RigSpec| Rig::new(&spec, &OUTPUTS, RATE_HZ, 0).unwrap_err().to_string();
    let range = with_sensors(|sensors| sensors.b = quiet(0.0, 0.5));
    insta::assert_snapshot!(says(range), @"rig.sensors.b: `range_m_s2` is 0: it must be a positive number");
    let resolution = with_sensors(|sensors| sensors.c = quiet(1.0, -0.5));
    insta::assert_snapshot!(says(resolution), @"rig.sensors.c: `resolution_m_s2` is -0.5: it must be zero or a positive number");
    let coarse = with_sensors(|sensors| sensors.c = quiet(1.0, 1.5));
    insta::assert_snapshot!(says(coarse), @"rig.sensors.c: `resolution_m_s2` is 1.5: it must be at most the range, or no count is within it");
    let limit = RigSpec {
        exciter: ExciterSpec { force_limit_n: f64::NAN, torque_limit_nm: 1.0, at: None },
        ..RigSpec::default()
    };
    insta::assert_snapshot!(says(limit), @"rig.exciter: `force_limit_n` is NaN: it must be a positive number");
}

#[test]
fn exciter_knows_its_limits() {
    let exciter = ExciterSpec { force_limit_n: 10.0, torque_limit_nm: 20.0, at: None };
    assert!(exciter.can_produce(&Load::force_n(10.0, -10.0)));
    assert!(!exciter.can_produce(&Load::force_n(0.0, -10.001)));
    assert!(exciter.can_produce(&Load::torque_nm(20.0, 0.0)));
    assert!(!exciter.can_produce(&Load::torque_nm(0.0, f64::NAN)));
}

#[test]
fn says_what_is_wrong_with_the_limits_of_the_gate() {
    let says = |gate: &str, shaker| {
        let rig = RigSpec { gate: toml::from_str(gate).unwrap(), shaker, ..RigSpec::default() };
        Rig::new(&rig, &OUTPUTS, RATE_HZ, 0).map_or_else(|error| error.to_string(), |_| String::from("fine"))
    };
    insta::assert_snapshot!(says("force_rate_limit_n_per_s = -1.0", None), @"rig.gate: `force_rate_limit_n_per_s` is -1: it must be a positive number");
    insta::assert_snapshot!(says("torque_rate_limit_nm_per_s = 0.0", None), @"rig.gate: `torque_rate_limit_nm_per_s` is 0: it must be a positive number");
    insta::assert_snapshot!(says("travel_limit_m = nan", None), @"rig.gate: `travel_limit_m` is NaN: it must be a positive number");
    insta::assert_snapshot!(says("travel_limit_m = inf", None), @"rig.gate: `travel_limit_m` is inf: it must be a positive number");
    let shaker = Some(shaker());
    insta::assert_snapshot!(says("torque_rate_limit_nm_per_s = 5.0", shaker), @"rig.gate: `torque_rate_limit_nm_per_s` is 5: it must be left out with a shaker, which exerts no torque");
    insta::assert_snapshot!(says("travel_limit_m = 0.02", shaker), @"rig.gate: `travel_limit_m` is 0.02: it must be below `rig.shaker.stroke_m`, at which the shaker trips");
    let all = "force_rate_limit_n_per_s = 1.0\ntravel_limit_m = 0.019";
    assert_eq!([says(all, shaker), says(all, None), says("", shaker)], ["fine"; 3]);
}

fn shaker() -> ShakerSpec {
    ShakerSpec {
        direction_deg: 60.0,
        amplifier: Amplifier::Current,
        moving_mass_kg: 0.2,
        stiffness_n_m: 5e3,
        damping_n_s_m: 5.0,
        force_factor_n_a: 20.0,
        resistance_ohm: 2.0,
        inductance_h: 3e-4,
        stroke_m: 0.02,
        current_limit_a: 15.0,
        voltage_limit_v: 60.0,
    }
}

#[test]
fn the_gate_checks_range_change_and_travel() {
    let exciter = Exciter::Ideal(ExciterSpec { force_limit_n: 10.0, torque_limit_nm: 20.0, at: None });
    let limits = GateSpec {
        force_rate_limit_n_per_s: Some(500.0),
        torque_rate_limit_nm_per_s: Some(250.0),
        travel_limit_m: Some(0.25),
    };
    let (from, within) = (Load::force_n(1.0, -2.0), Limit::Within);
    let check = |limits: GateSpec, travel_m, to| limits.command_check(&exciter, 1000.0, travel_m, [&from, &to]);
    // 3 N along x and 4 N along y at 0.5 N a sample period.
    let force = check(limits, Some(0.25), Load::force_n(-2.0, 2.0));
    assert_eq!(force, CommandCheck { range: within, change_periods: 8.0, travel: within });
    // The force goes: 2 N in 4 periods. The torque comes: 3 N·m in 12.
    let torque = check(limits, Some(0.250_001), Load::torque_nm(1.0, -3.0));
    assert_eq!(torque, CommandCheck { range: within, change_periods: 12.0, travel: Limit::Beyond });
    assert_eq!(check(limits, Some(0.0), Load::force_n(10.001, 0.0)).range, Limit::Beyond);
    assert_eq!(check(limits, Some(f64::NAN), from).travel, Limit::Beyond);
    // A travel that nobody measured is not within a limit.
    assert_eq!(check(limits, None, from).travel, Limit::Beyond);
    let free = check(GateSpec::default(), Some(1e9), Load::force_n(-10.0, 10.0));
    assert_eq!(free, CommandCheck { range: within, change_periods: 0.0, travel: within });

    // From one torque to another: 3 N·m at joint 1, 2 N·m at joint 2.
    let turned = [Load::torque_nm(2.0, 5.0), Load::torque_nm(-1.0, 3.0)];
    let torques = limits.command_check(&exciter, 1000.0, Some(0.0), [&turned[0], &turned[1]]);
    assert_eq!(torques.change_periods, 12.0);

    // Along the shaker, in any direction.
    let [held, load] = [-1.0, 3.0].map(|force_n| Load::planar([0.0; 2], (shaker().direction() * force_n).into()));
    let along = limits.command_check(&Exciter::Shaker(shaker()), 1000.0, Some(0.0), [&held, &load]);
    assert!((along.change_periods - 8.0).abs() < 1e-12, "{along:?}");
}

#[test]
fn an_axis_reads_gravity_its_share_of_the_other_and_its_gain() {
    let spec = SensorSpec { gravity_m_s2: Some(10.0), transverse: Some(0.05), gain: Some(1.5), ..ideal() };
    let [x, y] = instrument(&spec).values([100.0, 30.0]);
    // 1.5 (100 + 0.05 (30 + 10)), 1.5 (30 + 10 + 0.05 · 100)
    assert!((x - 153.0).abs() < 1e-12 && (y - 67.5).abs() < 1e-12, "{x} {y}");
}

#[test]
fn a_delay_is_whole_samples_and_begins_with_rest() {
    let mut late = instrument(&SensorSpec { delay_samples: Some(3), gravity_m_s2: Some(9.0), ..ideal() });
    let said: alloc::vec::Vec<_> = (1..=8).map(|k| late.values([f64::from(k), f64::from(k)])).collect();
    let y = said.iter().map(|[_, y]| *y);
    assert!(y.eq([9.0, 9.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0]), "{said:?}");
    assert!(said.iter().map(|[x, _]| *x).eq([0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), "{said:?}");
}

/// A high-pass takes gravity away, from the first sample on, and a slow vibration with it; the low-pass is half a power
/// at its corner.
#[test]
fn filters_settle_on_rest_and_have_their_corners() {
    let mut blocked = instrument(&SensorSpec { gravity_m_s2: Some(9.81), highpass_hz: Some(0.5), ..ideal() });
    for _ in 0..100 {
        assert!(blocked.values([0.0, 0.0])[1].abs() < 1e-10);
    }
    let peak = |spec: SensorSpec, frequency_hz: f64| {
        let mut instrument = instrument(&spec);
        let sine = |n: u32| libm::sin(core::f64::consts::TAU * frequency_hz / RATE_HZ * f64::from(n));
        (0..8000)
            .map(|n| (n, instrument.read_x(sine(n)).value))
            .filter(|(n, _)| *n >= 4000)
            .fold(0.0_f64, |peak, (_, value)| peak.max(value.abs()))
    };
    let high = peak(SensorSpec { highpass_hz: Some(2.0), ..ideal() }, 2.0);
    let low = peak(SensorSpec { lowpass_hz: Some(20.0), ..ideal() }, 20.0);
    assert!((high - 0.5_f64.sqrt()).abs() < 1e-3 && (low - 0.5_f64.sqrt()).abs() < 3e-3, "{high} {low}");
}

/// Filters smooth values clipped by the sensor, so no reading is marked. Readings clipped by the converter are.
#[test]
fn only_the_converter_marks_what_it_clips() {
    let mut sensor = instrument(&SensorSpec { sensor_range: Some(5.0), ..quiet(10.0, 0.0) });
    assert_eq!(sensor.read_x(-80.0), Reading { value: -5.0, clipped: false });
    let mut converter = instrument(&SensorSpec { sensor_range: Some(50.0), ..quiet(10.0, 0.0) });
    assert_eq!(converter.read_x(-80.0), Reading { value: -10.0, clipped: true });
}

#[test]
fn a_density_of_noise_is_that_rms_over_half_the_rate() {
    let density = |rate_hz| {
        let density = SensorSpec { noise_rms: None, noise_density: Some(0.25), ..ideal() };
        Instrument::new(&density, &PLANE, rate_hz, 3, 1).values([0.0; 2])
    };
    let rms = SensorSpec { noise_rms: Some(0.25 * libm::sqrt(400.0)), ..ideal() };
    assert_eq!(density(800.0), Instrument::new(&rms, &PLANE, 800.0, 3, 1).values([0.0; 2]));
    assert_ne!(density(800.0), density(1000.0));
}

#[test]
fn bits_count_from_one_end_of_the_range_to_the_other() {
    let spec = SensorSpec { resolution: None, bits: Some(3), ..quiet(6.0, 0.0) };
    let mut converter = instrument(&spec);
    // 7 counts: −6, −4, −2, 0, 2, 4, 6.
    let said = [0.9, 1.1, -4.9, -5.1, 6.9].map(|truth| converter.read_x(truth).value);
    assert_eq!(said, [0.0, 2.0, -4.0, -6.0, 6.0]);
    assert!(converter.read_x(7.1).clipped && !converter.read_x(6.9).clipped);
    // 24 bits over ±1600 m/s².
    let mut fine = instrument(&SensorSpec { range: 1600.0, bits: Some(24), ..spec });
    assert!((fine.read_x(1.0).value - 1.0).abs() <= 0.5 * 1600.0 / 8_388_607.0);
}

#[test]
fn one_form_of_noise_or_counts_replaces_the_default_of_the_other() {
    let read = |text: &str| toml::from_str::<RigSpec>(text).unwrap();
    let rig = read("[sensors.b]\nnoise_density_m_s2_per_sqrt_hz = 1e-3\nbits = 16\n[head]\nbits = 24");
    assert_eq!((rig.sensors.b.noise_rms, rig.sensors.b.resolution), (None, None));
    assert_eq!((rig.head.noise_rms, rig.head.resolution), (Some(0.01), None));
    assert_eq!(rig.sensors.c, SensorSpec::of(Measured::Acceleration));
    assert_eq!(read(&toml::to_string(&rig).unwrap()), rig);
}

#[test]
fn says_what_is_wrong_with_a_chain() {
    let says = |keys: &str| {
        let rig = toml::from_str(&alloc::format!("[sensors.b]\n{keys}")).unwrap();
        Rig::new(&rig, &OUTPUTS, RATE_HZ, 0).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says("noise_rms_m_s2 = 0.1\nnoise_density_m_s2_per_sqrt_hz = 0.1"), @"rig.sensors.b: `noise_rms_m_s2` and `noise_density_m_s2_per_sqrt_hz` state the same: leave one out");
    insta::assert_snapshot!(says("resolution_m_s2 = 0.1\nbits = 12"), @"rig.sensors.b: `resolution_m_s2` and `bits` state the same: leave one out");
    insta::assert_snapshot!(says("bits = 1"), @"rig.sensors.b: `bits` is 1: it must be from 2 to 48");
    insta::assert_snapshot!(says("gravity_m_s2 = -9.81"), @"rig.sensors.b: `gravity_m_s2` is -9.81: it must be zero or a positive number");
    insta::assert_snapshot!(says("transverse = 1"), @"rig.sensors.b: `transverse` is 1: it must be above -1 and below 1");
    insta::assert_snapshot!(says("gain = 0"), @"rig.sensors.b: `gain` is 0: it must be a number from -10 to 10, and not 0");
    insta::assert_snapshot!(says("sensor_range_m_s2 = nan"), @"rig.sensors.b: `sensor_range_m_s2` is NaN: it must be a positive number");
    insta::assert_snapshot!(says("lowpass_hz = 500"), @"rig.sensors.b: `lowpass_hz` is 500: it must be above 0 and below half the sample rate");
    insta::assert_snapshot!(says("highpass_hz = 30\nlowpass_hz = 20"), @"rig.sensors.b: `highpass_hz` is 30: it must be below `lowpass_hz`, or nothing passes");
    insta::assert_snapshot!(says("delay_samples = 1001"), @"rig.sensors.b: `delay_samples` is 1001: it must be at most 1000");
}
