//! Sweeps, noise, multisines and load files as they are played.

use super::*;
use crate::rig::Load;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use nalgebra::{Complex, Normed as _};
use proptest::prelude::*;

const RATE_HZ: f64 = 1000.0;

fn along_y(ramp_s: f64, profile: Waveform) -> Result<Profile, ExcitationError> {
    let amplitude = Load::force_n(0.0, -8.0);
    Profile::new(&ExcitationSpec { amplitude, ramp_s, profile }, RATE_HZ)
}

/// The played samples over the amplitude.
fn played(profile: &Profile) -> Vec<f64> {
    (0..profile.samples()).map(|n| profile.load(n).force_n.y / -8.0).collect()
}

fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |peak, value| value.abs().max(peak))
}

fn rms(values: &[f64]) -> f64 {
    libm::sqrt(values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64)
}

/// Σ x(n) w(n) e^(−2πi f n/rate), with a Hann window: its main lobe is 4/T wide.
fn line(values: &[f64], hz: f64) -> Complex<f64> {
    let count = values.len() as f64;
    let term = |(n, value): (usize, &f64)| {
        let taper = libm::sin(PI * ((n as f64 + 0.5) / count));
        let (sine, cosine) = libm::sincos(-TAU * hz / RATE_HZ * n as f64);
        Complex::new(cosine, sine) * (value * taper * taper)
    };
    values.iter().enumerate().map(term).sum()
}

/// The mean power of lines at these frequencies.
fn power(values: &[f64], hz: impl IntoIterator<Item = f64>) -> f64 {
    let lines: Vec<f64> = hz.into_iter().map(|hz| line(values, hz).norm().powi(2)).collect();
    lines.iter().sum::<f64>() / lines.len() as f64
}

fn grid(from_hz: f64, to_hz: f64, points: u32) -> impl Iterator<Item = f64> {
    (0..points).map(move |k| from_hz + (to_hz - from_hz) * f64::from(k) / f64::from(points - 1))
}

proptest! {
    #[test]
    fn the_frequency_of_a_logarithmic_sweep_grows_as_a_power(
        from_hz in 1.0..100.0, to_hz in 1.0..100.0, at in 0.0..0.999,
    ) {
        let profile = Waveform::SweptSine { from_hz, to_hz, duration_s: 10.0, law: SweepLaw::Logarithmic };
        let profile = along_y(0.0, profile).unwrap();
        let n = (at * 9_999.0) as u64;
        let cycles = profile.phase_cycles((n + 1) as f64) - profile.phase_cycles(n as f64);
        let found_hz = RATE_HZ * (cycles - libm::floor(cycles));
        let middle_s = (n as f64 + 0.5) / RATE_HZ;
        let expected_hz: f64 = from_hz * libm::pow(to_hz / from_hz, middle_s / 10.0);
        prop_assert!((found_hz / expected_hz - 1.0).abs() < 1e-5, "{} {}", found_hz, expected_hz);
    }

    #[test]
    fn noise_has_its_peak_its_band_and_the_bits_of_its_seed(
        from_hz in 5.0..100.0_f64, width_hz in 20.0..300.0_f64, seed: u64,
    ) {
        let to_hz = from_hz + width_hz;
        let random = |seed| Waveform::Random { from_hz, to_hz, duration_s: 3.0, spectrum: None, seed };
        let profile = along_y(0.0, random(seed)).unwrap();
        let values = played(&profile);
        prop_assert_eq!(values.len(), 3000);
        prop_assert!((peak(&values) - 1.0).abs() < 1e-15);
        let factor = 1.0 / rms(&values);
        prop_assert!((2.0..6.0).contains(&factor), "peak factor {}", factor);
        let inside = power(&values, grid(from_hz + 2.0, to_hz - 2.0, 60));
        let below = power(&values, grid(0.0, from_hz - 3.0, 20));
        let above = power(&values, grid(to_hz + 3.0, 499.0, 60));
        // Lines at a distance of 3 Hz are out of the main lobe of a window of 3 s.
        prop_assert!(below.max(above) < 1e-4 * inside, "{} {} {}", below, inside, above);
        prop_assert_eq!(&along_y(0.0, random(seed)).unwrap(), &profile);
        prop_assert_ne!(played(&along_y(0.0, random(seed ^ 1)).unwrap()), values);
    }

    #[test]
    fn a_multisine_has_equal_lines_in_its_band_and_repeats_to_the_bit(
        first in 3_u32..40, lines in 1_u32..60, tenths in 5_u32..25, seed: u64, schroeder: bool,
    ) {
        let period_s = f64::from(tenths) / 10.0;
        let (from_hz, to_hz) = (f64::from(first) / period_s, f64::from(first + lines - 1) / period_s);
        let phases = if schroeder { Phases::Schroeder } else { Phases::Random };
        let profile = Waveform::Multisine { from_hz, to_hz, period_s, periods: 3, phases, seed };
        let values = played(&along_y(0.0, profile).unwrap());
        let period = values.len() / 3;
        prop_assert_eq!(period, tenths as usize * 100);
        prop_assert!(values[period..].iter().zip(&values).all(|(later, earlier)| later.to_bits() == earlier.to_bits()));
        prop_assert!((peak(&values) - 1.0).abs() < 1e-15);
        let transform = resonarm_numeric::dft::Lines::new(period, period, 0, period / 2);
        let found = transform.transform(values[..period].iter().map(|value| Complex::new(*value, 0.0)));
        let size = found[first as usize].norm();
        for (k, found) in found.iter().enumerate() {
            let expected = if (first..first + lines).contains(&(k as u32)) { size } else { 0.0 };
            prop_assert!((found.norm() - expected).abs() < 1e-9 * size, "{}", k);
        }
    }
}

