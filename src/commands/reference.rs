//! `resonarm reference`: the tables of the program, as documents.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use resonarm::conformance::{Check, REQUIREMENTS, Requirement, WIRE_REQUIREMENTS, cases};
use resonarm::protocol::Node;
use resonarm::run::Mode;
use resonarm::structure::{Channel, Kind, READINGS, known_states};
use serde_json::json;

use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;

/// Writes the tables of channels and of requirements as Markdown.
///
/// Tables of an earlier version are replaced.
#[derive(Debug, Args)]
pub(crate) struct Reference {
    /// Folder for the documents; it is created if missing.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    json: JsonFlag,
}

impl Reference {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let failed = Failure::write(&self.folder);
        std::fs::create_dir_all(&self.folder).map_err(&failed)?;
        let documents = [("channels.md", channels()), ("requirements.md", requirements())];
        let mut files = Vec::new();
        for (name, text) in documents {
            let path = self.folder.join(name);
            std::fs::write(&path, text).map_err(&failed)?;
            files.push(path);
        }
        let text = || files.iter().map(|path| format!("{}\n", path.display())).collect();
        self.json.show(&json!({ "files": files }), text, &[])
    }
}

/// Writes the table of the channels that a recording can have; those that differ by their number only share a row.
fn channels() -> String {
    let mut families: Vec<((String, String), Vec<Channel>)> = Vec::new();
    for channel in known_states().into_iter().chain(READINGS) {
        let family = numbered(&channel.name);
        // A list in place of a map: the rows keep the order of the channels in a recording.
        match families.iter_mut().find(|(known, _)| *known == family) {
            Some((_, members)) => members.push(channel),
            None => families.push((family, vec![channel])),
        }
    }
    let mut text = String::from(
        "# Channels\n\nEvery channel that a recording can have. Which of them one has depends on its structure and its \
         instruments; `resonarm inspect` lists them.\n\n\
         | channel | is | unit | at | axis | bit of `clipped` |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for (_, members) in &families {
        text.extend(row(members));
    }
    text
}

/// Splits a name into the parts before and after its number.
fn numbered(name: &str) -> (String, String) {
    let at = name.find(|letter: char| letter.is_ascii_digit()).unwrap_or(name.len());
    let (before, rest) = name.split_at(at);
    (before.to_owned(), rest.trim_start_matches(|letter: char| letter.is_ascii_digit()).to_owned())
}

/// Returns the row of channels that differ by their number.
fn row(members: &[Channel]) -> Option<String> {
    let first = members.first()?;
    let last = members.last()?;
    let bit = match first.kind {
        Kind::Reading { clip_bit } => clip_bit.to_string(),
        Kind::State | Kind::Load | Kind::Internal => String::new(),
    };
    let from_to = |from: String, to: String| if members.len() > 1 { format!("{from} to {to}") } else { from };
    let name = from_to(format!("`{}`", first.name), format!("`{}`", last.name));
    let at = from_to(first.point.name().into_owned(), last.point.name().into_owned());
    let kind = first.kind.name();
    let unit = first.quantity.unit();
    let axis = first.axis.name();
    Some(format!("| {name} | {kind} | {unit} | {at} | {axis} | {bit} |\n"))
}

/// Writes the table of the demands of the protocol and of a user protocol, with the cases of `conformance` that test
/// them.
fn requirements() -> String {
    let modes = || Mode::ALL.into_iter().flat_map(|mode| Node::ALL.map(|node| (mode, node)));
    let tested = |requirement: &Requirement| {
        let all = modes().flat_map(|(mode, node)| cases(node, mode));
        let named = all.filter(|case| case.requirements.contains(&requirement.id));
        named.map(|case| format!("`{}`", case.id)).collect::<Vec<_>>().join(", ")
    };
    let mut text = String::from(
        "# Requirements\n\nWhat the protocol demands of a plant and an exciter, by the numbers of \
         [its specification](../../firmware-protocol/SPEC.md), and the cases of `resonarm conformance` that test it.\n\n",
    );
    text += &table("cases", &REQUIREMENTS, tested);
    text += "\n## Of a protocol of your own\n\nWhat `resonarm conformance --scenario` tests of nodes that speak \
             [a protocol of yours](../own-protocol.md).\n\n";
    text + &table("tested", &WIRE_REQUIREMENTS, |_| String::from("yes"))
}

fn table(head: &str, requirements: &[Requirement], tested: impl Fn(&Requirement) -> String) -> String {
    let mut text = format!("| number | demand | {head} |\n| --- | --- | --- |\n");
    for requirement in requirements {
        let by = match requirement.check {
            Check::Cases => tested(requirement),
            Check::Elsewhere(why) => format!("none: {why}"),
        };
        let _ = writeln!(text, "| {} | {} | {by} |", requirement.id, requirement.text);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_joined_and_others_are_not() {
        let text = channels();
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with("| `")).collect();
        assert!(rows.contains(&"| `alpha1_rad` to `alpha8_rad` | state | rad | joint 1 to joint 8 | about z |  |"));
        assert!(rows.contains(&"| `head_force_y_n` | reading | N | tip C | y | 5 |"));
        assert_eq!(rows.len(), 6 + 5 + 3 + READINGS.len(), "{text}");
    }

    #[test]
    fn every_demand_has_its_cases_or_says_why_not() {
        let text = requirements();
        let rows: Vec<Vec<&str>> = text
            .lines()
            .filter(|line| line.starts_with("| R-") || line.starts_with("| W-"))
            .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
            .collect();
        assert_eq!(rows.len(), REQUIREMENTS.len() + WIRE_REQUIREMENTS.len());
        assert!(rows.iter().all(|cells| cells.len() == 3 && cells.iter().all(|cell| !cell.is_empty())), "{text}");
    }
}
