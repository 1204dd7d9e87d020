//! Cases for CANopen drives (CiA 301, CiA 402-2), by their objects.

use super::monitor::Heard;
use super::plant_cases::{arm, drive, judged_fault, load_of};
use super::protocol::COMMAND_BASE;
use super::tester::{Alter, Tester};
use crate::stop::{Stop, failed, inconclusive, late, not_at_once, skipped, wrong};
use crate::times::{GONE_NS, MARGIN_NS, MS, ms};
use resonarm_bench::node::WireSpec;
use resonarm_bench::node::cia402::{DriveSpec, TORQUE_MODE};
use resonarm_files::decoder::Meaning;
use resonarm_protocol::{Frame, FrameError, Id};
use resonarm_wire::canopen::cia402::DriveState;
use resonarm_wire::canopen::{HEARTBEAT_BASE, NMT_ID, SDO_REQUEST_BASE, SYNC_ID};

/// Plus the node id: TPDO 2.
const MOTION_BASE: u16 = 0x280;
/// The profile of drives, in the low half of the device type (object 1000).
const PROFILE: u32 = 402;
/// An index that CiA 301 reserves, and the abort code of an object that does not exist.
const NO_OBJECT: u16 = 0x0FFF;
const ABORT_NO_OBJECT: u32 = 0x0602_0000;
/// Number of times that a drive is asked for its positions.
const SYNCS: usize = 20;
/// The longest heartbeat period that is watched, ns.
const HEARTBEAT_MOST_NS: u64 = 5_000 * MS;

/// The answer of a drive to an SDO.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    Value(u32),
    Written,
    Aborted(u32),
}

/// Starts the drives' communication, which then say their statuswords by themselves.
fn meet(t: &mut Tester) -> Result<(), Stop> {
    send(t, NMT_ID, &[1, 0])?;
    if t.wait_for(0, t.settings.patience_ns, |_| true)?.is_some() {
        return Ok(());
    }
    t.heard_nothing("drive", "")
}

/// The drives of the user protocol: none of a DBC, which has none of these cases.
fn drives(t: &Tester) -> Vec<DriveSpec> {
    match &t.on.spec {
        WireSpec::Cia402(spec) => spec.drives.clone(),
        WireSpec::Mapped(_) => Vec::new(),
    }
}

fn send(t: &mut Tester, id: u16, data: &[u8]) -> Result<(), Stop> {
    let frame: Result<Frame, FrameError> = Frame::classic(Id::Standard(id), data);
    match frame {
        Ok(frame) => t.send(&frame),
        Err(error) => inconclusive(format!("the tester can't send this: {error}")),
    }
}

/// Sends an SDO request, and waits for the answer.
fn ask(t: &mut Tester, node_id: u8, request: [u8; 8]) -> Result<Answer, Stop> {
    let from = t.mark();
    send(t, SDO_REQUEST_BASE + u16::from(node_id), &request)?;
    let index = u16::from_le_bytes([request[1], request[2]]);
    let heard = t.wait_for(from, GONE_NS, |heard| answer(heard, index, request[3]).is_some())?;
    match heard.and_then(|heard| answer(&heard, index, request[3])) {
        Some(answer) => Ok(answer),
        None => late(format!("node {node_id} doesn't answer an SDO about {index:04X} within {}", ms(GONE_NS))),
    }
}

fn answer(heard: &Heard, index: u16, subindex: u8) -> Option<Answer> {
    heard.message.means.iter().find_map(|meaning| {
        let Meaning::Object { action, object: Some(object) } = meaning else { return None };
        if (object.index, object.subindex) != (index, subindex) {
            return None;
        }
        match *action {
            "value of" => Some(Answer::Value(heard.signal("value").unwrap_or(0.0) as i64 as u32)),
            "written" => Some(Answer::Written),
            "abort" => Some(Answer::Aborted(heard.signal("code").unwrap_or(0.0) as u32)),
            _ => None,
        }
    })
}

fn read(t: &mut Tester, node_id: u8, index: u16, subindex: u8) -> Result<u32, Stop> {
    let [low, high] = index.to_le_bytes();
    // 0x40 begins an upload, as CiA 301 calls the reading of an object.
    match ask(t, node_id, [0x40, low, high, subindex, 0, 0, 0, 0])? {
        Answer::Value(value) => Ok(value),
        Answer::Aborted(code) => {
            failed(format!("node {node_id} aborts the reading of {index:04X}:{subindex:02X}: {code:#010x}"))
        }
        Answer::Written => failed(format!("node {node_id} answers the reading of {index:04X} as if it was written")),
    }
}

