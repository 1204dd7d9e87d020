//! `resonarm conformance`: whether a node on a bus conforms to the protocol.

mod report;

use std::path::{Path, PathBuf};

use clap::Args;

use super::protocol::NetworkFlags;
use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::numbers;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::recordings::{existing, wait_for_reader};
use crate::session::seconds;
use report::Row;
use resonarm::bus::{self, BusAddress, BusError};
use resonarm::conformance::{
    self, BusWire, Case, Commands, Evidence, ExpectedSine, Finding, ProtocolCase, REQUIREMENTS, Requirement, Settings,
    SineAmplitude, UserWire, UserWireError, WIRE_REQUIREMENTS, WireCase,
};
use resonarm::protocol::{EncodeError, ForceCommand, Message, Network, Node, Profile};
use resonarm::recording::Configuration;
use resonarm::run::Mode;
use resonarm::scenario::Scenario;
use resonarm_numeric::number::short;
use resonarm_numeric::seed;

/// Tests a node on a CAN bus for conformance to the protocol, or to a protocol of yours.
///
/// The command acts as the other node, and reports violations. It makes a plant shake its arm and fault. A protocol of
/// yours is in the section [wire] of --scenario.
#[derive(Debug, Args)]
pub(crate) struct Conformance {
    /// CAN bus, as vcan0, can0, python-can:interface=I,channel=C.
    #[arg(long, help_heading = heading::BUS, value_name = "BUS")]
    bus: String,
    /// Node under test.
    ///
    /// An exciter must be restarted whenever it ends, as by a loop in a shell.
    #[arg(long, help_heading = heading::BUS, value_parser = flags::described(ROLES))]
    role: Node,
    /// Mode of the node; each has its specific cases.
    #[arg(long, help_heading = heading::BUS, value_parser = flags::one_of(ON_A_BUS, Mode::name), default_value_t = Mode::RealTime)]
    mode: Mode,
    /// TOML file with a protocol of yours, [wire], in place of Resonarm's.
    ///
    /// To test an exciter, the arm of the scenario is simulated.
    #[arg(
        long,
        value_name = "FILE",
        help_heading = heading::NETWORK,
        conflicts_with_all = [
            "base", "plant_id", "exciter_id", "profile", "beyond_n_per_s", "beyond_travel_n", "bit_rate_hz", "soak_s",
            "expect_frequency_hz", "expect_force_n", "expect_torque_nm", "pid", "seed",
        ]
    )]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    network: NetworkFlags,
    /// Only the cases whose names begin with this; may be repeated.
    ///
    /// For example, `--case plant-hello`.
    #[arg(long = "case", help_heading = heading::TEST, value_name = "NAME")]
    cases: Vec<String>,
    /// Force commanded along x, in both directions, N.
    #[arg(long, help_heading = heading::TEST, value_name = "N", default_value_t = 5.0)]
    force_n: f64,
    /// Torque commanded by a protocol without forces, N·m.
    ///
    /// It acts at a joint, in both directions.
    #[arg(long, help_heading = heading::TEST, value_name = "NM", default_value_t = 5.0, requires = "scenario")]
    torque_nm: f64,
    /// Force that the plant must reject for its size, N [default: none; in the FD profile 1.01 times the plant's limit].
    ///
    /// A plant that accepts it applies it.
    #[arg(long, help_heading = heading::TEST, value_name = "N", hide_short_help = true)]
    beyond_n: Option<f64>,
    /// Rate of change of the force that the plant must reject, N/s [default: none is tried].
    ///
    /// A plant that accepts it applies it.
    #[arg(long, help_heading = heading::TEST, value_name = "N/S", hide_short_help = true)]
    beyond_n_per_s: Option<f64>,
    /// Force along x that drives the plant beyond its largest travel, N [default: none is tried].
    #[arg(long, help_heading = heading::TEST, value_name = "N", hide_short_help = true)]
    beyond_travel_n: Option<f64>,
    /// Longest wait for the node under test, s.
    #[arg(long, help_heading = heading::BUS, value_name = "S", default_value_t = 10.0)]
    patience_s: f64,
    /// Bit rate of the bus, Hz; some cases are then repeated at a bus load of 70 % [default: without load alone].
    #[arg(long, help_heading = heading::TEST, value_name = "HZ", value_parser = numbers::integer(10_000..=1_000_000_u32), hide_short_help = true)]
    bit_rate_hz: Option<u32>,
    /// Time of random good and bad frames, s; 0 sends none.
    #[arg(long, help_heading = heading::TEST, value_name = "S", default_value_t = 5.0)]
    soak_s: f64,
    /// Frequency of the sine to expect, Hz [default: no sine is expected].
    ///
    /// The exciter is set up to command it. Its amplitude is --expect-force-n or --expect-torque-nm.
    #[arg(long, help_heading = heading::TEST, value_name = "HZ")]
    expect_frequency_hz: Option<f64>,
    /// Amplitude of that sine as a force along x, N.
    ///
    /// A ramp may come before it.
    #[arg(long, help_heading = heading::TEST, value_name = "N")]
    expect_force_n: Option<f64>,
    /// Amplitude of that sine as a torque at joint 1, N·m.
    ///
    /// A ramp may come before it.
    #[arg(long, help_heading = heading::TEST, value_name = "NM")]
    expect_torque_nm: Option<f64>,
    /// Process of the node, which one case stops for 0.4 s [default: the case is left out].
    ///
    /// It must be on this machine.
    #[arg(long, help_heading = heading::TEST, value_name = "PID", value_parser = numbers::integer(1..=i32::MAX), hide_short_help = true)]
    pid: Option<i32>,
    /// Seed of the random frames, decimal or as 0x1F.
    ///
    /// It is the first bit to damage, too; each further damaged frame has the next bit wrong.
    #[arg(long, help_heading = heading::TEST, value_name = "N", value_parser = seed::parse, default_value_t = 0, hide_short_help = true)]
    seed: u64,
    #[command(flatten)]
    json: JsonFlag,
    /// Also write the report as JUnit XML to this file.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Record every frame, and where each case begins and ends, into this MCAP file.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

