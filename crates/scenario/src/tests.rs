use super::*;
use resonarm_bench::node::Timing;
use resonarm_dynamics::structure::{BodySpec, Preset};
use resonarm_protocol::timing;

fn parse(text: &str) -> Result<Scenario, ScenarioError> {
    Scenario::parse(text, "test.toml")
}

#[test]
fn an_empty_scenario_is_the_default_and_survives_writing() {
    let scenario = parse("").unwrap();
    assert_eq!(scenario, Scenario::default());
    let written = scenario.to_toml().unwrap();
    assert_eq!(parse(&written).unwrap().to_toml().unwrap(), written);
    assert!(written.contains("steps_per_sample = 2"), "{written}");
    let BodySpec::Chain(chain) = scenario.under_test().unwrap().assembly.spec().body.clone() else {
        panic!("no chain")
    };
    assert_eq!(chain, Preset::Irb1600Fitted.chain().unwrap());
    assert!(written.contains("preset = \"irb1600-fitted\"\nangles_deg = [0.0, 60.0]\n"), "{written}");
    assert_eq!(scenario.real_time_timing().unwrap(), Timing::real_time(1000));
    assert_eq!(scenario.lockstep_timing().unwrap(), Timing::lockstep(timing::LOCKSTEP_TIMEOUT_NS));
}

#[test]
fn own_parameters_replace_the_presets() {
    let scenario = parse("[structure]\npreset = 'irb1600-table1'\nset = { 'link2.inertia_kg_m2' = 1.5 }").unwrap();
    assert_eq!(scenario.under_test().unwrap().assembly, parse("").unwrap().under_test().unwrap().assembly);
}

