//! The protocol that the plant uses in place of Resonarm's.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::cia402::{Cia402Exciter, Cia402Node, Cia402Spec};
use super::exciter_interface::ExciterInterface;
use super::exciter_lack::ExciterLack;
use super::interface::PlantInterface;
use super::mapped::MappedNode;
use super::mapped::exciter::MappedExciter;
use super::mapped::mapping::Mapping;
use super::time_base::TimeBase;
use crate::control::Controller;
use crate::rig::{Exciter, GateSpec};
use resonarm_protocol::Id;
use resonarm_protocol::node::Timing;

/// A user protocol, ready for a node.
#[derive(Clone, Debug)]
pub enum WireSpec {
    /// Messages of a DBC, mapped to loads, requests and readings.
    Mapped(Mapping),
    /// CANopen drives, one for each joint.
    Cia402(Cia402Spec),
}

impl WireSpec {
    /// Builds the plant's node with `rate_hz` samples per second, for an exciter with these limits and those of
    /// the gate.
    pub fn node(
        &self,
        (rate_hz, time_base): (u16, TimeBase),
        timing: Timing,
        exciter: Exciter,
        limits: GateSpec,
    ) -> Box<dyn PlantInterface> {
        match self {
            WireSpec::Mapped(mapping) => {
                Box::new(MappedNode::new(mapping.clone(), (rate_hz, time_base), timing, exciter, limits))
            }
            WireSpec::Cia402(spec) => Box::new(Cia402Node::new(spec, (rate_hz, time_base), timing, exciter, limits)),
        }
    }

    /// Builds the exciter's node, which lets `controller` answer `rate_hz` samples per second.
    ///
    /// # Errors
    /// [`ExciterLack`] says what the protocol lacks for it.
    pub fn exciter(
        &self,
        rate: (u16, TimeBase),
        timing: Timing,
        controller: Box<dyn Controller>,
    ) -> Result<Box<dyn ExciterInterface>, ExciterLack> {
        Ok(match self {
            WireSpec::Mapped(mapping) => Box::new(MappedExciter::new(mapping, rate, timing, controller)?),
            WireSpec::Cia402(spec) => Box::new(Cia402Exciter::new(spec, rate, timing, controller)?),
        })
    }

    /// Returns the identifiers of all messages; `None` if a master chooses some of them during the run: they
    /// may be any of 11 bits.
    pub fn ids(&self) -> Option<Vec<Id>> {
        match self {
            WireSpec::Mapped(mapping) => {
                let incoming = mapping.incoming.iter().map(|message| message.id);
                Some(incoming.chain(mapping.outgoing.iter().map(|message| message.id)).collect())
            }
            WireSpec::Cia402(_) => None,
        }
    }
}
