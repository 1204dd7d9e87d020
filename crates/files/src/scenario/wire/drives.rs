//! The drives of a preset.

use serde::{Deserialize, Serialize};

use super::error::WireError;
use super::{LockstepSpec, WireSection};
use crate::scenario::Scenario;
use resonarm_bench::node::cia402::{Cia402Spec, DriveSpec, Joint};
use resonarm_bench::rig::Exciter;

/// The longest timeout, s.
const TIMEOUT_MAX_S: f64 = 3600.0;

/// A protocol whose messages are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PresetSpec {
    /// CANopen drives in cyclic synchronous torque (CiA 301, CiA 402).
    Cia402,
}

impl PresetSpec {
    /// Its name in a scenario.
    pub const fn name(self) -> &'static str {
        match self {
            PresetSpec::Cia402 => "cia402",
        }
    }
}

/// A drive at a joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSection {
    /// Its node id, 1 to 127.
    pub node_id: u32,
    /// The joint, 1 or 2.
    pub joint: u32,
    /// Turns of the motor for one of the joint.
    pub gear_ratio: f64,
    /// The rated torque of the motor, N·m: a whole number of mN·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rated_torque_nm: Option<f64>,
    /// Counts of the encoder for a turn of the motor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_counts_per_turn: Option<u32>,
}

/// The CANopen drives of a scenario.
pub(super) fn cia402(scenario: &Scenario, section: &WireSection) -> Result<Cia402Spec, WireError> {
    check_keys(section, PresetSpec::Cia402)?;
    if section.lockstep == Some(LockstepSpec::Command) {
        return Err(WireError::LockstepBySync { preset: PresetSpec::Cia402.name() });
    }
    check_drives(scenario, section, PresetSpec::Cia402)?;
    let timeout_ns = timeout_ns(scenario, section)?;
    let drives = section.drives.iter().zip(1..).map(|(drive, number)| cia402_drive(drive, number));
    Ok(Cia402Spec { drives: drives.collect::<Result<_, _>>()?, timeout_ns })
}

/// Refuses the keys of a mapping by a DBC.
fn check_keys(section: &WireSection, preset: PresetSpec) -> Result<(), WireError> {
    let given = [
        ("dbc", !section.dbc.as_os_str().is_empty()),
        ("node", section.node.is_some()),
        ("arm", section.arm.is_some()),
        ("sync", section.sync.is_some()),
        ("commands", !section.commands.is_empty()),
        ("events", !section.events.is_empty()),
        ("readings", !section.readings.is_empty()),
    ];
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((key, _)) => Err(WireError::NotOfPreset { key, preset: preset.name() }),
        None => Ok(()),
    }
}

/// Refuses the keys of a preset where there is none.
pub(super) fn check_no_preset(section: &WireSection) -> Result<(), WireError> {
    let given = [("drives", !section.drives.is_empty()), ("timeout_s", section.timeout_s.is_some())];
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((key, _)) => Err(WireError::OfPreset { key }),
        None if section.dbc.as_os_str().is_empty() => Err(WireError::NeitherDbcNorPreset),
        None => Ok(()),
    }
}

/// What all presets with drives demand: joints and node ids that there are, each once, and nothing that exerts no torque.
fn check_drives(scenario: &Scenario, section: &WireSection, preset: PresetSpec) -> Result<(), WireError> {
    if section.drives.is_empty() {
        return Err(WireError::NoDrives { preset: preset.name() });
    }
    if let Exciter::Shaker(_) = scenario.rig.drive() {
        return Err(WireError::DrivesOfShaker);
    }
    for (drive, number) in section.drives.iter().zip(1..) {
        if !(1..=127).contains(&drive.node_id) {
            return Err(number_error(number, "node_id", drive.node_id.into(), "a whole number from 1 to 127"));
        }
        if !(1..=2).contains(&drive.joint) {
            return Err(number_error(number, "joint", drive.joint.into(), "1 or 2"));
        }
        if !(drive.gear_ratio > 0.0 && drive.gear_ratio.is_finite()) {
            return Err(number_error(number, "gear_ratio", drive.gear_ratio, "a positive number"));
        }
        for (other, before) in section.drives.iter().zip(1..number) {
            let of = [("node_id", other.node_id, drive.node_id), ("joint", other.joint, drive.joint)];
            if let Some((name, got, _)) = of.into_iter().find(|(_, one, another)| one == another) {
                return Err(WireError::DriveTwice { number, other: before, name, got });
            }
        }
    }
    Ok(())
}

