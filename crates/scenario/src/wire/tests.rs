//! Mappings, good and bad.

use super::*;
use resonarm_bench::node::mapped::mapping::{Arming, LoadInput, Mapping, Source, Trigger, Value};

const DBC: &str = include_str!("tests/bench.dbc");
const SCENARIO: &str = include_str!("tests/bench.toml");

fn scenario(text: &str, dbc: &str) -> Result<Scenario, ScenarioError> {
    let mut scenario = Scenario::parse(text, "bench.toml")?;
    if let Some(wire) = &mut scenario.wire {
        wire.text = Some(dbc.to_string());
    }
    Ok(scenario)
}

/// Returns the mapping of the scenario with one text replaced by another.
fn changed(old: &str, new: &str) -> Result<Mapping, String> {
    assert!(SCENARIO.contains(old), "{old}");
    compiled(&SCENARIO.replace(old, new), DBC)
}

fn compiled(text: &str, dbc: &str) -> Result<Mapping, String> {
    match scenario(text, dbc).and_then(|scenario| scenario.wire_spec()) {
        Ok(Some(WireSpec::Mapped(mapping))) => Ok(mapping),
        Ok(_) => Err(String::from("no mapping")),
        Err(error) => Err(error.to_string()),
    }
}

fn says(old: &str, new: &str) -> String {
    changed(old, new).unwrap_err()
}

/// As `says`, for a change of the DBC.
fn dbc_says(old: &str, new: &str) -> String {
    assert!(DBC.contains(old), "{old}");
    compiled(SCENARIO, &DBC.replace(old, new)).unwrap_err()
}

#[test]
fn a_mapping_has_the_messages_in_si_units() {
    let mapping = compiled(SCENARIO, DBC).unwrap();
    let [drive] = &mapping.incoming[..] else { panic!("{:?}", mapping.incoming) };
    assert_eq!((drive.commands[0].scale, drive.events.len(), drive.timeout_ns), (1.0, 2, 100_000_000));
    assert_eq!(mapping.arming, Arming::Message);
    let triggers: Vec<Trigger> = mapping.outgoing.iter().map(|message| message.trigger).collect();
    assert_eq!(triggers, [Trigger::Every(1), Trigger::Every(10)]);
    assert!(changed("{ signal = \"Force\" }", "{ signal = \"Force\", scale = 4.0 }").is_ok());
}

