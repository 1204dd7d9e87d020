//! Stores a scenario in a recording and restores it.

use std::sync::Arc;

use super::Scenario;
use crate::configuration::Configuration;
use crate::error::ScenarioError;
use crate::specification;
use crate::structure::StructureKind;
use resonarm_bench::control::ControlSpec;
use resonarm_protocol::{PROTOCOL_VERSION, dbc};

/// Key of the scenario in a recording's configuration.
const SCENARIO: &str = "scenario";
/// Key of the DBC text of the user protocol in a recording's configuration.
const DBC: &str = "wire_dbc";
/// Key of the text of the specification in a recording's configuration, and beginning of the keys of the files that it names.
const SPECIFICATION: &str = "specification";
const TABLE: &str = "specification_file:";

impl Scenario {
    /// Returns what a recording states about its run: the whole scenario, the run loop, the protocol.
    ///
    /// # Errors
    /// The errors of [`Scenario::to_toml`].
    pub fn configuration(&self, run_loop: &str) -> Result<Configuration, ScenarioError> {
        let mut configuration = Configuration::new().with(SCENARIO, self.to_toml()?);
        // The text of the DBC goes along, since the file may have changed or be gone when the recording is
        // replayed.
        if let Some(text) = self.wire.as_ref().and_then(|wire| wire.text.clone()) {
            configuration = configuration.with(DBC, text);
        }
        let test = self.control.as_ref().and_then(ControlSpec::test);
        if let Some(source) = test.and_then(|(_, test)| test.source.as_ref()) {
            configuration = configuration.with(SPECIFICATION, &source.text);
            for (name, text) in &source.tables {
                configuration = configuration.with(format!("{TABLE}{name}"), text);
            }
        }
        Ok(configuration
            .with("run_loop", run_loop)
            .with("protocol_version", format!("{}.{}", PROTOCOL_VERSION >> 4, PROTOCOL_VERSION & 0xF))
            .with("protocol_dbc_crc32", format!("{:08x}", dbc::hash(self.network.profile))))
    }

    /// Restores the scenario that a recording was made with. An FMU that it names is not loaded: a recording is
    /// data.
    ///
    /// # Errors
    /// [`ScenarioError::NotInRecording`] if the recording has none, [`ScenarioError::Parse`] if this program can't read
    /// it, [`ScenarioError::Specification`] if it can't read the specification of its control.
    pub fn from_configuration(configuration: &Configuration) -> Result<Scenario, ScenarioError> {
        let text = configuration.get(SCENARIO).ok_or(ScenarioError::NotInRecording)?;
        // Checks are skipped: the run has taken place, and a check that was added since must not make its
        // recording unreadable.
        let mut scenario = Scenario::parse_unchecked(text, "the recording's scenario")?;
        if let Some(wire) = &mut scenario.wire {
            wire.text = configuration.get(DBC).map(str::to_string);
        }
        let test = scenario.control.as_mut().and_then(ControlSpec::test_mut);
        if let (Some(test), Some(text)) = (test, configuration.get(SPECIFICATION)) {
            let table = |name: &str| {
                let text = configuration.get(&format!("{TABLE}{name}")).map(str::to_string);
                text.ok_or_else(|| String::from("the recording does not hold it"))
            };
            let source = specification::parse_source(text, "the recording's specification", table)?;
            test.source = Some(Arc::new(source));
        }
        scenario.structure.is_recorded = scenario.structure.kind == StructureKind::Fmu;
        Ok(scenario)
    }
}
