//! A file that is whole under its name, or not there.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::source::file_kind;
use super::{Existing, RecordingError};

/// A file being written. Dropped before [`Staged::publish`], it leaves nothing, and what was there before as it was.
pub(super) struct Staged {
    target: PathBuf,
    /// Its name in the same folder until then; `None` if it has its own from the start.
    temporary: Option<PathBuf>,
    /// What was created at the target, so that nobody else takes its name.
    reserved: Option<fs::Metadata>,
    published: bool,
}

impl Staged {
    /// Begins a file that will be `path`, and gives it opened.
    ///
    /// With [`Existing::Overwrite`] a file that is there stays as it is until it is replaced.
    pub fn create(path: &Path, existing: Existing) -> Result<(Staged, File), RecordingError> {
        match (existing, fs::metadata(path)) {
            (Existing::Refuse, _) => {
                let reserved = open_new(path)?.metadata().map_err(failed(path))?;
                Staged::beside(path.to_path_buf(), Some(reserved), path)
            }
            (Existing::Overwrite, Ok(found)) if !found.is_file() => {
                let got = file_kind(found.file_type());
                Err(failed(path)(io::Error::other(format!("it is {got}, expected a regular file or none"))))
            }
            (Existing::Overwrite, Ok(_)) => Staged::in_place_of(path),
            (Existing::Overwrite, Err(_)) => Staged::beside(path.to_path_buf(), None, path),
        }
    }

    /// As [`Staged::create`], of a file that grows under its name where nothing is there, and of pipes and devices.
    pub fn create_growing(path: &Path, existing: Existing) -> Result<(Staged, File), RecordingError> {
        let (file, is_new) = match (existing, fs::metadata(path)) {
            (Existing::Overwrite, Ok(found)) if found.is_file() => return Staged::in_place_of(path),
            (Existing::Overwrite, Ok(_)) => (OpenOptions::new().write(true).open(path).map_err(failed(path))?, false),
            (Existing::Refuse, _) | (Existing::Overwrite, Err(_)) => (open_new(path)?, true),
        };
        let reserved = is_new.then(|| file.metadata()).transpose().map_err(failed(path))?;
        Ok((Staged { target: path.to_path_buf(), temporary: None, reserved, published: false }, file))
    }

    /// A file that will take the place of another. Behind a symbolic link, the file it names is replaced.
    fn in_place_of(path: &Path) -> Result<(Staged, File), RecordingError> {
        Staged::beside(path.canonicalize().map_err(failed(path))?, None, path)
    }

    /// A file in the folder of the target, which in what users read is called `path`.
    fn beside(target: PathBuf, reserved: Option<fs::Metadata>, path: &Path) -> Result<(Staged, File), RecordingError> {
        let mut staged = Staged { target, temporary: None, reserved, published: false };
        let name = staged.target.file_name().unwrap_or_default().to_string_lossy();
        // One that a killed process has left may have the same number.
        for number in 0.. {
            let temporary = staged.target.with_file_name(format!(".{name}.{}.{number}.part", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&temporary) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(failed(path)(error)),
                Ok(file) => {
                    staged.temporary = Some(temporary);
                    return Ok((staged, file));
                }
            }
        }
        unreachable!("some number is free")
    }

    /// Gives the file its name, once. What must be whole under it must have been synchronised.
    pub fn publish(&mut self) -> Result<(), RecordingError> {
        if self.published {
            return Ok(());
        }
        if let Some(temporary) = &self.temporary {
            let failed =
                |source: io::Error| RecordingError::Write { path: self.target.clone(), source: Arc::new(source) };
            fs::rename(temporary, &self.target).map_err(failed)?;
            let folder = self.target.parent().filter(|folder| !folder.as_os_str().is_empty());
            // Some file systems refuse to synchronise a folder; the file itself is safe by then.
            let _not_everywhere = File::open(folder.unwrap_or(Path::new("."))).and_then(|folder| folder.sync_all());
        }
        self.published = true;
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if !self.published {
            let _gone = self.temporary.as_ref().map(fs::remove_file);
            if self.reserved.as_ref().is_some_and(|ours| is_at(ours, &self.target)) {
                let _gone = fs::remove_file(&self.target);
            }
        }
    }
}

/// Creates a file where none is.
fn open_new(path: &Path) -> Result<File, RecordingError> {
    OpenOptions::new().write(true).create_new(true).open(path).map_err(|source| match source.kind() {
        io::ErrorKind::AlreadyExists => RecordingError::Exists { path: path.to_path_buf() },
        _ => failed(path)(source),
    })
}

fn failed(path: &Path) -> impl Fn(io::Error) -> RecordingError {
    move |source| RecordingError::Create { path: path.to_path_buf(), source: Arc::new(source) }
}

/// Whether both paths lead to one file, be it by links.
pub(super) fn same_file(one: &Path, other: &Path) -> bool {
    fs::metadata(one).is_ok_and(|one| is_at(&one, other))
}

/// Whether `path` leads to this file.
pub(super) fn is_at(file: &fs::Metadata, path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| (found.dev(), found.ino()) == (file.dev(), file.ino()))
}
