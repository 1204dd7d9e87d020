//! What can go wrong in an analysis, and what to try.

use thiserror::Error;

/// Why an analysis has no result.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// A matrix has no inverse.
    #[error("a {size} x {size} matrix has no inverse")]
    Singular {
        /// Rows of the matrix.
        size: usize,
    },
}
