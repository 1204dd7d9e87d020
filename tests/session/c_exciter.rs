//! The exciter's node in C, `firmware-protocol/c`, beside that of the library, in virtual time: of the same frames
//! and times both must make the same frames, deadlines and ends. A plant of the library answers them, over a wire that
//! loses, repeats and damages.

mod partner;

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

use resonarm::control::{Abort, Answer, Controller, Length, LoadKind, ResponsePoint};
use resonarm::node::{
    self, ExciterInterface, ExciterNode, ExciterOutcome, PlantInterface, PlantNode, PublishedSample, Timing,
};
use resonarm::protocol::header::Header;
use resonarm::protocol::{
    Emergency, EmergencyCode, Frame, FrameFormat, Heartbeat, Hello, Id, Message, MessageKind, Network, Node, NodeState,
    OperatorCommand, OperatorRequest, Profile, SamplesPerFrame, Transmitter, timing,
};
use resonarm::rig::Load;
use resonarm::rig::{Exciter, Measurement};

const RATE_HZ: u16 = 1000;
const TICK_NS: u64 = 1_000_000;
/// A sample that is never reached.
const NEVER: u64 = u64::MAX;

/// A controller that ends, gives up, or asks too much at these samples; that of the harness in C.
#[derive(Clone, Copy, Debug)]
struct Plan {
    finish: u64,
    give_up: u64,
    beyond: u64,
}

impl Controller for Plan {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Force
    }

    fn restart(&mut self) {}

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let n = sample.sample;
        if n >= self.finish {
            Answer::Finished
        } else if n >= self.give_up {
            Answer::Aborted(Abort::HeadClipped { frequency_hz: 1.0 })
        } else if n >= self.beyond {
            Answer::Hold(Load::force_n(1e39, 0.0))
        } else {
            Answer::Hold(Load::force_n((n % 1000) as f64 * 0.02, 0.0))
        }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Unknown
    }
}

/// The node in C for the network of a profile, built with the header that the crate writes for it.
fn program(network: Network) -> &'static Path {
    static PROGRAMS: [OnceLock<PathBuf>; 2] = [OnceLock::new(), OnceLock::new()];
    PROGRAMS[network.profile() as usize].get_or_init(|| {
        let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("exciter-{}", network.profile()));
        let (config, program) = (out.join("resonarm_config.h"), out.join("exciter_harness"));
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(&config, Header(network).to_string()).unwrap();
        let mut make = Command::new("make");
        make.args(["--silent", "--directory", concat!(env!("CARGO_MANIFEST_DIR"), "/firmware-protocol/c")]);
        make.arg(format!("OUT={}", out.display())).arg(format!("CONFIG={}", config.display()));
        let output = make.arg(&program).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        program
    })
}

/// A node in C and one of the library with the same input.
struct Both {
    process: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    node: ExciterNode,
    is_jammed: bool,
}

impl Both {
    fn start(network: Network, timing: Timing, plan: Plan) -> Both {
        let mut process = Command::new(program(network)).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (input, output) = (process.stdin.take(), BufReader::new(process.stdout.take().unwrap()));
        let node = node::carry(network, RATE_HZ, timing, Box::new(plan));
        let mut both = Both { process, input, output, node, is_jammed: false };
        let mode = if timing == Timing::real_time(RATE_HZ) { "real-time" } else { "lockstep" };
        let Plan { finish, give_up, beyond } = plan;
        both.ask(&format!("init {mode} {RATE_HZ} {finish} {give_up} {beyond}"));
        both.both("start 0", |node| node.start(0));
        both
    }

    fn ask(&mut self, command: &str) -> String {
        self.input.as_mut().unwrap().write_all(format!("{command}\n").as_bytes()).unwrap();
        let mut answer = String::new();
        self.output.read_line(&mut answer).unwrap();
        answer.trim_end().to_string()
    }

    /// What the library's node has to tell, in the words of the harness.
    fn report(&self) -> String {
        let node = &self.node;
        let (number, fault) = match node.outcome() {
            None => (0, None),
            Some(ExciterOutcome::Finished) => (1, None),
            Some(ExciterOutcome::Aborted(_)) => (2, None),
            Some(ExciterOutcome::Stopped) => (3, None),
            Some(ExciterOutcome::PlantLeft) => (4, None),
            Some(ExciterOutcome::Faulted(emergency)) => (5, Some(emergency)),
        };
        let fault = fault.map_or(String::new(), |Emergency { node, code, detail, sample }| {
            format!(" {} {} {detail} {sample}", node.number(), code as u16)
        });
        let (said, detail) = node.plant_fault().map_or((0, 0), |said| (said.code as u16, said.detail));
        format!(
            "| next {} | {} {number}{fault} {} {} {} {} {} {} {} {} {} {said} {detail}",
            node.next_deadline_ns(),
            node.state().heartbeat_byte(),
            u8::from(node.has_heard_plant()),
            node.samples_played(),
            node.work().missed_samples(),
            node.stale_samples(),
            node.slipped_periods(),
            node.frames().refused,
            node.frames().other_sender,
            node.frames().unsent,
            u8::from(node.is_quiet()),
        )
    }

