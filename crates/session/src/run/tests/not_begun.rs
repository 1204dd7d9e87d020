//! What is left of a run that can't begin.

use super::*;
use resonarm_bus::memory;
use resonarm_realtime::ThreadSetup;

/// A run in real time whose thread is to have a core that no machine has.
fn session(path: &std::path::Path, existing: Existing) -> Session {
    let thread = ThreadSetup { priority: None, lock_memory: false, core: Some(usize::MAX), cores_awake: false };
    let options = Options {
        record: Some(RecordTo { path: path.to_path_buf(), existing }),
        thread: Some(thread),
        on_shortfall: OnShortfall::Refuse,
        ..Options::default()
    };
    let mut scenario = scenario();
    scenario.simulation.duration_s = Some(1e-3);
    Session::new(scenario, Mode::RealTime, options).unwrap()
}

#[test]
fn neither_a_thread_nor_a_recording_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let [mut near, _far] = memory::pair(64);
    let (watch, mut watcher) = watch();
    let refused = session(&path, Existing::Refuse).watched(watch).plant(&mut near, &Signals::default(), &mut |_| {});
    assert!(matches!(refused, Err(RunError::NoRealTimeThread { .. })), "{refused:?}");
    watcher.take(usize::MAX, |_, _| {});
    assert_eq!(watcher.loops(), 0, "the thread beside the loop goes on");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "a file is left");
    // With a thread that the machine has, the same run is recorded.
    let mut again = session(&path, Existing::Refuse);
    again.options.thread = None;
    let report = again.plant(&mut near, &Signals::default(), &mut |_| {}).unwrap();
    assert_eq!((report.samples, report.recording.unwrap().samples), (2, 2));
}

#[test]
fn a_recording_that_may_be_overwritten_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, "the last run").unwrap();
    let [mut near, _far] = memory::pair(64);
    let refused = session(&path, Existing::Overwrite).plant(&mut near, &Signals::default(), &mut |_| {});
    assert!(matches!(refused, Err(RunError::NoRealTimeThread { .. })), "{refused:?}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "the last run");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a part of a file is left");
}
