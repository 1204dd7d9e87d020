//! Discovery of Python, of its environment, and of python-can in it.
//!
//! An embedded interpreter knows the directory it was installed in and nothing of virtual environments. So the
//! environment is looked up here: the one that VIRTUAL_ENV names, otherwise a `.venv` in the working directory or
//! the nearest of its parents, otherwise the packages of the interpreter itself.
//!
//! The packages of an environment are code that runs with the rights of this user. An environment that is named is the
//! user's choice. One that is found counts only if nobody else can have put it there or changed it: anybody who may write
//! to a directory above the working directory could otherwise place one.

use core::fmt;
use std::env;
use std::ffi::{CString, OsString};
use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use pyo3::exceptions::PyModuleNotFoundError;
use pyo3::prelude::*;
use pyo3::types::PyModule;

use crate::error::{Operation, PythonCanError, exception};

/// A release of Python, which decides where packages are and which of them can be loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Version {
    major: u8,
    minor: u8,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// A virtual environment as its `pyvenv.cfg` describes it (Python's documentation of the module `venv`, PEP 405).
#[derive(Debug, PartialEq, Eq)]
struct VirtualEnvironment {
    path: PathBuf,
    version: Version,
    /// The packages of the interpreter itself are out of sight.
    isolated: bool,
}

impl VirtualEnvironment {
    /// The directory of its packages.
    fn packages(&self) -> PathBuf {
        self.path.join(format!("lib/python{}/site-packages", self.version))
    }
}

/// Describes where python-can would be loaded from, and its version, for people. No Python runs.
///
/// # Errors
/// [`PythonCanError::VirtualEnvironment`], [`PythonCanError::Untrusted`], and [`PythonCanError::Missing`] if an
/// environment has no python-can.
pub fn would_load() -> Result<String, PythonCanError> {
    let working_directory = env::current_dir().unwrap_or_default();
    let Some(environment) = find(env::var_os("VIRTUAL_ENV"), &working_directory)? else {
        return Ok(String::from(
            "those of the interpreter, because VIRTUAL_ENV is not set and no .venv is in this directory or above it",
        ));
    };
    let path = environment.path.display();
    let packages = environment.packages();
    if !packages.join("can/__init__.py").is_file() {
        return Err(PythonCanError::Missing {
            environment: format!("the virtual environment `{path}` (Python {})", environment.version),
            command: format!("{path}/bin/python3 -m pip install python-can"),
        });
    }
    // The release is in the name of the folder of metadata (PEP 376), so that no Python need run to find it.
    let installed =
        fs::read_dir(&packages).into_iter().flatten().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let version =
        installed.filter_map(|name| Some(name.strip_prefix("python_can-")?.strip_suffix(".dist-info")?.to_owned()));
    let version = version.max().unwrap_or_else(|| String::from("of unknown version"));
    Ok(format!("{version}, of `{path}` (Python {})", environment.version))
}

