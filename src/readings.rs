//! The readings a bench would take of computed motions, in the documents and tables of every command for periodic
//! motions.

use clap::Args;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value, json};

use resonarm::analysis::{Readings, Response};
use resonarm::excitation::Phasor;

/// Whether to add readings.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct ReadingsFlag {
    /// Add what a bench reads at B and C to the points in JSON and CSV: the fundamental of displacement, velocity and
    /// acceleration.
    #[arg(long)]
    pub readings: bool,
}

/// The keys, for the end of a help text: a line for each paragraph.
const HELP: &str = "\
With --readings every motion in JSON and CSV has its component at the frequency of the excitation; a doubled motion \
too.
  JSON: readings.PLACE.QUANTITY.PART_UNIT, as readings.c_x.acceleration.amplitude_m_s2 or readings.c_x.velocity.lag_deg
  CSV: PLACE_QUANTITY_PART_UNIT, as c_x_acceleration_amplitude_m_s2 or c_x_velocity_lag_deg
PLACE is b_x, b_y, c_x or c_y: the points B and C along x and y of the base frame. QUANTITY is displacement, velocity \
or acceleration, in m, m/s and m/s². With the load A sin Ωt, A with its sign, the component is
  amplitude sin(Ωt − lag) = real sin Ωt + imaginary cos Ωt
with a lag from −180° to 180°. At small loads real + i imaginary is A times what `frf` gives; the phase of `frf`, by \
which the response leads, is the lag with the other sign.";

/// The end of a help text: examples, then the keys, and further remarks on readings.
pub(crate) fn help_after(examples: &str, more: &str) -> String {
    format!("{examples}\n\n{HELP}{more}")
}

const PLACES: [(&str, Response); 4] =
    [("b_x", Response::BX), ("b_y", Response::BY), ("c_x", Response::CX), ("c_y", Response::CY)];

type Of = fn(&Readings, Response) -> Phasor;
const QUANTITIES: [(&str, &str, Of); 3] = [
    ("displacement", "m", Readings::displacement),
    ("velocity", "m_s", Readings::velocity),
    ("acceleration", "m_s2", Readings::acceleration),
];

/// The components of a phasor and their units; `unit` is that of the quantity.
fn components(phasor: Phasor, unit: &str) -> [(&'static str, &str, f64); 4] {
    [
        ("amplitude", unit, libm::hypot(phasor.re, phasor.im)),
        ("lag", "deg", lag_deg(phasor)),
        ("real", unit, phasor.re),
        ("imaginary", unit, phasor.im),
    ]
}

/// The lag behind sin Ωt, above −180° and up to 180°.
fn lag_deg(phasor: Phasor) -> f64 {
    // The difference is +0 for both zeros: a response in phase lags by 0°, not −0°; one in antiphase by 180°, not
    // −180°.
    libm::atan2(0.0 - phasor.im, phasor.re).to_degrees()
}

/// Readings as they appear in a document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReadingsDocument(pub Readings);

impl ReadingsDocument {
    pub fn value(&self) -> Value {
        let quantity = |(name, unit, of): (&str, &str, Of), place| {
            let numbers = components(of(&self.0, place), unit)
                .map(|(component, unit, value)| (format!("{component}_{unit}"), json!(value)));
            (name.to_string(), Value::Object(Map::from_iter(numbers)))
        };
        let place = |(name, place): (&str, Response)| {
            let quantities = QUANTITIES.map(|each| quantity(each, place));
            (name.to_string(), Value::Object(Map::from_iter(quantities)))
        };
        Value::Object(Map::from_iter(PLACES.map(place)))
    }

    /// The cells of a table, a comma before each.
    pub fn cells(&self) -> String {
        let mut text = String::new();
        for (_, place) in PLACES {
            for (_, unit, of) in QUANTITIES {
                for (component, _, value) in components(of(&self.0, place), unit) {
                    text += &if component == "lag" { format!(",{value}") } else { format!(",{value:e}") };
                }
            }
        }
        text
    }
}

impl Serialize for ReadingsDocument {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value().serialize(serializer)
    }
}

/// The columns of a table, a comma before each; empty if they are not wanted.
pub(crate) fn columns(wanted: bool) -> String {
    let mut text = String::new();
    if !wanted {
        return text;
    }
    for (place, _) in PLACES {
        for (quantity, unit, _) in QUANTITIES {
            for (component, unit, _) in components(Phasor::default(), unit) {
                text += &format!(",{place}_{quantity}_{component}_{unit}");
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lags_are_within_one_turn() {
        let lag = |re, im| lag_deg(Phasor::new(re, im)).to_string();
        assert_eq!([lag(1.0, 0.0), lag(1.0, -0.0), lag(0.0, -1.0), lag(0.0, 2.0)], ["0", "0", "90", "-90"]);
        assert_eq!([lag(-1.0, 0.0), lag(-1.0, -0.0), lag(-1.0, 1.0), lag(0.0, 0.0)], ["180", "180", "-135", "0"]);
    }
}
