//! The states of a grid and their fates, as `basins` prints and draws them.

use serde::Serialize;

use crate::settling_flags::or_empty;
use resonarm::analysis::time_domain::BasinOutcome;
use resonarm::study::StateGrid;
use resonarm_figures::plot::{Axis, Color, Figure, Legend, Marker, Panel, Series};

/// An initial state of the grid, as the results state it.
#[derive(Serialize)]
struct Cell {
    at: [f64; 2],
    /// The number of the response that it reaches, counted from 1.
    #[serde(rename = "motion")]
    orbit: Option<usize>,
    /// Periods of the excitation until this was certain.
    periods: Option<u64>,
    /// `reaches`, `undecided` or `diverges`.
    outcome: &'static str,
}

/// The cells of a grid, and the numbers of those without a response.
#[derive(Serialize)]
pub(crate) struct Cells {
    undecided: usize,
    diverging: usize,
    cells: Vec<Cell>,
}

impl Cells {
    /// Lists the fates of the states of a grid.
    pub fn new(grid: &StateGrid, outcomes: &[BasinOutcome]) -> Cells {
        let cell = |(index, outcome): (usize, &BasinOutcome)| {
            let (orbit, periods, name) = match outcome {
                BasinOutcome::Reaches { orbit, periods } => (Some(orbit + 1), Some(*periods), "reaches"),
                BasinOutcome::Undecided => (None, None, "undecided"),
                BasinOutcome::Diverges => (None, None, "diverges"),
            };
            Cell { at: grid.values(index), orbit, periods, outcome: name }
        };
        let cells: Vec<Cell> = outcomes.iter().enumerate().map(cell).collect();
        let count = |name: &str| cells.iter().filter(|cell| cell.outcome == name).count();
        Cells { undecided: count("undecided"), diverging: count("diverges"), cells }
    }

    /// Returns the number of states.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Returns the number of states that reach a response, which is counted from 0.
    pub fn reaching(&self, orbit: usize) -> usize {
        self.cells.iter().filter(|cell| cell.orbit == Some(orbit + 1)).count()
    }

    /// Says in words how many states reach no response, and what to try.
    pub fn others(&self, time_constants: f64) -> String {
        let mut text = String::new();
        if self.undecided > 0 {
            text += &format!(
                "undecided: {} states reach none of these within {time_constants} time constants (try more \
                 --time-constants)\n",
                self.undecided
            );
        }
        if self.diverging > 0 {
            text += &format!("beyond all bounds: {} states\n", self.diverging);
        }
        text
    }

    /// Returns a line for each state, whose coordinates have these names.
    pub fn csv(&self, [x, y]: [&str; 2]) -> String {
        let mut text = format!("{x},{y},outcome,motion,periods\n");
        for Cell { at: [x, y], orbit, periods, outcome } in &self.cells {
            let (orbit, periods) = (or_empty(*orbit), or_empty(*periods));
            text += &format!("{x},{y},{outcome},{orbit},{periods}\n");
        }
        text
    }

    /// Draws a tile for each state, in the colour of the response it reaches, which `labels` name; the sections of the
    /// responses are drawn over them. `spacing` is the distance of neighbouring states along each axis.
    pub fn figure(
        &self,
        [x, y]: [&str; 2],
        spacing: [f64; 2],
        labels: Vec<String>,
        sections: Vec<(f64, f64)>,
    ) -> Figure {
        let mut panel = Panel::new(Axis::linear(x), Axis::linear(y)).legend(Legend::Below);
        let cells = |wanted: &dyn Fn(&Cell) -> bool| {
            self.cells.iter().filter(|cell| wanted(cell)).map(|cell| (cell.at[0], cell.at[1])).collect::<Vec<_>>()
        };
        let colors = [Color::SkyBlue, Color::Vermillion, Color::Yellow, Color::Green, Color::Purple, Color::Blue];
        for (k, label) in labels.into_iter().enumerate() {
            // Seven stable orbits at one frequency would repeat a colour; grey and black are kept for the states that
            // reach none.
            let color = colors[k % colors.len()];
            let points = cells(&|cell| cell.orbit == Some(k + 1));
            panel = panel.with_any(Series::tiles(label, color, spacing, points));
        }
        for (outcome, label, color) in
            [("undecided", "undecided", Color::Grey), ("diverges", "beyond all bounds", Color::Black)]
        {
            let points = cells(&|cell| cell.outcome == outcome);
            panel = panel.with_any(Series::tiles(label, color, spacing, points));
        }
        // Drawn last, over the tiles. The other coordinates of an orbit are usually not those of the plane of the
        // grid, so that its mark is a projection and may lie in a tile of another colour.
        let sections = Series::markers("stable responses, projected", Color::Black, Marker::Diamond, sections);
        let panel = panel.with(sections.marked(8.0, false));
        Figure::new("Basins of attraction: where each initial state ends").with(panel)
    }
}
