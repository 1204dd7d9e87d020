//! ZIP archives whose bytes follow from their content alone: entries in the order of their names, one fixed date.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// The level of deflate: more takes longer, and saves a few per cent.
const LEVEL: i64 = 6;

/// Files by their names, with `/` between folders.
pub(crate) type Files = BTreeMap<String, Vec<u8>>;

/// The archive of `files`.
///
/// # Errors
/// A file, or all together, of 4 GiB or more.
pub(crate) fn pack(files: &Files) -> io::Result<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, data) in files {
        // Date and permissions are fixed: those of the build machine would change the bytes of the archive.
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(LEVEL))
            // 1980-01-01, the first that an archive can state.
            .last_modified_time(DateTime::default())
            .unix_permissions(if name.ends_with(".so") { 0o755 } else { 0o644 });
        archive.start_file(name, options)?;
        archive.write_all(data)?;
    }
    Ok(archive.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_files_give_the_same_bytes() {
        let files = Files::from([("b/a.so".into(), vec![7; 1000]), ("a".into(), b"text".to_vec())]);
        let archive = pack(&files).unwrap();
        assert_eq!(archive, pack(&files).unwrap());
        let mut read = zip::ZipArchive::new(Cursor::new(archive)).unwrap();
        let entries = [0, 1].map(|index| {
            let mut entry = read.by_index(index).unwrap();
            let mut data = Vec::new();
            io::copy(&mut entry, &mut data).unwrap();
            (entry.name().unwrap().into_owned(), data, entry.unix_mode().unwrap() & 0o777, entry.last_modified())
        });
        let date = Some(DateTime::default());
        assert_eq!(
            entries,
            [("a".to_owned(), b"text".to_vec(), 0o644, date), ("b/a.so".to_owned(), vec![7; 1000], 0o755, date)]
        );
    }
}
