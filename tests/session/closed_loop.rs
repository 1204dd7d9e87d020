//! A closed loop over the wire: the same points whatever carries the frames, and a controller of one's own in its
//! place.

use resonarm::control::{Answer, Controller, Length, LoadKind, ResponsePoint};
use resonarm::node::ExciterOutcome;
use resonarm::rig::Load;
use resonarm::rig::Measurement;
use resonarm::run::{BothReport, Mode, Options, Session, Signals};
use resonarm::scenario::Scenario;

const WALK: &str = "[control]\nlaw = 'phase-walk'\namplitude = { joint1 = 10.0 }\npoints = 3\n";

fn both(text: &str, mode: Mode) -> BothReport {
    let session = Session::new(Scenario::parse(text, "test").unwrap(), mode, Options::default()).unwrap();
    session.both(&Signals::default(), &mut |_event| {}).unwrap()
}

#[test]
fn a_walk_in_lockstep_is_the_free_one_bit_for_bit() {
    let [free, lockstep] = [Mode::Free, Mode::Lockstep].map(|mode| both(WALK, mode));
    assert_eq!(free.exciter.outcome, Some(ExciterOutcome::Finished));
    assert_eq!((free.exciter.responses.len(), free.plant.bus.refused), (3, 0));
    assert_eq!(free.exciter.responses, lockstep.exciter.responses);
    assert_eq!(free.exciter.samples_played, lockstep.exciter.samples_played);
}

/// Gives up with a word of its own, and the plant is disarmed.
#[test]
fn a_controller_that_gives_up_disarms() {
    // Ranges that the resonance exceeds: from clipped readings the walk learns nothing.
    let deaf = format!("{WALK}[rig]\nsensors.b.range_m_s2 = 50.0\nsensors.c.range_m_s2 = 50.0\n");
    let report = both(&deaf, Mode::Free);
    assert!(matches!(report.exciter.outcome, Some(ExciterOutcome::Aborted(_))), "{:?}", report.exciter.outcome);
    assert_eq!(report.plant.outcome, resonarm::run::PlantOutcome::Disarmed);
}

/// Pushes against the velocity at the tip, which it integrates from the accelerometer.
#[derive(Debug, Default)]
struct Damper {
    velocity_m_s: f64,
}

impl Controller for Damper {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Force
    }

    fn restart(&mut self) {
        *self = Damper::default();
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        // It forgets within 0.1 s, or the offset of the sensor would make the integral grow without end.
        self.velocity_m_s = 0.99 * self.velocity_m_s + 1e-3 * sample.acceleration_c_m_s2[0].value;
        if sample.sample < 2000 {
            Answer::Hold(Load::force_n(-400.0 * self.velocity_m_s, 0.0))
        } else {
            Answer::Finished
        }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Samples(2000)
    }
}

#[test]
fn a_controller_of_one_s_own_needs_no_excitation() {
    for mode in [Mode::Free, Mode::Lockstep] {
        let scenario = Scenario::parse("structure = { initial = [1e-4, 0, 0, 0] }", "test").unwrap();
        let session = Session::new(scenario, mode, Options::default()).unwrap();
        let session = session.with_controller(|| Box::new(Damper::default()));
        let report = session.both(&Signals::default(), &mut |_event| {}).unwrap();
        assert_eq!(
            (report.exciter.outcome, report.exciter.samples_played),
            (Some(ExciterOutcome::Finished), 2001),
            "{mode}"
        );
    }
}