/// Over 20 seeds, the power of noise is equal in ten parts of the band, within the statistical error of 20·50 lines
/// each.
#[test]
fn noise_is_flat_and_normal() {
    let mut parts = [0.0; 10];
    let (mut within, mut total) = (0, 0);
    for seed in 0..20 {
        let profile = Waveform::Random { from_hz: 50.0, to_hz: 150.0, duration_s: 4.0, spectrum: None, seed };
        let values = played(&along_y(0.0, profile).unwrap());
        let sigma = rms(&values);
        within += values.iter().filter(|value| value.abs() < sigma).count();
        total += values.len();
        for (part, sum) in parts.iter_mut().enumerate() {
            let from_hz = 50.0 + 10.0 * part as f64;
            *sum += power(&values, grid(from_hz + 0.5, from_hz + 9.5, 25)) / (sigma * sigma);
        }
    }
    let mean = parts.iter().sum::<f64>() / 10.0;
    assert!(parts.iter().all(|part| (part / mean - 1.0).abs() < 0.25), "{parts:?}");
    // 68.27 % of a normal distribution are within a standard deviation.
    assert!((within as f64 / total as f64 - 0.6827).abs() < 0.01, "{within} of {total}");
}

/// The level of a table by the formula of the standards: N dB an octave between breakpoints.
fn level(table: &[[f64; 2]], hz: f64) -> f64 {
    let above = table.iter().position(|[point_hz, _]| *point_hz >= hz).unwrap().max(1);
    let ([f1, l1], [f2, l2]) = (table[above - 1], table[above]);
    let slope_db = 10.0 * libm::log10(l2 / l1) / libm::log2(f2 / f1);
    l1 * libm::pow(10.0, 0.1 * slope_db * libm::log2(hz / f1))
}