fn timeout_ns(scenario: &Scenario, section: &WireSection) -> Result<u64, WireError> {
    let timeout_s = section.timeout_s.unwrap_or(scenario.network.command_timeout_s);
    if !(timeout_s > 0.0 && timeout_s <= TIMEOUT_MAX_S) {
        return Err(WireError::TimeoutOfDrives { got: timeout_s });
    }
    Ok(libm::round(timeout_s * 1e9) as u64)
}

fn cia402_drive(drive: &DriveSection, number: usize) -> Result<DriveSpec, WireError> {
    let missing = |name| WireError::DriveWithout { number, name, preset: PresetSpec::Cia402.name() };
    let rated_nm = drive.rated_torque_nm.ok_or_else(|| missing("rated_torque_nm"))?;
    let rated_mnm = libm::round(1e3 * rated_nm);
    let is_whole = (1e3 * rated_nm - rated_mnm).abs() <= 1e-9 * rated_mnm;
    if !(is_whole && (1.0..=f64::from(u32::MAX)).contains(&rated_mnm)) {
        let expected = "a whole number of mN·m from 0.001 to 4294967.295, as object 6076 says it so";
        return Err(number_error(number, "rated_torque_nm", rated_nm, expected));
    }
    let encoder_counts_per_turn = drive.encoder_counts_per_turn.ok_or_else(|| missing("encoder_counts_per_turn"))?;
    if encoder_counts_per_turn == 0 {
        return Err(number_error(number, "encoder_counts_per_turn", 0.0, "at least 1"));
    }
    Ok(DriveSpec {
        node_id: drive.node_id as u8,
        joint: if drive.joint == 1 { Joint::First } else { Joint::Second },
        gear_ratio: drive.gear_ratio,
        rated_torque_mnm: rated_mnm as u32,
        encoder_counts_per_turn,
    })
}

