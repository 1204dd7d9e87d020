//! A million frames between both nodes on a bus with everything that goes wrong on one: nothing acts on the arm but
//! what the controller commanded for that very sample, and when the faults are over all is as if they had never been.

use std::fmt::Write;

use resonarm::bus::fault::{FaultSpec, Faulty, check};
use resonarm::bus::memory::{self, MemoryBus};
use resonarm::bus::{Bus, BusError, Sent, VirtualBus};
use resonarm::control::{Answer, Controller, Length, LoadKind, ResponsePoint};
use resonarm::node::{
    self, ExciterInterface, ExciterNode, ExciterOutcome, PlantInterface, PlantNode, PublishedSample, Timing,
};
use resonarm::protocol::{Network, Node, Profile};
use resonarm::realtime::{Clock, VirtualClock};
use resonarm::rig::Load;
use resonarm::rig::{Exciter, Measurement, Reading};

const MS: u64 = 1_000_000;
const SAMPLES: u64 = 290_000;
/// From here on the bus is sound, s and samples.
const SOUND_S: u64 = 280;

/// The load that is commanded for a sample, in halves of a newton, which both profiles say exactly: no two of any 20
/// samples in a row have the same.
fn commanded(sample: u64) -> Load {
    let halves = |factor: u64, modulus: u64| (sample * factor % modulus) as f64 - 999.0;
    Load::force_n(0.5 * halves(7919, 1999), 0.5 * halves(104_729, 1997))
}

/// The sample as the head's reading, N: two numbers of counts.
fn measurement(sample: u64) -> Measurement {
    let reading = |count: u64| Reading { value: count as f64 / 50.0, clipped: false };
    let head_force_n = [reading(sample % 30_000), reading(sample / 30_000)];
    Measurement { sample, head_force_n, ..Measurement::default() }
}

/// Answers the sample that the head's reading tells.
#[derive(Debug)]
struct Telling;

impl Controller for Telling {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Force
    }

    fn restart(&mut self) {}

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let [low, high] = sample.head_force_n.map(|reading| (reading.value * 50.0).round() as u64);
        Answer::Hold(commanded(high * 30_000 + low))
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Unknown
    }
}

fn faults() -> Vec<FaultSpec> {
    let mut text = String::new();
    let mut add = |node: &str, kind: &str, (from, to): (u64, u64), rest: &str| {
        let head = format!("[[faults]]\nnode = '{node}'\nkind = '{kind}'\nfrom_s = {from}\nto_s = {to}");
        writeln!(text, "{head}.3\n{rest}").unwrap();
    };
    for node in ["plant", "exciter"] {
        let all = (1, SOUND_S - 1);
        add(node, "loss", all, "probability = 0.05\ndirection = 'receive'");
        add(node, "bit_error", all, "probability = 0.02");
        add(node, "duplication", all, "probability = 0.01");
        add(node, "jitter", all, "probability = 0.02\ndelay_s = 0.0004");
        add(node, "reordering", all, "probability = 0.01\ndelay_s = 0.0025");
        add(node, "babble", all, "rate_hz = 97\nids = [0x080, 0x200, 0x201, 0x203, 0x208, 0x702]");
    }
    // One of the four every seven seconds: 36 in all.
    for k in 0..9 {
        add("plant", "bus_off", (20 + 28 * k, 20 + 28 * k), "");
        add("exciter", "bus_off", (27 + 28 * k, 27 + 28 * k), "");
        add("plant", "link_down", (34 + 28 * k, 34 + 28 * k), "direction = 'send'");
        add("exciter", "link_down", (41 + 28 * k, 41 + 28 * k), "direction = 'receive'");
    }
    #[derive(serde::Deserialize)]
    struct Faults {
        faults: Vec<FaultSpec>,
    }
    toml::from_str::<Faults>(&text).unwrap().faults
}

type End = Faulty<MemoryBus, VirtualClock>;

/// A controller that boots.
fn exciter(network: Network, now_ns: u64) -> ExciterNode {
    let mut exciter = node::carry(network, 1000, Timing::real_time(1000), Box::new(Telling));
    exciter.start(now_ns);
    exciter
}

struct Soak {
    clock: VirtualClock,
    plant: PlantNode,
    exciter: ExciterNode,
    near: End,
    far: End,
    /// The load that acts, and the sample whose command it is, if it is one.
    acting: (Load, u64),
    commands: u64,
    anew: u64,
    network: Network,
}

impl Soak {
    fn new(profile: Profile) -> Soak {
        let clock = VirtualClock::default();
        let faults = faults();
        check(&faults).unwrap();
        let [near, far] = memory::pair(1024);
        let end = |bus, node| Faulty::new(bus, clock.clone(), &faults, node, 11);
        let (near, far) = (end(near, Node::Plant), end(far, Node::Exciter));
        let network = Network::default().with_profile(profile);
        let mut plant = PlantNode::new(network, 1000, Timing::real_time(1000), Exciter::default());
        plant.start(0);
        let exciter = exciter(network, 0);
        Soak { clock, plant, exciter, near, far, acting: (Load::default(), 0), commands: 0, anew: 0, network }
    }

    fn frames(&self) -> u64 {
        let [near, far] = [&self.near, &self.far].map(|end| end.statistics());
        near.sent + near.received + far.sent + far.received
    }

