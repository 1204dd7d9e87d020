//! The `resonarm` program.

fn main() {}
