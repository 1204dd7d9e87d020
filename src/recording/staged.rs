//! A file that takes its name only when it is whole.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::source::file_kind;
use super::{Existing, RecordingError};

/// A file being written under another name in the same folder. Dropped before [`Staged::publish`], it leaves nothing.
pub(super) struct Staged {
    target: PathBuf,
    temporary: PathBuf,
    /// The target was created empty, so that nobody else takes its name.
    reserved: bool,
    published: bool,
}

impl Staged {
    /// Begins a file that will be `path`, and gives it opened.
    ///
    /// With [`Existing::Overwrite`] a file that is there stays as it is until it is replaced.
    pub fn create(path: &Path, existing: Existing) -> Result<(Staged, File), RecordingError> {
        let failed = |source: io::Error| RecordingError::Create { path: path.to_path_buf(), source: Arc::new(source) };
        let (target, reserved) = match (existing, fs::metadata(path)) {
            (Existing::Refuse, _) => {
                super::sink::open(path, Existing::Refuse)?;
                (path.to_path_buf(), true)
            }
            (Existing::Overwrite, Ok(found)) if !found.is_file() => {
                let got = file_kind(found.file_type());
                return Err(failed(io::Error::other(format!("it is {got}, expected a regular file or none"))));
            }
            // Behind a symbolic link, the file it names is replaced.
            (Existing::Overwrite, Ok(_)) => (path.canonicalize().map_err(failed)?, false),
            (Existing::Overwrite, Err(_)) => (path.to_path_buf(), false),
        };
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let temporary = target.with_file_name(format!(".{name}.{}.part", std::process::id()));
        let staged = Staged { target, temporary, reserved, published: false };
        let file = OpenOptions::new().write(true).create_new(true).open(&staged.temporary).map_err(failed)?;
        Ok((staged, file))
    }

    /// Gives the file its name; its content must have been synchronised.
    pub fn publish(mut self) -> Result<(), RecordingError> {
        let failed = |source: io::Error| RecordingError::Write { path: self.target.clone(), source: Arc::new(source) };
        fs::rename(&self.temporary, &self.target).map_err(failed)?;
        let folder = self.target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Some file systems refuse to synchronise a folder; the file itself is safe by then.
        let _not_everywhere = File::open(folder).and_then(|folder| folder.sync_all());
        self.published = true;
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if !self.published {
            let _gone = fs::remove_file(&self.temporary);
            if self.reserved {
                let _gone = fs::remove_file(&self.target);
            }
        }
    }
}

/// Whether both paths lead to one file, be it by links.
pub(super) fn same_file(one: &Path, other: &Path) -> bool {
    fs::metadata(one).is_ok_and(|one| is_at(&one, other))
}

/// Whether `path` leads to this file.
pub(super) fn is_at(file: &fs::Metadata, path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| (found.dev(), found.ino()) == (file.dev(), file.ino()))
}
