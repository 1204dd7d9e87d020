//! CANopen drives as a user protocol, `preset = "cia402"`.

use super::drives::{DriveSpec, PresetSpec, TIMEOUT_S};
use super::error::WireError;
use super::{LockstepSpec, WireSection};
use crate::Scenario;
use resonarm_bench::node::cia402::{self, Cia402Spec};

/// Longest timeout that a scenario may state, s.
const TIMEOUT_MAX_S: f64 = 3600.0;
const PRESET: PresetSpec = PresetSpec::Cia402;

/// Builds the CANopen drives of a scenario.
pub(super) fn spec(scenario: &Scenario, section: &WireSection) -> Result<Cia402Spec, WireError> {
    section.check_preset(scenario, PRESET)?;
    if section.lockstep == Some(LockstepSpec::Command) {
        return Err(WireError::LockstepBySync { preset: PRESET.name() });
    }
    let timeout_s = section.timeout_s.unwrap_or(TIMEOUT_S);
    if !(timeout_s > 0.0 && timeout_s <= TIMEOUT_MAX_S) {
        return Err(WireError::TimeoutOfDrives { got: timeout_s });
    }
    let drives = section.drives.iter().enumerate().map(|(place, spec)| drive(place, spec));
    Ok(Cia402Spec { drives: drives.collect::<Result<_, _>>()?, timeout_ns: libm::round(timeout_s * 1e9) as u64 })
}

