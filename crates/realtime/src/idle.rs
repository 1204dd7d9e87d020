//! Keeping the cores awake: the way out of a deep idle state adds to every wake-up.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

use crate::shortfall::{Shortfall, Wanted};

/// The kernel's interface for the longest wake-up latency that a user tolerates (kernel documentation, "PM Quality Of
/// Service Interface").
const INTERFACE: &str = "/dev/cpu_dma_latency";

/// Holds all cores out of their idle states, as long as it lives: no wake-up waits for a core to come back from one.
///
/// It acts on the whole machine, costs power and heat, and on a shared machine takes time from others; so it must
/// be asked for. The kernel drops the request when the value is dropped or the process ends.
#[derive(Debug)]
pub struct CoresAwake {
    _request: File,
}

impl CoresAwake {
    /// Asks the kernel to keep the cores awake.
    ///
    /// # Errors
    /// A [`Shortfall`] that says how to fix it, if the interface is missing or not open to this process.
    pub fn request() -> Result<Self, Shortfall> {
        Self::request_at(Path::new(INTERFACE))
    }

    fn request_at(interface: &Path) -> Result<Self, Shortfall> {
        let write = || -> io::Result<File> {
            let mut file = OpenOptions::new().write(true).open(interface)?;
            file.write_all(&0_i32.to_ne_bytes())?; // the latency tolerated, in microseconds
            Ok(file)
        };
        write().map(|request| Self { _request: request }).map_err(|error| Shortfall {
            wanted: Wanted::CoresAwake,
            what: "cores kept awake".to_owned(),
            why: format!("{}: {error}", interface.display()),
            fix: format!("`sudo setfacl -m u:$USER:w {INTERFACE}`, or run as root; where there is no such file, boot with `idle=poll`"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_request_is_a_latency_of_zero_in_the_kernel_s_form() {
        let folder = tempfile::tempdir().unwrap();
        let interface = folder.path().join("cpu_dma_latency");
        std::fs::write(&interface, b"").unwrap();
        let awake = CoresAwake::request_at(&interface).unwrap();
        assert_eq!(std::fs::read(&interface).unwrap(), [0; 4]);
        drop(awake);
    }

    #[test]
    fn a_missing_interface_is_a_shortfall() {
        let shortfall = CoresAwake::request_at(Path::new("/nonexistent/cpu_dma_latency")).unwrap_err();
        assert_eq!(shortfall.wanted, Wanted::CoresAwake);
        insta::assert_snapshot!(shortfall, @"no cores kept awake: /nonexistent/cpu_dma_latency: No such file or directory (os error 2); to fix: `sudo setfacl -m u:$USER:w /dev/cpu_dma_latency`, or run as root; where there is no such file, boot with `idle=poll`");
    }
}
