//! States and loads gathered from frames.

use super::*;
use resonarm_scenario::WireSection;

const DBC: &str = r#"VERSION ""

BU_: Plant Controller

BO_ 256 Torque: 3 Controller
 SG_ Torque1 : 0|16@1- (0.1,0) [0|0] "Nm" Plant
 SG_ Enable : 16|8@1+ (1,0) [0|0] "" Plant

BO_ 512 Angles: 8 Plant
 SG_ A1 : 0|16@1- (0.001,0) [0|0] "rad" Controller
 SG_ A2 : 16|16@1- (0.001,0) [0|0] "rad" Controller
 SG_ Index : 32|8@1+ (1,0) [0|0] "" Controller

BO_ 513 Rates: 8 Plant
 SG_ R1 : 0|16@1- (0.001,0) [0|0] "rad/s" Controller
 SG_ R2 : 16|16@1- (0.001,0) [0|0] "rad/s" Controller
 SG_ Index : 32|8@1+ (1,0) [0|0] "" Controller
"#;

const SCENARIO: &str = r#"
rig.exciter = { torque_limit_nm = 1000 }
[wire]
dbc = "a.dbc"
commands = [{ message = "Torque", torque1_nm = { signal = "Torque1" } }]
events = [{ message = "Torque", signal = "Enable", arm = [1], disarm = [0] }]

[[wire.readings]]
message = "Angles"
every = 1
signals.A1 = { quantity = "alpha1_rad" }
signals.A2 = { quantity = "alpha2_rad", scale = -1 }
signals.Index = { sample = true }

[[wire.readings]]
message = "Rates"
every = 1
signals.R1 = { quantity = "alpha1_dot_rad_s" }
signals.R2 = { quantity = "alpha2_dot_rad_s" }
signals.Index = { sample = true }
"#;

fn gatherer() -> Gatherer {
    let mut scenario = Scenario::parse(SCENARIO, "test").unwrap();
    scenario.wire = scenario.wire.map(|wire| WireSection { text: Some(DBC.to_string()), ..wire });
    Gatherer::new(&scenario).unwrap().unwrap()
}

#[test]
fn states_come_with_the_load_commanded_then() {
    let mut gatherer = gatherer();
    assert_eq!(gatherer.direction(Id::Standard(0x200)), Some(Direction::Sent));
    // Indices go round at 256, and messages of a sample come in any order.
    let frames = [
        (900, "200#03000400FF00"),
        (400, "201#01000200FF00"),
        // 0x0064 and 0xFF9C are 100 and -100 counts of 0.1 N·m, low byte first.
        (1100, "100#640001"),
        (1900, "200#050006000000"),
        (1950, "201#010002000000"),
        (2100, "100#9CFF01"),
        (2900, "201#010002000100"),
        (2950, "200#070008000100"),
        (3000, "100#640000"),
        (3900, "201#010002000200"),
        (3950, "200#090008000200"),
    ];
    let mut records = Vec::new();
    for (us, frame) in frames {
        gatherer.add(&frame.parse().unwrap(), us * 1000);
        records.extend(core::iter::from_fn(|| gatherer.next(false)));
    }
    records.extend(core::iter::from_fn(|| gatherer.next(true)));
    let found: Vec<(u64, [f64; 2], f64)> = records
        .iter()
        .map(|record| match record {
            Record::State(state) => {
                (state.sample, state.states.coordinates().try_into().unwrap(), state.load.torque_nm[0])
            }
            other => panic!("{other:?}"),
        })
        .collect();
    let expected =
        [(0, [0.003, -0.004], 10.0), (1, [0.005, -0.006], -10.0), (2, [0.007, -0.008], 0.0), (3, [0.009, -0.008], 0.0)];
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for ((sample, alpha, torque), (of, expected, load)) in found.iter().zip(expected) {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(*sample == of && near(alpha[0], expected[0]) && near(alpha[1], expected[1]), "{found:?}");
        assert!(near(*torque, load), "{found:?}");
    }
    let found = gatherer.finish();
    assert_eq!((found.states, found.missing_states.len(), found.missing_readings.len()), (4, 0, 6));
    assert!(found.missing_readings.iter().all(|missing| !missing.is_carried));
}