/// Over 20 seeds, the power of noise and of bursts in ten parts of the band is that of the table, within the
/// statistical error of 20·50 lines each.
#[test]
fn noise_follows_its_spectrum() {
    let table = [[50.0, 0.01], [80.0, 0.01], [100.0, 0.16], [120.0, 0.16], [150.0, 0.02]];
    let shape = || Some(Spectrum(table.into()));
    let waveform = |bursts, seed| match bursts {
        false => Waveform::Random { from_hz: 50.0, to_hz: 150.0, duration_s: 4.0, spectrum: shape(), seed },
        true => Waveform::BurstRandom {
            from_hz: 50.0,
            to_hz: 150.0,
            burst_s: 4.0,
            period_s: 5.0,
            periods: 1,
            spectrum: shape(),
            seed,
        },
    };
    for bursts in [false, true] {
        let (mut found, mut expected) = ([0.0; 10], [0.0; 10]);
        for seed in 0..20 {
            let values = played(&along_y(0.0, waveform(bursts, seed)).unwrap());
            assert!((peak(&values) - 1.0).abs() < 1e-15);
            let values = &values[..4000];
            let sigma = rms(values);
            for (part, (found, expected)) in found.iter_mut().zip(&mut expected).enumerate() {
                let hz = || grid(50.5 + 10.0 * part as f64, 59.5 + 10.0 * part as f64, 25);
                *found += power(values, hz()) / (sigma * sigma);
                *expected += hz().map(|hz| level(&table, hz)).sum::<f64>();
            }
        }
        let scale = found.iter().sum::<f64>() / expected.iter().sum::<f64>();
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / (scale * expected) - 1.0).abs() < 0.25, "{bursts}: {found} {}", scale * expected);
        }
    }
}

/// A flat table gives the same bits as none, and only the ratios of the levels count.
#[test]
fn a_flat_spectrum_is_none() {
    let noise = |spectrum: Option<[[f64; 2]; 2]>| {
        let spectrum = spectrum.map(|table| Spectrum(table.into()));
        played(
            &along_y(0.0, Waveform::Random { from_hz: 20.0, to_hz: 90.0, duration_s: 2.0, spectrum, seed: 4 }).unwrap(),
        )
    };
    let flat = noise(None);
    assert_eq!(noise(Some([[20.0, 1.0], [90.0, 1.0]])), flat);
    let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(close(&noise(Some([[20.0, 1e-200], [90.0, 1e-200]])), &flat));
    let (small, large) = (noise(Some([[20.0, 1e-300], [90.0, 3e-300]])), noise(Some([[20.0, 1e300], [90.0, 3e300]])));
    assert!(close(&small, &large) && !close(&small, &flat));
}

#[test]
fn a_schroeder_multisine_is_flatter_than_noise() {
    let factor = |phases| {
        let profile = Waveform::Multisine { from_hz: 10.0, to_hz: 100.0, period_s: 2.0, periods: 1, phases, seed: 0 };
        1.0 / rms(&played(&along_y(0.0, profile).unwrap()))
    };
    let (schroeder, random) = (factor(Phases::Schroeder), factor(Phases::Random));
    // Peak factors: about 1.7 with Schroeder's phases, and 3 to 4 with random ones.
    assert!(schroeder < 1.9 && random > 2.3, "{schroeder} {random}");
}

#[test]
fn bursts_are_on_and_off_and_differ() {
    let profile = Waveform::BurstRandom {
        from_hz: 20.0,
        to_hz: 90.0,
        burst_s: 0.3,
        period_s: 0.5,
        periods: 4,
        spectrum: None,
        seed: 5,
    };
    let values = played(&along_y(0.1, profile).unwrap());
    assert_eq!(values.len(), 2000);
    assert!((peak(&values) - 1.0).abs() < 1e-15);
    let mut bursts = values.chunks(500);
    for period in bursts.clone() {
        assert!(period[300..].iter().all(|value| *value == 0.0) && period[0] == 0.0);
        assert!(
            rms(&period[100..200]) > 4.0 * rms(&period[..20]) && rms(&period[100..200]) > 4.0 * rms(&period[280..300])
        );
    }
    assert_ne!(bursts.next(), bursts.next());
}

/// The ends of noise and multisines are softened like those of sines.
#[test]
fn ramps_soften_the_ends() {
    let profile = Waveform::Random { from_hz: 20.0, to_hz: 90.0, duration_s: 4.0, spectrum: None, seed: 1 };
    let (soft, hard) = (played(&along_y(1.0, profile.clone()).unwrap()), played(&along_y(0.0, profile).unwrap()));
    assert_eq!(soft[1000..3000], hard[1000..3000]);
    assert!(soft[0] == 0.0 && (soft[500] - 0.5 * hard[500]).abs() < 1e-12);
}

fn file(text: &str) -> Result<Profile, ExcitationError> {
    along_y(0.0, Waveform::File { path: String::from("load.csv"), load: Some(LoadFile::parse(text).unwrap()) })
}

