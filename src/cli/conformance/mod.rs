//! `resonarm conformance`: whether a node on a bus keeps the protocol.

mod report;

use std::path::PathBuf;

use clap::{Args, ValueEnum, value_parser};

use super::failure::{Failure, Verdict};
use super::flags;
use super::output;
use super::protocol::NetworkFlags;
use super::session::seconds;
use crate::bus::{self, BusAddress, BusError};
use crate::conformance::{self, BusWire, Case, Evidence, Finding, Settings};
use crate::protocol::{Network, Node};
use crate::recording::{Existing, RecordingError};
use crate::run::Mode;
use crate::seed;
use report::Row;

/// Tests whether a plant or an exciter on a bus keeps the protocol: plays the other side, and says what it does wrong.
/// It makes a plant shake its arm and fault.
#[derive(Debug, Args)]
pub(super) struct Conformance {
    /// The bus: vcan0, can0, python-can:interface=I,channel=C.
    #[arg(long, value_name = "BUS")]
    bus: String,
    /// The node under test. An exciter must be started again whenever it ends, as by a loop in a shell.
    #[arg(long)]
    role: Role,
    /// The mode in which the node is: each has cases of its own.
    #[arg(long, value_parser = flags::one_of(ON_A_BUS, Mode::name), default_value_t = Mode::RealTime)]
    mode: Mode,
    #[command(flatten)]
    network: NetworkFlags,
    /// Only the cases whose names begin so, such as plant-hello; may be given more than once.
    #[arg(long = "case", value_name = "NAME")]
    cases: Vec<String>,
    /// Force that a plant is commanded along x, both ways, N.
    #[arg(long, value_name = "N", default_value_t = 5.0)]
    force_n: f64,
    /// A force that the plant must refuse for its size, N [default: none is tried]. A plant that takes it applies it.
    #[arg(long, value_name = "N")]
    beyond_n: Option<f64>,
    /// A rate of change of the force that the plant must refuse, N/s [default: none is tried]. A plant that takes it
    /// applies it.
    #[arg(long, value_name = "N/S")]
    beyond_n_per_s: Option<f64>,
    /// A force along x that drives the plant beyond its largest travel, N [default: none is tried].
    #[arg(long, value_name = "N")]
    beyond_travel_n: Option<f64>,
    /// How long the node under test is waited for, s.
    #[arg(long, value_name = "S", default_value_t = 10.0, allow_hyphen_values = true)]
    patience_s: f64,
    /// Bit rate of the bus, Hz: some cases are tried at 70 % of it, too [default: they are not].
    #[arg(long, value_name = "HZ", value_parser = value_parser!(u32).range(10_000..=1_000_000))]
    bit_rate_hz: Option<u32>,
    /// How long good and bad frames at random are sent, s; 0 is not at all.
    #[arg(long, value_name = "S", default_value_t = 5.0, allow_hyphen_values = true)]
    soak_s: f64,
    /// What is drawn at random; and which bit of the first damaged frame is wrong, the next has the next one wrong.
    #[arg(long, value_name = "N", value_parser = seed::parse, default_value_t = 0)]
    seed: u64,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    /// Write the report as JUnit XML, too.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Record every frame, and where each case begins and ends, into this MCAP file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    overwrite: output::OverwriteFlag,
}

/// The modes of a node on a bus.
const ON_A_BUS: [Mode; 2] = [Mode::RealTime, Mode::Lockstep];

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Role {
    Plant,
    Exciter,
}

impl From<Role> for Node {
    fn from(role: Role) -> Node {
        match role {
            Role::Plant => Node::Plant,
            Role::Exciter => Node::Exciter,
        }
    }
}

