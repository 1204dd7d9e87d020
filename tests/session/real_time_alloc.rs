//! The tick path of the real-time loop takes no memory. The guard aborts the process at the first allocation.

use assert_no_alloc::assert_no_alloc;
use resonarm::realtime::{Clock, OverrunPolicy, Periodic, SampleRate, SystemClock, ThreadSetup, unix_time_ns};
use resonarm::rig::Load;
use resonarm::scenario::Scenario;

#[test]
fn ticks_on_time_late_and_failed_allocate_nothing() {
    ThreadSetup::default().apply();
    // Its period is no whole number of nanoseconds, so that the remainder is carried as well.
    let rate = SampleRate::new(1999.5).unwrap();
    let mut periodic = Periodic::start(&SystemClock, rate, OverrunPolicy::Fault).unwrap();
    let overruns = assert_no_alloc(|| {
        for index in 0..400 {
            let Ok(tick) = periodic.tick() else { break };
            if index % 50 == 25 {
                SystemClock.sleep_until_ns(tick.woke_ns + 1_200_000); // work of more than two periods
            }
            assert!(unix_time_ns() > 0);
            periodic.finish(&tick, 0);
        }
        periodic.summary().overruns
    });
    // Every fiftieth of 400 ticks is slow.
    assert!(overruns >= 8, "the slow ticks were not counted: {overruns}");
    let mut periodic = Periodic::start(&SystemClock, rate, OverrunPolicy::Stop).unwrap();
    let start_ns = periodic.start_ns();
    let error = assert_no_alloc(|| {
        SystemClock.sleep_until_ns(start_ns + 1_000_000);
        periodic.tick()
    });
    assert!(error.is_err());
}

/// With every part of the chain and every kind of fault.
#[test]
fn instruments_at_work_allocate_nothing() {
    let chain = "transverse = 0.03, gain = 1.02, highpass_hz = 0.5, lowpass_hz = 200, delay_samples = 3, bits = 24";
    let fault = |kind: &str| format!("{{ instrument = 'b', from_s = 0.02, to_s = 0.05, kind = {kind} }}");
    let faults = [
        "'noise', rms_m_s2 = 1",
        "'drift', rate_m_s2_per_s = 1",
        "'spike', amplitude_m_s2 = 9",
        "'stuck'",
        "'dropout'",
    ];
    let text = format!(
        "[rig]\nsensors.b = {{ {chain}, gravity_m_s2 = 9.81 }}\nsensors.laser = {{ at = 'tip', measures = 'velocity', {chain} }}\n\
         sensors.enc2 = {{ at = 'joint2', {chain} }}\nhead = {{ {chain} }}\nfaults = [{}]",
        faults.map(fault).join(", ")
    );
    let mut plant = Scenario::parse(&text, "test").unwrap().plant().unwrap();
    let zero = assert_no_alloc(|| {
        let samples = (0..100).filter(|_| {
            let [x, y] = plant.measure().acceleration_b_m_s2;
            plant.advance(&Load::force_n(5.0, 5.0)).is_ok() && x.value == 0.0 && y.value == 0.0
        });
        samples.count()
    });
    // The delay's three at rest, of which the high-pass leaves nothing, and those of the dropout.
    assert_eq!(zero, 3 + 30);
}

/// Modes by their exact flow with the coil, and between the switches of a contact.
#[test]
fn a_shaken_structure_allocates_nothing() {
    let modes = "[structure]\nkind = 'modal'\nmodes = [{ frequency_hz = 20.0, damping_ratio = 0.01, shape = { 'tip.x' = 0.5 } }]\n";
    let stop = "elements = [{ kind = 'contact', at = 'tip.x', stiffness_n_m = 1e5, gap_m = 1e-4 }]\n";
    let shaker = "[rig.shaker]\namplifier = 'voltage'\nmoving_mass_kg = 0.5\nstiffness_n_m = 2000.0\ndamping_n_s_m = 10.0\n\
        force_factor_n_a = 20.0\nresistance_ohm = 2.0\ninductance_h = 3e-4\nstroke_m = 0.0127\n\
        current_limit_a = 15.0\nvoltage_limit_v = 60.0\n";
    for elements in ["", stop] {
        let sensor = "[rig.sensors.m3]\nat = 'tip.x'\nmeasures = 'displacement'\n";
        let text = format!("{modes}{elements}{shaker}{sensor}");
        let mut plant = Scenario::parse(&text, "test").unwrap().plant().unwrap();
        let advanced = assert_no_alloc(|| {
            let samples =
                (0..200).filter(|_| plant.measure().sample < 200 && plant.advance(&Load::force_n(20.0, 0.0)).is_ok());
            samples.count()
        });
        assert_eq!(advanced, 200);
    }
}