#[test]
fn what_arms_and_what_is_lacking_is_said_in_words() {
    let section = |text: &str| scenario(text, DBC).unwrap().wire.unwrap();
    let lacks = |text: &str| section(text).lacks().iter().map(|lack| format!("{lack}\n")).collect::<String>();
    assert_eq!(section(SCENARIO).arming(), "message Drive with Enable = 1");
    insta::assert_snapshot!(lacks(SCENARIO), @"commands name no sample, so neither their age nor the round-trip time can be measured");
    let bare = "[wire]\ndbc = 'bench.dbc'\narm = 'zero-command'\n[[wire.commands]]\nmessage = 'Drive'\nforce_x_n = { signal = 'Force' }";
    assert_eq!(section(bare).arming(), "commands below a hundredth of the exciter's limits, the first that come");
    insta::assert_snapshot!(lacks(bare), @"
    commands name no sample, so neither their age nor the round-trip time can be measured
    message Drive has no counter, so a repeated or old frame counts as new
    message Drive has no checksum, so damage that the CAN controller's CRC misses acts as a load
    no message arms the plant: its first commands near zero arm it, and after a fault it can't be armed again
    no message clears a fault: the operator clears it in the live view (--live), or a new run begins without it
    ");
}

#[test]
fn a_scenario_with_a_wire_survives_a_recording() {
    let scenario = scenario(SCENARIO, DBC).unwrap();
    let configuration = scenario.configuration("real-time").unwrap();
    let read = Scenario::from_configuration(&configuration).unwrap();
    assert_eq!(read.wire, scenario.wire);
    assert!(read.wire_spec().unwrap().is_some());
}

#[test]
fn commands_that_are_refused() {
    insta::assert_snapshot!(says("message = \"Drive\"\nforce_x_n", "message = \"Driv\"\nforce_x_n"), @r#"
    bench.dbc has no message "Driv"
    Did you mean "Drive"?
    "#);
    insta::assert_snapshot!(says("signal = \"Force\"", "signal = \"Forc\""), @r#"
    bench.dbc, line 9: message Drive has no signal "Forc"
    Did you mean "Force"?
    "#);
    insta::assert_snapshot!(says("force_x_n = { signal = \"Force\" }", "force_x_n = { signal = \"Force\" }\nforce_y_n = { signal = \"Force\" }"), @"wire.commands: message Drive, signal Force: it is mapped twice, as force_x_n and as force_y_n");
    insta::assert_snapshot!(says("force_x_n = { signal = \"Force\" }", "torque1_nm = { signal = \"Force\" }"), @r#"wire.commands: message Drive, signal Force: its unit "N" can't be converted to N·m (known are Nm, mNm, Ncm, kNm): give `scale`, the load in N·m for its value 1"#);
    insta::assert_snapshot!(says("force_x_n = { signal = \"Force\" }", "force_n = { signal = \"Force\" }"), @"wire.commands: message Drive, signal Force: force_n is along the shaker, but the scenario has no [rig.shaker]");
    insta::assert_snapshot!(says("force_x_n = { signal = \"Force\" }\n", ""), @"wire.commands: message Drive: it has no load: give `force_x_n`, `force_y_n`, `force_z_n`, `force_n`, or a torque, as `torque1_nm`");
    insta::assert_snapshot!(says("signal = \"Force\" }", "signal = \"Force\", scale = 0.0 }"), @"wire.commands: message Drive, signal Force: `scale` is 0: it must be a number other than 0");
    insta::assert_snapshot!(says("counter = { signal = \"Alive\" }\nchecksum = { signal = \"Crc\", preset = \"autosar-p1\", data_id = 0x123 }", "counter = { signal = \"Crc\" }\nchecksum = { signal = \"Crc\", preset = \"autosar-p1\", data_id = 0x123 }"), @"wire.commands: message Drive, signal Crc: it is mapped twice, as the counter and as the checksum");
    insta::assert_snapshot!(says("\"autosar-p1\", data_id = 0x123", "\"autosar-p3\", data_id = 0x123"), @r#"wire.commands: message Drive, signal Crc: there is no checksum "autosar-p3": expected one of autosar-p1, autosar-p1-alternating, autosar-p1-low, autosar-p1-nibble, autosar-p2, autosar-p4, autosar-p5, autosar-p6, autosar-p7, autosar-p11, autosar-p11-nibble, crc8-j1850, crc8-2f, sum, xor"#);
    insta::assert_snapshot!(says("\"autosar-p1\", data_id = 0x123", "\"autosar-p1\", data_id = 0x12345"), @"wire.commands: message Drive, signal Crc: autosar-p1: data id 0x12345 is too large: it must be at most 0xffff");
    insta::assert_snapshot!(says("preset = \"autosar-p1\", data_id = 0x123", "algorithm = \"crc\", data_id = 0x123"), @"wire.commands: message Drive, signal Crc: `data_id` belongs to a `preset`: give its bytes in `before` or `after`");
    insta::assert_snapshot!(says("preset = \"autosar-p1\", data_id = 0x123", "algorithm = \"crc\", polynomial = 0x11D"), @"wire.commands: message Drive, signal Crc: polynomial 0x11d does not fit the 8 bits of the checksum");
    insta::assert_snapshot!(says("preset = \"autosar-p1\", data_id = 0x123", "preset = \"sum\", polynomial = 0x1D"), @"wire.commands: message Drive, signal Crc: a `preset` has only a `data_id` beside it: leave out the parameters of an algorithm");
    insta::assert_snapshot!(says("timeout_s = 0.1", "timeout_s = 0.001"), @"wire.commands: message Drive: `timeout_s` is 0.001, but the DBC sends the message every 0.001 s: it must be at least two cycles");
    insta::assert_snapshot!(says("timeout_s = 0.1", "timeout_s = -1.0"), @"wire.commands: message Drive: `timeout_s` is -1: it must be a positive number of seconds, at most 3600");
    insta::assert_snapshot!(dbc_says("[-655|655] \"N\"", "[-655|655] \"kp\""), @r#"wire.commands: message Drive, signal Force: its unit "kp" can't be converted to N (known are N, mN, daN, kN, lbf): give `scale`, the load in N for its value 1"#);
    insta::assert_snapshot!(dbc_says("Alive : 48|4@1+ (1,0) [0|14] \"\" Shaker", "Alive : 48|3@1+ (1,0) [0|7] \"\" Shaker"), @"wire.commands: message Drive, signal Alive: it has 15 values: with 3 bits a counter must have 2 to 8");
}

#[test]
fn nodes_events_and_lockstep_that_are_refused() {
    insta::assert_snapshot!(says("node = \"Shaker\"", "node = \"Shakr\""), @r#"wire.node: the DBC has no node "Shakr"; is it "Shaker"?"#);
    insta::assert_snapshot!(says("node = \"Shaker\"", "node = \"Vector__XXX\""), @r#"wire.node is "Vector__XXX", the name of a DBC for no node; leave `node` out, so that any message can be a command or a reading"#);
    insta::assert_snapshot!(says("node = \"Shaker\"", "node = \"Controller\""), @"wire.commands: message Drive: it is sent by Controller, but commands must not be sent by Controller (`wire.node`)");
    insta::assert_snapshot!(says("arm = [1]\n", ""), @r#"[wire] has nothing that arms the plant: give an event with `arm`, or `arm = "operator"` (in the live view), or `arm = "zero-command"` (by first commands near zero)"#);
    insta::assert_snapshot!(says("arm = [1]", "arm = [1]\nreset = [1]"), @"wire.events: message Drive: one of its values has two meanings");
    insta::assert_snapshot!(says("lockstep = \"command\"", "lockstep = \"sync\""), @"wire.sync: name the message that synchronises");
    insta::assert_snapshot!(says("lockstep = \"command\"", "sync = \"Drive\""), @r#"wire.sync: nothing waits for it: give `lockstep = "sync"`, or readings with `on = "sync"`, or leave it out"#);
}

/// As `says`, with another scale and offset of the signal Enable, which has 2 bits here.
fn enable_says(scale: &str, arm: &str) -> Result<Mapping, String> {
    let dbc = DBC.replace("Enable : 16|1@1+ (1,0)", &format!("Enable : 20|2@1+ ({scale})"));
    compiled(&SCENARIO.replace("arm = [1]\ndisarm = [0]", arm), &dbc)
}

#[test]
fn values_that_a_signal_does_not_have_are_refused() {
    let refused = |scale, arm| enable_says(scale, arm).unwrap_err();
    insta::assert_snapshot!(refused("1,0", "arm = [9]\ndisarm = [0]"), @"wire.events: message Drive, signal Enable, line 11 of the DBC: `arm` is 9, but the signal has values from 0 to 3 in steps of 1; the nearest is 3: give one of its values, or widen the signal");
    insta::assert_snapshot!(refused("1,0", "arm = [2.5]\ndisarm = [0]"), @"wire.events: message Drive, signal Enable, line 11 of the DBC: `arm` is 2.5, but the signal has values from 0 to 3 in steps of 1; the nearest is 2: give one of its values, or widen the signal");
    insta::assert_snapshot!(refused("1,0", "arm = [1]\ndisarm = [-1]"), @"wire.events: message Drive, signal Enable, line 11 of the DBC: `disarm` is -1, but the signal has values from 0 to 3 in steps of 1; the nearest is 0: give one of its values, or widen the signal");
    insta::assert_snapshot!(refused("1,0", "arm = [1]\ndisarm = [0]\nrequire = [4]"), @"wire.events: message Drive, signal Enable, line 11 of the DBC: `require` is 4, but the signal has values from 0 to 3 in steps of 1; the nearest is 3: give one of its values, or widen the signal");
    insta::assert_snapshot!(refused("1,0", "arm = [nan]\ndisarm = [0]"), @"wire.events: message Drive, signal Enable, line 11 of the DBC: `arm` is NaN, but the signal has values from 0 to 3 in steps of 1: give one of its values, or widen the signal");
    insta::assert_snapshot!(refused("0.1,5", "arm = [5.1]\ndisarm = [0]"), @"wire.events: message Drive, signal Enable, line 11 of the DBC: `disarm` is 0, but the signal has values from 5 to 5.3 in steps of 0.1; the nearest is 5: give one of its values, or widen the signal");
    insta::assert_snapshot!(says("fault = 3", "fault = 99"), @"wire.readings: message Meas, signal State, line 19 of the DBC: `state.fault` is 99, but the signal has values from 0 to 15 in steps of 1; the nearest is 15: give one of its values, or widen the signal");
    insta::assert_snapshot!(says("other = 15", "other = -1"), @"wire.readings: message Meas, signal Reason, line 20 of the DBC: `reason.other` is -1, but the signal has values from 0 to 15 in steps of 1; the nearest is 0: give one of its values, or widen the signal");
    insta::assert_snapshot!(says("sample = true", "constant = 24.5"), @"wire.readings: message Meas, signal Sample, line 21 of the DBC: `constant` is 24.5, but the signal has values from 0 to 255 in steps of 1; the nearest is 24: give one of its values, or widen the signal");
    let (state, from_2) = ("State : 32|4@1+ (1,0)", "State : 32|4@1+ (1,2)");
    insta::assert_snapshot!(dbc_says(state, from_2), @"wire.readings: message Meas, signal State, line 19 of the DBC: `state.pre-operational` is 1, but the signal has values from 2 to 17 in steps of 1; the nearest is 2: give one of its values, or widen the signal");
}

#[test]
fn a_value_is_what_the_wire_makes_of_it() {
    let mapping = enable_says("0.1,0", "arm = [0.3]\ndisarm = [0]").unwrap();
    let signal = mapping.incoming[0].events[0].signal.as_ref().unwrap().signal;
    let mut payload = [0; 8];
    signal.encode(0.3, &mut payload).unwrap();
    assert_eq!(mapping.incoming[0].events[0].actions[0].0, signal.decode(&payload).unwrap());
    let twice = enable_says("0.1,0", "arm = [0.3]\ndisarm = [0.30000000000000004]").unwrap_err();
    insta::assert_snapshot!(twice, @"wire.events: message Drive: one of its values has two meanings");
}

#[test]
fn readings_that_are_refused() {
    insta::assert_snapshot!(says("quantity = \"acceleration_c_x_m_s2\"", "quantity = \"acceleration_d_x_m_s2\""), @r#"wire.readings: message Meas, signal AccX: there is no quantity "acceleration_d_x_m_s2"; is it "acceleration_c_x_m_s2"?; there are head_force_x_n, head_force_y_n, acceleration_b_x_m_s2, acceleration_b_y_m_s2, acceleration_c_x_m_s2, acceleration_c_y_m_s2, alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s, torque1_nm, torque2_nm, force_x_n, force_y_n"#);
    insta::assert_snapshot!(says("quantity = \"acceleration_c_x_m_s2\"", "quantity = \"coil_current_a\""), @"wire.readings: message Meas, signal AccX: coil_current_a is a state of the shaker, but the scenario has no [rig.shaker]");
    insta::assert_snapshot!(says("quantity = \"acceleration_c_x_m_s2\"", "quantity = \"head_force_x_n\""), @r#"wire.readings: message Meas, signal AccX: its unit "g" can't be converted to N (known are N, mN, daN, kN, lbf): give `scale`, its value for 1 N"#);
    insta::assert_snapshot!(says("sample = true", "sample = true, constant = 3"), @"wire.readings: message Meas, signal Sample: it has 2 of the keys `quantity`, `clipped`, `state`, `reason`, `constant` and `sample`: give exactly one");
    insta::assert_snapshot!(says("pre-operational = 1", "preoperational = 1"), @r#"wire.readings: message Meas, signal State: there is no state "preoperational"; is it "pre-operational"?; there are boot-up, pre-operational, operational, fault"#);
    insta::assert_snapshot!(says("command-timeout = 1", "timeout = 1"), @r#"wire.readings: message Meas, signal Reason: there is no fault "timeout"; there are command-timeout, stop, overrun, bus-loss, sequence, exciter-tripped, simulation-failed, none, other"#);
    insta::assert_snapshot!(says("every = 10\n", ""), @"wire.readings: message Pose: the DBC has no cycle time for it: give `every`, `period_s` or `on`");
    insta::assert_snapshot!(says("every = 10", "every = 0"), @"wire.readings: message Pose: `every` is 0: it must be at least 1");
    insta::assert_snapshot!(says("rate_hz = 1000", "rate_hz = 1500"), @"wire.readings: message Meas: its cycle time in the DBC, 0.001 s, is 1.5 samples at 1500 Hz: give `every`, or choose a rate at which it is a whole number of samples");
    insta::assert_snapshot!(says("rate_hz = 1000", "rate_hz = 1000\n[network]\nbit_rate_hz = 250000"), @"the messages of [wire] take up to 117.0 % of network.bit_rate_hz, more than the limit of 80 % for a bus with control; send readings less often, or raise the bit rate");
    insta::assert_snapshot!(dbc_says("AccX : 0|16@1- (0.01,0) [-327|327] \"g\"", "AccX : 0|16@1- (0.001,0) [-32|32] \"g\""), @"wire.readings: message Meas, signal AccX: its range is -32.768 to 32.767 g, but acceleration_c_x_m_s2 goes from -163.154594 to 163.154594: widen the signal, or lower rig.sensors.c.range_m_s2");
}

#[test]
fn signals_of_the_dbc_that_are_refused() {
    insta::assert_snapshot!(dbc_says("Force : 0|16@1- (0.02,0)", "Force : 0|16@1- (0,0)"), @"bench.dbc, line 10: signal Force of Drive: its factor is 0: it must be a finite number other than 0");
    insta::assert_snapshot!(dbc_says("Force : 0|16@1- (0.02,0)", "Force : 56|16@1- (0.02,0)"), @"bench.dbc, line 10: signal Force of Drive: from start bit 56 its 16 bits take 9 bytes, but the payload has only 8");
    insta::assert_snapshot!(dbc_says("Enable : 16|1@1+", "Enable : 8|1@1+"), @"bench.dbc, line 10: signal Force of Drive: bit 8 also belongs to Enable, in line 11");
    insta::assert_snapshot!(dbc_says("SG_ Force :", "SG_ Force m1 :"), @"bench.dbc, line 10: signal Force of Drive: it is multiplexed, but the message has no switch, a signal marked M");
    insta::assert_snapshot!(dbc_says("BO_ 256 Drive: 8", "BO_ 256 Drive: 9"), @"bench.dbc, line 9: message Drive: its length is 9 bytes: a classical frame has 0 to 8; if it is CAN FD, its attribute VFrameFormat has to be StandardCAN_FD or ExtendedCAN_FD");
    insta::assert_snapshot!(dbc_says("BO_ 256 Drive: 8", "BO_ 4096 Drive: 8"), @"bench.dbc, line 9: message Drive: identifier 4096 does not fit 11 bits: with 29 bits it is written as 2147487744, with bit 31");
}

fn odrive(keys: &str) -> Result<Mapping, String> {
    compiled(&format!("[wire]\npreset = 'odrive'\n{keys}"), "")
}

#[test]
fn a_preset_has_the_messages_of_its_drives() {
    let two = "{ node_id = 0, joint = 2 }, { node_id = 5, joint = 1, gear_ratio = 8.0, torque_constant_nm_a = 0.1 }";
    let mapping = odrive(&format!("drives = [{two}]")).unwrap();
    let ids: Vec<u32> = mapping.incoming.iter().map(|message| message.id.raw()).collect();
    assert_eq!(ids, [0x02, 0x07, 0x0B, 0x0E, 0x18, 0xA2, 0xA7, 0xAB, 0xAE, 0xB8]);
    let torque = &mapping.incoming[8].commands[0];
    assert_eq!((torque.scale, torque.input), (8.0, LoadInput::Torque(0)));
    let ids: Vec<u32> = mapping.outgoing.iter().map(|message| message.id.raw()).collect();
    assert_eq!(ids, [0x01, 0x03, 0x09, 0x14, 0x15, 0x17, 0x1C, 0xA1, 0xA3, 0xA9, 0xB4, 0xB5, 0xB7, 0xBC]);
    assert_eq!(mapping.outgoing[2].trigger, Trigger::Every(10));
    let lockstep = odrive("lockstep = 'command'\ndrives = [{ node_id = 0, joint = 2 }]").unwrap();
    assert_eq!(lockstep.outgoing[2].trigger, Trigger::Every(1));
}

#[test]
fn drives_that_are_refused() {
    let says = |keys: &str| odrive(keys).unwrap_err();
    let found = [
        says(""),
        says("dbc = 'bench.dbc'"),
        says("drives = [{ node_id = 64, joint = 1 }]"),
        says("drives = [{ node_id = 0, joint = 3 }]"),
        says("drives = [{ node_id = 0, joint = 1 }, { node_id = 0, joint = 2 }]"),
        says("drives = [{ node_id = 0, joint = 1, gear_ratio = 0.0 }]"),
        says("drives = [{ node_id = 0, joint = 1, torque_constant_nm_a = -1.0 }]"),
        says("timeout_s = 0.0\ndrives = [{ node_id = 0, joint = 1 }]"),
        says(
            "drives = [{ node_id = 0, joint = 1 }]\n[rig.shaker]\nmoving_mass_kg = 1\nstiffness_n_m = 1\ndamping_n_s_m = 1\nforce_factor_n_a = 1\nresistance_ohm = 1\ninductance_h = 0\nstroke_m = 1\ncurrent_limit_a = 1\nvoltage_limit_v = 1",
        ),
        compiled("[wire]\ndrives = [{ node_id = 0, joint = 1 }]", "").unwrap_err(),
    ];
    insta::assert_snapshot!(found.join("\n"), @r#"
    [wire]: a preset needs at least one drive: drives = [{ node_id = 0, joint = 1 }]
    [wire]: with a `preset` the messages are given: leave out `dbc`, `node`, `arm`, `sync`, `commands`, `events` and `readings`
    wire.drives, number 1: `node_id` is 64: it must be from 0 to 63, and another than those before
    wire.drives, number 1: `joint` is 3: it must be the number of a joint of the structure, and another than those before
    wire.drives, number 2: `node_id` is 0: it must be from 0 to 63, and another than those before
    wire.drives, number 1: `gear_ratio` is 0: it must be a number other than 0
    wire.drives, number 1: `torque_constant_nm_a` is -1: it must be a positive number
    wire.commands: message Axis0_Set_Input_Torque: `timeout_s` is 0: it must be a positive number of seconds, at most 3600
    [wire]: a drive exerts a torque, but a shaker can't: leave out [rig.shaker]
    [wire]: `drives` and `timeout_s` belong to a `preset`: give one, as "odrive"
    "#);
}

/// Angles and rates are counted as in the scenario's structure, and only its states can be sent.
#[test]
fn states_are_those_of_the_structure() {
    let link = "{ length_m = 0.3, mass_kg = 2.0, centre_of_mass_m = 0.1, inertia_kg_m2 = 0.02, angle_deg = 0, stiffness_nm_rad = 1e4, damping_nm_s_rad = 2.0 }";
    let chain = format!("structure = {{ kind = 'chain', links = [{link}, {link}, {link}] }}\n");
    let modal = "structure = { kind = 'modal', modes = [{ frequency_hz = 20, damping_ratio = 0.01, shape = { 'tip.x' = 0.5 } }] }\n";
    let sent = |structure: &str, name: &str| {
        let text: String =
            SCENARIO.lines().filter(|line| !line.contains("alpha")).map(|line| format!("{line}\n")).collect();
        let quantity = format!("quantity = \"{name}\", scale = 1.0");
        let text = text.replace("quantity = \"acceleration_c_x_m_s2\"", &quantity);
        compiled(&(structure.to_string() + &text), DBC)
    };
    let place = |structure: &str, name: &str| {
        let mapping = sent(structure, name).unwrap();
        let mut sources = mapping.outgoing.iter().flat_map(|message| &message.signals).map(|signal| &signal.source);
        let place = sources.find_map(|source| match source {
            Source::Value { value: Value::State(place), .. } => Some(*place),
            _ => None,
        });
        place.unwrap()
    };
    assert_eq!(
        [place("", "alpha1_dot_rad_s"), place(&chain, "alpha1_dot_rad_s"), place(&chain, "alpha3_rad")],
        [2, 3, 2]
    );
    assert_eq!(place(modal, "q1_dot_m_sqrt_kg_s"), 1);
    assert!(sent(modal, "alpha1_rad").unwrap_err().contains("there is no quantity \"alpha1_rad\""));
}

/// A drive turns any joint that the structure has.
#[test]
fn drives_turn_the_joints_of_the_structure() {
    let link = "{ length_m = 0.3, mass_kg = 2.0, centre_of_mass_m = 0.1, inertia_kg_m2 = 0.02, angle_deg = 0, stiffness_nm_rad = 1e4, damping_nm_s_rad = 2.0 }";
    let drives = |links: usize, joint: usize| {
        let links = vec![link; links].join(", ");
        let text = format!(
            "structure = {{ kind = 'chain', links = [{links}] }}\n[wire]\npreset = 'odrive'\n\
             drives = [{{ node_id = 0, joint = {joint}, gear_ratio = 8.0 }}]\n"
        );
        compiled(&text, "")
    };
    let input = |mapping: &Mapping| mapping.incoming.iter().flat_map(|message| &message.commands).next().unwrap().input;
    assert_eq!(input(&drives(3, 3).unwrap()), LoadInput::Torque(2));
    insta::assert_snapshot!(drives(2, 3).unwrap_err(), @"wire.drives, number 1: `joint` is 3: it must be the number of a joint of the structure, and another than those before");
}
