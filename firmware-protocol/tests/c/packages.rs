//! The library as others take it: by CMake, by pkg-config, as an Arduino library.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use resonarm_protocol::{DEFAULT_BASE, Network, header};

const SOURCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/c");
/// Prints the library's version, and whether its network is the default one.
const USER: &str = r#"#include <resonarm_exciter.h>
#include <stdio.h>
int main(void) {
    printf("%s 0x%x\n", RESONARM_VERSION, (unsigned)resonarm_own_network().base);
    return 0;
}
"#;

/// Runs a command that must succeed; its standard output.
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8(output.stdout).unwrap()
}

/// An empty folder for the output of a test.
fn empty(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Installs the library by CMake with these settings; returns the prefix.
fn install(folder: &Path, settings: &[String]) -> PathBuf {
    let (build, prefix) = (folder.join("build"), folder.join("installed"));
    run(Command::new("cmake").args(["-S", SOURCE, "-B"]).arg(&build).args(settings));
    run(Command::new("cmake").arg("--build").arg(&build));
    run(Command::new("cmake").arg("--install").arg(&build).arg("--prefix").arg(&prefix));
    prefix
}

/// The output of a project of CMake with these lines in place of the library's target.
fn user_of_cmake(folder: &Path, lines: &str, settings: &[String]) -> String {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("user.c"), USER).unwrap();
    let project = format!(
        "cmake_minimum_required(VERSION 3.16)\nproject(user C)\n{lines}\nadd_executable(user user.c)\n\
         target_link_libraries(user PRIVATE resonarm::resonarm)\n"
    );
    fs::write(folder.join("CMakeLists.txt"), project).unwrap();
    run(Command::new("cmake").arg("-S").arg(folder).arg("-B").arg(folder.join("build")).args(settings));
    run(Command::new("cmake").arg("--build").arg(folder.join("build")));
    run(&mut Command::new(folder.join("build/user")))
}

fn expected(base: u16) -> String {
    format!("{} 0x{base:x}\n", env!("CARGO_PKG_VERSION"))
}

#[test]
fn cmake_and_pkg_config_find_the_installed_library() {
    let folder = empty("cmake");
    let prefix = install(&folder, &[]);
    let settings = [format!("-DCMAKE_PREFIX_PATH={}", prefix.display())];
    let said = user_of_cmake(&folder.join("user"), "find_package(resonarm 0.1 REQUIRED)", &settings);
    assert_eq!(said, expected(DEFAULT_BASE));

    let packages = prefix.join("lib/pkgconfig");
    let flags =
        run(Command::new("pkg-config").args(["--cflags", "--libs", "resonarm"]).env("PKG_CONFIG_PATH", &packages));
    let program = folder.join("by-pkg-config");
    run(Command::new("cc").arg(folder.join("user/user.c")).args(flags.split_whitespace()).arg("-o").arg(&program));
    assert_eq!(run(&mut Command::new(program)), expected(DEFAULT_BASE));
}

/// In its headers, for those who install it, and in the compiler's flags, for those who add its folder.
#[test]
fn a_network_of_ones_own_reaches_those_who_use_the_library() {
    let folder = empty("cmake-config");
    let network = Network::new(0x300).unwrap();
    let config = folder.join("own.h");
    fs::write(&config, header::Header(network).to_string()).unwrap();
    let settings = [format!("-DRESONARM_CONFIG={}", config.display()), String::from("-DRESONARM_CLASSIC_ONLY=ON")];
    let prefix = install(&folder, &settings);
    let found = [format!("-DCMAKE_PREFIX_PATH={}", prefix.display())];
    assert_eq!(user_of_cmake(&folder.join("found"), "find_package(resonarm REQUIRED)", &found), expected(0x300));
    let added = format!("add_subdirectory({SOURCE} resonarm)");
    assert_eq!(user_of_cmake(&folder.join("added"), &added, &settings), expected(0x300));
}

#[test]
fn the_arduino_library_compiles_with_its_folder_alone() {
    let folder = empty("arduino");
    run(Command::new("make")
        .args(["--silent", "--directory", SOURCE, "arduino"])
        .arg(format!("OUT={}", folder.display())));
    let sources = folder.join("arduino/Resonarm/src");
    for entry in fs::read_dir(&sources).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.extension().is_some_and(|extension| extension == "c") {
            let mut compiler = Command::new("arm-none-eabi-gcc");
            compiler.args([
                "-ffreestanding",
                "-mcpu=cortex-m0",
                "-Os",
                "-std=gnu11",
                "-Wall",
                "-Werror",
                "-fsyntax-only",
                "-I",
            ]);
            run(compiler.arg(&sources).arg(&entry));
        }
    }
}

#[test]
fn the_packages_have_the_version_of_the_crate() {
    let version = env!("CARGO_PKG_VERSION");
    let json = fs::read_to_string(Path::new(SOURCE).join("library.json")).unwrap();
    assert_eq!(serde_json::from_str::<serde_json::Value>(&json).unwrap()["version"], version);
    let properties = fs::read_to_string(Path::new(SOURCE).join("library.properties")).unwrap();
    assert!(properties.contains(&format!("\nversion={version}\n")), "{properties}");
}
