//! The documentation within an FMU.

use crate::content::VERSION;
use crate::description::escaped;
use crate::variables::{Causality, Variable};

/// The licence of the library.
pub(crate) const LICENSE: &str = "Resonarm, and the library in this FMU, are under the Apache License 2.0 or the MIT License, at your choice:\n\
    https://www.apache.org/licenses/LICENSE-2.0\n\
    https://opensource.org/license/mit\n\n\
    SPDX-License-Identifier: Apache-2.0 OR MIT\n";

/// `documentation/index.html`: what the FMU is, and its variables.
pub(crate) fn index(name: &str, variables: &[Variable], scenario: &str) -> String {
    let row = |variable: &Variable| {
        let role = match variable.causality {
            Causality::Independent => "time",
            Causality::Parameter => "parameter",
            Causality::Input => "input",
            Causality::Output => "output",
        };
        let unit = variable.unit.map_or("", |unit| unit.name);
        let [name, text] = [&variable.name, &variable.description].map(|text| escaped(text));
        format!("<tr><td><code>{name}</code></td><td>{role}</td><td>{unit}</td><td>{text}</td></tr>\n")
    };
    let rows: String = variables.iter().map(row).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{name}</title></head><body>\n\
         <h1>{name}</h1>\n<p>Exported by resonarm {VERSION}. Samples fall at their own times, whatever the steps of the \
         importer: loads are held from sample to sample, and outputs are those of the last sample. A reading describes the \
         middle of a sample period before its sample.</p>\n<h2>Variables</h2>\n<table>\n{rows}</table>\n<h2>Scenario</h2>\n<pre>{scenario}</pre>\n\
         </body></html>\n",
        name = escaped(name),
        scenario = escaped(scenario)
    )
}
