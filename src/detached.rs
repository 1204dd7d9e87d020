//! What `continue` has searched beside a branch, as text and JSON.

use serde_json::{Value, json};

use crate::read_at::ReadAt;
use resonarm::analysis::{Searched, SubHarmonicSearch};
use resonarm_numeric::number::{rounded, significant};

/// Returns what was searched, or why nothing was.
pub(crate) fn document(searched: &Searched, read: &[ReadAt]) -> Value {
    let mut document = match searched.not_searched {
        Some(reason) => json!({ "not_searched": reason.name() }),
        None => {
            let largest = searched.largest.iter().zip(read);
            let largest = largest.map(|(size, at)| (at.name.clone(), json!({ "largest": size, "unit": at.unit() })));
            json!({
                "frequencies_hz": searched.frequencies_hz, "starts": searched.starts,
                "largest": Value::Object(largest.collect()), "loads": searched.loads,
                "attached": searched.attached, "evaluations": searched.work.evaluations,
            })
        }
    };
    if let Some(SubHarmonicSearch { values, error }) = &searched.sub_harmonics {
        document["sub_harmonics"] = json!({
            "periods": SubHarmonicSearch::PERIODS, "values": values, "error": error.as_ref().map(ToString::to_string),
        });
    }
    document
}

/// Says what was searched, or why nothing was, and how many branches with the period of the load were found. The load has
/// the first unit, the coordinate that varies the second.
pub(crate) fn text(searched: &Searched, found: usize, read: &[ReadAt], [load, varied]: [&str; 2]) -> String {
    let mut text = match searched.not_searched {
        Some(reason) => format!("{reason}\n"),
        None => in_words(searched, found, read, load),
    };
    match searched.attached {
        0 => {}
        1 => text += "a branch that leaves a known one was found and is not listed (--branches)\n",
        count => {
            text += &format!("{count} branches that leave known ones were found and are not listed (--branches)\n")
        }
    }
    text + &searched.sub_harmonics.as_ref().map_or_else(String::new, |search| sought(search, varied))
}

/// Says where responses with the period of the load were searched.
fn in_words(searched: &Searched, found: usize, read: &[ReadAt], load: &str) -> String {
    let (frequencies, starts) = (searched.frequencies_hz.len(), searched.starts);
    let mut text = format!("responses were searched at {frequencies} frequencies with {starts} starts each");
    if let (Some(largest), Some(at)) = (searched.largest.first(), read.first()) {
        text += &format!(", up to {largest:.2e} {} at {}", at.unit(), at.name);
    }
    if let Some([from, to]) = searched.loads {
        text +=
            &format!(", and along folds for loads from {} to {} {load}", significant(&from, 3), significant(&to, 3));
    }
    let found = if found == 0 { String::from("none") } else { found.to_string() };
    text + &format!(": found {found}; others may exist\n")
}

/// Says where sub-harmonic responses were sought.
fn sought(search: &SubHarmonicSearch, unit: &str) -> String {
    match (&search.error, search.values.as_slice()) {
        (Some(error), _) => format!("sub-harmonic responses were not sought: {error}\n"),
        (None, []) => String::from(
            "sub-harmonic responses were not sought: no free vibration has a half or a third of the frequency\n",
        ),
        (None, values @ [first, ..]) => {
            let [from, to] = [first, values.last().unwrap_or(first)].map(|value| rounded(value, 7));
            format!(
                "sub-harmonic responses of 2 and 3 periods were sought near free vibrations at {} values from {from} to {to} \
                 {unit}; others may exist\n",
                values.len()
            )
        }
    }
}
