//! `plot`: channels of a recording over time, their spectra and distributions.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{complaint, document, resonarm};

/// A mode of 20 Hz whose tip is pushed at random.
const SCENARIO: &str = "[structure]
kind = 'modal'
modes = [{ frequency_hz = 20.0, damping_ratio = 0.02, shape = { 'tip.x' = 1.0, 'mid.x' = 0.5 } }]
[rig.exciter]
at = 'tip.x'
[rig.sensors.b]
at = 'mid'
[rig.sensors.c]
at = 'tip'
[excitation]
amplitude = { exciter_x = 20.0 }
profile = { waveform = 'random', from_hz = 5, to_hz = 80, duration_s = 20, seed = 3 }
";

fn recorded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("random.toml"), SCENARIO).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "random.toml", "--record", "random.mcap"];
    assert_eq!(resonarm(folder.path(), &run).code, 0);
    folder
}

fn shown(folder: &Path, kind: &str, more: &[&str]) -> Value {
    document(folder, 0, &[&["plot", "random.mcap", "--of", kind, "--json"], more].concat())
}

fn list(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

const TIP: &str = "acceleration_c_x_m_s2";
const HEAD: &str = "head_force_x_n";

/// By Parseval's theorem the area of a density without window is the mean square, exactly with segments that cover the record.
#[test]
fn densities_have_the_mean_square_as_their_area() {
    let folder = recorded();
    let over_time = shown(folder.path(), "time", &["--channels", TIP, "--from-s", "1", "--to-s", "8.999"]);
    let values = list(&over_time["channels"][TIP]["values"]);
    assert_eq!(values.len(), 8000);
    let mean_square = values.iter().map(|value| value * value).sum::<f64>() / 8000.0;
    let segments = ["--segment-s", "2", "--overlap", "0", "--window", "rectangular"];
    let range = ["--channels", TIP, "--from-s", "1", "--to-s", "8.999"];
    let found = shown(folder.path(), "psd", &[&range[..], &segments].concat());
    // Four segments of 2 s cover the 8 s without overlap.
    assert_eq!(found["averages"], 4);
    assert_eq!(found["converter"], "sinc5");
    let (hz, psd) = (list(&found["frequency_hz"]), list(&found["channels"][TIP]["psd"]));
    // Lines are 0.5 Hz apart. The droop is put back, for the mean square is that of the readings.
    let readings: f64 = hz.iter().zip(&psd).map(|(hz, psd)| psd * droop(*hz) * 0.5).sum();
    assert!((readings / mean_square - 1.0).abs() < 1e-12, "{readings} {mean_square}");
    let rms = found["channels"][TIP]["rms"].as_f64().unwrap();
    assert!((rms * rms / (psd.iter().sum::<f64>() * 0.5) - 1.0).abs() < 1e-12);
    assert_eq!(found["channels"][TIP]["psd_unit"], "(m/s²)²/Hz");
}

/// The square of the gain of a sinc filter of order 5 at 1000 samples a second, (sin x/x)¹⁰ with x = πfT.
fn droop(hz: f64) -> f64 {
    let x = core::f64::consts::PI * hz / 1000.0;
    if hz == 0.0 { 1.0 } else { (libm::sin(x) / x).powi(10) }
}

/// A force F that is held from sample to sample has the fundamental F sin x/x, x = πfT, and the tip the accelerance
/// r²/(1 − r² + 2iζr), r = f/f₀. The line of a density is half of the square of the amplitude, although the converters read
/// only 83 % of it.
#[test]
fn a_density_has_no_droop() {
    let folder = tempfile::tempdir().unwrap();
    let sine = "profile = { waveform = 'dwell', frequency_hz = 150.0, duration_s = 12, settle_s = 1 }";
    let random = SCENARIO.lines().find(|line| line.starts_with("profile")).unwrap();
    fs::write(folder.path().join("sine.toml"), SCENARIO.replace(random, sine)).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "sine.toml", "--record", "random.mcap"];
    assert_eq!(resonarm(folder.path(), &run).code, 0);
    let wanted = ["--channels", &format!("{HEAD},{TIP}"), "--from-s", "6", "--to-s", "9.999"];
    let segments = ["--segment-s", "1", "--overlap", "0", "--window", "rectangular"];
    let found = shown(folder.path(), "psd", &[&wanted[..], &segments].concat());
    let (x, ratio) = (core::f64::consts::PI * 0.15, 150.0_f64 / 20.0);
    let force = 20.0 * libm::sin(x) / x;
    let accelerance = ratio * ratio / libm::hypot(1.0 - ratio * ratio, 2.0 * 0.02 * ratio);
    let line = list(&found["frequency_hz"]).iter().position(|hz| *hz == 150.0).unwrap();
    for (channel, amplitude) in [(HEAD, force), (TIP, force * accelerance)] {
        let density = list(&found["channels"][channel]["psd"])[line];
        // In segments of whole periods a sine is one line, of the width 1 Hz.
        assert!((density / (0.5 * amplitude * amplitude) - 1.0).abs() < 2e-3, "{channel}: {density} {amplitude}");
    }
}

