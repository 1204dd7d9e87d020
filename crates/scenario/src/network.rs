//! The CAN network of a scenario, and its deadlines.

use serde::{Deserialize, Serialize};

use super::Scenario;
use crate::error::ScenarioError;
use resonarm_bench::node::Timing;
use resonarm_bench::rig::Converter;
use resonarm_bus::fault::{self, FaultSpec};
use resonarm_protocol::{Network, Node, Profile, SamplesPerFrame, timing};

/// Longest timeout that a scenario may state, s.
const TIMEOUT_MAX_S: f64 = 3600.0;

/// The CAN network and its deadlines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkSection {
    /// Base identifier, a multiple of 0x10 from 0x180 to 0x570.
    pub base_id: u16,
    /// Node id of the plant, 1 to 127.
    pub plant_id: u8,
    /// Node id of the exciter, 1 to 127, another than the plant's.
    pub exciter_id: u8,
    /// Profile of the protocol, that is, whether commands and samples are classical or CAN FD frames.
    #[serde(with = "profile_name")]
    pub profile: Profile,
    /// Largest number of samples in a sensor frame of the FD profile, 1 or 2. Two are for logging in open loop.
    pub samples_per_frame: u8,
    /// Longest time without a valid command while armed, s; at least two samples, at most an hour.
    pub command_timeout_s: f64,
    /// Longest time without a sign of life of the partner while armed, s; at most an hour.
    pub partner_timeout_s: f64,
    /// Longest time for which each node waits for the other in lockstep, s of wall-clock time; at most an hour.
    pub lockstep_timeout_s: f64,
    /// Converter of the instruments of the plant at the other end of the bus. An exciter on a bus corrects the
    /// readings for it, and `import` those of a log. `None` corrects nothing: `rig.converter` describes the
    /// simulated plant and no other one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant_converter: Option<Converter>,
    /// Bit rate of the bus, 10000 to 1000000 Hz. Sample rates that exceed it are rejected, and frames take
    /// their time in free runs and in lockstep with both nodes in one process. `None` is a bus without limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit_rate_hz: Option<u32>,
    /// Bit rate of the data phase of FD frames, from `bit_rate_hz`, the default, to 8000000 Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_bit_rate_hz: Option<u32>,
    /// Free runs: probability that a bit on the bus is not what was sent, 0 to 0.01; needs `bit_rate_hz`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit_error_rate: Option<f64>,
    /// Faults of the nodes on the bus at stated times, at most
    /// [`MOST_FAULTS`](resonarm_bus::fault::MOST_FAULTS).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultSpec>,
}

impl Default for NetworkSection {
    /// The values that the protocol's specification recommends.
    fn default() -> NetworkSection {
        let network = Network::default();
        NetworkSection {
            base_id: network.base(),
            plant_id: network.node_id(Node::Plant),
            exciter_id: network.node_id(Node::Exciter),
            profile: network.profile(),
            samples_per_frame: SamplesPerFrame::default() as u8,
            command_timeout_s: timing::COMMAND_TIMEOUT_NS as f64 * 1e-9,
            partner_timeout_s: timing::HEARTBEAT_TIMEOUT_NS as f64 * 1e-9,
            lockstep_timeout_s: timing::LOCKSTEP_TIMEOUT_NS as f64 * 1e-9,
            plant_converter: None,
            bit_rate_hz: None,
            data_bit_rate_hz: None,
            bit_error_rate: None,
            faults: Vec::new(),
        }
    }
}

impl NetworkSection {
    /// Returns the largest number of samples in a sensor frame.
    ///
    /// # Errors
    /// [`ScenarioError::Value`] if it is neither 1 nor 2, or 2 in the classic profile.
    pub fn samples_per_frame(&self) -> Result<SamplesPerFrame, ScenarioError> {
        let known = SamplesPerFrame::from_number(self.samples_per_frame);
        let fits = |samples: &SamplesPerFrame| *samples == SamplesPerFrame::One || self.profile == Profile::Fd;
        let expected = "1, or with `network.profile = \"fd\"` 2";
        let refused = || ScenarioError::value("network.samples_per_frame", self.samples_per_frame, expected);
        known.filter(fits).ok_or_else(refused)
    }

