//! The body of a structure, on which its elements act.

use alloc::boxed::Box;

use super::chain::Chain;
use super::modal::Modal;

/// Body of a structure, on which the elements act.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Body {
    Chain(Box<Chain>),
    Modal(Modal),
}