fn number_error(number: usize, name: &'static str, got: f64, expected: &'static str) -> WireError {
    WireError::DriveNumber { number, name, got, expected }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::ScenarioError;
    use resonarm_bench::node::WireSpec;

    const DRIVES: &str = "drives = [\n\
        { node_id = 1, joint = 1, gear_ratio = 100.0, rated_torque_nm = 1.0, encoder_counts_per_turn = 65536 },\n\
        { node_id = 2, joint = 2, gear_ratio = 50.0, rated_torque_nm = 0.25, encoder_counts_per_turn = 4096 },\n]\n";

    fn spec(text: &str) -> Result<Option<WireSpec>, ScenarioError> {
        Scenario::parse(text, "a test")?.wire_spec()
    }

    fn said(text: &str) -> String {
        spec(text).unwrap_err().to_string()
    }

    fn wire(more: &str) -> String {
        format!("[wire]\npreset = \"cia402\"\n{more}")
    }

    #[test]
    fn a_preset_has_drives() {
        let text = wire(&format!("timeout_s = 0.5\nlockstep = \"sync\"\n{DRIVES}"));
        let Ok(Some(WireSpec::Cia402(spec))) = spec(&text) else { panic!() };
        assert_eq!(spec.timeout_ns, 500_000_000);
        let [first, second] = spec.drives[..] else { panic!() };
        assert_eq!((first.node_id, first.joint, first.rated_torque_mnm), (1, Joint::First, 1000));
        assert_eq!((second.node_id, second.joint, second.rated_torque_mnm), (2, Joint::Second, 250));
        let scenario = Scenario::parse(&text, "a test").unwrap();
        let again = Scenario::parse(&scenario.to_toml().unwrap(), "again").unwrap();
        assert_eq!(again.wire, scenario.wire);
        let Ok(Some(WireSpec::Cia402(spec))) = super::tests::spec(&wire(DRIVES)) else { panic!() };
        let timeout_s = Scenario::default().network.command_timeout_s;
        assert_eq!(spec.timeout_ns as f64, 1e9 * timeout_s);
    }

    #[test]
    fn keys_of_a_dbc_and_of_a_preset_exclude_each_other() {
        insta::assert_snapshot!(said(&wire(&format!("dbc = \"a.dbc\"\n{DRIVES}"))), @r#"wire.dbc: it maps messages of a DBC, and `preset = "cia402"` has its own: leave one of them out"#);
        insta::assert_snapshot!(said(&wire(&format!("arm = \"operator\"\n{DRIVES}"))), @r#"wire.arm: it maps messages of a DBC, and `preset = "cia402"` has its own: leave one of them out"#);
        insta::assert_snapshot!(said(&format!("[wire]\ndbc = \"a.dbc\"\n{DRIVES}")), @r#"wire.drives: it is of a preset, as `preset = "cia402"`, and there is none: leave it out"#);
        insta::assert_snapshot!(said("[wire]\ndbc = \"a.dbc\"\ntimeout_s = 1.0\n"), @r#"wire.timeout_s: it is of a preset, as `preset = "cia402"`, and there is none: leave it out"#);
        insta::assert_snapshot!(said("[wire]\nnode = \"Arm\"\n"), @"[wire] says no protocol: give `dbc`, the file with the messages, or `preset`");
        insta::assert_snapshot!(said(&wire(&format!("lockstep = \"command\"\n{DRIVES}"))), @r#"wire.lockstep: with `preset = "cia402"` a SYNC answers a sample: give `lockstep = "sync"`"#);
    }

    #[test]
    fn drives_that_can_not_be_are_refused() {
        insta::assert_snapshot!(said(&wire("")), @r#"wire.drives: `preset = "cia402"` needs a drive for joint 1 or joint 2, or one for each"#);
        let with = |from: &str, to: &str| said(&wire(&DRIVES.replacen(from, to, 1)));
        insta::assert_snapshot!(with("node_id = 1", "node_id = 128"), @"wire.drives: `node_id` of drive 1 is 128: it must be a whole number from 1 to 127");
        insta::assert_snapshot!(with("node_id = 2", "node_id = 1"), @"wire.drives: `node_id` of drive 2 is 1, as that of drive 1");
        insta::assert_snapshot!(with("joint = 2", "joint = 3"), @"wire.drives: `joint` of drive 2 is 3: it must be 1 or 2");
        insta::assert_snapshot!(with("joint = 2", "joint = 1"), @"wire.drives: `joint` of drive 2 is 1, as that of drive 1");
        insta::assert_snapshot!(with("gear_ratio = 50.0", "gear_ratio = -1.0"), @"wire.drives: `gear_ratio` of drive 2 is -1: it must be a positive number");
        insta::assert_snapshot!(with("rated_torque_nm = 0.25", "rated_torque_nm = 0.0005"), @"wire.drives: `rated_torque_nm` of drive 2 is 0.0005: it must be a whole number of mN·m from 0.001 to 4294967.295, as object 6076 says it so");
        insta::assert_snapshot!(with("rated_torque_nm = 0.25, ", ""), @r#"wire.drives: drive 2 has no `rated_torque_nm`, which `preset = "cia402"` needs"#);
        insta::assert_snapshot!(with("= 4096", "= 0"), @"wire.drives: `encoder_counts_per_turn` of drive 2 is 0: it must be at least 1");
        insta::assert_snapshot!(said(&wire(&format!("timeout_s = 0.0\n{DRIVES}"))), @"wire.timeout_s is 0: it must be a positive number of seconds, at most 3600");
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/bk4809.toml");
        let shaker = std::fs::read_to_string(path).unwrap();
        insta::assert_snapshot!(said(&format!("{shaker}\n{}", wire(DRIVES))), @"wire.drives: a drive exerts a torque at a joint, and [rig.shaker] exerts none: leave one of them out");
    }
}
