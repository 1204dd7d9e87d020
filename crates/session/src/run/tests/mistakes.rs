//! What a failed run says of the controller's mistake.

use super::*;
use resonarm_bench::control::{Answer, Controller, Length, LoadKind, ResponsePoint};
use resonarm_bench::rig::Load;
use resonarm_bench::rig::Measurement;
use resonarm_protocol::{Emergency, Node};

/// Holds a small force, and from sample 100 on another.
#[derive(Debug)]
struct Steps {
    then_n: f64,
}

impl Controller for Steps {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Force
    }

    fn restart(&mut self) {}

    fn answer(&mut self, sample: &Measurement) -> Answer {
        Answer::Hold(Load::force_n(if sample.sample < 100 { 1.0 } else { self.then_n }, 0.0))
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Unknown
    }
}

fn run(then_n: f64, more: &str) -> BothReport {
    let scenario = Scenario::parse(more, "test").unwrap();
    let session = Session::new(scenario, Mode::Free, Options::default()).unwrap();
    session.with_controller(move || Box::new(Steps { then_n })).both(&Signals::default(), &mut |_| {}).unwrap()
}

/// The plant said "partner fault" and the exciter "a command beyond the range of its signal", and neither said which.
#[test]
fn a_command_beyond_its_signal_is_named_with_its_value() {
    let report = run(1e6, "");
    assert_eq!(report.plant.fault.unwrap().code, EmergencyCode::PartnerFault as u16);
    let reason = ExciterEnd::from(&report.exciter).reason.unwrap();
    assert!(reason.contains("the controller commands exciter_x = 1000000 N at sample 100: "), "{reason}");
}

#[test]
fn the_first_command_beyond_a_limit_is_named_with_the_limit() {
    let report = run(310.0, "[rig.exciter]\nforce_limit_n = 300.0");
    assert_eq!(report.plant.fault.unwrap().code, EmergencyCode::CommandTimeout as u16);
    assert!(report.plant.refused.out_of_range > 0, "{:?}", report.plant);
    let first = report.plant.first_refused_command.unwrap();
    assert!(first.starts_with("exciter_x = 310 N at sample 100: ") && first.contains("300 N"), "{first}");
}

#[test]
fn the_first_refused_frame_is_shown_with_its_reason() {
    let fault = "[[network.faults]]\nnode = 'plant'\nkind = 'bit_error'\ndirection = 'receive'\nids = [0x201]\ncount = 1\n\
        from_s = 0.05\n[simulation]\nduration_s = 0.2";
    let report = run(1.0, fault);
    assert_eq!((report.plant.outcome, report.plant.bus.refused), (PlantOutcome::Completed, 1));
    let first = report.plant.first_refused_frame.unwrap();
    assert!(first.starts_with("201#") && first.contains("CRC"), "{first}");
}

/// Each end blamed the other for a corrupted heartbeat, and "the partner says why" at both.
#[test]
fn ends_of_which_neither_has_faulted_do_not_blame_each_other() {
    let of = |node, detail| Emergency { node, code: EmergencyCode::PartnerFault, detail, sample: 585 };
    let (plant, exciter) = (of(Node::Plant, 2), of(Node::Exciter, 1));
    for said in [fault_text(&plant, None, Some(&exciter), None), fault_text(&exciter, None, None, None)] {
        assert!(said.contains("a heartbeat") && said.contains("bit errors"), "{said}");
    }
}
