//! What is refused, and in which words.

use super::*;

fn refused(spec: &StructureSpec) -> String {
    Assembly::new(spec).unwrap_err().to_string()
}
