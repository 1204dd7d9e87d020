//! The build of the library.

/// The build of the library. A recording must state it so that it can be re-simulated with bit-identical results.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct BuildInfo {
    /// Version of the crate.
    pub version: String,
    /// Commit of the sources, with `-dirty` behind it if they were edited since; `unknown` for a build without git.
    pub git_commit: String,
    /// Target triple for which the program was compiled.
    pub target: String,
    /// Profile of the build: `debug` or `release`.
    pub profile: String,
    /// Output of `rustc --version`.
    pub compiler: String,
}

/// Returns the build that runs now.
pub fn build_info() -> BuildInfo {
    BuildInfo {
        version: env!("CARGO_PKG_VERSION").to_string(),
        git_commit: env!("RESONARM_GIT_COMMIT").to_string(),
        target: env!("RESONARM_TARGET").to_string(),
        profile: env!("RESONARM_PROFILE").to_string(),
        compiler: env!("RESONARM_RUSTC").to_string(),
    }
}
