//! The protocol that the plant speaks, in place of Resonarm's.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::cia402::{Cia402Exciter, Cia402Node, Cia402Spec};
use super::mapped::MappedNode;
use super::mapped::exciter::MappedExciter;
use super::mapped::mapping::Mapping;
use super::{ExciterInterface, ExciterLack, PlantInterface, Timing};
use crate::control::Controller;
use crate::rig::{Exciter, GateSpec};
use resonarm_protocol::Id;

/// When the commands of a user's protocol are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeBase {
    /// At the deadline of each sample; each message, or drive, has its own timeout.
    Clock,
    /// When the sample published last has its answer; the timeout is that of the run.
    Lockstep,
}

/// A protocol of the user's.
#[derive(Clone, Debug)]
pub enum WireSpec {
    /// Messages of a DBC.
    Mapped(Mapping),
    /// CANopen drives.
    Cia402(Cia402Spec),
}

impl WireSpec {
    /// The plant's node, of `rate_hz` samples a second, for an exciter of these limits and those of its gate.
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

    /// The exciter's node, the other end, which lets `controller` answer `rate_hz` samples a second.
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

    /// The identifiers of all its messages; `None` if a master chooses some of them during the run: any of 11 bits.
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
