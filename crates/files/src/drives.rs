//! The torques that a master commands CANopen drives to apply, reconstructed from the frames between them.

use resonarm_bench::node::cia402::{Cia402Spec, DriveSpec, TORQUE_MODE};
use resonarm_bench::rig::Load;
use resonarm_protocol::Frame;
use resonarm_wire::canopen::cia402::{Command, DriveState, halts};
use resonarm_wire::canopen::dictionary::{Address, at};
use resonarm_wire::canopen::listen::{Heard, Listener, Sdo};
use resonarm_wire::canopen::{NmtCommand, NmtState};

/// The objects by which a master commands a drive.
const CONTROLWORD: Address = at(0x6040, 0);
const MODE: Address = at(0x6060, 0);
const TARGET: Address = at(0x6071, 0);

/// The torques that a master requests: for enabled drives in the mode cyclic synchronous torque, targets received since
/// they were enabled. The effect of a gate is not in the frames.
///
/// A drive is in the state that follows from the controlwords, unless its statusword or an emergency says another.
#[derive(Clone, Debug)]
pub struct Targets {
    drives: Vec<Drive>,
}

#[derive(Clone, Debug)]
struct Drive {
    spec: DriveSpec,
    listener: Listener,
    state: DriveState,
    controlword: u16,
    mode: i64,
    /// Thousandths of the rated torque.
    target: i64,
    /// Values of PDOs that act only at the next SYNC.
    waiting: Vec<(Address, i64)>,
}

impl Targets {
    /// Starts with drives that have just been reset.
    pub fn new(spec: &Cia402Spec) -> Targets {
        let drive = |spec: &DriveSpec| Drive {
            spec: *spec,
            listener: Listener::new(spec.node_id, spec.dictionary()),
            state: DriveState::SwitchOnDisabled,
            controlword: 0,
            mode: 0,
            target: 0,
            waiting: Vec::new(),
        };
        Targets { drives: spec.drives.iter().map(drive).collect() }
    }

    /// Processes the next frame on the bus; returns its meaning for each drive that it concerns.
    pub fn hear(&mut self, frame: &Frame) -> Vec<(DriveSpec, Heard)> {
        let heard = self.drives.iter_mut().map(|drive| (drive.spec, drive.hear(frame)));
        heard.filter(|(_, heard)| *heard != Heard::Foreign).collect()
    }

    /// Returns the load that is requested.
    pub fn load(&self) -> Load {
        self.drives.iter().fold(Load::default(), |sum, drive| {
            let torque_nm = drive.torque_nm();
            sum + Load::at_joint(drive.spec.joint, torque_nm)
        })
    }
}

impl Drive {
    fn hear(&mut self, frame: &Frame) -> Heard {
        let heard = self.listener.hear(frame);
        match &heard {
            Heard::Pdo { is_sent: true, values, .. } => {
                let status = values.iter().find(|(address, _)| address.index == 0x6041);
                status.and_then(|(_, value)| value.number()).into_iter().for_each(|word| self.report(word as u16));
            }
            Heard::Pdo { number, values, missing: None, .. } => {
                let numbers = values.iter().filter_map(|(address, value)| Some((*address, value.number()?)));
                self.waiting.extend(numbers);
                // Of the types 0 to 240 it acts at the next SYNC.
                if self.listener.dictionary().number(at(0x1400 + number - 1, 2)) > 240 {
                    self.act();
                }
            }
            Heard::Sync(_) => self.act(),
            // A write counts once the drive has confirmed it. Before that the drive may still refuse it.
            Heard::Sdo(Sdo::Confirmed(address) | Sdo::SegmentTaken(Some(address))) => {
                self.write(*address, self.listener.dictionary().number(*address));
            }
            Heard::Sdo(Sdo::Given(address, _)) if address.index == 0x6041 => {
                self.report(self.listener.dictionary().number(*address) as u16);
            }
            // Codes below 0x0100 say that there is no error, or no longer one (CiA 301).
            Heard::Emergency { code: 0x0100.., .. } => self.enter(DriveState::Fault),
            // Starting a node leaves the state of the drive as it is. Every other command, and a boot-up, ends its
            // operation.
            Heard::Nmt { command: NmtCommand::Start, .. } => {}
            Heard::Nmt { node, .. } if ![0, self.spec.node_id].contains(node) => {}
            Heard::Nmt { .. } | Heard::Heartbeat(NmtState::Initialising) => {
                self.waiting.clear();
                if !self.state.is_fault() {
                    self.enter(DriveState::SwitchOnDisabled);
                }
            }
            _ => {}
        }
        heard
    }

