//! The text of the protocol's sources, in C and in Rust, for a program that hands them to its user.

use include_dir::include_dir;

pub use include_dir::Dir;

/// The library in C: its headers.
pub static C_HEADERS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/c/include");
/// The library in C: its sources, with the headers that they alone include.
pub static C_SOURCES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/c/src");
/// Files that drive a node in C, and its port to Linux, as pairs of file name and text.
pub const C_LOOP: [(&str, &str); 5] = [
    ("loop.c", include_str!("../c/controller/loop.c")),
    ("loop.h", include_str!("../c/controller/loop.h")),
    ("port.h", include_str!("../c/port/port.h")),
    ("linux_socketcan.c", include_str!("../c/port/linux_socketcan.c")),
    ("linux_socketcan.h", include_str!("../c/port/linux_socketcan.h")),
];
/// Folder `src` of this crate.
pub static RUST: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/src");