fn write(t: &mut Tester, node_id: u8, index: u16, value: &[u8]) -> Result<Answer, Stop> {
    let [low, high] = index.to_le_bytes();
    // An expedited download: bits 2 and 3 are the number of bytes without data (CiA 301).
    let command = 0x23 | (4 - value.len().min(4) as u8) << 2;
    let mut request = [command, low, high, 0, 0, 0, 0, 0];
    request[4..].iter_mut().zip(value).for_each(|(to, from)| *to = *from);
    ask(t, node_id, request)
}

/// The objects say what the scenario says.
pub(super) fn objects(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    for DriveSpec { node_id, rated_torque_mnm, encoder_counts_per_turn, .. } in drives(t) {
        let profile = read(t, node_id, 0x1000, 0)? & 0xFFFF;
        if profile != PROFILE {
            return wrong(format!("node {node_id} has the device profile {profile} (1000), not {PROFILE}"));
        }
        read(t, node_id, 0x1018, 1)?;
        // Bit n − 1 of the supported modes stands for mode n (CiA 402).
        if read(t, node_id, 0x6502, 0)? >> (TORQUE_MODE - 1) & 1 == 0 {
            return wrong(format!("node {node_id} doesn't support cyclic synchronous torque (bit 9 of 6502)"));
        }
        let rated = read(t, node_id, 0x6076, 0)?;
        if rated != rated_torque_mnm {
            return wrong(format!("node {node_id} has the rated torque {rated} mN·m (6076), not {rated_torque_mnm}"));
        }
        let counts = read(t, node_id, 0x608F, 1)?;
        let turns = read(t, node_id, 0x608F, 2)?;
        if u64::from(counts) != u64::from(encoder_counts_per_turn) * u64::from(turns.max(1)) {
            return wrong(format!(
                "node {node_id} has {counts} counts for {turns} turns (608F), not {encoder_counts_per_turn} for one"
            ));
        }
    }
    Ok(())
}

/// The drive aborts transfers of objects that can't be read or written.
pub(super) fn aborts(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    for DriveSpec { node_id, .. } in drives(t) {
        let [low, high] = NO_OBJECT.to_le_bytes();
        match ask(t, node_id, [0x40, low, high, 0, 0, 0, 0, 0])? {
            Answer::Aborted(ABORT_NO_OBJECT) => {}
            Answer::Aborted(code) => {
                return wrong(format!(
                    "node {node_id} aborts the reading of {NO_OBJECT:04X}, which does not exist, by {code:#010x}, not \
                     {ABORT_NO_OBJECT:#010x}"
                ));
            }
            _ => return wrong(format!("node {node_id} has a value of {NO_OBJECT:04X}, which CiA 301 reserves")),
        }
        if write(t, node_id, 0x6041, &[0, 0])? == Answer::Written {
            return wrong(format!("node {node_id} lets its statusword (6041) be written"));
        }
    }
    Ok(())
}

