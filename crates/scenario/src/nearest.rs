//! Finds the known name closest to an unknown one, for suggestions in messages.

/// Returns the name closest to `got` by edit distance (Damerau–Levenshtein, normalised), if the similarity
/// exceeds one half.
pub fn nearest<'a>(got: &str, names: impl Iterator<Item = &'a str>) -> Option<String> {
    let near = names.map(|name| (strsim::normalized_damerau_levenshtein(got, name), name));
    let (similarity, name) = near.max_by(|a, b| a.0.total_cmp(&b.0))?;
    // Below one half, short names match almost anything, and a wrong suggestion is worse than none.
    (similarity > 0.5).then(|| name.to_string())
}
