//! Content of an FMU: its settings and its scenario, as files of its `resources`, and the token that stands for them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::fault::Fault;
use resonarm_bench::control::ControlSpec;
use resonarm_bench::excitation::{LoadFile, Waveform};
use resonarm_scenario::{Scenario, ScenarioError};

/// The version of the library, which the resources state: another version reads a scenario differently.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The file of the settings.
const SETTINGS: &str = "fmu.toml";
/// The file of the scenario.
const SCENARIO: &str = "scenario.toml";
/// The DBC of the scenario's own protocol.
const DBC: &str = "wire.dbc";
/// The load of the scenario's excitation.
const LOAD: &str = "load.csv";
/// The specification of the scenario's control.
const SPECIFICATION: &str = "specification.toml";
/// Names that a file that the specification names can't have.
const RESERVED: [&str; 5] = [SETTINGS, SCENARIO, DBC, LOAD, SPECIFICATION];

/// Interface by which an FMU is connected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interface {
    /// Loads in, readings out, as numbers.
    #[default]
    Signals,
    /// CAN frames by FMI-LS-BUS.
    Can,
}

/// Part of a rig that an FMU simulates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The structure with its instruments, and with [`Interface::Can`] its node.
    #[default]
    Plant,
    /// The emulated exciter controller.
    Exciter,
    /// The bus between nodes, on which frames take their time.
    Bus,
}

/// Clock by which a node's frames leave it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TxClock {
    /// A triggered output clock: the node asks for event mode at the end of a step.
    #[default]
    Triggered,
    /// A countdown input clock: the node says beforehand when it sends.
    Countdown,
}

/// The settings of an FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Interface by which the FMU is connected.
    pub interface: Interface,
    /// Part of the test rig that the FMU simulates.
    pub role: Role,
    /// Clock by which the FMU's frames leave it.
    pub clock: TxClock,
    /// Number of nodes for which a bus has terminals.
    pub nodes: u8,
}

/// An FMU's settings with the version that wrote them.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Versioned {
    version: String,
    settings: Settings,
}

/// Settings and scenario of an FMU.
#[derive(Clone, Debug, PartialEq)]
pub struct Content {
    /// Settings with which it was exported.
    pub settings: Settings,
    /// Scenario of the FMU, with the files that it names.
    pub scenario: Scenario,
}

impl Content {
    /// The files of the resources, by their names.
    ///
    /// # Errors
    /// [`ScenarioError::Write`] if the scenario can't be written.
    pub fn files(&self) -> Result<BTreeMap<String, Vec<u8>>, ScenarioError> {
        let mut scenario = self.scenario.clone();
        let mut files = BTreeMap::new();
        if let Some(wire) = &mut scenario.wire
            && let Some(text) = &wire.text
        {
            files.insert(DBC.to_string(), text.clone().into_bytes());
            wire.dbc = DBC.into();
        }
        if let Some(Waveform::File { path, load: Some(load) }) =
            scenario.excitation.as_mut().map(|spec| &mut spec.profile)
        {
            files.insert(LOAD.to_string(), rows(load).into_bytes());
            *path = LOAD.to_string();
        }
        if let Some(test) = scenario.control.as_mut().and_then(ControlSpec::test_mut)
            && let Some(source) = &test.source
        {
            // The specification names its tables, which therefore keep their names beside it.
            for (name, text) in &source.tables {
                if Path::new(name).file_name().is_none_or(|file| file != name.as_str())
                    || RESERVED.contains(&name.as_str())
                {
                    let reason = format!(
                        "the specification names {name}: put the file beside it, under another name than those of the FMU"
                    );
                    return Err(ScenarioError::Write { reason });
                }
                files.insert(name.clone(), text.clone().into_bytes());
            }
            files.insert(SPECIFICATION.to_string(), source.text.clone().into_bytes());
            test.specification = SPECIFICATION.to_string();
        }
        let versioned = Versioned { version: VERSION.to_string(), settings: self.settings };
        let settings =
            toml::to_string(&versioned).map_err(|error| ScenarioError::Write { reason: error.to_string() })?;
        files.insert(SETTINGS.to_string(), settings.into_bytes());
        files.insert(SCENARIO.to_string(), scenario.to_toml()?.into_bytes());
        Ok(files)
    }

    /// The content in the resources of an FMU, in `folder`, if `token` is its token.
    ///
    /// # Errors
    /// [`Fault::Resource`] if a file is missing or unreadable, [`Fault::Version`] of another version,
    /// [`Fault::Token`] for a wrong token, [`Fault::Scenario`] for an invalid scenario.
    pub fn read(folder: &Path, token: &str) -> Result<Content, Fault> {
        let path = folder.join(SETTINGS);
        let unreadable = |reason: String| Fault::Resource { path: path.clone(), reason };
        let text = fs::read_to_string(&path).map_err(|source| unreadable(source.to_string()))?;
        let versioned: Versioned = toml::from_str(&text).map_err(|error| unreadable(error.to_string()))?;
        if versioned.version != VERSION {
            return Err(Fault::Version { got: versioned.version, expected: VERSION });
        }
        let content = Content { settings: versioned.settings, scenario: Scenario::read(&folder.join(SCENARIO))? };
        // The token follows from what was read, so a scenario that was edited after the export is noticed.
        let expected = self::token(&content.files()?);
        if token == expected { Ok(content) } else { Err(Fault::Token { got: token.to_string(), expected }) }
    }
}

