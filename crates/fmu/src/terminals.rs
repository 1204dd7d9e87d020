//! Files that FMI-LS-BUS demands of an FMU beside its variables: terminals and a manifest.

use std::fmt::Write;

use crate::content::{Role, Settings};
use crate::variables::terminals;

/// The file of the terminals.
pub(crate) const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";
/// The file of the manifest.
pub(crate) const MANIFEST: &str = "extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml";

/// Returns the file `terminalsAndIcons.xml` with the network terminals.
pub(crate) fn terminals_and_icons(settings: &Settings) -> String {
    let mut xml = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiTerminalsAndIcons fmiVersion=\"3.0\">\n  <Terminals>\n",
    );
    for name in terminals(settings) {
        let _ = writeln!(
            xml,
            "    <Terminal name=\"{name}\" terminalKind=\"org.fmi-ls-bus.network-terminal\" \
             matchingRule=\"org.fmi-ls-bus.transceiver\">"
        );
        for member in ["Rx_Data", "Rx_Clock", "Tx_Data", "Tx_Clock"] {
            let _ = writeln!(
                xml,
                "      <TerminalMemberVariable variableKind=\"signal\" memberName=\"{member}\" variableName=\"{name}.{member}\"/>"
            );
        }
        xml += "    </Terminal>\n";
    }
    xml + "  </Terminals>\n</fmiTerminalsAndIcons>\n"
}

/// Returns the file `fmi-ls-manifest.xml`, which declares FMI-LS-BUS.
pub(crate) fn manifest(settings: &Settings) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiLayeredStandardManifest xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" \
         fmi-ls:fmi-ls-name=\"org.fmi-standard.fmi-ls-bus\" fmi-ls:fmi-ls-version=\"1.0.0\" \
         fmi-ls:fmi-ls-description=\"Layered Standard for the simulation of bus communication on a Physical Signal Abstraction \
         or Network Abstraction based level.\" isBusSimulationFMU=\"{}\"/>\n",
        settings.role == Role::Bus
    )
}