/// Imports the module `can` from the environment found.
pub(super) fn import_can(py: Python<'_>) -> Result<Bound<'_, PyModule>, PythonCanError> {
    let raised = |error| exception(py, Operation::Import, error);
    let working_directory = env::current_dir().unwrap_or_default();
    let environment = find(env::var_os("VIRTUAL_ENV"), &working_directory)?;
    let python = base_interpreter(py).map_err(raised)?;
    if let Some(environment) = &environment {
        let info = py.version_info();
        let embedded = Version { major: info.major, minor: info.minor };
        if environment.version != embedded {
            return Err(PythonCanError::Version {
                path: environment.path.clone(),
                environment: environment.version.to_string(),
                embedded: embedded.to_string(),
                python,
            });
        }
        activate(py, environment).map_err(raised)?;
    }
    py.import("can").map_err(|error| match is_missing(py, &error) {
        true => missing(py, environment.as_ref(), &python),
        false => raised(error),
    })
}

/// Whether it is `can` itself that Python did not find, and not something that `can` imports.
fn is_missing(py: Python<'_>, error: &PyErr) -> bool {
    let name = || error.value(py).getattr("name").and_then(|name| name.extract::<String>());
    error.is_instance_of::<PyModuleNotFoundError>(py) && name().is_ok_and(|name| name == "can")
}

fn missing(py: Python<'_>, environment: Option<&VirtualEnvironment>, python: &str) -> PythonCanError {
    let info = py.version_info();
    let version = format!("{}.{}.{}", info.major, info.minor, info.patch);
    match environment {
        Some(VirtualEnvironment { path, .. }) => PythonCanError::Missing {
            environment: format!("the virtual environment `{}` (Python {version})", path.display()),
            command: format!("{}/bin/python3 -m pip install python-can", path.display()),
        },
        // Distributions forbid pip outside an environment (PEP 668), so the command makes one where it will be found.
        None => PythonCanError::Missing {
            environment: format!("Python {version} (`{python}`; no VIRTUAL_ENV, no .venv here or above)"),
            command: format!("{python} -m venv .venv && .venv/bin/python3 -m pip install python-can"),
        },
    }
}

/// The executable that belongs to the embedded interpreter; `sys.executable` may be another one, found on PATH.
fn base_interpreter(py: Python<'_>) -> PyResult<String> {
    let prefix: String = py.import("sys")?.getattr("base_exec_prefix")?.extract()?;
    let info = py.version_info();
    Ok(format!("{prefix}/bin/python{}.{}", info.major, info.minor))
}

fn activate(py: Python<'_>, environment: &VirtualEnvironment) -> PyResult<()> {
    let source = CString::new(include_str!("activate.py"))?;
    let module = PyModule::from_code(py, &source, c"activate.py", c"resonarm_activate")?;
    module.getattr("activate")?.call1((environment.packages().as_os_str(), environment.isolated))?;
    Ok(())
}

/// The environment to use, by the rule at the top of this file.
fn find(named: Option<OsString>, start: &Path) -> Result<Option<VirtualEnvironment>, PythonCanError> {
    if let Some(name) = named.filter(|name| !name.is_empty()) {
        return read(PathBuf::from(name)).map(Some);
    }
    let mut found = start.ancestors().map(|parent| parent.join(".venv"));
    let Some(path) = found.find(|path| path.join("pyvenv.cfg").is_file()) else { return Ok(None) };
    let user = rustix::process::geteuid().as_raw();
    // The folder that holds the environment counts as well: who may write there can put another in its place.
    let above = path.parent().into_iter();
    above.chain([&*path, &path.join("pyvenv.cfg")]).try_for_each(|place| check_owner(&path, place, user))?;
    let environment = read(path)?;
    let path = &environment.path;
    let packages = environment.packages();
    // Every folder down to the packages: who may write to one of them can replace what is below it.
    packages.ancestors().take_while(|place| *place != path).try_for_each(|place| check_owner(path, place, user))?;
    Ok(Some(environment))
}

/// Checks that only `user` and root could have made `place`, of the environment at `path`, or could change it; a link and
/// what it leads to. What is not there is not loaded.
fn check_owner(path: &Path, place: &Path, user: u32) -> Result<(), PythonCanError> {
    let untrusted = |reason: String| {
        Err(PythonCanError::Untrusted { path: path.to_path_buf(), place: place.to_path_buf(), reason })
    };
    for (metadata, is_link) in [(fs::symlink_metadata(place), true), (fs::metadata(place), false)] {
        let Ok(metadata) = metadata else { continue };
        let owner = metadata.uid();
        let group = metadata.gid();
        let mode = metadata.mode();
        if owner != user && owner != 0 {
            return untrusted(format!("belongs to the user with id {owner}"));
        }
        // The mode of a link means nothing. Many systems give each user a group of the same number.
        let is_private = group == owner;
        if !(is_link && metadata.is_symlink()) && (mode & 0o002 != 0 || (mode & 0o020 != 0 && !is_private)) {
            return untrusted(format!("can be written by other users (mode {:04o}, group {group})", mode & 0o7777));
        }
    }
    Ok(())
}

/// Reads `pyvenv.cfg`: lines `key = value`. `venv` writes `version`, virtualenv and uv write `version_info`.
fn read(path: PathBuf) -> Result<VirtualEnvironment, PythonCanError> {
    let file = path.join("pyvenv.cfg");
    let refuse = |reason: String| PythonCanError::VirtualEnvironment { path: path.clone(), reason };
    let text =
        fs::read_to_string(&file).map_err(|error| refuse(format!("can't read `{}`: {error}", file.display())))?;
    let value = |wanted: &str| {
        let pairs = text.lines().filter_map(|line| line.split_once('='));
        pairs.map(|(key, value)| (key.trim(), value.trim())).find(|(key, _)| *key == wanted).map(|(_, value)| value)
    };
    let version = value("version").or_else(|| value("version_info")).and_then(parse_version);
    let version = version.ok_or_else(|| refuse(format!("`{}` contains no version", file.display())))?;
    let isolated = !value("include-system-site-packages").is_some_and(|shared| shared.eq_ignore_ascii_case("true"));
    Ok(VirtualEnvironment { path, version, isolated })
}

fn parse_version(text: &str) -> Option<Version> {
    let mut parts = text.split('.');
    Some(Version { major: parts.next()?.parse().ok()?, minor: parts.next()?.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(parent: &Path, name: &str, config: &str) -> PathBuf {
        let path = parent.join(name);
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("pyvenv.cfg"), config).unwrap();
        path
    }

    #[test]
    fn reads_what_venv_and_virtualenv_write() {
        let directory = tempfile::tempdir().unwrap();
        let venv = "home = /usr/bin\ninclude-system-site-packages = false\nversion = 3.11.2\n";
        let path = environment(directory.path(), "a", venv);
        let expected =
            VirtualEnvironment { path: path.clone(), version: Version { major: 3, minor: 11 }, isolated: true };
        assert_eq!(read(path).unwrap(), expected);
        let virtualenv = "version_info=3.12.1.final.0\ninclude-system-site-packages=True";
        let read = read(environment(directory.path(), "b", virtualenv)).unwrap();
        assert_eq!((read.version, read.isolated), (Version { major: 3, minor: 12 }, false));
    }

    #[test]
    fn prefers_the_named_environment_then_the_nearest() {
        let directory = tempfile::tempdir().unwrap();
        let config = "version = 3.11.2";
        let outer = environment(directory.path(), ".venv", config);
        let project = directory.path().join("project/src");
        fs::create_dir_all(&project).unwrap();
        let path = |named: Option<&Path>| find(named.map(Into::into), &project).unwrap().map(|found| found.path);
        assert_eq!(path(None), Some(outer.clone()));
        assert_eq!(path(Some(Path::new(""))), Some(outer));
        let inner = environment(&directory.path().join("project"), ".venv", config);
        assert_eq!(path(None), Some(inner));
        let named = environment(directory.path(), "named", config);
        assert_eq!(path(Some(&named)), Some(named));
    }

    /// Anybody who may write above the working directory could place an environment there, as before CVE-2022-24765 of git.
    #[test]
    fn an_environment_that_others_could_have_made_is_refused() {
        use std::os::unix::fs::PermissionsExt as _;
        let directory = tempfile::tempdir().unwrap();
        let path = environment(directory.path(), ".venv", "version = 3.11.2");
        let project = directory.path().join("project");
        fs::create_dir_all(&project).unwrap();
        let user = rustix::process::geteuid().as_raw();
        let text = |error: PythonCanError| error.to_string().replace(&directory.path().display().to_string(), "DIR");
        check_owner(&path, &path, user).unwrap();
        // Root may own it, and nobody else but the user.
        if user != 0 {
            let refused = text(check_owner(&path, &path, user + 1).unwrap_err());
            assert!(refused.contains(&format!("belongs to the user with id {user}")), "{refused}");
        }
        let set = |place: &Path, mode: u32| fs::set_permissions(place, fs::Permissions::from_mode(mode)).unwrap();
        set(directory.path(), 0o1777);
        let refused = text(find(None, &project).unwrap_err());
        assert!(
            refused
                .starts_with("the virtual environment `DIR/.venv` is not used, as `DIR` can be written by other users"),
            "{refused}"
        );
        assert_eq!(find(Some(path.clone().into()), &project).unwrap().map(|found| found.path), Some(path.clone()));
        set(directory.path(), 0o755);
        set(&path, 0o757);
        assert!(text(find(None, &project).unwrap_err()).contains("as `DIR/.venv` can be written"));
        set(&path, 0o755);
        let packages = path.join("lib/python3.11/site-packages");
        fs::create_dir_all(&packages).unwrap();
        set(&packages, 0o777);
        assert!(text(find(None, &project).unwrap_err()).contains("site-packages` can be written"));
        set(&packages, 0o755);
        assert!(find(None, &project).unwrap().is_some());
    }

    #[test]
    fn says_why_it_is_not_an_environment() {
        let message = |error: PythonCanError| error.to_string();
        let missing = find(Some("/nonexistent".into()), Path::new("/")).unwrap_err();
        insta::assert_snapshot!(message(missing), @"`/nonexistent` is not a Python virtual environment: can't read `/nonexistent/pyvenv.cfg`: No such file or directory (os error 2); make one with `python3 -m venv /nonexistent`, or unset VIRTUAL_ENV");
        let directory = tempfile::tempdir().unwrap();
        let broken = environment(directory.path(), "broken", "home = /usr/bin");
        let text = message(read(broken).unwrap_err()).replace(&directory.path().display().to_string(), "DIR");
        insta::assert_snapshot!(text, @"`DIR/broken` is not a Python virtual environment: `DIR/broken/pyvenv.cfg` contains no version; make one with `python3 -m venv DIR/broken`, or unset VIRTUAL_ENV");
    }
}
