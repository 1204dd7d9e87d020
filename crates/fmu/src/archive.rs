//! ZIP archives whose bytes follow from their content alone: entries in the order of their names, one fixed date.
//!
//! PKZIP 6.3.10: a local header and the data of each entry, then the central directory and its end.

use std::collections::BTreeMap;
use std::io::{self, Write};

use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};

/// 1980-01-01 in the date of MS-DOS: bits 9 on the years since 1980, 5 to 8 the month, 0 to 4 the day.
const DATE: u16 = 1 << 5 | 1;
/// Version 2.0, the first with deflate.
const VERSION: u16 = 20;
const DEFLATED: u16 = 8;
/// The name is UTF-8.
const UTF8: u16 = 1 << 11;
/// Made on UNIX, whose mode is in the upper half of the external attributes.
const MADE_ON_UNIX: u16 = 3 << 8 | VERSION;

/// Files by their names, with `/` between folders.
pub(crate) type Files = BTreeMap<String, Vec<u8>>;

/// What the directory repeats of an entry.
struct Entry {
    name: String,
    crc: u32,
    packed: u32,
    size: u32,
    offset: u32,
}

/// The archive of `files`.
///
/// # Errors
/// A file, or all together, of 4 GiB or more.
pub(crate) fn zip(files: &Files) -> io::Result<Vec<u8>> {
    let mut archive = Vec::new();
    let mut entries = Vec::new();
    for (name, data) in files {
        entries.push(append(&mut archive, name, data)?);
    }
    let directory = archive.len();
    for entry in &entries {
        let mode: u32 = if entry.name.ends_with(".so") { 0o100_755 } else { 0o100_644 };
        put(&mut archive, &[&[0x4b50, 0x0201, MADE_ON_UNIX], &common(entry)[..], &[0, 0, 0]].concat());
        archive.extend((mode << 16).to_le_bytes());
        archive.extend(entry.offset.to_le_bytes());
        archive.extend(entry.name.as_bytes());
    }
    let (count, length) = (short(entries.len())?, long(archive.len() - directory)?);
    put(&mut archive, &[0x4b50, 0x0605, 0, 0, count, count]);
    archive.extend(length.to_le_bytes());
    archive.extend(long(directory)?.to_le_bytes());
    put(&mut archive, &[0]);
    Ok(archive)
}

fn append(archive: &mut Vec<u8>, name: &str, data: &[u8]) -> io::Result<Entry> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::new(6));
    encoder.write_all(data)?;
    let packed = encoder.finish()?;
    let mut crc = Crc::new();
    crc.update(data);
    let (size, offset) = (long(data.len())?, long(archive.len())?);
    short(name.len())?;
    let entry = Entry { name: name.to_string(), crc: crc.sum(), packed: long(packed.len())?, size, offset };
    put(archive, &[&[0x4b50, 0x0403], &common(&entry)[..]].concat());
    archive.extend(name.as_bytes());
    archive.extend(packed);
    Ok(entry)
}

/// What both headers have: version, flags, method, time, date, CRC, sizes, lengths of name and extra field.
fn common(entry: &Entry) -> [u16; 13] {
    let [crc, packed, size] =
        [entry.crc, entry.packed, entry.size].map(|number| [number as u16, (number >> 16) as u16]);
    let name = entry.name.len() as u16;
    let [flags, time] = [UTF8, 0];
    [VERSION, flags, DEFLATED, time, DATE, crc[0], crc[1], packed[0], packed[1], size[0], size[1], name, 0]
}

fn put(archive: &mut Vec<u8>, words: &[u16]) {
    archive.extend(words.iter().flat_map(|word| word.to_le_bytes()));
}

fn short(number: usize) -> io::Result<u16> {
    u16::try_from(number).map_err(|_| too_large(number))
}

fn long(number: usize) -> io::Result<u32> {
    u32::try_from(number).map_err(|_| too_large(number))
}

fn too_large(number: usize) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, format!("{number}: more than an archive can hold"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_files_give_the_same_bytes_with_the_stated_headers() {
        let files = Files::from([("b/a.so".into(), vec![7; 1000]), ("a".into(), b"text".to_vec())]);
        let archive = zip(&files).unwrap();
        assert_eq!(archive, zip(&files).unwrap());
        assert_eq!(archive[..4], *b"PK\x03\x04");
        assert_eq!(archive[26..31], [1, 0, 0, 0, b'a']);
        let end = &archive[archive.len() - 22..];
        assert_eq!((&end[..4], &end[8..12]), (&b"PK\x05\x06"[..], &[2, 0, 2, 0][..]));
        let directory = u32::from_le_bytes(end[16..20].try_into().unwrap()) as usize;
        assert_eq!(archive[directory..directory + 4], *b"PK\x01\x02");
    }
}
