//! Any bytes as a DBC and a payload: it is refused, or every message of it decodes the payload, and what it decodes is
//! written back where the signal can say it and is not for reading alone.
#![no_main]

use libfuzzer_sys::fuzz_target;
use resonarm::dbc::Database;

fuzz_target!(|input: &[u8]| {
    let (payload, text) = input.split_at(input.len().min(64));
    let Ok(database) = Database::parse(text, "fuzz") else { return };
    _ = database.problems();
    for message in database.messages() {
        for signal in message.signals() {
            let Some(value) = signal.decode(payload) else { continue };
            _ = (signal.text(payload), signal.large_integer(payload));
            if message.signal(signal.name()).is_err() {
                continue;
            }
            let mut written = payload.to_vec();
            if value.is_finite() && signal.wire().encode(value, &mut written).is_ok() {
                let again = signal.decode(&written).expect("a payload as long as before");
                let count = signal.wire().resolution().unwrap_or(0.0);
                // A float of 32 bits has no resolution of its own and keeps 24 bits, 6e-8 of its value.
                assert!((again - value).abs() <= count.max(1e-6 * value.abs()), "{value} became {again}");
            }
        }
    }
});
