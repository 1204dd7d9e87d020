//! The reasons why an FMU can't be the structure under test.

use thiserror::Error;

use resonarm_bench::structure::NothingSensed;

/// Why an FMU can't be the structure under test.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The archive is none, has entries that an FMU does not have, or unpacks to more bytes than one has.
    #[error("{reason}")]
    Archive {
        /// What is wrong with the archive, and what an FMU may have.
        reason: String,
    },
    /// The folder of an instance can't be written.
    #[error("can't unpack the FMU into a temporary folder: {reason}; TMPDIR names another place for it")]
    Unpack {
        /// Error of the operating system.
        reason: String,
    },
    /// The description can't be read, or lacks or misstates something that a structure needs.
    #[error("modelDescription.xml: {reason}")]
    Description {
        /// What is wrong with which element or attribute.
        reason: String,
    },
    /// The FMU is none that can be stepped here: by its version, its interfaces, its platforms or the tool that made it.
    #[error("{reason}")]
    Unsuitable {
        /// What it is, and what it has to be.
        reason: String,
    },
    /// The library can't be loaded, or lacks a function.
    #[error("the library of the FMU {reason}")]
    Library {
        /// Error of the loader, or the missing function.
        reason: String,
    },
    /// The process in which the FMU is to run can't be started.
    #[error("can't start a process for the FMU: {reason}")]
    Process {
        /// Reason why the process could not be started.
        reason: String,
    },
    /// A call before the simulation or as the FMU was let go failed, or its process ended.
    #[error("{reason}{}", log.as_ref().map(|log| format!("; the FMU says: {log}")).unwrap_or_default())]
    Start {
        /// Description of what failed, with the status or the end of the process.
        reason: String,
        /// The last message of the FMU.
        log: Option<String>,
    },
    /// A key of the scenario does not suit the FMU.
    #[error("{key}: {reason}")]
    Key {
        /// Name of the key, with its section.
        key: String,
        /// What is wrong with it, and what it must be.
        reason: String,
    },
    /// A sensor is where nothing is read.
    #[error(transparent)]
    NothingSensed(#[from] NothingSensed),
}

impl ImportError {
    /// Whether the system lacks something, such as memory or space for files, and the FMU may be all right.
    pub fn is_of_the_system(&self) -> bool {
        matches!(self, ImportError::Process { .. } | ImportError::Unpack { .. })
    }
}
