use super::*;

fn quiet(range_m_s2: f64, resolution_m_s2: f64) -> AccelerometerSpec {
    AccelerometerSpec { range_m_s2, noise_rms_m_s2: 0.0, resolution_m_s2 }
}

#[test]
fn rounds_to_counts_and_marks_what_is_beyond_the_range() {
    let mut sensor = quiet(10.0, 0.5).sensor("test", 0, 0).unwrap();
    let cases = [(0.2, 0.0, false), (0.3, 0.5, false), (-9.9, -10.0, false), (10.1, 10.0, false), (10.3, 10.0, true)];
    for (truth, value, clipped) in cases.into_iter().chain([(-1e9, -10.0, true)]) {
        assert_eq!(sensor.read(truth), Reading { value, clipped }, "{truth}");
    }
}

#[test]
fn never_says_more_than_its_range() {
    let read = |range, resolution, truth| quiet(range, resolution).sensor("test", 0, 0).unwrap().read(truth);
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
    let spec = AccelerometerSpec { range_m_s2: 1.0, noise_rms_m_s2: 1.0, resolution_m_s2: 0.25 };
    let mut sensor = spec.sensor("test", 0, 0).unwrap();
    let readings: alloc::vec::Vec<_> = core::iter::repeat_with(|| sensor.read(0.0)).take(1000).collect();
    assert!(readings.iter().all(|reading| reading.value.abs() <= 1.0));
    assert!(readings.iter().all(|reading| !reading.clipped || reading.value.abs() == 1.0));
    // Beyond ±1.125 are 26 % of a standard normal; four standard errors are 5.5 %.
    let clipped = readings.iter().filter(|reading| reading.clipped).count();
    assert!((205..315).contains(&clipped), "{clipped}");
}

#[test]
fn noise_is_normal_and_seeded() {
    let spec = AccelerometerSpec { noise_rms_m_s2: 2.0, resolution_m_s2: 0.0, range_m_s2: 1e3 };
    let draw = |seed, stream| {
        let mut sensor = spec.sensor("test", seed, stream).unwrap();
        core::iter::repeat_with(move || sensor.read(5.0).value).take(40_000).collect::<alloc::vec::Vec<_>>()
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
    let says = |spec: RigSpec| Rig::new(&spec, 0).unwrap_err().to_string();
    let range = RigSpec { accelerometer_b: quiet(0.0, 0.5), ..RigSpec::default() };
    insta::assert_snapshot!(says(range), @"rig.accelerometer_b: `range_m_s2` is 0: it must be a positive number");
    let resolution = RigSpec { accelerometer_c: quiet(1.0, -0.5), ..RigSpec::default() };
    insta::assert_snapshot!(says(resolution), @"rig.accelerometer_c: `resolution_m_s2` is -0.5: it must be zero or a positive number");
    let coarse = RigSpec { accelerometer_c: quiet(1.0, 1.5), ..RigSpec::default() };
    insta::assert_snapshot!(says(coarse), @"rig.accelerometer_c: `resolution_m_s2` is 1.5: it must be at most the range, or no count is within it");
    let limit =
        RigSpec { exciter: ExciterSpec { force_limit_n: f64::NAN, torque_limit_nm: 1.0 }, ..RigSpec::default() };
    insta::assert_snapshot!(says(limit), @"rig.exciter: `force_limit_n` is NaN: it must be a positive number");
}

#[test]
fn exciter_knows_its_limits() {
    let exciter = ExciterSpec { force_limit_n: 10.0, torque_limit_nm: 20.0 };
    assert!(exciter.can_produce(&Load::force_n(10.0, -10.0)));
    assert!(!exciter.can_produce(&Load::force_n(0.0, -10.001)));
    assert!(exciter.can_produce(&Load::torque_nm(20.0, 0.0)));
    assert!(!exciter.can_produce(&Load::torque_nm(0.0, f64::NAN)));
}