#[test]
fn the_peak_of_a_played_file_is_the_amplitude() {
    let values = played(&file("load_n\n1\n\n-4 # the peak\n 2e0\n").unwrap());
    assert_eq!(values, [0.25, -1.0, 0.5]);
}

#[test]
fn a_file_with_times_runs_straight_between_its_points() {
    let profile = file("time_s, load\r\n5.000, 0\r\n5.004, 2\r\n5.006, -2\r\n").unwrap();
    let expected = [0.0, 0.25, 0.5, 0.75, 1.0, 0.0, -1.0];
    let values = played(&profile);
    assert_eq!(values.len(), expected.len());
    assert!(values.iter().zip(expected).all(|(value, expected)| (value - expected).abs() < 1e-9), "{values:?}");
    assert_eq!(profile.load(7).force_n.y, 0.0);
}

#[test]
fn says_what_is_wrong_with_a_file() {
    let says = |text: &str| LoadFile::parse(text).unwrap_err().to_string();
    insta::assert_snapshot!(says("1\n2\nthree\n"), @"line 3: `three` is not a finite number");
    insta::assert_snapshot!(says("t,load\n0,1\n1,inf\n"), @"line 3: `inf` is not a finite number");
    insta::assert_snapshot!(says("1\n2,3\n"), @"line 2 has 2 columns: there must be 1, the load, as in the lines before");
    insta::assert_snapshot!(says("0,1,2\n"), @"line 1 has 3 columns: there must be 1, the load, or 2, time and load, in all lines");
    insta::assert_snapshot!(says("0,1\n0.1,2\n0.1,3\n"), @"line 3: time goes from 0.1 to 0.1 s: it must increase");
    insta::assert_snapshot!(says("# nothing\n0\n0\n"), @"it has no load other than 0: give a line with a load for each sample, or with time and load");
    insta::assert_snapshot!(says("some words"), @"it has no load other than 0: give a line with a load for each sample, or with time and load");
    insta::assert_snapshot!(file("0,1\n0.0005,2\n").unwrap_err(), @"excitation: the load file has points 0.0005 s apart, closer than the samples (0.001 s): filter it and resample it at the sample rate first");
    let unread = Waveform::File { path: String::from("load.csv"), load: None };
    insta::assert_snapshot!(along_y(0.0, unread).unwrap_err(), @"excitation: the load file was not read: it is read only with a scenario file, from that file's folder; read the scenario from a file");
}

#[test]
fn says_what_is_wrong_with_noise() {
    let says = |profile| along_y(0.0, profile).unwrap_err().to_string();
    let random = |from_hz, to_hz, duration_s| Waveform::Random { from_hz, to_hz, duration_s, spectrum: None, seed: 0 };
    insta::assert_snapshot!(says(random(10.0, 5.0, 1.0)), @"excitation: `to_hz` is 5: it must be at least `from_hz`");
    insta::assert_snapshot!(says(random(10.0, 500.0, 1.0)), @"excitation: the frequency 500 Hz is too high for the sample rate of 1000 Hz: it must be below half of that");
    insta::assert_snapshot!(says(random(10.1, 10.2, 1.0)), @"excitation: no multiple of 0.9765625 Hz is between 10.1 and 10.2 Hz: make the band wider, or `duration_s` longer");
    insta::assert_snapshot!(says(random(10.0, 20.0, 1e9)), @"excitation: `duration_s` is 1e12 samples long: it must be from 1 to 4194304");
    let multisine = |period_s, periods| Waveform::Multisine {
        from_hz: 10.0,
        to_hz: 20.0,
        period_s,
        periods,
        phases: Phases::Random,
        seed: 0,
    };
    insta::assert_snapshot!(says(multisine(0.0333, 2)), @"excitation: `period_s` is 0.0333: it must be a whole number of samples");
    insta::assert_snapshot!(says(multisine(0.04, 2)), @"excitation: no multiple of 25 Hz is between 10 and 20 Hz: make the band wider, or `period_s` longer");
    insta::assert_snapshot!(says(multisine(1.0, 0)), @"excitation: `periods` is 0: it must be from 1 to 1000000");
    let bursts = |burst_s, period_s| Waveform::BurstRandom {
        from_hz: 10.0,
        to_hz: 20.0,
        burst_s,
        period_s,
        periods: 2,
        spectrum: None,
        seed: 0,
    };
    insta::assert_snapshot!(says(bursts(2.0, 1.0)), @"excitation: `period_s` is 1: it must be at least `burst_s`");
}

