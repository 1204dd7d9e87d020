//! The reference recordings, simulated again with identical results. After an intended change of the arithmetic
//! `recordings/make` makes them anew.

use std::path::PathBuf;

use resonarm::recording::{Existing, Integrity, Recording};
use resonarm::replay::{resimulate, resimulate_readings};
use resonarm::run::{Mode, Options, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

/// Paths are relative to the project's folder, in which tests run.
const RECORDINGS: &str = "recordings";

fn recordings() -> Vec<PathBuf> {
    let paths = std::fs::read_dir(RECORDINGS).unwrap().map(|entry| entry.unwrap().path());
    paths.filter(|path| path.extension().is_some_and(|extension| extension == "mcap")).collect()
}

#[test]
fn every_state_is_the_recorded_one() {
    let paths = recordings();
    assert_eq!(paths.len(), 11, "{paths:?}");
    for path in paths {
        let recording = Recording::open(&path).unwrap();
        assert_eq!(*recording.integrity(), Integrity::Complete, "{}", path.display());
        assert!(path.metadata().unwrap().len() < 300_000, "{} is too large for the repository", path.display());
        let verdict = resimulate(&recording).unwrap();
        assert!(verdict.identical, "{}: {verdict:?}; if this is meant, run recordings/make", path.display());
        assert!(verdict.samples > 800, "{}: {verdict:?}", path.display());
    }
}

#[test]
fn every_reading_of_the_instruments_is_the_recorded_one() {
    for path in recordings() {
        let recording = Recording::open(&path).unwrap();
        let verdict = resimulate_readings(&recording).unwrap();
        assert!(verdict.identical, "{}: {verdict:?}; if this is meant, run recordings/make", path.display());
        assert!(verdict.samples > 800, "{}: {verdict:?}", path.display());
    }
}

/// A free run is a function of its scenario: repeated, it has the same records, frames and events included.
#[test]
fn a_free_run_made_again_is_the_recorded_one() {
    let folder = tempfile::tempdir().unwrap();
    let mut made = 0;
    for path in recordings() {
        let recording = Recording::open(&path).unwrap();
        if recording.configuration().get("run_loop") != Some("free") {
            continue;
        }
        let scenario = Scenario::from_configuration(recording.configuration()).unwrap();
        let again = folder.path().join(path.file_name().unwrap());
        let record = Some(RecordTo { path: again.clone(), existing: Existing::Refuse });
        let session = Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap();
        session.both(&Signals::default(), &mut |_| {}).unwrap();
        let again = Recording::open(&again).unwrap();
        assert_eq!(again.configuration(), recording.configuration(), "{}", path.display());
        let (mut recorded, mut simulated) = (recording.records().unwrap(), again.records().unwrap());
        let count = recorded.by_ref().zip(simulated.by_ref()).map(|(one, other)| {
            assert_eq!(one.unwrap(), other.unwrap(), "{}; if this is meant, run recordings/make", path.display());
        });
        assert!(count.count() > 3000, "{}", path.display());
        assert!(recorded.next().is_none() && simulated.next().is_none(), "{}", path.display());
        made += 1;
    }
    assert_eq!(made, 10);
}