    /// Carries frames both ways until nothing more moves at this time.
    fn exchange(&mut self) {
        let now_ns = self.clock.now_ns();
        let lost = |lost: Result<(), BusError>| {
            lost.is_err_and(|error| {
                assert!(error.is_recoverable(), "{error}");
                true
            })
        };
        loop {
            let before = self.frames();
            if lost(self.serve_plant(now_ns)) {
                self.plant.bus_lost(now_ns);
            }
            if lost(self.serve_exciter(now_ns)) {
                self.exciter.bus_lost(now_ns);
            }
            self.plant.handle_deadline(now_ns);
            self.exciter.handle_deadline(now_ns);
            if self.frames() == before {
                return;
            }
        }
    }

    fn serve_plant(&mut self, now_ns: u64) -> Result<(), BusError> {
        while let Some(received) = self.near.receive()? {
            self.plant.handle_frame(now_ns, &received.frame);
        }
        while let Some(frame) = self.plant.next_frame() {
            if self.near.send(&frame)? == Sent::QueueFull {
                break;
            }
            self.plant.frame_sent();
        }
        Ok(())
    }

    fn serve_exciter(&mut self, now_ns: u64) -> Result<(), BusError> {
        while let Some(received) = self.far.receive()? {
            self.exciter.handle_frame(now_ns, &received.frame);
        }
        while let Some(frame) = self.exciter.next_frame() {
            if self.far.send(&frame)? == Sent::QueueFull {
                break;
            }
            self.exciter.frame_sent();
        }
        Ok(())
    }

    /// One sample, and the frames until the next.
    fn sample(&mut self, sample: u64) {
        let due_ns = (sample + 1) * MS;
        self.clock.advance_to_ns(sample * MS);
        self.plant.publish(&PublishedSample::of(&measurement(sample))).unwrap();
        self.exchange();
        loop {
            let next_ns = [self.near.next_event_ns(), self.far.next_event_ns()].into_iter().flatten().min();
            let Some(next_ns) = next_ns.filter(|next_ns| *next_ns < due_ns) else { break };
            self.clock.advance_to_ns(next_ns);
            self.exchange();
        }
        self.judge(sample);
        while self.exciter.poll_event().is_some() || self.plant.poll_event().is_some() {}
    }

    /// A controller that faulted begins anew. One that took a late heartbeat for the plant's wish to end has ended, and
    /// another takes its place.
    fn continue_run(&mut self) {
        let now_ns = self.clock.now_ns();
        if self.exciter.outcome().is_some() {
            self.anew += 1;
            if !self.exciter.rearm(now_ns) {
                self.exciter = exciter(self.network, now_ns);
            }
        }
    }

    /// What acts from this sample on: the command for it or for a recent sample after the last one taken, what was
    /// held, or a step of the ramp. A plant that was disarmed in the sample of a command is a step down from that
    /// already.
    fn judge(&mut self, sample: u64) {
        let load = self.plant.load();
        let (last, answered) = self.acting;
        let part = if self.plant.is_armed() { 1.0 } else { 49.0 / 50.0 };
        let acts = |recent: &u64| commanded(*recent).force_n * part == load.force_n;
        let smaller =
            |k: usize| load.force_n[k].abs() <= last.force_n[k].abs() && load.force_n[k] * last.force_n[k] >= 0.0;
        match (sample.saturating_sub(20).max(answered)..=sample).rev().find(acts) {
            Some(recent) => {
                self.commands += u64::from(recent != answered);
                self.acting.1 = recent;
            }
            None => assert!(smaller(0) && smaller(1), "sample {sample}: {load:?} acts after {last:?}"),
        }
        assert!(!self.plant.is_armed() || !self.plant.is_answered() || load == commanded(sample), "sample {sample}");
        assert_eq!(load.torque_nm, Load::default().torque_nm);
        self.acting.0 = load;
    }
}

#[test]
fn a_million_frames_with_everything_wrong_and_no_wrong_command_acts() {
    let (plant, exciter) = soak(Profile::Classic);
    assert!(plant + exciter > 1_000_000, "{plant} {exciter}");
}

#[test]
fn the_same_in_the_fd_profile_which_has_two_frames_a_sample() {
    let (plant, exciter) = soak(Profile::Fd);
    assert!(plant + exciter > 450_000, "{plant} {exciter}");
}

/// The frames that plant and exciter sent.
fn soak(profile: Profile) -> (u64, u64) {
    let mut soak = Soak::new(profile);
    for sample in 0..SAMPLES {
        soak.sample(sample);
        soak.continue_run();
        // Sound for 2 s: long enough for a node that faulted last to be reset and armed again.
        if sample > (SOUND_S + 2) * 1000 {
            assert!(soak.plant.is_answered(), "sample {sample}: {:?}", soak.plant.state());
        }
    }
    let [plant_sent, exciter_sent] = [&soak.near, &soak.far].map(|end| end.statistics().sent);
    // 36 times a node was off or cut off, and the run began anew; of the rest most samples were answered.
    assert!(soak.anew >= 18, "{}", soak.anew);
    assert!(soak.commands > SAMPLES / 2, "{}", soak.commands);
    let refused = (soak.plant.frames().refused, soak.exciter.frames().refused);
    assert!(refused.0 > 5_000 && refused.1 > 5_000, "{refused:?}");
    soak.exciter.stop(soak.clock.now_ns());
    (SAMPLES..SAMPLES + 100).for_each(|sample| soak.sample(sample));
    assert_eq!((soak.exciter.outcome(), soak.plant.is_quiet()), (Some(ExciterOutcome::Stopped), true));
    (plant_sent, exciter_sent)
}
