//! The CAN interfaces that this Linux has, as sysfs lists them.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use std::{fs, io};

/// The hardware type of a CAN interface (`ARPHRD_CAN` of `linux/if_arp.h`).
const ARPHRD_CAN: &str = "280";

/// The names of all CAN interfaces, up or down, sorted. Needs no AF_CAN in the kernel.
///
/// # Errors
/// What reading `/sys/class/net` gave.
pub fn interfaces() -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir("/sys/class/net")? {
        // Beside interfaces the directory may hold plain files (bonding_masters), whose names don't end here.
        if let Ok(name) = entry?.file_name().into_string()
            && fs::read_to_string(format!("/sys/class/net/{name}/type")).is_ok_and(|kind| kind.trim() == ARPHRD_CAN)
        {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}
