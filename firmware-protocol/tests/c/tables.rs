//! Constants, the table of states, hellos, windows and bases.

use std::process::Command;

use resonarm_protocol::header::Header;
use resonarm_protocol::{
    Hello, MessageKind, Mismatch, Network, NetworkError, NodeState, PROTOCOL_VERSION, Profile, StateEvent, Version,
    dbc, network, timing,
};

use super::Harness;
use super::harness::{bits, build_for};

#[test]
fn the_constants_are_equal() {
    let expected: [u64; 18] = [
        PROTOCOL_VERSION.into(),
        (dbc::hash(Profile::Classic) & Hello::DBC_HASH_MASK).into(),
        (dbc::hash(Profile::Fd) & Hello::DBC_HASH_MASK).into(),
        network::BASE_MIN.into(),
        network::BASE_MAX.into(),
        MessageKind::COUNT as u64,
        timing::HEARTBEAT_PERIOD_NS,
        timing::HEARTBEAT_TIMEOUT_NS,
        timing::HELLO_PERIOD_NS,
        timing::COMMAND_TIMEOUT_NS,
        timing::COMMAND_AGE_NS,
        timing::FORCE_RAMP_NS,
        timing::LOCKSTEP_TIMEOUT_NS,
        timing::LOCKSTEP_LOOK_NS,
        timing::REAL_TIME_RATE_MIN_HZ.into(),
        timing::STALE_SAMPLES_LIMIT,
        timing::SAMPLE_WINDOW_MIN.into(),
        network::NODE_ID_MAX.into(),
    ];
    let mut both = Harness::start(Profile::Classic);
    let found: Vec<u64> = both.ask("constants").split(' ').map(|word| word.parse().unwrap()).collect();
    assert_eq!(found, expected);
    both.end();
}

#[test]
fn the_tables_are_equal() {
    let mut both = Harness::start(Profile::Classic);
    for state in NodeState::ALL {
        for (number, event) in StateEvent::ALL.into_iter().enumerate() {
            let to = state.next(event).unwrap_or(state).heartbeat_byte();
            assert_eq!(
                both.ask(&format!("next {} {number}", state.heartbeat_byte())),
                to.to_string(),
                "{state} {event:?}"
            );
        }
    }
    for rate_hz in [0, 1, 16, 45, 46, 47, 48, 99, 100, 1000, 1573, 65_535] {
        let expected = format!("{} {}", timing::sample_window(rate_hz), timing::sample_period_ns(rate_hz));
        assert_eq!(both.ask(&format!("window {rate_hz}")), expected);
    }
    let networks = (0x170..0x590).map(|base| (base, 1, 2));
    for (base, plant, exciter) in networks.chain([0, 1, 2, 127, 128, 255].map(|id| (0x200, id, 2))).chain([
        (0x200, 1, 0),
        (0x200, 127, 127),
        (0x200, 1, 128),
    ]) {
        let expected = match Network::new(base).and_then(|network| network.with_node_ids(plant, exciter)) {
            Ok(_) => "valid",
            Err(NetworkError::OutOfRange { .. }) => "base",
            Err(NetworkError::Unaligned { .. }) => "unaligned",
            Err(NetworkError::NodeId { .. }) => "node-id",
            Err(NetworkError::SameNodeId { .. }) => "same",
        };
        assert_eq!(both.ask(&format!("network {base} {plant} {exciter} 0")), expected, "{base:#X} {plant} {exciter}");
    }
    both.end();
}

#[test]
fn the_header_in_the_tree_is_that_of_the_default_network() {
    assert_eq!(include_str!("../../c/include/resonarm_config.h"), Header(Network::default()).to_string());
}

#[test]
fn the_library_has_the_numbers_of_the_header_it_is_built_with() {
    for (base, plant, exciter, profile) in
        [(0x200, 1, 2, Profile::Classic), (0x300, 3, 4, Profile::Fd), (0x570, 127, 1, Profile::Classic)]
    {
        let network = Network::new(base).unwrap().with_node_ids(plant, exciter).unwrap().with_profile(profile);
        let output = Command::new(build_for(network, "config")).output().unwrap();
        assert!(output.status.success(), "{network:?}: {}", String::from_utf8_lossy(&output.stdout));
    }
}

#[test]
fn hellos_are_compared_alike() {
    let own = Hello::new(Profile::Classic, 1000);
    let version = |major, minor| Version { major, minor };
    let mut both = Harness::start(Profile::Classic);
    for partner in [
        own,
        Hello { version: version(1, 9), ..own },
        Hello { version: version(2, 1), dbc_hash: 0, profile: Profile::Fd, rate_hz: 1 },
        Hello { dbc_hash: 0, profile: Profile::Fd, ..own },
        Hello { profile: Profile::Fd, rate_hz: 1, ..own },
        Hello { rate_hz: 999, ..own },
    ] {
        let values = |hello: Hello| {
            let Version { major, minor } = hello.version;
            let profile = hello.profile as u8;
            bits(&[major.into(), minor.into(), hello.dbc_hash.into(), profile.into(), hello.rate_hz.into()])
        };
        let expected = own.mismatch(&partner).map_or(0xFFFF, |mismatch: Mismatch| mismatch as u16);
        let answer = both.ask(&format!("compare{}{}", values(own), values(partner)));
        assert_eq!(answer, expected.to_string(), "{partner:?}");
    }
    both.end();
}
