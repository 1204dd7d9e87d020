//! Finished points of a long computation, kept in a file of JSON lines, so that it can be stopped and resumed.
//!
//! The first line says what is computed, and by which build; every other line is a point. A line counts when its end is
//! written, so a process that is killed loses at most the point it was writing.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use thiserror::Error;

use resonarm_files::recording::build_info;

/// Error of a journal that can't be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum JournalError {
    /// The file can't be opened or read.
    #[error("can't open {}: {source}", path.display())]
    Open {
        /// Path of the journal.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file can't be written.
    #[error("can't write {}: {source}", path.display())]
    Write {
        /// Path of the journal.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Another process has it open.
    #[error("{} is in use by another process: wait until it has ended, or name another file", path.display())]
    InUse {
        /// Path of the journal.
        path: PathBuf,
    },
    /// The file holds points of another computation.
    #[error(
        "{} was started with {key} = {had}, but this command has {has}: repeat the command that started it to continue it, \
         name another file, or delete it", path.display()
    )]
    Differs {
        /// Path of the journal.
        path: PathBuf,
        /// The first key that differs, as `a.b`.
        key: String,
        /// Its value in the file.
        had: Value,
        /// Value of the key in this computation.
        has: Value,
    },
    /// A line has an unexpected content.
    #[error("line {line} of {} is not a {what}: delete the file to start again", path.display())]
    Damaged {
        /// Path of the journal.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Description of the entry that is expected there.
        what: &'static str,
    },
}

/// A journal that is open for appending points.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens the journal at `path`, or creates it, for a computation that `configuration` describes in full. Also
    /// returns the points in it, in the order in which they were written.
    ///
    /// # Errors
    /// [`JournalError`] if the file can't be opened, holds points of another computation, or is no journal.
    pub fn open<P: DeserializeOwned>(path: &Path, configuration: &Value) -> Result<(Journal, Vec<P>), JournalError> {
        let path = path.to_path_buf();
        let open = |source| JournalError::Open { path: path.clone(), source };
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).map_err(open)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(JournalError::InUse { path }),
            Err(TryLockError::Error(source)) => return Err(open(source)),
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(open)?;
        let mut journal = Journal { path, file };
        // Numbers as they are after being written and read.
        // The build belongs to it: another one may round differently, and a study must not mix points of two builds.
        let header: Value = json!({ "build": build_info(), "configuration": configuration });
        // The bytes behind the last end of a line were cut off.
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        let mut lines = bytes[..whole].split(|byte| *byte == b'\n').peekable();
        let had = match lines.next_if(|_first| whole > 0) {
            Some(first) => Some(header_in(first).ok_or_else(|| journal.damaged(1, "header"))?),
            None if is_torn_header(&bytes) => None,
            None => return Err(journal.damaged(1, "header")),
        };
        let mut lines = lines.filter(|line| !line.is_empty()).peekable();
        let (Some(had), Some(_)) = (had, lines.peek()) else {
            // Nothing is computed yet, so nothing can be lost: whatever it was begun with, it is begun anew.
            journal.cut(0)?;
            journal.append(&header)?;
            return Ok((journal, Vec::new()));
        };
        if let Some((key, had, has)) = difference("", &had, &header) {
            return Err(JournalError::Differs { path: journal.path, key, had, has });
        }
        let points = lines
            .enumerate()
            .map(|(k, line)| serde_json::from_slice(line).map_err(|_error| journal.damaged(k + 2, "point")))
            .collect::<Result<_, _>>()?;
        journal.cut(whole)?;
        Ok((journal, points))
    }

    /// Removes the content behind these bytes.
    fn cut(&mut self, bytes: usize) -> Result<(), JournalError> {
        let cut = self.file.set_len(bytes as u64).and_then(|()| self.file.seek(SeekFrom::End(0)));
        cut.map(drop).map_err(|source| JournalError::Write { path: self.path.clone(), source })
    }

    /// Writes a line.
    ///
    /// # Errors
    /// [`JournalError::Write`] with the error of the operating system.
    pub fn append(&mut self, value: &impl Serialize) -> Result<(), JournalError> {
        let failed = |source| JournalError::Write { path: self.path.clone(), source };
        let mut line = serde_json::to_vec(value).map_err(|error| failed(error.into()))?;
        line.push(b'\n');
        // One call for the line with its end, so that a killed process tears at most the line that it was writing.
        self.file.write_all(&line).map_err(failed)
    }

    /// Removes the file: the computation is complete.
    ///
    /// # Errors
    /// [`JournalError::Write`] with the error of the operating system.
    pub fn remove(self) -> Result<(), JournalError> {
        std::fs::remove_file(&self.path).map_err(|source| JournalError::Write { path: self.path, source })
    }

    /// Makes the error for a line, counted from 1, with an unexpected content.
    pub fn damaged(&self, line: usize, what: &'static str) -> JournalError {
        JournalError::Damaged { path: self.path.clone(), line, what }
    }
}

/// Returns the header in a line, if it is one.
fn header_in(line: &[u8]) -> Option<Value> {
    let found: Value = serde_json::from_slice(line).ok()?;
    ["build", "configuration"].iter().all(|key| found.get(key).is_some()).then_some(found)
}

