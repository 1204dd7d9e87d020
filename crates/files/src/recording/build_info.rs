//! Which build of the library this is.

/// Which build of the library this is: what a recording must state so that it can be simulated again bit for bit.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct BuildInfo {
    /// Version of the crate.
    pub version: String,
    /// Commit of the sources, `-dirty` behind it if they were edited since; `unknown` for a build without git.
    pub git_commit: String,
    /// Target triple for which the program was compiled.
    pub target: String,
    /// Profile of the build: `debug` or `release`.
    pub profile: String,
    /// What `rustc --version` says.
    pub compiler: String,
}

/// The build that runs now.
pub fn build_info() -> BuildInfo {
    BuildInfo {
        version: env!("CARGO_PKG_VERSION").to_string(),
        git_commit: env!("RESONARM_GIT_COMMIT").to_string(),
        target: env!("RESONARM_TARGET").to_string(),
        profile: env!("RESONARM_PROFILE").to_string(),
        compiler: env!("RESONARM_RUSTC").to_string(),
    }
}
