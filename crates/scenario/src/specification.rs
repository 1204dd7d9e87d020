//! Specifications of tests as files, and the files of breakpoints that they name.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::text_file;
use crate::toml_error::TomlError;
use resonarm_bench::control::SpecificationSource;
use resonarm_specification::{Specification, SpecificationError, SpecificationFile};

/// Reason why a file is not a specification.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SpecificationFileError {
    /// The file can't be read.
    #[error("can't read the specification {}: {source}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The text is not TOML, or has other keys than a specification.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// A value of the specification can't be.
    #[error("{origin}: {source}")]
    Value {
        /// Path or name of the text.
        origin: String,
        /// Reason, with the place of the value.
        source: SpecificationError,
    },
}

/// Reads a specification; files of breakpoints are relative to its folder.
///
/// # Errors
/// [`SpecificationFileError`] names the place of what can't be used.
pub fn read(path: &Path) -> Result<Specification, SpecificationFileError> {
    Ok(read_source(path)?.specification)
}

/// Reads a specification with the texts that it is made of, as [`read`].
///
/// # Errors
/// As [`read`].
pub fn read_source(path: &Path) -> Result<SpecificationSource, SpecificationFileError> {
    let read = text_file::read(path);
    let text = read.map_err(|source| SpecificationFileError::Read { path: path.to_path_buf(), source })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let table = |name: &str| text_file::read_numbers(&folder.join(name)).map_err(|error| error.to_string());
    parse_source(&text, &path.display().to_string(), table)
}

/// Reads a specification from its text; messages call the text `origin`. Files of breakpoints are relative to `folder`.
///
/// # Errors
/// [`SpecificationFileError`] names the place of what can't be used.
pub fn parse(text: &str, origin: &str, folder: &Path) -> Result<Specification, SpecificationFileError> {
    let table = |name: &str| text_file::read_numbers(&folder.join(name)).map_err(|error| error.to_string());
    Ok(parse_source(text, origin, table)?.specification)
}

/// Reads a specification from its text; `table` returns the text of a file of breakpoints by its name, or says why it can't.
///
/// # Errors
/// [`SpecificationFileError`] names the place of what can't be used.
pub fn parse_source(
    text: &str,
    origin: &str,
    mut table: impl FnMut(&str) -> Result<String, String>,
) -> Result<SpecificationSource, SpecificationFileError> {
    let file: SpecificationFile = toml::from_str(text).map_err(|error| TomlError::new(origin, &error))?;
    let mut tables = Vec::new();
    let specification = Specification::new(&file, |name| {
        let text = table(name)?;
        tables.push((name.to_owned(), text.clone()));
        Ok(text)
    });
    let specification =
        specification.map_err(|source| SpecificationFileError::Value { origin: origin.to_owned(), source })?;
    Ok(SpecificationSource { specification, text: text.to_owned(), tables })
}

/// Returns the files that [`read`] reads: the specification itself and those that it names, as far as it can be read.
pub fn files(path: &Path) -> Vec<PathBuf> {
    let text = text_file::read(path).ok();
    let file = text.and_then(|text| toml::from_str::<SpecificationFile>(&text).ok());
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = file.iter().flat_map(SpecificationFile::files).map(|name| folder.join(name));
    core::iter::once(path.to_path_buf()).chain(named).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use resonarm_specification::Test;

    const TEXT: &str = "\
[spec]
kind = 'random'
sources = ['own']
[random]
unit = '(m/s2)2/Hz'
file = 'profile.csv'
tolerance_db = [-3, 3]
";

    #[test]
    fn breakpoints_are_read_from_the_folder_of_the_specification() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spec.toml");
        std::fs::write(&path, TEXT).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("profile.csv: "));
        std::fs::write(folder.path().join("profile.csv"), "frequency_hz,density\n10,1\n100,0.1\n").unwrap();
        let Test::Random(test) = read(&path).unwrap().test else { unreachable!("the kind is random") };
        assert!((test.figures(None).rms_m_s2 / 4.798_525_912_188_081 - 1.0).abs() < 1e-12);
        assert_eq!(files(&path), [path.clone(), folder.path().join("profile.csv")]);
    }

    #[test]
    fn what_can_not_be_used_is_named() {
        let folder = Path::new("");
        let says = |text: &str| parse(text, "spec.toml", folder).unwrap_err().to_string();
        let said = says(&TEXT.replace("tolerance_db", "tolerance_dB"));
        assert!(said.contains("line 7") && said.contains("Did you mean `tolerance_db`?"), "{said}");
        let said = says(&TEXT.replace("file = 'profile.csv'", "breakpoints = [[10, 1], [5, 1]]"));
        assert_eq!(
            said,
            "spec.toml: [random] `breakpoints`, number 2: the frequency, Hz, is 5: it must be positive and above the one before"
        );
    }
}
