//! The library as it is linked: its symbols, its version, without the FD profile, and frames from an interrupt.

use std::path::Path;
use std::process::Command;

use super::Harness;
use super::harness::{build, build_with};

const CLASSIC_ONLY: &str = "DEFINES=-DRESONARM_CLASSIC_ONLY";

/// The symbols that the library defines for others.
fn symbols(library: &Path) -> Vec<String> {
    let output = Command::new("nm").args(["-g", "--defined-only"]).arg(library).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let lines = text.lines().filter_map(|line| line.split_whitespace().nth(2).map(String::from));
    lines.collect()
}

#[test]
fn every_symbol_of_the_library_has_its_prefix() {
    for library in [build("libresonarm.a"), build_with("classic-only", CLASSIC_ONLY, "libresonarm.a")] {
        let symbols = symbols(&library);
        assert!(symbols.iter().any(|symbol| symbol == "resonarm_exciter_start"), "{symbols:?}");
        let others: Vec<_> = symbols.iter().filter(|symbol| !symbol.starts_with("resonarm_")).collect();
        assert!(others.is_empty(), "{others:?}");
    }
}

#[test]
fn the_version_of_the_library_is_that_of_the_crate() {
    let header = include_str!("../../c/include/resonarm.h");
    for (name, number) in [
        ("MAJOR", env!("CARGO_PKG_VERSION_MAJOR")),
        ("MINOR", env!("CARGO_PKG_VERSION_MINOR")),
        ("PATCH", env!("CARGO_PKG_VERSION_PATCH")),
    ] {
        assert!(header.contains(&format!("\n#define RESONARM_VERSION_{name} {number}\n")), "{name} is not {number}");
    }
    let version = env!("CARGO_PKG_VERSION");
    assert!(header.contains(&format!("\n#define RESONARM_VERSION \"{version}\"\n")), "the text is not {version}");
}

#[test]
fn without_the_fd_profile_the_library_has_nothing_of_it() {
    let symbols = symbols(&build_with("classic-only", CLASSIC_ONLY, "libresonarm.a"));
    let names = ["resonarm_fd_", "resonarm_e2e_p5_", "single", "resonarm_readings_"];
    let left: Vec<_> = symbols.iter().filter(|symbol| names.iter().any(|name| symbol.contains(name))).collect();
    assert!(left.is_empty(), "{left:?}");
    let mut classic = Harness::start_classic_only();
    assert_eq!(classic.ask("network 512 1 2 1"), "not-built");
    assert_eq!(classic.ask("network 512 1 2 0"), "valid");
    classic.end();
}

/// The queue is built with the sanitisers of addresses and undefined behaviour, and with that of threads.
#[test]
fn frames_come_whole_and_in_order_from_an_interrupt() {
    let (queue, threads) = (build("receive_queue"), build("receive_queue_threads"));
    for (program, arguments) in
        [(&queue, ["signal", "20000"]), (&queue, ["thread", "20000"]), (&threads, ["thread", "20000"])]
    {
        let output = Command::new(program).args(arguments).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&said));
    }
}