/// Says whether a file without the end of a line is empty, or may be a header whose writing was cut off.
fn is_torn_header(bytes: &[u8]) -> bool {
    const BEGIN: &[u8] = br#"{"build":{"#;
    bytes.starts_with(BEGIN) || BEGIN.starts_with(bytes)
}

/// Returns the first key in which two documents differ, as `a.b`, and the two values.
pub(crate) fn difference(at: &str, had: &Value, has: &Value) -> Option<(String, Value, Value)> {
    if let (Value::Object(a), Value::Object(b)) = (had, has) {
        let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
        return keys.into_iter().find_map(|key| {
            let within = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
            difference(&within, a.get(key).unwrap_or(&Value::Null), b.get(key).unwrap_or(&Value::Null))
        });
    }
    (had != has).then(|| (at.to_string(), had.clone(), has.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO_HEADER: &str = "line 1 of DIR/sweep.partial.jsonl is not a header: delete the file to start again";

    fn says(path: &Path, configuration: &Value) -> String {
        let error = Journal::open::<u32>(path, configuration).unwrap_err();
        error.to_string().replace(&path.display().to_string(), "DIR/sweep.partial.jsonl")
    }

    #[test]
    fn keeps_whole_lines_and_drops_a_torn_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = json!({ "beta2_deg": [60.0, 0.1], "steps": 3 });
        let (mut journal, points) = Journal::open::<f64>(&path, &configuration).unwrap();
        assert!(points.is_empty());
        let written = [0.1 + 0.2, 5e-324, 22.063_474_107_006_545];
        written.iter().for_each(|value| journal.append(value).unwrap());
        journal.file.write_all(b"1.").unwrap();
        let refusal = Journal::open::<f64>(&path, &configuration).unwrap_err();
        assert!(matches!(refusal, JournalError::InUse { .. }), "{refusal}");
        drop(journal);
        let (mut journal, points) = Journal::open::<f64>(&path, &configuration).unwrap();
        assert_eq!(points.iter().map(|p: &f64| p.to_bits()).collect::<Vec<_>>(), written.map(f64::to_bits));
        journal.append(&7.0).unwrap();
        drop(journal);
        let (journal, points) = Journal::open::<f64>(&path, &configuration).unwrap();
        assert_eq!(points.len(), 4);
        journal.remove().unwrap();
        assert!(!path.exists());
    }

    /// A file that is no journal stays as it is, to the last byte: one line, no end of a line, the JSON of another.
    #[test]
    fn a_foreign_file_is_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let foreign =
            ["one line\n", "no end of a line", "two\nlines, the last one open", "{}\n", "{\"build\":1}\n", "\n"];
        for text in foreign {
            std::fs::write(&path, text).unwrap();
            assert_eq!(says(&path, &json!({ "steps": 3 })), NO_HEADER, "{text:?}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }

    /// The remains of a process that was killed while it wrote the header.
    #[test]
    fn a_journal_with_a_torn_header_is_begun_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = json!({ "steps": 3 });
        drop(Journal::open::<u32>(&path, &configuration).unwrap());
        let header = std::fs::read(&path).unwrap();
        for length in 0..=header.len() {
            std::fs::write(&path, &header[..length]).unwrap();
            let (journal, points) = Journal::open::<u32>(&path, &configuration).unwrap();
            assert!(points.is_empty());
            drop(journal);
            assert_eq!(std::fs::read(&path).unwrap(), header, "{length} bytes");
        }
    }

    #[test]
    fn says_what_does_not_fit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = json!({ "arm": { "beta2_deg": 60.0, "mass2_kg": 36.0 }, "steps": 3 });
        let (mut journal, _) = Journal::open::<u32>(&path, &json!({ "steps": 7 })).unwrap();
        drop(journal);
        // A journal without points is replaced.
        (journal, _) = Journal::open::<u32>(&path, &configuration).unwrap();
        journal.append(&1).unwrap();
        drop(journal);
        insta::assert_snapshot!(says(&path, &json!({ "arm": { "beta2_deg": 90.0, "mass2_kg": 36.0 }, "steps": 3 })), @"DIR/sweep.partial.jsonl was started with configuration.arm.beta2_deg = 60.0, but this command has 90.0: repeat the command that started it to continue it, name another file, or delete it");
        insta::assert_snapshot!(says(&path, &json!({ "arm": { "beta2_deg": 60.0, "mass2_kg": 36.0 }, "steps": 4 })), @"DIR/sweep.partial.jsonl was started with configuration.steps = 3, but this command has 4: repeat the command that started it to continue it, name another file, or delete it");
        let header = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, format!("{header}three\n")).unwrap();
        insta::assert_snapshot!(says(&path, &configuration), @"line 3 of DIR/sweep.partial.jsonl is not a point: delete the file to start again");
        std::fs::write(&path, "once upon a time\n1\n").unwrap();
        insta::assert_snapshot!(says(&path, &configuration), @"line 1 of DIR/sweep.partial.jsonl is not a header: delete the file to start again");
    }
}
