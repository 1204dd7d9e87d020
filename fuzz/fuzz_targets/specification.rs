//! Any text as a specification of a vibration test: it is refused, or its figures are computed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use resonarm::scenario::specification::parse_source;
use resonarm::specification::Test;

fuzz_target!(|text: &str| {
    let table = |name: &str| Err(format!("{name}: there are no files"));
    let Ok(source) = parse_source(text, "fuzz", table) else { return };
    match source.specification.test {
        Test::Random(test) => {
            let figures = test.figures(None);
            assert!(figures.rms_m_s2.is_finite() && figures.rms_m_s2 > 0.0, "{figures:?}");
        }
        Test::Sine(test) => {
            for segment in test.figures() {
                assert!(!segment.seconds.is_nan(), "{segment:?}");
            }
        }
        Test::Shock(test) => _ = (test.figures(), test.velocity_change_m_s()),
        Test::Srs(test) => _ = test.figures(),
    }
});