    /// Makes both do the same, compares, and gives the frames that were sent.
    fn both(&mut self, command: &str, act: impl FnOnce(&mut ExciterNode)) -> Vec<Frame> {
        let answer = self.ask(command);
        act(&mut self.node);
        let sent: Vec<Frame> =
            if self.is_jammed { Vec::new() } else { core::iter::from_fn(|| self.node.poll_transmit()).collect() };
        let frames: String = sent.iter().map(|frame| format!("{frame} ")).collect();
        assert_eq!(answer, frames + &self.report(), "after {command}");
        sent
    }

    fn frame(&mut self, now_ns: u64, frame: &Frame) -> Vec<Frame> {
        let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
        let format = if matches!(frame.format(), FrameFormat::Fd { .. }) { "f" } else { "c" };
        let command = format!("frame {now_ns} {format} {:X} {} {data}", frame.id().raw(), frame.len());
        self.both(&command, |node| node.handle_frame(now_ns, frame))
    }

    fn jam(&mut self, is_jammed: bool) -> Vec<Frame> {
        self.is_jammed = is_jammed;
        self.both(if is_jammed { "jam" } else { "flow" }, |_| {})
    }

    fn end(mut self) {
        drop(self.input.take());
        assert!(self.process.wait().unwrap().success());
    }
}

/// Numbers that look random (G. Marsaglia, "Xorshift RNGs", J. Stat. Softw. 8, 14 (2003)).
struct Xorshift(u64);

impl Xorshift {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// Whether a thing that comes once in `n` times comes now.
    fn once_in(&mut self, n: u64) -> bool {
        self.next().is_multiple_of(n)
    }
}

/// What the wire carries: the profile, and in the FD profile the most samples in a frame of the plant's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wire {
    Classic,
    Fd(SamplesPerFrame),
}

impl Wire {
    const ALL: [Wire; 3] = [Wire::Classic, Wire::Fd(SamplesPerFrame::One), Wire::Fd(SamplesPerFrame::Two)];

    fn network(self) -> Network {
        match self {
            Wire::Classic => Network::default(),
            Wire::Fd(_) => Network::new(0x300).unwrap().with_node_ids(3, 4).unwrap().with_profile(Profile::Fd),
        }
    }

    fn plant(self, timing: Timing) -> PlantNode {
        let plant = PlantNode::new(self.network(), RATE_HZ, timing, Exciter::default());
        match self {
            Wire::Classic => plant,
            Wire::Fd(most) => plant.with_samples_per_frame(most),
        }
    }

    fn hello(self) -> Hello {
        Hello::new(self.network().profile(), RATE_HZ)
    }
}

/// A plant, both exciters, and the wire between them.
struct Bench {
    now_ns: u64,
    sample: u64,
    wire: Wire,
    /// Whether the plant has sent two samples in a frame.
    has_pairs: bool,
    timing: Timing,
    plant: PlantNode,
    both: Both,
    random: Xorshift,
}

