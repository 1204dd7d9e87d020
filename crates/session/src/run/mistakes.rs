//! Descriptions of a controller's mistakes: the first rejected command with its load and the limit, and the first
//! rejected frame with the reason.

use resonarm_bench::node::RefusedLoad;
use resonarm_bench::plant::Plant;
use resonarm_bench::rig::Load;
use resonarm_files::decoder::{Decoded, DecodedMessage, Decoder, Outcome};
use resonarm_numeric::number::short;
use resonarm_protocol::{ForceCommand, Frame, Message, Receiver, Refusal, TorqueCommand};
use resonarm_scenario::Scenario;

/// The first frame that a node rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RefusedFrame {
    /// The node's sample at that time.
    pub sample: u64,
    /// The rejected frame as it was received.
    pub frame: Frame,
}

impl RefusedFrame {
    /// Describes the frame and the reason of its rejection, on the protocol of this scenario.
    pub fn in_words(&self, scenario: &Scenario) -> String {
        let RefusedFrame { sample, frame } = self;
        let reason = reason(scenario, frame).unwrap_or_else(|| {
            String::from("the frame itself is valid, but its counter was repeated or jumped, or another node sent it")
        });
        format!("{frame} at sample {sample}: {reason}")
    }
}

/// Returns the reason for which a receiver that has heard nothing before rejects a frame; `None` if it accepts the
/// frame.
fn reason(scenario: &Scenario, frame: &Frame) -> Option<String> {
    match Decoder::of_scenario(scenario).ok()? {
        Some(mut decoder) => match decoder.decode(frame) {
            Decoded::Message(DecodedMessage { message, outcome: Outcome::Refused(fault), .. }) => {
                Some(format!("{message}: {fault}"))
            }
            _ => None,
        },
        None => Some(Receiver::new(scenario.network().ok()?).accept(frame).err()?.to_string()),
    }
}

/// Describes a command that was rejected for its load, with the limit.
pub(super) fn refused_command(refused: &RefusedLoad, plant: &Plant) -> String {
    let RefusedLoad { sample, load, refusal } = refused;
    let (force_n, torque_nm) = plant.exciter().limits();
    let gate = plant.gate();
    let limits: &[(Option<f64>, &str)] = match refusal {
        Refusal::OutOfRange => &[(Some(force_n), "N"), (Some(torque_nm), "N\u{b7}m")],
        Refusal::RateOfChange => {
            &[(gate.force_rate_limit_n_per_s, "N/s"), (gate.torque_rate_limit_nm_per_s, "N\u{b7}m/s")]
        }
        _ => &[(gate.travel_limit_m, "m of travel")],
    };
    let limits = limits.iter().filter_map(|(limit, unit)| limit.map(|limit| format!("{} {unit}", short(&limit))));
    let limits = limits.collect::<Vec<String>>().join(" and ");
    format!("{load} at sample {sample}: {refusal}; the limit is {limits}")
}

/// Returns the reason for which an exciter can't send this load of its controller.
pub(super) fn unsent_command(sample: u64, load: &Load, scenario: &Scenario) -> String {
    let reason = match (&scenario.wire, scenario.network()) {
        (None, _) if !load.is_native() => Some(String::from("the protocol has no field for a part of this load")),
        (None, Ok(network)) => {
            let Load { force_n, torque_nm } = load;
            let message = if torque_nm.norm() > 0.0 || torque_nm.iter().any(|part| part.is_nan()) {
                Message::Torque(TorqueCommand { torque1_nm: torque_nm[0], torque2_nm: torque_nm[1], sample: 0 })
            } else {
                Message::Force(ForceCommand { force_x_n: force_n.x, force_y_n: force_n.y, sample: 0 })
            };
            message.check(network).err().map(|error| error.to_string())
        }
        _ => None,
    };
    let reason = reason.unwrap_or_else(|| String::from("the protocol has no signal for this load"));
    format!("the controller commands {load} at sample {sample}: {reason}")
}

/// Returns the full index of a sample that a protocol states modulo 65536: the last one up to `now`.
pub(super) fn last_such_sample(stated: u16, now: u64) -> u64 {
    // The difference modulo 65536 is how many samples ago it was, if less than 65536.
    let ahead = u64::from((now as u16).wrapping_sub(stated));
    now.checked_sub(ahead).unwrap_or_else(|| stated.into())
}

/// Returns the full index of a sample that a protocol states modulo 65536: the first one from a little before `from`
/// on.
pub(super) fn first_such_sample(stated: u16, from: u64) -> u64 {
    /// Samples by which a node that reports a fault may be behind the one that counts.
    const BEHIND: u64 = 1000;
    let from = from.saturating_sub(BEHIND);
    from + u64::from(stated.wrapping_sub(from as u16))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_counted_beyond_65536() {
        for sample in [0, 27_714, 65_535, 65_536, 93_250, 1_000_000] {
            for now in [sample, sample + 60] {
                assert_eq!(last_such_sample(sample as u16, now), sample, "{sample} {now}");
            }
            for from in [sample.saturating_sub(900), sample, sample + 900] {
                assert_eq!(first_such_sample(sample as u16, from), sample, "{sample} {from}");
            }
        }
        assert_eq!(last_such_sample(500, 3), 500, "a partner that counts otherwise");
    }
}