    /// Rejects timeouts, faults and frame settings that no run can use.
    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        self.samples_per_frame()?;
        timeout("network.command_timeout_s", self.command_timeout_s)?;
        timeout("network.partner_timeout_s", self.partner_timeout_s)?;
        timeout("network.lockstep_timeout_s", self.lockstep_timeout_s)?;
        Ok(fault::check(&self.faults)?)
    }
}

impl Scenario {
    /// Returns the converter of the plant on the bus, which need not be the simulated one:
    /// `network.plant_converter`, else unknown.
    pub fn partner_converter(&self) -> Converter {
        self.network.plant_converter.unwrap_or(Converter::Unknown)
    }

    /// Returns the CAN network.
    ///
    /// # Errors
    /// [`ScenarioError::Network`] for an impossible base identifier or impossible node ids.
    pub fn network(&self) -> Result<Network, ScenarioError> {
        let NetworkSection { base_id, plant_id, exciter_id, profile, .. } = self.network;
        Ok(Network::new(base_id)?.with_node_ids(plant_id, exciter_id)?.with_profile(profile))
    }

    /// Returns the deadlines of a run in real time.
    ///
    /// # Errors
    /// [`ScenarioError::Rate`] and [`ScenarioError::RealTimeRate`] if the rate is none for real time,
    /// [`ScenarioError::Value`] if a timeout is not positive, longer than an hour, or the command timeout is less than
    /// two samples.
    pub fn real_time_timing(&self) -> Result<Timing, ScenarioError> {
        let rate_hz = self.wire_rate_hz()?;
        if rate_hz < timing::REAL_TIME_RATE_MIN_HZ {
            return Err(ScenarioError::RealTimeRate { got_hz: rate_hz });
        }
        let command_timeout_s = timeout("network.command_timeout_s", self.network.command_timeout_s)?;
        let samples = f64::from(self.network.samples_per_frame);
        // A timeout of less than two sample periods would trip on the normal jitter of one late command.
        if command_timeout_s * self.simulation.rate_hz < 2.0 * samples {
            let expected = "at least two samples long (2 / simulation.rate_hz), or four with two samples a frame";
            return Err(ScenarioError::value("network.command_timeout_s", command_timeout_s, expected));
        }
        let partner_timeout_s = timeout("network.partner_timeout_s", self.network.partner_timeout_s)?;
        Ok(Timing {
            command_timeout_ns: nanoseconds(command_timeout_s),
            command_age_ns: nanoseconds(command_timeout_s),
            partner_timeout_ns: nanoseconds(partner_timeout_s),
            ..Timing::real_time(rate_hz)
        })
    }

    /// Returns the deadlines of a run in lockstep.
    ///
    /// # Errors
    /// [`ScenarioError::Value`] if the timeout is not positive, or longer than an hour.
    pub fn lockstep_timing(&self) -> Result<Timing, ScenarioError> {
        let timeout_s = timeout("network.lockstep_timeout_s", self.network.lockstep_timeout_s)?;
        Ok(Timing::lockstep(nanoseconds(timeout_s)))
    }
}

/// Serialises a profile by its name.
mod profile_name {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use resonarm_protocol::Profile;

    pub fn serialize<S: Serializer>(profile: &Profile, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(profile.name())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Profile, D::Error> {
        let name = String::deserialize(deserializer)?;
        name.parse().map_err(|_unknown| D::Error::unknown_variant(&name, &["classic", "fd"]))
    }
}

/// Checks that a timeout is positive and at most an hour, s.
fn timeout(name: &'static str, got: f64) -> Result<f64, ScenarioError> {
    // NaN fails both comparisons and is rejected with the rest.
    if got > 0.0 && got <= TIMEOUT_MAX_S {
        Ok(got)
    } else {
        Err(ScenarioError::value(name, got, "a positive number of seconds, at most 3600"))
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    libm::round(seconds * 1e9) as u64
}