fn drive(place: usize, spec: &DriveSpec) -> Result<cia402::DriveSpec, WireError> {
    let missing = |name| WireError::DriveWithout { place, name, preset: PRESET.name() };
    let number = |name, got, expected| Err(WireError::Drive { place, name, got, expected });
    let rated_nm = spec.rated_torque_nm.ok_or_else(|| missing("rated_torque_nm"))?;
    let rated_mnm = libm::round(1e3 * rated_nm);
    // Object 6076 holds the rated torque as an integer in mN·m. A rounded value would scale every torque on the
    // bus by a wrong factor, so it is an error.
    let is_whole = (1e3 * rated_nm - rated_mnm).abs() <= 1e-9 * rated_mnm;
    if !(is_whole && (1.0..=f64::from(u32::MAX)).contains(&rated_mnm)) {
        let expected = "a whole number of mN·m from 0.001 to 4294967.295, as object 6076 says it so";
        return number("rated_torque_nm", rated_nm, expected);
    }
    let encoder_counts_per_turn = spec.encoder_counts_per_turn.ok_or_else(|| missing("encoder_counts_per_turn"))?;
    if encoder_counts_per_turn == 0 {
        return number("encoder_counts_per_turn", 0.0, "at least 1");
    }
    Ok(cia402::DriveSpec {
        node_id: spec.node_id,
        joint: usize::from(spec.joint) - 1,
        gear_ratio: spec.gear_ratio,
        rated_torque_mnm: rated_mnm as u32,
        encoder_counts_per_turn,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ScenarioError;
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
        let text = wire(&format!("timeout_s = 0.25\nlockstep = \"sync\"\n{DRIVES}"));
        let Ok(Some(WireSpec::Cia402(spec))) = spec(&text) else { panic!() };
        assert_eq!(spec.timeout_ns, 250_000_000);
        let [first, second] = spec.drives[..] else { panic!() };
        assert_eq!((first.node_id, first.joint, first.rated_torque_mnm), (1, 0, 1000));
        assert_eq!((second.node_id, second.joint, second.rated_torque_mnm), (2, 1, 250));
        let scenario = Scenario::parse(&text, "a test").unwrap();
        let again = Scenario::parse(&scenario.to_toml().unwrap(), "again").unwrap();
        assert_eq!(again.wire, scenario.wire);
        let Ok(Some(WireSpec::Cia402(spec))) = super::tests::spec(&wire(DRIVES)) else { panic!() };
        assert_eq!(spec.timeout_ns, 500_000_000);
    }

    #[test]
    fn keys_of_a_dbc_and_of_a_preset_exclude_each_other() {
        insta::assert_snapshot!(said(&wire(&format!("dbc = \"a.dbc\"\n{DRIVES}"))), @"[wire]: with a `preset` the messages are given: leave out `dbc`, `node`, `arm`, `sync`, `commands`, `events` and `readings`");
        insta::assert_snapshot!(said(&wire(&format!("arm = \"operator\"\n{DRIVES}"))), @"[wire]: with a `preset` the messages are given: leave out `dbc`, `node`, `arm`, `sync`, `commands`, `events` and `readings`");
        insta::assert_snapshot!(said(&format!("[wire]\ndbc = \"a.dbc\"\n{DRIVES}")), @r#"[wire]: `drives` and `timeout_s` belong to a `preset`: give one, as "odrive""#);
        insta::assert_snapshot!(said("[wire]\ndbc = \"a.dbc\"\ntimeout_s = 1.0\n"), @r#"[wire]: `drives` and `timeout_s` belong to a `preset`: give one, as "odrive""#);
        insta::assert_snapshot!(said("[wire]\nnode = \"Arm\"\n"), @"[wire] names no protocol: give `dbc`, the file with the messages, or `preset`");
        insta::assert_snapshot!(said(&wire(&format!("lockstep = \"command\"\n{DRIVES}"))), @r#"wire.lockstep: with `preset = "cia402"` a SYNC answers a sample: give `lockstep = "sync"`"#);
    }

    #[test]
    fn drives_that_can_not_be_are_refused() {
        insta::assert_snapshot!(said(&wire("")), @"[wire]: a preset needs at least one drive: drives = [{ node_id = 0, joint = 1 }]");
        let with = |from: &str, to: &str| said(&wire(&DRIVES.replacen(from, to, 1)));
        insta::assert_snapshot!(with("node_id = 1", "node_id = 128"), @"wire.drives, number 1: `node_id` is 128: it must be from 1 to 127, and another than those before");
        insta::assert_snapshot!(with("node_id = 2", "node_id = 1"), @"wire.drives, number 2: `node_id` is 1: it must be from 1 to 127, and another than those before");
        insta::assert_snapshot!(with("joint = 2", "joint = 3"), @"wire.drives, number 2: `joint` is 3: it must be the number of a joint of the structure, and another than those before");
        insta::assert_snapshot!(with("joint = 2", "joint = 1"), @"wire.drives, number 2: `joint` is 1: it must be the number of a joint of the structure, and another than those before");
        insta::assert_snapshot!(with("gear_ratio = 50.0", "gear_ratio = 0.0"), @"wire.drives, number 2: `gear_ratio` is 0: it must be a number other than 0");
        insta::assert_snapshot!(with("rated_torque_nm = 0.25", "rated_torque_nm = 0.0005"), @"wire.drives, number 2: `rated_torque_nm` is 0.0005: it must be a whole number of mN·m from 0.001 to 4294967.295, as object 6076 says it so");
        insta::assert_snapshot!(with("rated_torque_nm = 0.25, ", ""), @r#"wire.drives, number 2: it has no `rated_torque_nm`, which `preset = "cia402"` needs"#);
        insta::assert_snapshot!(with("joint = 2", "torque_constant_nm_a = 1.0, joint = 2"), @r#"wire.drives, number 2: `torque_constant_nm_a` is not a key of `preset = "cia402"`: leave it out"#);
        insta::assert_snapshot!(with("= 4096", "= 0"), @"wire.drives, number 2: `encoder_counts_per_turn` is 0: it must be at least 1");
        insta::assert_snapshot!(said(&wire(&format!("timeout_s = 0.0\n{DRIVES}"))), @"wire.timeout_s is 0: it must be a positive number of seconds, at most 3600");
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/bk4809.toml");
        let shaker = std::fs::read_to_string(path).unwrap();
        insta::assert_snapshot!(said(&format!("{shaker}\n{}", wire(DRIVES))), @"[wire]: a drive exerts a torque, but a shaker can't: leave out [rig.shaker]");
    }

    /// Bits at 1 kHz with the most stuff bits, and three of intermission: SYNC 55; of each drive an RPDO of 4 bytes,
    /// 95, a TPDO of 8 bytes, 135, and, 100 times a second, one of 5 bytes, 105; a heartbeat a second, 65.
    #[test]
    fn a_bus_that_can_not_carry_the_drives_is_refused() {
        let at = |rate: u32, bit_rate: u32| {
            let head = format!("[simulation]\nrate_hz = {rate}\n[network]\nbit_rate_hz = {bit_rate}\n");
            spec(&format!("{head}{}", wire(DRIVES)))
        };
        assert!(at(1000, 1_000_000).is_ok() && at(500, 500_000).is_ok());
        insta::assert_snapshot!(at(1000, 500_000).unwrap_err(), @"the frames of the drives, with a SYNC and a target for each drive once a sample, take up to 107.2 % of network.bit_rate_hz, more than the limit of 80 % for a bus with control; lower simulation.rate_hz, or raise the bit rate");
        insta::assert_snapshot!(at(2000, 1_000_000).unwrap_err(), @"the frames of the drives, with a SYNC and a target for each drive once a sample, take up to 105.1 % of network.bit_rate_hz, more than the limit of 80 % for a bus with control; lower simulation.rate_hz, or raise the bit rate");
        // One drive asks for less.
        let one = DRIVES.lines().filter(|line| !line.contains("node_id = 2")).collect::<Vec<_>>().join("\n");
        let head = "[simulation]\nrate_hz = 1000\n[network]\nbit_rate_hz = 500000\n";
        assert!(spec(&format!("{head}{}", wire(&one))).is_ok());
    }
}
