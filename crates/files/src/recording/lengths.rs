//! Checks lengths inside a record before the MCAP library allocates as much memory as a damaged length states, up to 4
//! GiB.

use mcap::records::op;

/// Says whether every field of the record, and every length in it, fits into it (MCAP specification, "Records"): fields
/// of fixed size are followed by texts and the like, each as its length (`u32`) and that many bytes; the last may be a
/// map, which is itself a row of texts.
pub(super) fn fit(opcode: u8, body: &[u8]) -> bool {
    let rest = match opcode {
        op::HEADER => after_texts(2, Some(body)),
        op::FOOTER => body.get(8 + 8 + 4..),
        op::SCHEMA => after_texts(3, body.get(2..)),
        op::CHANNEL => after_texts(2, body.get(4..)).and_then(after_map),
        op::MESSAGE => body.get(2 + 4 + 8 + 8..),
        op::CHUNK => after_texts(1, body.get(8 + 8 + 8 + 4..)),
        op::MESSAGE_INDEX => after_texts(1, body.get(2..)),
        // Behind the four numbers stand a map of offsets, the length of the message index, the name of the
        // compression, and two lengths.
        op::CHUNK_INDEX => after_texts(1, body.get(4 * 8..))
            .and_then(|rest| after_texts(1, rest.get(8..)))
            .and_then(|rest| rest.get(8 + 8..)),
        op::ATTACHMENT => after_texts(2, body.get(8 + 8..)).and_then(after_data).and_then(|rest| rest.get(4..)),
        op::ATTACHMENT_INDEX => after_texts(2, body.get(5 * 8..)),
        op::STATISTICS => after_texts(1, body.get(8 + 2 + 4 * 4 + 8 + 8..)),
        op::METADATA => after_texts(1, Some(body)).and_then(after_map),
        op::METADATA_INDEX => after_texts(1, body.get(8 + 8..)),
        op::SUMMARY_OFFSET => body.get(1 + 8 + 8..),
        op::DATA_END => body.get(4..),
        _ => Some(body),
    };
    rest.is_some()
}

/// Returns the number of eight bytes at `place` of a record whose fields fit.
pub(super) fn number_at(body: &[u8], place: usize) -> u64 {
    let bytes = body.get(place..).and_then(<[u8]>::first_chunk);
    bytes.map_or(0, |bytes| u64::from_le_bytes(*bytes))
}

/// Returns the first text, and the bytes behind it.
fn split(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

/// Returns the bytes behind the data of an attachment, whose length has eight bytes.
fn after_data(bytes: &[u8]) -> Option<&[u8]> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.get(usize::try_from(u64::from_le_bytes(*length)).ok()?..)
}

fn after_texts(count: usize, bytes: Option<&[u8]>) -> Option<&[u8]> {
    (0..count).fold(bytes, |rest, _| Some(split(rest?)?.1))
}

fn after_map(bytes: &[u8]) -> Option<&[u8]> {
    let (mut row, rest) = split(bytes)?;
    while !row.is_empty() {
        row = split(row)?.1;
    }
    Some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &[u8]) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes()[..], text].concat()
    }

    #[test]
    fn every_cut_and_every_longer_length_is_seen() {
        let map = || text(&[text(b"key"), text(b"value")].concat());
        let records = [
            (op::HEADER, vec![vec![], text(b""), text(b"library")]),
            (op::SCHEMA, vec![vec![1, 0], text(b"name"), text(b"protobuf"), text(b"data")]),
            (op::CHANNEL, vec![vec![1, 0, 1, 0], text(b"topic"), text(b"protobuf"), map()]),
            (op::CHUNK, vec![vec![0; 28], text(b"lz4")]),
            (op::METADATA, vec![vec![], text(b"name"), map()]),
            (op::MESSAGE_INDEX, vec![vec![1, 0], text(&[0; 16])]),
        ];
        for (opcode, fields) in records {
            let body = fields.concat();
            assert!(fit(opcode, &body), "{opcode}");
            assert!((0..body.len()).all(|length| !fit(opcode, &body[..length])), "{opcode}");
            for field in 1..fields.len() {
                let mut longer = body.clone();
                // The highest byte of a little-endian length of four.
                longer[fields[..field].concat().len() + 3] = 0xFF;
                assert!(!fit(opcode, &longer), "{opcode}, field {field}");
            }
        }
        let mut longer = [text(b"name"), map()].concat();
        let inner = longer.len() - text(b"value").len();
        longer[inner] += 1;
        assert!(!fit(op::METADATA, &longer));
    }
}
