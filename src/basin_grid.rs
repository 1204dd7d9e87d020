//! The grid of initial states of `basins`, with its flags.

use clap::Args;

use crate::failure::Failure;
use crate::help::heading;
use crate::numbers;
use resonarm::study::StateGrid;
use resonarm_numeric::number::short;

/// The largest number of values of a coordinate.
const MOST: u32 = 1000;

/// The grid of initial states.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::RANGE)]
pub(crate) struct GridFlags {
    /// First value of each coordinate [default: the negative of --to].
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1)]
    from: Option<Vec<f64>>,
    /// Last value of each coordinate [default: 1.5 times as far as the largest stable response reaches].
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1)]
    to: Option<Vec<f64>>,
    /// Number of values of each coordinate, evenly spaced, from 2 to 1000.
    #[arg(
        long,
        value_name = "NX,NY",
        default_value = "41,41",
        allow_hyphen_values = true,
        value_delimiter = ',',
        num_args = 1,
        value_parser = numbers::integer_checked_later(2..=MOST)
    )]
    points: Vec<u32>,
}

impl GridFlags {
    /// Returns the grid in two coordinates; without flags each of them extends as far as `reach`.
    pub fn grid(
        &self,
        coordinates: [usize; 2],
        names: [&str; 2],
        reach: [f64; 2],
        others: Vec<f64>,
    ) -> Result<StateGrid, Failure> {
        if names[0] == names[1] {
            return Err(Failure::usage(format!("--coordinates names {} twice: give two different ones", names[0])));
        }
        let counts = pair("--points", &self.points)?;
        if let Some(count) = counts.iter().find(|count| !(2..=MOST).contains(*count)) {
            return Err(Failure::usage(format!("--points has the value {count}: it must be from 2 to {MOST}")));
        }
        let to = self.to.as_ref().map_or(Ok(reach), |to| pair("--to", to))?;
        // Coordinates count from rest, so a grid without --from is symmetric about the state of rest.
        let from = self.from.as_ref().map_or_else(|| Ok(to.map(|to| -to)), |from| pair("--from", from))?;
        let ends = [0, 1].map(|axis| [from[axis], to[axis]]);
        match ends.iter().find(|[from, to]| !(from.is_finite() && to.is_finite() && from != to)) {
            Some([from, to]) => {
                let (from, to) = (short(from), short(to));
                Err(Failure::usage(format!("invalid grid from {from} to {to}: the ends must be two different numbers")))
            }
            None => Ok(StateGrid { coordinates, ends, counts: counts.map(|count| count as usize), others }),
        }
    }
}

/// Returns the two values of a flag.
pub(crate) fn pair<T: Copy>(flag: &str, values: &[T]) -> Result<[T; 2], Failure> {
    let count = values.len();
    <[T; 2]>::try_from(values).map_err(|_count| Failure::usage(format!("{flag} has {count} values, expected two: X,Y")))
}
