//! A conformance case: its name, its subject and its script.

use resonarm_protocol::Node;
use resonarm_session::run::Mode;

/// One case: a script of what is sent, and what must or must not be received. Its script is for a tester
/// on Resonarm's protocol ([`ProtocolCase`](super::ProtocolCase)) or on a user's ([`WireCase`](super::WireCase)).
#[derive(Clone, Copy, Debug)]
pub struct Case<S> {
    /// Name of the case, such as `plant-hello`.
    pub id: &'static str,
    /// The kind of node tested.
    pub tested: Node,
    /// The mode that the node is in.
    pub mode: Mode,
    /// Subject that the case tests.
    pub title: &'static str,
    /// The requirements that it covers.
    pub requirements: &'static [&'static str],
    pub(super) script: S,
}
