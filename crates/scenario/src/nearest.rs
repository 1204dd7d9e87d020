//! The known name nearest to one that is not known.

/// The name nearest to `got`, by the edits between them (Damerau–Levenshtein), if more than half of it agrees.
pub fn nearest<'a>(got: &str, names: impl Iterator<Item = &'a str>) -> Option<String> {
    let near = names.map(|name| (strsim::normalized_damerau_levenshtein(got, name), name));
    let (similarity, name) = near.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (similarity > 0.5).then(|| name.to_string())
}