#[test]
fn names_an_unknown_key_and_suggests_the_nearest() {
    let says = |text: &str| parse(text).and_then(|scenario| scenario.under_test()).unwrap_err().to_string();
    insta::assert_snapshot!(says("[simulation]\nrate_hz = 1000\nstep_per_sample = 2\n"), @r"
    test.toml: TOML parse error at line 3, column 1
      |
    3 | step_per_sample = 2
      | ^^^^^^^^^^^^^^^
    unknown field `step_per_sample`, expected one of `rate_hz`, `steps_per_sample`, `scheme`, `seed`, `duration_s`
    Did you mean `steps_per_sample`?
    ");
    let parameter = says("[structure.set]\nmass_kg = 3.0");
    assert!(parameter.starts_with("structure.set: `mass_kg` is 3: there is no parameter `mass_kg`"), "{parameter}");
    insta::assert_snapshot!(says("[structure]\npreset = 'irb140'"), @"structure: there is no preset `irb140`: expected one of irb1600-table1, irb1600-fitted");
}

#[test]
fn says_what_is_wrong_with_the_numbers() {
    let says = |text: &str| {
        let scenario = parse(text).unwrap();
        let checks = || -> Result<(), ScenarioError> {
            scenario.wire_rate_hz()?;
            scenario.duration_samples()?;
            scenario.network()?;
            scenario.real_time_timing()?;
            scenario.lockstep_timing()?;
            scenario.profile().map(|_| ())
        };
        checks().unwrap_err().to_string()
    };
    insta::assert_snapshot!(says("simulation.rate_hz = 0"), @"simulation.rate_hz is 0: it must be an integer from 1 to 65535 Hz");
    insta::assert_snapshot!(says("simulation.rate_hz = 999.5"), @"simulation.rate_hz is 999.5: it must be an integer from 1 to 65535 Hz");
    insta::assert_snapshot!(says("simulation.duration_s = nan"), @"simulation.duration_s is NaN: it must be a positive number");
    insta::assert_snapshot!(says("network.base_id = 0x205"), @"network: base identifier 0x205 is not a multiple of 0x10: take 0x200");
    insta::assert_snapshot!(says("network.exciter_id = 1"), @"network: plant and exciter both have the node id 1: give them different ones");
    insta::assert_snapshot!(says("network.command_timeout_s = 0.0005"), @"network.command_timeout_s is 0.0005: it must be at least two samples long (2 / simulation.rate_hz), or four with two samples a frame");
    insta::assert_snapshot!(says("network.command_timeout_s = 0.019\nsimulation.rate_hz = 100"), @"network.command_timeout_s is 0.019: it must be at least two samples long (2 / simulation.rate_hz), or four with two samples a frame");
    insta::assert_snapshot!(says("simulation.rate_hz = 99\nnetwork.command_timeout_s = 0.1"), @"simulation.rate_hz is 99: a run in real time needs at least 100 Hz; lockstep and free runs take any rate");
    insta::assert_snapshot!(says(""), @"the scenario has neither [excitation] nor [control]: add one, as scenarios/bench.toml and scenarios/demo.toml show");
}

#[test]
fn says_what_a_bus_cannot_carry_and_which_rates_are_none() {
    let spec = |text: &str| parse(&format!("[network]\n{text}")).unwrap().timed_bus();
    let says = |text: &str| spec(text).unwrap_err().to_string();
    insta::assert_snapshot!(says("bit_rate_hz = 500_000"), @"simulation.rate_hz is 1000: frames and heartbeats take up to 541570 bit/s, 108.3 % of network.bit_rate_hz, 500000; lower the rate to 923, or raise network.bit_rate_hz to 541570");
    insta::assert_snapshot!(says("bit_rate_hz = 2_000_000"), @"network.bit_rate_hz is 2000000: it must be from 10000 to 1000000 Hz; `data_bit_rate_hz` is that of FD frames' data");
    insta::assert_snapshot!(says("data_bit_rate_hz = 2_000_000"), @"network.data_bit_rate_hz is 2000000: it must be left out, or stated with `network.bit_rate_hz`, the rate of arbitration");
    insta::assert_snapshot!(says("bit_rate_hz = 1_000_000\ndata_bit_rate_hz = 500_000"), @"network.data_bit_rate_hz is 500000: it must be from `network.bit_rate_hz` to 8000000 Hz");
    insta::assert_snapshot!(says("bit_error_rate = 1e-6"), @"network.bit_error_rate is 1e-6: it must be left out, or stated with `network.bit_rate_hz`: without it frames have no bits");
    insta::assert_snapshot!(says("bit_rate_hz = 1_000_000\nbit_error_rate = 0.1"), @"network.bit_error_rate is 0.1: it must be a probability from 0 to 0.01");
    assert_eq!(spec("").unwrap(), None);
    let fd = |text: &str| says(&format!("profile = 'fd'\n{text}\n[simulation]\nrate_hz = 3900"));
    insta::assert_snapshot!(fd("bit_rate_hz = 1_000_000\ndata_bit_rate_hz = 2_000_000"), @"simulation.rate_hz is 3900: frames and heartbeats take up to 2408322 bit/s, 133.0 % of network.bit_rate_hz, 1000000, and data_bit_rate_hz, 2000000; lower the rate to 2931, or raise network.data_bit_rate_hz to 2880858");
    insta::assert_snapshot!(fd("bit_rate_hz = 250_000\ndata_bit_rate_hz = 8_000_000"), @"simulation.rate_hz is 3900: frames and heartbeats take up to 2408322 bit/s, 127.5 % of network.bit_rate_hz, 250000, and data_bit_rate_hz, 8000000; lower the rate to 3055, or raise network.bit_rate_hz to 343985");
    insta::assert_snapshot!(fd("bit_rate_hz = 500_000"), @"simulation.rate_hz is 3900: frames and heartbeats take up to 2408322 bit/s, 481.7 % of network.bit_rate_hz, 500000; lower the rate to 807, or raise network.data_bit_rate_hz to 4335577");
    insta::assert_snapshot!(says("bit_rate_hz = 1_000_000\n[simulation]\nrate_hz = 2000"), @"simulation.rate_hz is 2000: frames and heartbeats take up to 1081570 bit/s, 108.2 % of network.bit_rate_hz, 1000000; lower the rate to 1848");
    // What the message says is right, and no more than that fits.
    let at = |rate_hz: u32, bit_rate_hz: u32| {
        let text = format!("simulation.rate_hz = {rate_hz}\nnetwork.bit_rate_hz = {bit_rate_hz}");
        parse(&text).unwrap().timed_bus().is_ok()
    };
    // The bit rate that the first message asks for carries the load exactly, with nothing to spare.
    assert!(at(1000, 541_570) && !at(1000, 541_569));
    assert!(at(923, 500_000) && !at(924, 500_000));
    let fd_at = |rate_hz: u32, bit_rate_hz: u32, data_bit_rate_hz: u32| {
        let rates = format!("bit_rate_hz = {bit_rate_hz}\ndata_bit_rate_hz = {data_bit_rate_hz}");
        parse(&format!("simulation.rate_hz = {rate_hz}\n[network]\nprofile = 'fd'\n{rates}"))
            .unwrap()
            .timed_bus()
            .is_ok()
    };
    assert!(fd_at(2931, 1_000_000, 2_000_000) && !fd_at(2932, 1_000_000, 2_000_000));
}

#[test]
fn rejects_when_it_is_read_what_no_run_can_use() {
    let says = |text: &str| parse(text).unwrap_err().to_string();
    insta::assert_snapshot!(says("network.samples_per_frame = 2"), @r#"network.samples_per_frame is 2: it must be 1, or with `network.profile = "fd"` 2"#);
    insta::assert_snapshot!(says("network.profile = \"fd\"\nnetwork.samples_per_frame = 3"), @r#"network.samples_per_frame is 3: it must be 1, or with `network.profile = "fd"` 2"#);
    insta::assert_snapshot!(says("network.profile = \"fd\"\nnetwork.samples_per_frame = 2\ncontrol.law = \"phase-walk\"\ncontrol.amplitude = { exciter_x = 10 }"), @"network.samples_per_frame is 2: it must be 1 with [control]: a loop that is closed answers every sample");
    insta::assert_snapshot!(says("network.profile = \"can\""), @r#"
    test.toml: TOML parse error at line 1, column 19
      |
    1 | network.profile = "can"
      |                   ^^^^^
    unknown variant `can`, expected `classic` or `fd`
    "#);
    insta::assert_snapshot!(says("network.command_timeout_s = 1.9e10"), @"network.command_timeout_s is 19000000000: it must be a positive number of seconds, at most 3600");
    insta::assert_snapshot!(says("network.partner_timeout_s = 0"), @"network.partner_timeout_s is 0: it must be a positive number of seconds, at most 3600");
    insta::assert_snapshot!(says("network.lockstep_timeout_s = nan"), @"network.lockstep_timeout_s is NaN: it must be a positive number of seconds, at most 3600");
    insta::assert_snapshot!(says("simulation.steps_per_sample = 1002"), @"simulation: `steps_per_sample` is 1002: it must be even, since the instruments sample in the middle, and from 2 to 1000");
    insta::assert_snapshot!(says("simulation.steps_per_sample = 3"), @"simulation: `steps_per_sample` is 3: it must be even, since the instruments sample in the middle, and from 2 to 1000");
    assert!(parse("simulation.steps_per_sample = 1000").is_ok());
    insta::assert_snapshot!(says("[[network.faults]]\nnode = 'plant'\nkind = 'delay'\nfrom_s = 0"), @"network.faults, number 1: `delay_s` is missing: add it, or change `kind`");
    let plays = |rig: &str, amplitude: &str| {
        let profile = "profile = { waveform = 'dwell', frequency_hz = 20, duration_s = 2, settle_s = 0.5 }";
        parse(&format!("{rig}\n[excitation]\namplitude = {{ {amplitude} }}\n{profile}"))
    };
    let says = |rig: &str, amplitude: &str| plays(rig, amplitude).unwrap_err().to_string();
    insta::assert_snapshot!(says("rig.exciter.force_limit_n = 10", "exciter_x = 20"), @"excitation.amplitude.exciter_x is 20, beyond rig.exciter.force_limit_n, 10 N: lower it, or raise the limit if the exciter has more");
    insta::assert_snapshot!(says("", "joint2 = -1600.1"), @"excitation.amplitude.joint2 is -1600.1, beyond rig.exciter.torque_limit_nm, 1600 N·m: lower it, or raise the limit if the exciter has more");
    insta::assert_snapshot!(says("rig.exciter.force_limit_n = 1000", "exciter_y = 700"), @r#"excitation.amplitude.exciter_y is 700, beyond the range of the protocol, 655.34 N: lower it, or use `network.profile = "fd"`, since a command can't state more"#);
    // 9.991 N is sent as 10 N, which the exciter can't produce.
    assert!(plays("rig.exciter.force_limit_n = 9.995", "exciter_x = 9.991").is_err());
    assert!(plays("rig.exciter.force_limit_n = 10", "exciter_x = 10").is_ok());
}

#[test]
fn what_was_recorded_is_not_judged_again() {
    let recorded =
        Scenario::parse_unchecked("network.partner_timeout_s = 1e9\nsimulation.steps_per_sample = 6", "test").unwrap();
    let configuration = recorded.configuration("free").unwrap();
    assert_eq!(Scenario::from_configuration(&configuration).unwrap(), recorded);
}

fn refusal(section: &str) -> String {
    Scenario::parse(section, "test").unwrap_err().to_string()
}

#[test]
fn rejects_harmonics_that_can_t_be_cancelled() {
    let with = |orders: &str| {
        refusal(&format!(
            "[control]\nlaw = 'phase-walk'\namplitude = {{ exciter_x = 1 }}\ncancel_harmonics = {orders}\n"
        ))
    };
    insta::assert_snapshot!(with("[0]"), @r"
    test: TOML parse error at line 1, column 1
      |
    1 | [control]
      | ^^^^^^^^^
    `cancel_harmonics`: harmonic 0 can't be cancelled: expected 2 or 3, which are read beside the fundamental
    ");
    insta::assert_snapshot!(with("[2, 1]"), @r"
    test: TOML parse error at line 1, column 1
      |
    1 | [control]
      | ^^^^^^^^^
    `cancel_harmonics`: harmonic 1 can't be cancelled: expected 2 or 3, which are read beside the fundamental
    ");
    insta::assert_snapshot!(with("[7]"), @r"
    test: TOML parse error at line 1, column 1
      |
    1 | [control]
      | ^^^^^^^^^
    `cancel_harmonics`: harmonic 7 can't be cancelled: expected 2 or 3, which are read beside the fundamental
    ");
    insta::assert_snapshot!(with("[2, 3, 2]"), @r"
    test: TOML parse error at line 1, column 1
      |
    1 | [control]
      | ^^^^^^^^^
    `cancel_harmonics`: harmonic 2 is listed twice: list it once
    ");
    let open = "[excitation]\namplitude = { exciter_x = 1 }\ncancel_harmonics = [2]\n\
        profile = { waveform = 'dwell', frequency_hz = 20, duration_s = 2, settle_s = 1 }\n";
    insta::assert_snapshot!(refusal(open), @r"
    test: TOML parse error at line 3, column 1
      |
    3 | cancel_harmonics = [2]
      | ^^^^^^^^^^^^^^^^
    unknown field `cancel_harmonics`, expected one of `amplitude`, `ramp_s`, `profile`
    ");
    let torque = "[control]\nlaw = 'phase-walk'\namplitude = { joint1 = 1 }\ncancel_harmonics = [2]\n";
    let scenario = Scenario::parse(torque, "test").unwrap();
    insta::assert_snapshot!(scenario.controller().unwrap_err(), @"control: `cancel_harmonics` uses the impedance head, which measures no torque: leave it out, or give forces");
}
