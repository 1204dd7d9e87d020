//! An exciter's node commands no more than its capabilities state: that in C as that of the crate.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use resonarm_protocol::node::{Answer, Answering, ExciterNode, ExciterOutcome, Timing};
use resonarm_protocol::{
    Capabilities, Emergency, EmergencyCode, Frame, FrameFormat, Heartbeat, Hello, Message, MessageKind, Network, Node,
    NodeState, Profile, SamplesPerFrame, SensorValues, Sensors, Transmitter,
};

use super::harness::build_for;

const RATE_HZ: u16 = 1000;
const NEVER: u64 = u64::MAX;

/// The controller of the harness in C: n counts of force along x.
struct Rising;

impl Answering for Rising {
    type Abort = ();

    fn restart(&mut self) {}

    fn answer(&mut self, sample: u64, _values: &SensorValues) -> Answer<()> {
        Answer::HoldForce { force_x_n: sample as f64 * 0.02, force_y_n: 0.0 }
    }
}

/// A node in C and one of the crate with the same capabilities: samples in a frame, as the former has it, and a
/// force, N.
struct Both {
    process: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    node: ExciterNode<Rising>,
    plant: Transmitter,
    now_ns: u64,
}

impl Both {
    fn start(profile: Profile, samples: u8, limit_n: u32) -> Both {
        let network = Network::new(0x300).unwrap().with_node_ids(3, 4).unwrap().with_profile(profile);
        let program = build_for(network, "exciter_harness");
        let mut process = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (input, output) = (process.stdin.take(), BufReader::new(process.stdout.take().unwrap()));
        let capabilities = Capabilities {
            node: Node::Exciter,
            samples_per_frame: SamplesPerFrame::One,
            force_limit_n: limit_n.into(),
            torque_limit_nm: 0.0,
        };
        let node = ExciterNode::new(network, RATE_HZ, Timing::real_time(RATE_HZ), capabilities, Rising);
        let mut both = Both { process, input, output, node, plant: Transmitter::new(network), now_ns: 0 };
        both.ask(&format!("init real-time {RATE_HZ} {NEVER} {NEVER} {NEVER} {samples} {limit_n}"));
        both.both("start 0", |node| node.start(0));
        both.hear(&Message::PlantHello(Hello::new(profile, RATE_HZ)));
        both.hear(&Message::Heartbeat(Heartbeat { node: Node::Plant, state: NodeState::Operational }));
        both
    }

    fn ask(&mut self, command: &str) -> String {
        self.input.as_mut().unwrap().write_all(format!("{command}\n").as_bytes()).unwrap();
        let mut answer = String::new();
        self.output.read_line(&mut answer).unwrap();
        answer.split('|').next().unwrap().trim_end().to_string()
    }

    /// Makes both do the same, compares the frames that they send, and gives them.
    fn both(&mut self, command: &str, act: impl FnOnce(&mut ExciterNode<Rising>)) -> Vec<Frame> {
        let of_c = self.ask(command);
        act(&mut self.node);
        let sent: Vec<Frame> = core::iter::from_fn(|| {
            let frame = self.node.next_frame()?;
            self.node.frame_sent();
            Some(frame)
        })
        .collect();
        let ours = sent.iter().map(Frame::to_string).collect::<Vec<_>>().join(" ");
        assert_eq!(of_c, ours, "after {command}");
        sent
    }

    /// A message of the plant comes in, a tick later.
    fn hear(&mut self, message: &Message) -> Vec<Frame> {
        self.now_ns += 1_000_000;
        let (now_ns, frame) = (self.now_ns, self.plant.frame(message).unwrap());
        let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
        let format = if matches!(frame.format(), FrameFormat::Fd { .. }) { "f" } else { "c" };
        let command = format!("frame {now_ns} {format} {:X} {} {data}", frame.id().raw(), frame.len());
        self.both(&command, |node| node.handle_frame(now_ns, &frame))
    }

    /// Answers so many samples; how many commands were sent, and the fault that ended it.
    fn play(mut self, samples: u16) -> (usize, Option<Emergency>) {
        let network = self.node.network();
        let is_command = |frame: &&Frame| frame.id().raw() == u32::from(MessageKind::Force.id(network));
        let mut commands = 0;
        for sample in 0..samples {
            let sensors = Message::Sensors(Sensors { values: SensorValues::default(), sample });
            commands += self.hear(&sensors).iter().filter(is_command).count();
        }
        drop(self.input.take());
        assert!(self.process.wait().unwrap().success());
        match self.node.outcome() {
            Some(ExciterOutcome::Faulted(emergency)) => (commands, Some(emergency)),
            None => (commands, None),
            Some(other) => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_command_beyond_the_stated_force_is_a_fault_and_is_not_sent() {
    let beyond = |sample| Emergency { node: Node::Exciter, code: EmergencyCode::CommandOutOfRange, detail: 0, sample };
    // 0.02 N more with each sample: 1 N is that of sample 50.
    assert_eq!(Both::start(Profile::Fd, 1, 1).play(80), (51, Some(beyond(51))));
    assert_eq!(Both::start(Profile::Fd, 1, 2).play(80), (80, None));
    // Capabilities that are left out are sent as one sample in a frame and no load.
    assert_eq!(Both::start(Profile::Fd, 0, 0).play(80), (1, Some(beyond(1))));
}
