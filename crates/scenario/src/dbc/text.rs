//! Character encoding of DBC files.

use std::borrow::Cow;

/// The characters of the bytes 0x80 to 0x9F in code page 1252 of Windows; its five unused bytes are the control
/// characters of these numbers. All other bytes are the first 256 characters of Unicode.
const FROM_0X80: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8D}', 'Ž', '\u{8F}', '\u{90}', '‘', '’',
    '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9D}', 'ž', 'Ÿ',
];

/// Decodes the text as UTF-8, with or without a byte order mark, or else as Windows code page 1252, which many
/// tools write.
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text.strip_prefix('\u{FEFF}').unwrap_or(text)),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| character(*byte)).collect()),
    }
}

fn character(byte: u8) -> char {
    FROM_0X80.get(usize::from(byte).wrapping_sub(0x80)).copied().unwrap_or(char::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_both_encodings() {
        assert_eq!(decode("\u{FEFF}°C".as_bytes()), "°C");
        assert_eq!(decode("m/s²".as_bytes()), "m/s²");
        assert_eq!(decode(b"\xB0C \x80 \x9F \xFF"), "°C € Ÿ ÿ");
    }
}
