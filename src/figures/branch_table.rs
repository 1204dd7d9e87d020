//! Branches as tables: comma-separated values (RFC 4180), with the units in the names of the columns.

use crate::readings::{self, Reader};
use resonarm::analysis::{BifurcationKind, Branch, Orbit};

/// A line for each motion. `branch` is 0, and counts from 1 for doubled branches; `varied` names the column of the
/// quantity that varies; with a reader each line also has the readings.
pub(crate) fn csv(varied: &str, branches: &[&Branch], reader: Option<&Reader>) -> String {
    let with_readings = readings::columns(reader.is_some());
    let is_frequency = varied == "frequency_hz";
    let column = if is_frequency { String::new() } else { format!("{varied},") };
    let mut text = format!(
        "branch,{column}frequency_hz,amplitude1_rad,amplitude2_rad,harmonic1_alpha1_rad,harmonic1_alpha2_rad,\
         largest_multiplier,stability,bifurcation{with_readings}\n"
    );
    for (number, branch) in branches.iter().enumerate() {
        for row in branch.rows() {
            let Orbit { value, frequency_hz, amplitude_rad: [a1, a2], harmonic1_rad: [h1, h2], .. } = row.orbit;
            let value = if is_frequency { String::new() } else { format!("{value},") };
            let stability = match row.stable() {
                Some(true) => "stable",
                Some(false) => "unstable",
                None => "marginal",
            };
            let bifurcation = row.bifurcation.map_or("", BifurcationKind::name);
            let largest = row.orbit.multipliers().iter().fold(0.0_f64, |largest, mu| largest.max(mu.norm_sqr())).sqrt();
            let read = reader.map_or_else(String::new, |reader| reader.read(row.orbit).cells());
            text += &format!(
                "{number},{value}{frequency_hz},{a1},{a2},{h1},{h2},{largest},{stability},{bifurcation}{read}\n"
            );
        }
    }
    text
}