/// The lines of a load file, each number with all its digits.
fn rows(load: &LoadFile) -> String {
    match load {
        LoadFile::Sampled(loads) => loads.iter().map(|load| format!("{load:e}\n")).collect(),
        LoadFile::Timed(rows) => rows.iter().map(|[t_s, load]| format!("{t_s:e},{load:e}\n")).collect(),
    }
}

/// The token of an FMU with these resources: the 128-bit FNV-1a hash (Fowler, Noll, Vo) of their names, lengths and
/// bytes.
///
/// h ← (h ⊕ byte) · (2⁸⁸ + 2⁸ + 3b₁₆) mod 2¹²⁸ for every byte.
pub fn token(files: &BTreeMap<String, Vec<u8>>) -> String {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = (1 << 88) + (1 << 8) + 0x3b;
    let hash =
        |hash: u128, bytes: &[u8]| bytes.iter().fold(hash, |h, byte| (h ^ u128::from(*byte)).wrapping_mul(PRIME));
    let of_all = files.iter().fold(OFFSET, |all, (name, data)| {
        // The lengths are hashed, too: else bytes could move from a name to its data, or to the next file, unnoticed.
        let lengths = [name.len() as u64, data.len() as u64].map(u64::to_le_bytes);
        [name.as_bytes(), &lengths.concat(), data].into_iter().fold(all, hash)
    });
    format!("{{{of_all:032x}}}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_token_is_the_published_hash() {
        // Of no bytes FNV-1a is its offset; that of a name, its lengths and its byte follows by hand.
        assert_eq!(token(&BTreeMap::new()), "{6c62272e07bb014262b821756295c58d}");
        let of = |name: &str, data: &[u8]| token(&BTreeMap::from([(name.to_string(), data.to_vec())]));
        assert_ne!(of("a", b"bc"), of("ab", b"c"));
        assert_eq!(of("a", b"b"), of("a", b"b"));
    }

    #[test]
    fn content_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("pulse.csv"), "0\n0.1\n1e-3\n").unwrap();
        let text =
            "excitation = { amplitude = { exciter_x = 3 }, profile = { waveform = 'file', path = 'pulse.csv' } }";
        fs::write(folder.path().join("s.toml"), text).unwrap();
        let scenario = Scenario::read(&folder.path().join("s.toml")).unwrap();
        let settings = Settings { clock: TxClock::Countdown, ..Settings::default() };
        let files = Content { settings, scenario }.files().unwrap();
        for (name, data) in &files {
            fs::write(folder.path().join(name), data).unwrap();
        }
        let content = Content::read(folder.path(), &token(&files)).unwrap();
        assert_eq!(content.settings.clock, TxClock::Countdown);
        assert_eq!(content.files().unwrap(), files);
        let error = Content::read(folder.path(), "{0}").unwrap_err().to_string();
        assert!(error.starts_with("the instantiation token is {0}"), "{error}");
    }

    /// The specification of a test, with its table, is read from the resources alone; one elsewhere is refused.
    #[test]
    fn a_specification_goes_along() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        let random = "[spec]\nkind = 'random'\nsources = []\n[random]\nunit = '(m/s2)2/Hz'\nfile = 'profile.csv'\n\
                      tolerance_db = [-3, 3]\n[schedule]\nlevels_db = [0]\nseconds = [10]\n[control]\nchannels = ['c.x']\n";
        write("random.toml", random);
        write("profile.csv", "10,0.1\n100,0.1\n");
        write("s.toml", "control = { law = 'random', amplitude = { exciter_x = 3 }, specification = 'random.toml' }");
        let scenario = || Scenario::read(&folder.path().join("s.toml")).unwrap();
        let files = Content { settings: Settings::default(), scenario: scenario() }.files().unwrap();
        let alone = tempfile::tempdir().unwrap();
        for (name, data) in &files {
            fs::write(alone.path().join(name), data).unwrap();
        }
        let content = Content::read(alone.path(), &token(&files)).unwrap();
        content.scenario.controller().unwrap();
        assert_eq!(content.files().unwrap(), files);
        write("random.toml", &random.replace("profile.csv", "./profile.csv"));
        let error = Content { settings: Settings::default(), scenario: scenario() }.files().unwrap_err().to_string();
        assert!(error.contains("the specification names ./profile.csv"), "{error}");
    }
}
