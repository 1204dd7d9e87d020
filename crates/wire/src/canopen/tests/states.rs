//! Network management, heartbeat, emergencies, the state machine of drives.

use super::cia402::{Command, DriveState};
use super::eds::Eds;
use super::*;
use std::string::ToString;

#[test]
fn network_management_is_for_the_node_or_for_all() {
    let mut master = Master::new();
    assert_eq!(master.send(NMT_ID, &[1, 6]), Handled::Foreign);
    assert_eq!(master.send(NMT_ID, &[1, 0]), Handled::Nmt(NmtCommand::Start));
    assert_eq!(master.server.state(), NmtState::Operational);
    master.send(NMT_ID, &[2, NODE]);
    assert_eq!(master.server.state(), NmtState::Stopped);
    assert_eq!(master.send(0x605, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]), Handled::Foreign);
    assert_eq!(master.send(SYNC_ID, &[]), Handled::Foreign);
    master.server.emergency(0x1000, 1, [0; 5]);
    assert!(master.frames().is_empty());
    master.send(NMT_ID, &[0x80, NODE]);
    assert_eq!(master.server.state(), NmtState::PreOperational);
    master.write(0x2000, 0, &[99, 0]).unwrap();
    master.send(NMT_ID, &[0x82, NODE]);
    master.frames();
    assert_eq!(master.read(0x2000, 0), Ok(99));
    master.send(NMT_ID, &[0x81, NODE]);
    assert_eq!(texts(&master.frames()), ["705#00"]);
    assert_eq!(master.read(0x2000, 0), Ok(7));
    assert_eq!(master.send(NMT_ID, &[7, NODE]), Handled::Foreign);
}

#[test]
fn the_heartbeat_says_the_state() {
    let mut master = Master::new();
    assert_eq!(master.server.next_deadline_ns(), None);
    master.write(0x1017, 0, &10_u16.to_le_bytes()).unwrap();
    let mut all = Vec::new();
    for (ms, command) in [(10, 1), (20, 2), (30, 0x80)] {
        master.send(NMT_ID, &[command, 0]);
        master.server.handle_deadline(ms * 1_000_000);
        all.extend(texts(&master.frames()));
    }
    assert_eq!(all, ["705#05", "705#04", "705#7F"]);
    assert_eq!(master.server.next_deadline_ns(), Some(40_000_000));
    master.server.emergency(0x8250, 0x11, [1, 2, 3, 4, 5]);
    assert_eq!(texts(&master.frames()), ["085#5082110102030405"]);
}

#[test]
fn a_controlword_asks_for_one_thing() {
    for (before, controlword, expected) in [
        (0x00, 0x06, Command::Shutdown),
        (0x00, 0x0E, Command::Shutdown),
        (0x06, 0x07, Command::SwitchOn),
        (0x07, 0x0F, Command::EnableOperation),
        (0x07, 0x10F, Command::EnableOperation),
        (0x0F, 0x00, Command::DisableVoltage),
        (0x0F, 0x0D, Command::DisableVoltage),
        (0x0F, 0x02, Command::QuickStop),
        (0x0F, 0x0B, Command::QuickStop),
        (0x00, 0x80, Command::FaultReset),
        (0x0F, 0x8F, Command::FaultReset),
        (0x80, 0x80, Command::DisableVoltage),
        (0x80, 0x8F, Command::EnableOperation),
    ] {
        assert_eq!(Command::of(before, controlword), expected, "{before:x} {controlword:x}");
    }
}

#[test]
fn only_enable_operation_enables_and_only_a_fault_reset_leaves_a_fault() {
    use Command::{DisableVoltage, EnableOperation, FaultReset, QuickStop, Shutdown, SwitchOn};
    let all = [Shutdown, SwitchOn, EnableOperation, DisableVoltage, QuickStop, FaultReset];
    for state in DriveState::ALL {
        for command in all {
            let to = state.after(command);
            if to == DriveState::OperationEnabled && state != to {
                assert_eq!(command, EnableOperation, "{state:?}");
                assert_ne!(state, DriveState::SwitchOnDisabled);
            }
            if state.is_fault() && to != state {
                assert_eq!((state, command, to), (DriveState::Fault, FaultReset, DriveState::SwitchOnDisabled));
            }
        }
    }
    let through = |commands: &[Command]| commands.iter().fold(DriveState::SwitchOnDisabled, |s, c| s.after(*c));
    assert_eq!(through(&[Shutdown]).bits(), 0x21);
    assert_eq!(through(&[Shutdown, SwitchOn]).bits(), 0x23);
    assert_eq!(through(&[Shutdown, SwitchOn, EnableOperation]).bits(), 0x27);
    assert_eq!(through(&[Shutdown, EnableOperation, QuickStop]).bits(), 0x07);
    assert_eq!(through(&[Shutdown, EnableOperation, QuickStop, DisableVoltage]).bits(), 0x40);
    assert_eq!(through(&[SwitchOn, EnableOperation]).bits(), 0x40);
}

#[test]
fn an_eds_says_what_the_dictionary_does() {
    let dictionary = dictionary();
    let eds = Eds { dictionary: &dictionary, node_id: NODE, file: "a.eds", product: "test", version: "1" }.to_string();
    for part in [
        "[1000]\nParameterName=Type\nObjectType=0x7\nDataType=0x0007\nAccessType=const\nDefaultValue=131474\nPDOMapping=0\n",
        "DefaultValue=$NODEID+0x200\n",
        "DefaultValue=$NODEID+0x80000300\n",
        "[1800]\nParameterName=TPDO 1 communication\nObjectType=0x9\nSubNumber=5\n",
        "LowLimit=1\nHighLimit=1000\nPDOMapping=1\n",
    ] {
        assert!(eds.contains(part), "{part}\n{eds}");
    }
    let list = eds.split("[OptionalObjects]\nSupportedObjects=").nth(1).unwrap();
    assert_eq!(list.lines().next(), Some((dictionary.objects().len() - 2).to_string().as_str()));
}

#[test]
fn a_statusword_has_the_state_of_its_bits() {
    use cia402::DriveState;
    // Bits without a meaning for the state, all set.
    for state in DriveState::ALL {
        let others = match state {
            DriveState::NotReady
            | DriveState::SwitchOnDisabled
            | DriveState::FaultReactionActive
            | DriveState::Fault => !0x4F,
            _ => !0x6F,
        };
        assert_eq!(DriveState::of(state.bits()), Some(state));
        assert_eq!(DriveState::of(state.bits() | others), Some(state));
    }
    assert_eq!(DriveState::of(0x22), None);
    assert!(Abort::ALL.iter().all(|abort| Abort::of(abort.code()) == Some(*abort)));
}