impl Conformance {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let (address, network): (BusAddress, _) = (self.bus.parse()?, self.network.network()?);
        let (settings, cases) = (self.settings()?, self.cases()?);
        self.overwrite.check(self.junit.iter().chain(&self.record).cloned())?;
        let mut bus = bus::open(&address)?;
        let evidence = self.evidence(&bus.name(), network, settings)?;
        let mut wire = BusWire::new(bus.as_mut(), evidence);
        let (rows, lost) = self.rows(&cases, &mut wire, network, settings)?;
        let (recording, unrecorded) = match wire.evidence.map(Evidence::finish).transpose() {
            Ok(recording) => (recording, None),
            Err(error) => (None, Some(error)),
        };
        let document = report::Document::new(self.role.into(), rows, recording);
        self.tell(&document)?;
        lost.map_or_else(|| bus.close(), Err)?;
        unrecorded.map_or(Ok(()), Err)?;
        Ok(Verdict::of(document.is_positive()))
    }

    /// What the cases found, and what became of the bus if it was lost: the cases after that are not run.
    fn rows(
        &self,
        cases: &[Case],
        wire: &mut BusWire,
        network: Network,
        settings: Settings,
    ) -> Result<(Vec<Row>, Option<BusError>), Failure> {
        let (mut rows, mut lost) = (Vec::new(), None);
        for case in cases {
            let row = match lost {
                Some(_) => Row::not_run(case),
                None => {
                    wire.begin(case);
                    let finding = conformance::run(case, wire, network, settings)
                        .unwrap_or_else(|error| Finding::lost(lost.insert(error)));
                    wire.end(case, &finding);
                    Row::new(case, &finding)
                }
            };
            if !self.json {
                output::print(&row.text())?;
            }
            rows.push(row);
        }
        Ok((rows, lost))
    }

    fn evidence(
        &self,
        interface: &str,
        network: Network,
        settings: Settings,
    ) -> Result<Option<Evidence>, RecordingError> {
        let existing = if self.overwrite.overwrite { Existing::Overwrite } else { Existing::Refuse };
        let run = (self.role.into(), network, settings);
        self.record.clone().map(|path| Evidence::create(path, existing, interface, run)).transpose()
    }

    /// Prints and writes the report.
    fn tell(&self, document: &report::Document) -> Result<(), Failure> {
        if let Some(path) = &self.junit {
            output::write(path.clone(), &document.junit())?;
        }
        if self.json { output::print_json(document) } else { output::print(&document.summary()) }
    }

    fn settings(&self) -> Result<Settings, Failure> {
        for (flag, unit, number) in [
            ("--force-n", "N", Some(self.force_n)),
            ("--beyond-n", "N", self.beyond_n),
            ("--beyond-n-per-s", "N/s", self.beyond_n_per_s),
            ("--beyond-travel-n", "N", self.beyond_travel_n),
        ] {
            if number.is_some_and(|number| !number.is_finite() || number <= 0.0) {
                return Err(Failure::Usage(format!("{flag} must be a number above 0 {unit}")));
            }
        }
        let ns = |flag, given_s| {
            seconds(flag, given_s).map(|time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX).min(u64::MAX / 4))
        };
        Ok(Settings {
            force_n: self.force_n,
            beyond_n: self.beyond_n,
            beyond_n_per_s: self.beyond_n_per_s,
            beyond_travel_n: self.beyond_travel_n,
            patience_ns: ns("--patience-s", self.patience_s)?,
            seed: self.seed,
            bit_rate_hz: self.bit_rate_hz,
            soak_ns: ns("--soak-s", self.soak_s)?,
        })
    }

    fn cases(&self) -> Result<Vec<Case>, Failure> {
        let all = || conformance::cases(self.role.into(), self.mode);
        if let Some(unknown) = self.cases.iter().find(|wanted| !all().any(|case| case.id.starts_with(wanted.as_str())))
        {
            let names = all().map(|case| case.id).collect::<Vec<_>>().join(", ");
            return Err(Failure::Usage(format!("there is no case {unknown:?}, only {names}")));
        }
        let is_wanted =
            |case: &Case| self.cases.is_empty() || self.cases.iter().any(|w| case.id.starts_with(w.as_str()));
        Ok(all().filter(is_wanted).collect())
    }
}