/// The accelerance of the tip over the force is −ω²/(ω₀² − ω² + 2iζω₀ω) per modal mass; away from the resonance leakage is
/// small.
#[test]
fn a_measured_response_is_that_of_the_structure() {
    let folder = recorded();
    let wide = ["--reference", HEAD, "--channels", TIP, "--segment-s", "4"];
    let found = shown(folder.path(), "frf", &wide);
    let hz = list(&found["frequency_hz"]);
    let measured: Vec<[f64; 2]> = serde_json::from_value(found["channels"][TIP]["frf"].clone()).unwrap();
    let coherence = list(&found["channels"][TIP]["coherence"]);
    for wanted in [12.0, 30.0, 50.0] {
        let line = hz.iter().position(|hz| *hz == wanted).unwrap();
        let ratio = wanted / 20.0;
        // 2ζr, with ζ = 0.02.
        let [re, im] = [1.0 - ratio * ratio, 0.04 * ratio];
        let expected = ratio * ratio / (re * re + im * im).sqrt();
        let size = measured[line].iter().map(|part| part * part).sum::<f64>().sqrt();
        assert!((size / expected - 1.0).abs() < 0.02, "{wanted}: {size} {expected}");
        // Beside the noise of the instruments only leakage takes something off.
        assert!(coherence[line] > 0.98, "{wanted}: {}", coherence[line]);
    }
    let alone = shown(folder.path(), "coherence", &wide);
    for (alone, both) in list(&alone["channels"][TIP]["coherence"]).iter().zip(&coherence) {
        assert!((alone - both).abs() < 1e-12, "{alone} {both}");
    }
}

#[test]
fn every_kind_is_drawn() {
    let folder = recorded();
    let tip = ["--channels", TIP];
    let over_force = ["--reference", HEAD, "--channels", TIP];
    let kinds: [(&str, &[&str], &str); 8] = [
        ("time", &tip, "values"),
        ("psd", &tip, "psd"),
        ("spectrogram", &tip, "psd"),
        ("histogram", &tip, "density"),
        ("srs", &tip, "maximax"),
        ("frf", &over_force, "frf"),
        ("coherence", &over_force, "coherence"),
        ("xy", &over_force, "values"),
    ];
    for (kind, more, key) in kinds {
        let plot = [&["plot", "random.mcap", "--of", kind, "--plot", kind], more].concat();
        let said = resonarm(folder.path(), &plot);
        assert_eq!(said.code, 0, "{kind}: {}", said.stderr);
        let read = |ending: &str| fs::read_to_string(folder.path().join(format!("{kind}{ending}"))).unwrap();
        let written: Value = serde_json::from_str(&read(".json")).unwrap();
        assert!(written["channels"][TIP][key].is_array(), "{kind}: {written:#}");
        assert!(read(".svg").contains("</svg>") && read(".csv").lines().count() > 10, "{kind}");
    }
}

/// The area of a histogram is 1, and its moments are those of the values.
#[test]
fn a_distribution_has_the_area_1() {
    let folder = recorded();
    let found = shown(folder.path(), "histogram", &["--channels", TIP]);
    let of = &found["channels"][TIP];
    let (edges, density) = (list(&of["edges"]), list(&of["density"]));
    let area: f64 = edges.windows(2).zip(&density).map(|(edge, density)| (edge[1] - edge[0]) * density).sum();
    assert!((area - 1.0).abs() < 1e-9, "{area}");
    // Of a narrow band of noise, nearly that of a normal distribution.
    assert!((of["kurtosis"].as_f64().unwrap() - 3.0).abs() < 1.0, "{}", of["kurtosis"]);
}

#[test]
fn impossible_plots_are_refused() {
    let folder = recorded();
    let refused = |more: &[&str]| complaint(folder.path(), 2, &[&["plot", "random.mcap", "--of"], more].concat());
    let says = |more: &[&str], wanted: &str| {
        let said = refused(more);
        assert!(said.contains(wanted), "{said}");
    };
    says(&["psd", "--channels", "nothing"], "no channel `nothing`: it has acceleration_b_m_s2");
    says(&["psd"], "no channel is chosen");
    says(&["frf", "--channels", TIP], "needs --reference");
    says(&["psd", "--channels", TIP, "--reference", HEAD], "leave --reference out");
    says(&["frf", "--channels", "q1_m_sqrt_kg", "--reference", HEAD], "choose channels of one kind");
    says(&["psd", "--channels", TIP, "--segment-s", "50"], "at most the length of the record");
    says(&["psd", "--channels", TIP, "--overlap", "1"], "it must be from 0 to below 1");
    says(&["srs", "--channels", TIP, "--quality", "0.5"], "it must be above 0.5");
}