    /// Carries out the object writes that were waiting, as at SYNC.
    fn act(&mut self) {
        for (address, number) in std::mem::take(&mut self.waiting) {
            self.write(address, number);
        }
    }

    fn write(&mut self, address: Address, number: i64) {
        match address {
            CONTROLWORD => {
                // Some commands are the edge of a bit, as the reset of a fault, so the word before counts as well (CiA
                // 402-2).
                let before = std::mem::replace(&mut self.controlword, number as u16);
                self.enter(self.state.after(Command::of(before, self.controlword)));
            }
            MODE => self.mode = number,
            TARGET => self.target = number,
            _ => {}
        }
        // A drive that halts, or has no mode, forgets its target.
        if !self.follows() {
            self.target = 0;
        }
    }

    fn report(&mut self, statusword: u16) {
        if let Some(state) = DriveState::of(statusword) {
            self.enter(state);
        }
    }

    fn enter(&mut self, state: DriveState) {
        // A target of an earlier operation must not act when the drive is enabled again.
        if state != self.state {
            self.target = 0;
        }
        self.state = state;
    }

    fn follows(&self) -> bool {
        let is_in_mode = self.mode == i64::from(TORQUE_MODE);
        self.state == DriveState::OperationEnabled && is_in_mode && !halts(self.controlword)
    }

    fn torque_nm(&self) -> f64 {
        if self.follows() { self.target as f64 * self.spec.torque_step_nm() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn targets() -> Targets {
        let drive = |node_id, joint| DriveSpec {
            node_id,
            joint,
            gear_ratio: 100.0,
            rated_torque_mnm: 1000,
            encoder_counts_per_turn: 65536,
        };
        Targets::new(&Cia402Spec { drives: vec![drive(1, 0), drive(2, 1)], timeout_ns: 1 })
    }

    fn after(targets: &mut Targets, frames: &[&str]) -> [f64; 2] {
        for frame in frames {
            targets.hear(&frame.parse().unwrap());
        }
        [0, 1].map(|joint| targets.load().torque_nm[joint])
    }

    /// Mode 10 and operation enabled.
    const ENABLED: [&str; 6] =
        ["601#2F6060000A000000", "581#6060600000000000", "201#06000000", "201#07000000", "201#0F000000", "080#"];

    #[test]
    fn targets_count_from_when_a_drive_is_enabled_until_it_no_longer_is() {
        let mut targets = targets();
        assert_eq!(after(&mut targets, &["201#0F00F401"]), [0.0; 2]);
        assert_eq!(after(&mut targets, &ENABLED), [0.0; 2]);
        assert_eq!(after(&mut targets, &["201#0F00F401"]), [50.0, 0.0]);
        // The other drive, whose mode nobody has set.
        assert_eq!(after(&mut targets, &["202#06000000", "202#0F000000", "202#0F000A00"]), [50.0, 0.0]);
        assert_eq!(after(&mut targets, &["201#0F01F401"]), [0.0; 2]);
        assert_eq!(after(&mut targets, &["201#0F00F401", "182#08000000000000"]), [50.0, 0.0]);
        assert_eq!(after(&mut targets, &["081#5082110000000000"]), [0.0; 2]);
        assert_eq!(after(&mut targets, &["201#0F00F401", "201#8F00F401", "201#0600F401"]), [0.0; 2]);
        assert_eq!(after(&mut targets, &["201#0700F401", "201#0F00F401"]), [50.0, 0.0]);
        assert_eq!(after(&mut targets, &["000#0202", "000#0101"]), [50.0, 0.0]);
        assert_eq!(after(&mut targets, &["000#8001"]), [0.0; 2]);
    }

    #[test]
    fn a_synchronous_pdo_acts_at_sync_and_an_aborted_write_never() {
        let mut targets = targets();
        after(&mut targets, &ENABLED);
        assert_eq!(after(&mut targets, &["601#2F00140200000000", "581#6000140200000000", "201#0F00F401"]), [0.0; 2]);
        assert_eq!(after(&mut targets, &["080#"]), [50.0, 0.0]);
        let refused = ["601#2B71600064000000", "581#8071600022000008"];
        assert_eq!(after(&mut targets, &refused), [50.0, 0.0]);
        assert_eq!(after(&mut targets, &["601#2B71600064000000", "581#6071600000000000"]), [10.0, 0.0]);
    }
}
