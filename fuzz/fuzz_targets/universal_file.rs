//! Any bytes as a universal file of frequency responses: they are refused, or every response has as many values as there are
//! frequencies, and lines connect nodes that have a position.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use resonarm::responses::responses_of;

fuzz_target!(|bytes: &[u8]| {
    let Ok(found) = responses_of(bytes, Path::new("fuzz")) else { return };
    assert!(!found.responses.is_empty());
    for response in &found.responses {
        assert_eq!(response.values.len(), found.frequency_hz.len());
    }
    for node in found.lines.iter().flatten() {
        assert!(found.positions_m.contains_key(node), "{node}");
    }
});