/// Controlwords bring it from one state to the next.
pub(super) fn states(t: &mut Tester) -> Result<(), Stop> {
    use DriveState::{OperationEnabled, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    meet(t)?;
    for DriveSpec { node_id, .. } in drives(t) {
        // Out of a fault of before: bit 7 rises.
        for controlword in [0x00, 0x80, 0x00] {
            control(t, node_id, controlword)?;
        }
        write(t, node_id, 0x6060, &[TORQUE_MODE as u8])?;
        for (controlword, state) in [
            (0x00, SwitchOnDisabled),
            // No step from here: before it is switched on a drive must be ready to switch on.
            (0x07, SwitchOnDisabled),
            (0x06, ReadyToSwitchOn),
            (0x07, SwitchedOn),
            (0x0F, OperationEnabled),
            (0x07, SwitchedOn),
            (0x06, ReadyToSwitchOn),
            (0x00, SwitchOnDisabled),
        ] {
            control(t, node_id, controlword)?;
            becomes(t, node_id, controlword, state)?;
        }
    }
    Ok(())
}

fn control(t: &mut Tester, node_id: u8, controlword: u16) -> Result<(), Stop> {
    match write(t, node_id, 0x6040, &controlword.to_le_bytes())? {
        Answer::Written => Ok(()),
        _ => failed(format!("node {node_id} doesn't let its controlword (6040) be written")),
    }
}

/// Polls the statusword until it says this state.
fn becomes(t: &mut Tester, node_id: u8, controlword: u16, wanted: DriveState) -> Result<(), Stop> {
    let give_up_ns = t.now_ns() + MARGIN_NS;
    loop {
        let statusword = read(t, node_id, 0x6041, 0)? as u16;
        let state = DriveState::of(statusword);
        if state == Some(wanted) {
            return Ok(());
        }
        if t.now_ns() >= give_up_ns {
            return not_at_once(format!(
                "{} after the controlword {controlword:#04x} the statusword of node {node_id} is {statusword:#06x}, not that of \
                 {wanted:?}",
                ms(MARGIN_NS)
            ));
        }
        t.run_ns(10 * MS)?;
    }
}

/// Heartbeats come as often as object 1017 says.
pub(super) fn heartbeats(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    let mut watched = 0;
    for DriveSpec { node_id, .. } in drives(t) {
        let period_ns = u64::from(read(t, node_id, 0x1017, 0)?) * MS;
        if period_ns == 0 || period_ns > HEARTBEAT_MOST_NS {
            continue;
        }
        watched += 1;
        let id = Id::Standard(HEARTBEAT_BASE + u16::from(node_id));
        // The first heartbeat may come at any time; from it on the periods are counted.
        let mut first_ns = None;
        for _ in 0..3 {
            let from = t.mark();
            if t.wait_for(from, period_ns + MARGIN_NS, |heard| heard.id == id)?.is_none() {
                return not_at_once(format!(
                    "node {node_id} is silent for {}, its heartbeat (1017) is due every {}",
                    ms(period_ns + MARGIN_NS),
                    ms(period_ns)
                ));
            }
            first_ns.get_or_insert(t.now_ns());
        }
        // Three heartbeats are two periods apart; those that waited while the tester was held up come at once.
        let took_ns = t.now_ns() - first_ns.unwrap_or(0) + t.watch.held_up_ns;
        if took_ns < period_ns {
            return failed(format!(
                "3 heartbeats of node {node_id} came within {}, and one is due every {} (1017)",
                ms(took_ns),
                ms(period_ns)
            ));
        }
    }
    if watched == 0 { skipped("no drive has a heartbeat at least every 5 s (1017)") } else { Ok(()) }
}

/// Each SYNC asks for a position.
pub(super) fn positions(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    t.run_ns(MARGIN_NS)?;
    let from = t.mark();
    for _ in 0..SYNCS {
        send(t, SYNC_ID, &[])?;
        t.run_ns(20 * MS)?;
    }
    t.run_ns(MARGIN_NS)?;
    for DriveSpec { node_id, .. } in drives(t) {
        let id = Id::Standard(MOTION_BASE + u16::from(node_id));
        let came = t.heard()[from..].iter().filter(|heard| heard.id == id).count();
        if came != SYNCS {
            return failed(format!("after {SYNCS} SYNCs {came} TPDO 2 of node {node_id} came"));
        }
    }
    Ok(())
}

/// Targets of a drive that is not enabled don't act.
pub(super) fn not_enabled(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    for drive in drives(t) {
        let node_id = drive.node_id;
        // Out of a fault, and then up to switched on, the last state before operation enabled.
        for controlword in [0x00, 0x80, 0x00, 0x06, 0x07] {
            control(t, node_id, controlword)?;
        }
        write(t, node_id, 0x6060, &[TORQUE_MODE as u8])?;
        // A target is in thousandths of the rated torque (object 6071), as the torque actual value is.
        let target = (load_of(t) / drive.torque_step_nm()) as i16;
        let [a, b] = 0x07_u16.to_le_bytes();
        let [c, d] = target.to_le_bytes();
        for _ in 0..5 {
            send(t, COMMAND_BASE + u16::from(node_id), &[a, b, c, d])?;
            t.run_ns(20 * MS)?;
            let acting = read(t, node_id, 0x6077, 0)? as i16;
            // A drive that acts shows the whole target; half of it is beyond any noise.
            if i32::from(acting).abs() * 2 > i32::from(target).abs() {
                return failed(format!("node {node_id}, switched on only, has the torque {acting} ‰ (6077)"));
            }
        }
        control(t, node_id, 0x00)?;
    }
    Ok(())
}

/// A fault has an emergency, and so has its end.
pub(super) fn emergencies(t: &mut Tester) -> Result<(), Stop> {
    t.on.awaited_ns()?;
    drive(t)?;
    t.alter = Alter::Mute;
    let from = t.mark();
    let since_ns = t.commanded_ns;
    if judged_fault(t, from, since_ns, t.on.timeout_ns() + GONE_NS)?.is_none() {
        return inconclusive("without targets it doesn't fault: the case plant-command-timeout tests this");
    }
    t.run_ns(MARGIN_NS)?;
    let codes = |t: &Tester, from: usize| -> Vec<u16> {
        t.heard()[from..]
            .iter()
            .filter(|heard| heard.message.message.starts_with("EMCY"))
            .filter_map(|heard| heard.signal("code"))
            .map(|code| code as u16)
            .collect()
    };
    let said = codes(t, from);
    let Some(code) = said.iter().find(|code| **code != 0) else {
        return not_at_once("it is in fault, and no emergency came");
    };
    t.note(format!("error code {code:04X}"));
    t.alter = Alter::Nothing;
    let from = t.mark();
    t.join()?;
    arm(t)?;
    match codes(t, from).contains(&0) {
        true => Ok(()),
        false => not_at_once("its fault is reset, and no emergency says that the error is over (0000)"),
    }
}