impl Bench {
    fn new(wire: Wire, timing: Timing, plan: Plan, seed: u64) -> Bench {
        let random = Xorshift(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        let both = Both::start(wire.network(), timing, plan);
        let mut bench =
            Bench { now_ns: 0, sample: 0, wire, has_pairs: false, timing, plant: wire.plant(timing), both, random };
        bench.plant.start(0);
        bench
    }

    /// A sample period on a faithful wire.
    fn tick(&mut self) {
        self.now_ns += TICK_NS;
        self.publish();
        for frame in self.fetch_from_plant() {
            self.deliver(&frame);
        }
        self.deadline();
    }

    fn publish(&mut self) {
        self.plant.handle_deadline(self.now_ns);
        self.sample += 1;
        let measurement = Measurement { sample: self.sample, ..Measurement::default() };
        self.plant.publish(&PublishedSample::of(&measurement)).unwrap();
    }

    fn fetch_from_plant(&mut self) -> Vec<Frame> {
        core::iter::from_fn(|| self.plant.poll_transmit()).collect()
    }

    fn deliver(&mut self, frame: &Frame) {
        self.has_pairs |= frame.id() == Id::Standard(MessageKind::SensorPair.id(self.wire.network()));
        let answers = self.both.frame(self.now_ns, frame);
        self.send_to_plant(&answers);
    }

    fn send_to_plant(&mut self, frames: &[Frame]) {
        frames.iter().for_each(|frame| self.plant.handle_frame(self.now_ns, frame));
    }

    fn deadline(&mut self) {
        let now_ns = self.now_ns;
        let sent = self.both.both(&format!("deadline {now_ns}"), |node| node.handle_deadline(now_ns));
        self.send_to_plant(&sent);
    }

    fn outcome(&self) -> Option<ExciterOutcome> {
        self.both.node.outcome()
    }

    /// Something that shall not happen on a bench, and does.
    fn disturb(&mut self) {
        let now_ns = self.now_ns;
        match self.random.next() % 14 {
            0 => self.plant.leave(now_ns),
            1 => {
                self.plant = self.wire.plant(self.timing);
                self.plant.start(now_ns);
            }
            2 => self.plant.slip(self.random.next() % 500),
            3 => self.plant.fault(now_ns, EmergencyCode::Overrun, 3),
            // An index further on, further back, or far away.
            4 => self.sample += self.random.next() % 400,
            5 => self.sample = self.sample.saturating_sub(self.random.next() % 20),
            6 => self.sample = self.random.next() % 70_000,
            7 => self.now_ns += self.random.next() % 400 * TICK_NS,
            8 => {
                let jam = !self.both.is_jammed;
                let sent = self.both.jam(jam);
                self.send_to_plant(&sent);
            }
            9 => self.stranger(),
            10 if self.random.once_in(4) => {
                let sent = self.both.both(&format!("stop {now_ns}"), |node| node.stop(now_ns));
                self.send_to_plant(&sent);
            }
            11 if self.random.once_in(4) => {
                let sent = self.both.both(&format!("bus-lost {now_ns}"), |node| node.bus_lost(now_ns));
                self.send_to_plant(&sent);
            }
            12 => self.silence(),
            13 => {
                // Another exciter, whose frames this one sees too.
                let hello = Message::ExciterHello(self.wire.hello());
                let frame = Transmitter::new(self.wire.network()).frame(&hello).unwrap();
                self.deliver(&frame);
            }
            _ => {}
        }
    }

    /// The plant is gone for a while, and the exciters listen.
    fn silence(&mut self) {
        let looks = self.random.next() % 400;
        self.silence_for(looks);
    }

    fn silence_for(&mut self, looks: u64) {
        for _ in 0..looks {
            self.now_ns += self.timing.look_period_ns;
            self.deadline();
        }
    }

    /// A frame that another than the plant has sent: a hello, or an operator's request.
    fn stranger(&mut self) {
        let (mut transmitter, hello) = (Transmitter::new(self.wire.network()), self.wire.hello());
        let hello = match self.random.next() % 5 {
            0 => Hello { rate_hz: 500, ..hello },
            1 => Hello { dbc_hash: 0, ..hello },
            _ => hello,
        };
        let operator = Message::Operator(OperatorCommand { request: OperatorRequest::Disarm, target: Node::Plant });
        // The counter of the first is out of sequence, that of the second is not.
        for message in [Message::PlantHello(hello), Message::PlantHello(hello), operator, operator] {
            let frame = transmitter.frame(&message).unwrap();
            self.deliver(&frame);
            self.plant.handle_frame(self.now_ns, &frame);
        }
    }

    /// A sample period on a bad wire.
    fn rough_tick(&mut self) {
        self.now_ns += TICK_NS;
        self.publish();
        for frame in self.fetch_from_plant() {
            match self.random.next() % 60 {
                0 => {}
                1 => {
                    self.deliver(&frame);
                    self.deliver(&frame);
                }
                2 => {
                    let mut data = frame.data().to_vec();
                    data[0] ^= 1 << (self.random.next() % 8);
                    self.deliver(&Frame::new(frame.id(), frame.format(), &data).unwrap());
                }
                _ => self.deliver(&frame),
            }
        }
        if self.outcome().is_none() && self.random.once_in(150) {
            self.disturb();
        }
        self.deadline();
    }
}

fn timings() -> [Timing; 2] {
    [Timing::real_time(RATE_HZ), Timing::lockstep(timing::LOCKSTEP_TIMEOUT_NS)]
}

#[test]
fn c_and_rust_end_alike_on_a_faithful_wire() {
    for (wire, timing) in Wire::ALL.into_iter().flat_map(|wire| timings().map(|timing| (wire, timing))) {
        for (plan, expected) in [
            (Plan { finish: 300, give_up: NEVER, beyond: NEVER }, 1),
            (Plan { finish: NEVER, give_up: 20, beyond: NEVER }, 2),
            (Plan { finish: NEVER, give_up: NEVER, beyond: 20 }, 5),
        ] {
            let mut bench = Bench::new(wire, timing, plan, 1);
            while bench.outcome().is_none() {
                bench.tick();
                assert!(bench.now_ns < 1_000_000_000);
            }
            let now_ns = bench.now_ns;
            let sent = bench.both.both(&format!("leave {now_ns}"), |node| node.leave(now_ns));
            assert_eq!(
                sent.last().map(Frame::id),
                // Emergencies have the identifier 0x080 and the number of the node, as in CANopen.
                Some(Id::Standard(0x080 + if wire == Wire::Classic { 2 } else { 4 }))
            );
            let number = match bench.outcome() {
                Some(ExciterOutcome::Finished) => 1,
                Some(ExciterOutcome::Aborted(_)) => 2,
                Some(ExciterOutcome::Faulted(_)) => 5,
                other => panic!("{other:?}"),
            };
            assert_eq!((number, bench.has_pairs), (expected, matches!(wire, Wire::Fd(SamplesPerFrame::Two))));
            bench.both.end();
        }
    }
}

/// Every way to end comes up, and every fault that an exciter finds.
#[test]
fn c_and_rust_do_the_same_whatever_the_wire_does() {
    let (mut outcomes, mut codes) = ([0_u32; 6], [0_u32; 15]);
    for (wire, seed) in Wire::ALL.into_iter().flat_map(|wire| (1..=40).map(move |seed| (wire, seed))) {
        let plan = Plan { finish: 700, give_up: NEVER, beyond: if seed % 8 == 0 { 400 } else { NEVER } };
        let mut bench = Bench::new(wire, timings()[seed as usize % 2], plan, seed);
        for _ in 0..1200 {
            let Some(outcome) = bench.outcome() else {
                bench.rough_tick();
                continue;
            };
            let now_ns = bench.now_ns;
            if let ExciterOutcome::Faulted(fault) = outcome {
                codes[fault.code as usize] += 1;
                bench.both.both(&format!("rearm {now_ns}"), |node| {
                    assert!(node.rearm(now_ns));
                });
                continue;
            }
            outcomes[match outcome {
                ExciterOutcome::Finished => 1,
                ExciterOutcome::Stopped => 3,
                _ => 4,
            }] += 1;
            bench.both.both(&format!("leave {now_ns}"), |node| node.leave(now_ns));
            break;
        }
        bench.both.end();
    }
    assert!([1, 3, 4].iter().all(|way| outcomes[*way] > 0), "{outcomes:?}");
    let found = [2, 4, 5, 6, 8, 9, 10, 13];
    assert!(found.iter().all(|code| codes[*code] > 0), "{codes:?}");
}

/// A bench whose exciters answer samples.
fn playing(wire: Wire) -> Bench {
    let mut bench = Bench::new(wire, timings()[0], Plan { finish: NEVER, give_up: NEVER, beyond: NEVER }, 1);
    (0..500).for_each(|_| bench.tick());
    assert!(bench.both.node.samples_played() > 400 && bench.outcome().is_none());
    bench
}

#[test]
fn the_window_of_the_sample_index_has_the_same_ends() {
    let steps = [(350, false), (351, true), (-350, false), (-351, true), (0, false)];
    let wires = [Wire::Classic, Wire::Fd(SamplesPerFrame::One)];
    for (wire, (step, is_fault)) in wires.into_iter().flat_map(|wire| steps.map(|step| (wire, step))) {
        let mut bench = playing(wire);
        // The tick adds one by itself.
        bench.sample = bench.sample.checked_add_signed(step - 1).unwrap();
        bench.tick();
        assert_eq!(bench.outcome().is_some(), is_fault, "{step}");
        bench.both.end();
    }
    let mut bench = playing(Wire::Classic);
    for again in 1..=10 {
        bench.sample -= 1;
        bench.tick();
        assert_eq!(bench.outcome().is_some(), again == 10, "{again}");
    }
    bench.both.end();
}

#[test]
fn a_command_that_waits_is_taken_back_when_the_work_ends() {
    let mut bench = playing(Wire::Classic);
    bench.both.jam(true);
    bench.tick();
    let now_ns = bench.now_ns;
    bench.both.both(&format!("stop {now_ns}"), |node| node.stop(now_ns));
    let ids: Vec<Id> = bench.both.jam(false).iter().map(Frame::id).collect();
    assert_eq!(ids, [0x200, 0x702].map(Id::Standard));
    bench.both.end();
}