#[test]
fn says_what_is_wrong_with_a_spectrum() {
    let says = |table: &[[f64; 2]]| {
        let spectrum = Some(Spectrum(table.into()));
        let random = Waveform::Random { from_hz: 10.0, to_hz: 20.0, duration_s: 1.0, spectrum, seed: 0 };
        along_y(0.0, random).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says(&[]), @"excitation: the number of breakpoints of `spectrum` is 0: it must be from 2 to 1000, each `[hz, level]`");
    insta::assert_snapshot!(says(&[[10.0, 1.0]]), @"excitation: the number of breakpoints of `spectrum` is 1: it must be from 2 to 1000, each `[hz, level]`");
    insta::assert_snapshot!(says(&[[10.0, 1.0]; 1001]), @"excitation: the number of breakpoints of `spectrum` is 1001: it must be from 2 to 1000, each `[hz, level]`");
    insta::assert_snapshot!(says(&[[10.0, 1.0], [20.0, 0.0]]), @"excitation: the level of `spectrum` at 20 Hz is 0: it must be a positive number");
    insta::assert_snapshot!(says(&[[10.0, f64::NAN], [20.0, 1.0]]), @"excitation: the level of `spectrum` at 10 Hz is NaN: it must be a positive number");
    insta::assert_snapshot!(says(&[[10.0, 1.0], [15.0, 1.0], [15.0, 2.0], [20.0, 1.0]]), @"excitation: `spectrum` goes from 15 to 15 Hz: its frequencies must increase");
    insta::assert_snapshot!(says(&[[10.0, 1.0], [f64::NAN, 1.0], [20.0, 1.0]]), @"excitation: `spectrum` goes from 10 to NaN Hz: its frequencies must increase");
    insta::assert_snapshot!(says(&[[5.0, 1.0], [20.0, 1.0]]), @"excitation: `from_hz` is 10, but the breakpoint of `spectrum` there is at 5 Hz: they must be equal");
    insta::assert_snapshot!(says(&[[10.0, 1.0], [19.0, 1.0]]), @"excitation: `to_hz` is 20, but the breakpoint of `spectrum` there is at 19 Hz: they must be equal");
}

#[test]
fn signals_read_from_toml() {
    let reads = |profile: &str| {
        let text = alloc::format!("amplitude = {{ exciter_x = 10 }}\nprofile = {{ {profile} }}");
        toml::from_str::<ExcitationSpec>(&text).unwrap().profile
    };
    assert_eq!(
        reads("waveform = 'swept-sine', from_hz = 1, to_hz = 2, duration_s = 3, law = 'logarithmic'"),
        Waveform::SweptSine { from_hz: 1.0, to_hz: 2.0, duration_s: 3.0, law: SweepLaw::Logarithmic }
    );
    assert_eq!(
        reads("waveform = 'random', from_hz = 1, to_hz = 2, duration_s = 3, seed = '0xffffffffffffffff'"),
        Waveform::Random { from_hz: 1.0, to_hz: 2.0, duration_s: 3.0, spectrum: None, seed: u64::MAX }
    );
    let Waveform::Random { spectrum, .. } =
        reads("waveform = 'random', from_hz = 1, to_hz = 2, duration_s = 3, spectrum = [[1, 1], [2, 0.5]]")
    else {
        panic!("no noise")
    };
    assert_eq!(spectrum, Some(Spectrum([[1.0, 1.0], [2.0, 0.5]].into())));
    assert_eq!(
        reads("waveform = 'multisine', from_hz = 1, to_hz = 2, period_s = 3, periods = 4, phases = 'schroeder'"),
        Waveform::Multisine { from_hz: 1.0, to_hz: 2.0, period_s: 3.0, periods: 4, phases: Phases::Schroeder, seed: 0 }
    );
    assert_eq!(reads("waveform = 'file', path = 'a.csv'"), Waveform::File { path: String::from("a.csv"), load: None });
}