const ROLES: [(Node, &str, &str); 2] = [(Node::Plant, "plant", ""), (Node::Exciter, "exciter", "")];

/// The modes in which a node on a bus can be tested.
const ON_A_BUS: [Mode; 2] = [Mode::RealTime, Mode::Lockstep];

/// Rejects a force that the profile can't carry.
fn check_carried(network: Network, flag: &str, force_n: Option<f64>) -> Result<(), Failure> {
    let command = |force_x_n| Message::Force(ForceCommand { force_x_n, force_y_n: 0.0, sample: 0 });
    let (Some(force_n), profile) = (force_n, network.profile()) else { return Ok(()) };
    match command(force_n).check(network) {
        // The encoder itself is asked, so that the limit is that of the frames and stated in one place only.
        Err(EncodeError::OutOfRange { limit, .. }) => {
            let more = if profile == Profile::Classic { "; use --profile fd, which carries more" } else { "" };
            let force_n = short(&force_n);
            let limit = short(&limit);
            Err(Failure::usage(format!(
                "{flag} is {force_n} N, but commands of the {profile} profile reach only ±{limit} N{more}"
            )))
        }
        _ => Ok(()),
    }
}

impl Conformance {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        match &self.scenario {
            Some(path) => self.on_wire(path),
            None => self.on_network(),
        }
    }

    /// Runs the cases of Resonarm's protocol.
    fn on_network(&self) -> Result<Verdict, Failure> {
        let address = self.bus.parse()?;
        let network = self.network.network()?;
        let settings = self.settings(Some(network))?;
        let cases = chosen(conformance::cases(self.role, self.mode), |case| case.id, &self.cases)?;
        let configuration = conformance::configuration(self.role, network, settings);
        let run = |case: &ProtocolCase, wire: &mut BusWire| conformance::run(case, wire, network, settings);
        self.report_on(&address, &cases, (&configuration, &REQUIREMENTS), run)
    }

    /// Runs the cases of the scenario's user protocol.
    fn on_wire(&self, path: &Path) -> Result<Verdict, Failure> {
        let address = self.bus.parse()?;
        let settings = self.settings(None)?;
        let user_wire = UserWire::new(Scenario::read(path)?, self.role, self.mode).map_err(refusal)?;
        let cases = chosen(conformance::wire_cases(&user_wire), |case| case.id, &self.cases)?;
        let configuration = user_wire.configuration(settings).map_err(refusal)?;
        let run = |case: &WireCase, wire: &mut BusWire| conformance::run_on_wire(case, wire, &user_wire, settings);
        self.report_on(&address, &cases, (&configuration, &WIRE_REQUIREMENTS), run)
    }

    /// Runs the cases on the bus, and reports.
    fn report_on<S>(
        &self,
        address: &BusAddress,
        cases: &[Case<S>],
        (configuration, requirements): (&Configuration, &[Requirement]),
        run: impl FnMut(&Case<S>, &mut BusWire) -> Result<Finding, BusError>,
    ) -> Result<Verdict, Failure> {
        let inputs = Inputs::of_scenario(self.scenario.as_deref());
        self.overwrite.check(self.junit.iter().chain(&self.record).cloned(), &inputs)?;
        // Before the bus is opened: the frames of a node that is already running would otherwise fill the socket's
        // buffer while nobody reads the pipe.
        let _reader = self.record.as_deref().map(wait_for_reader).transpose()?;
        let mut bus = bus::open(address)?;
        let existing = existing(self.overwrite.overwrite);
        let create = |path| Evidence::create(path, existing, &bus.name(), (self.role, configuration));
        let evidence = self.record.clone().map(create).transpose()?;
        let interface = match address {
            BusAddress::SocketCan(interface) => Some(interface.as_str()),
            BusAddress::Memory | BusAddress::PythonCan(_) => None,
        };
        let pid = self.pid.and_then(rustix::process::Pid::from_raw);
        let mut wire = BusWire::new(bus.as_mut(), evidence).with_means(interface, pid);
        let mut commands = Commands::default();
        let (rows, lost) = self.rows(cases, &mut wire, run, &mut commands)?;
        let (recording, unrecorded) = match wire.evidence.map(Evidence::finish).transpose() {
            Ok(recording) => (recording, None),
            Err(error) => (None, Some(error)),
        };
        let document = report::Document::new((self.role, requirements), rows, &commands, recording);
        // The report is written before the errors are returned: what was found so far is worth having even if the bus
        // was lost or the recording is incomplete.
        if let Some(path) = &self.junit {
            output::write(path.clone(), &document.junit())?;
        }
        self.json.show(&document, || document.summary(), &[])?;
        lost.map_or_else(|| bus.close(), Err)?;
        unrecorded.map_or(Ok(()), Err)?;
        Ok(Verdict::of(document.is_positive()))
    }

    /// Runs the cases and returns their results, and the error if the bus was lost: the cases after that are not run.
    fn rows<S>(
        &self,
        cases: &[Case<S>],
        wire: &mut BusWire,
        mut run: impl FnMut(&Case<S>, &mut BusWire) -> Result<Finding, BusError>,
        commands: &mut Commands,
    ) -> Result<(Vec<Row>, Option<BusError>), Failure> {
        let mut rows = Vec::new();
        let mut lost = None;
        for case in cases {
            // The remaining cases are listed as not run, so that a report names every case whatever happened to the
            // bus.
            let row = match lost {
                Some(_) => Row::not_run(case),
                None => {
                    wire.begin(case);
                    let finding = run(case, wire).unwrap_or_else(|error| Finding::lost(lost.insert(error)));
                    wire.end(case, &finding);
                    commands.merge(&finding.traffic.commands);
                    Row::new(case, &finding)
                }
            };
            if !self.json.json {
                output::print(&row.text())?;
            }
            rows.push(row);
        }
        Ok((rows, lost))
    }

    /// Checks and returns the settings; on Resonarm's protocol also against the range of its frames.
    fn settings(&self, network: Option<Network>) -> Result<Settings, Failure> {
        self.check_forces(network)?;
        let ns = |flag, given_s| {
            // A quarter of the range of 64 bits, so that adding such a time to a time stamp can't overflow.
            seconds(flag, given_s).map(|time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX).min(u64::MAX / 4))
        };
        Ok(Settings {
            force_n: self.force_n,
            torque_nm: self.torque_nm,
            beyond_n: self.beyond_n,
            beyond_n_per_s: self.beyond_n_per_s,
            beyond_travel_n: self.beyond_travel_n,
            patience_ns: ns("--patience-s", self.patience_s)?,
            seed: self.seed,
            bit_rate_hz: self.bit_rate_hz,
            soak_ns: ns("--soak-s", self.soak_s)?,
            sine: self.sine()?,
        })
    }

    /// Rejects forces that are invalid, beyond the profile's range, or not used for the role.
    fn check_forces(&self, network: Option<Network>) -> Result<(), Failure> {
        let [force, beyond, beyond_travel] = [
            ("--force-n", Some(self.force_n)),
            ("--beyond-n", self.beyond_n),
            ("--beyond-travel-n", self.beyond_travel_n),
        ];
        let of_plant = Some(Node::Plant);
        let of_exciter = Some(Node::Exciter);
        let all = [
            (force.0, "N", force.1, None),
            ("--torque-nm", "N m", Some(self.torque_nm), None),
            (beyond.0, "N", beyond.1, of_plant),
            ("--beyond-n-per-s", "N/s", self.beyond_n_per_s, of_plant),
            (beyond_travel.0, "N", beyond_travel.1, of_plant),
            ("--expect-frequency-hz", "Hz", self.expect_frequency_hz, of_exciter),
            ("--expect-force-n", "N", self.expect_force_n, of_exciter),
            ("--expect-torque-nm", "N m", self.expect_torque_nm, of_exciter),
        ];
        // Values are checked before roles, so that `--beyond-n -1 --role exciter` reports the value, which is wrong
        // for any role.
        let is_wrong = |n: f64| !n.is_finite() || n <= 0.0;
        if let Some((flag, unit, ..)) = all.into_iter().find(|(_, _, given, _)| given.is_some_and(is_wrong)) {
            return Err(Failure::usage(format!("{flag} must be a number above 0 {unit}")));
        }
        let of_other = |of: &Option<Node>| of.is_some_and(|of| of != self.role);
        if let Some((flag, _, _, Some(other))) = all.into_iter().find(|(.., given, of)| given.is_some() && of_other(of))
        {
            return Err(Failure::usage(format!("{flag} is for --role {other}: leave it out")));
        }
        let mut forces = [force, beyond, beyond_travel].into_iter();
        if let Some(network) = network {
            forces.try_for_each(|(flag, n)| check_carried(network, flag, n))?;
        }
        let force_n = self.force_n;
        // The plant must accept --force-n and reject these, so each of them must be the larger one.
        for (flag, given) in [beyond, beyond_travel] {
            if let Some(beyond_n) = given.filter(|beyond_n| *beyond_n <= force_n) {
                return Err(Failure::usage(format!(
                    "{flag} is {beyond_n} N, but it must be larger than --force-n, {force_n} N"
                )));
            }
        }
        Ok(())
    }

    fn sine(&self) -> Result<Option<ExpectedSine>, Failure> {
        let force = self.expect_force_n.map(SineAmplitude::ForceN);
        let torque = self.expect_torque_nm.map(SineAmplitude::TorqueNm);
        match (self.expect_frequency_hz, force, torque) {
            (_, Some(_), Some(_)) => Err(Failure::usage(
                "--expect-force-n and --expect-torque-nm exclude each other, since a command is a force or a torque: give one of them",
            )),
            (None, None, None) => Ok(None),
            (Some(frequency_hz), Some(amplitude), None) | (Some(frequency_hz), None, Some(amplitude)) => {
                Ok(Some(ExpectedSine { frequency_hz, amplitude }))
            }
            _ => Err(Failure::usage(
                "an expected sine needs its frequency and its amplitude: give --expect-frequency-hz with --expect-force-n or \
                 --expect-torque-nm",
            )),
        }
    }
}

/// Returns the cases whose names begin with one of --case; without it all cases.
pub(crate) fn chosen<T>(
    all: impl IntoIterator<Item = T>,
    id: impl Fn(&T) -> &'static str,
    wanted: &[String],
) -> Result<Vec<T>, Failure> {
    let all: Vec<T> = all.into_iter().collect();
    // A name that selects no case is an error. In CI a misspelt name would otherwise test nothing and pass.
    if let Some(unknown) = wanted.iter().find(|wanted| !all.iter().any(|case| id(case).starts_with(wanted.as_str()))) {
        let names = all.iter().map(&id).collect::<Vec<_>>().join(", ");
        return Err(Failure::usage(format!("unknown case {unknown:?}, expected one of {names}")));
    }
    let is_wanted = |case: &T| wanted.is_empty() || wanted.iter().any(|wanted| id(case).starts_with(wanted.as_str()));
    Ok(all.into_iter().filter(is_wanted).collect())
}

/// Says why the cases can't be run on the scenario's user protocol.
fn refusal(error: UserWireError) -> Failure {
    match error {
        UserWireError::Run(error) => error.into(),
        UserWireError::NoWire | UserWireError::Faults => Failure::usage(error.to_string()),
    }
}
