//! `--live`: shows a run or a recording in a browser.

use clap::Args;

use crate::failure::Failure;
use crate::help::heading;
use crate::output;
use crate::supervise::supervise;
use resonarm::control::{Length, Steered};
use resonarm::realtime::{Clock, SystemClock};
use resonarm::recording::Recording;
use resonarm::rig::Converter;
use resonarm::run::{Session, Signals, Watch};

/// Interval at which the stop signal is checked, ns.
const LOOK_NS: u64 = 20_000_000;

/// Whether the live view is served, and where.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::LIVE)]
pub(crate) struct LiveFlags {
    /// Show it in a browser, served at this address, or at 127.0.0.1.
    ///
    /// The address may have a port; without one a free port is chosen. The line that begins with `live view` has the
    /// URL.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1")]
    pub live: Option<String>,
    /// Also allow pages of this origin, as https://app.foxglove.dev; may be repeated.
    #[arg(long, value_name = "ORIGIN", requires = "live", hide_short_help = true)]
    pub live_origin: Vec<String>,
}

/// Whether the exciter is steered.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = heading::LIVE)]
pub(crate) struct SteerFlag {
    /// Play a sine that is set in the live view, not the scenario's excitation.
    ///
    /// Load, frequency and phase are set in the live view; the load acts along that of the scenario, in place of its
    /// excitation or control. It begins at zero.
    #[arg(long, requires = "live")]
    pub steer: bool,
}

impl SteerFlag {
    /// Returns the session, with the steered sine as its controller if --steer is given, for a plant whose instruments
    /// have this converter.
    pub fn steered(self, session: Session, converter: Converter) -> Result<(Session, Option<Steered>), Failure> {
        if !self.steer {
            return Ok((session, None));
        }
        let steered = session.scenario().steered(converter)?;
        let controller = steered.clone();
        Ok((session.with_controller(move || Box::new(controller.clone())), Some(steered)))
    }
}

/// The settings with which a recording is shown.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(feature = "live"), expect(dead_code, reason = "only the live view reads it"))]
pub(crate) struct Showing {
    /// The speed: recorded seconds a second.
    pub speed: f64,
    /// The number of times that it is shown; 0 repeats without end.
    pub times: u32,
    /// Whether the recording waits for its first viewer.
    pub wait: bool,
}

/// Shows a recording until a signal stops it.
pub(crate) fn show(flags: &LiveFlags, recording: Recording, showing: Showing) -> Result<(), Failure> {
    let _live = serving::of_recording(flags, recording, showing)?;
    until_stopped()
}

/// Waits until a signal stops the program.
fn until_stopped() -> Result<(), Failure> {
    let until_stopped = |signals: &Signals| {
        while !signals.is_stopped() {
            SystemClock.sleep_until_ns(SystemClock.now_ns() + LOOK_NS);
        }
    };
    supervise("live view", Length::Unknown, |_, _| {}, until_stopped)
}

/// The role of a session that is shown, and its bus.
#[derive(Clone, Debug)]
#[cfg_attr(not(feature = "live"), expect(dead_code, reason = "only the live view reads it"))]
pub(crate) struct ShownRole {
    pub role: Role,
    /// The bus in words.
    pub place: String,
    /// The name of the bus in recordings.
    pub interface: String,
    /// Whether the line with the URL is written as JSON.
    pub json: bool,
    /// The steered sine, if there is one.
    pub steered: Option<Steered>,
}

impl ShownRole {
    /// Returns a role on a bus, of this place and name, with neither JSON nor a steered sine.
    pub fn new(role: Role, place: impl Into<String>, interface: impl Into<String>) -> ShownRole {
        ShownRole { role, place: place.into(), interface: interface.into(), json: false, steered: None }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Plant,
    Exciter,
    PlantAndExciter,
}

/// A live view that is served until this is dropped.
pub(crate) struct Serving {
    watch: Watch,
    #[cfg(feature = "live")]
    live: resonarm_live::Live,
}

impl Serving {
    /// Shows a run that is over until a signal stops the program.
    pub fn show_until_stopped(&self) -> Result<(), Failure> {
        #[cfg(feature = "live")]
        self.live.run_is_over();
        output::note("live view    the run is over, and is shown until Ctrl-C");
        until_stopped()
    }
}

impl LiveFlags {
    /// Serves the live view of a session if --live is given; the session is then watched.
    pub fn watched(&self, session: Session, shown_role: &ShownRole) -> Result<(Session, Option<Serving>), Failure> {
        let Some(address) = &self.live else { return Ok((session, None)) };
        let serving = serving::of_session(address, &self.live_origin, &session, shown_role)?;
        Ok((session.watched(serving.watch.clone()), Some(serving)))
    }
}

#[cfg(not(feature = "live"))]
mod serving {
    use super::{Failure, LiveFlags, Serving, Session, Showing, ShownRole};
    use resonarm::recording::Recording;

    /// Says how to build a program with the live view.
    pub fn of_session(_: &str, _: &[String], _: &Session, _: &ShownRole) -> Result<Serving, Failure> {
        Err(missing())
    }

    /// Says how to build a program with the live view.
    pub fn of_recording(_: &LiveFlags, _: Recording, _: Showing) -> Result<core::convert::Infallible, Failure> {
        Err(missing())
    }

    fn missing() -> Failure {
        Failure::usage("--live is not in this build: build the program by `cargo build --release --features live`")
    }
}

#[cfg(feature = "live")]
mod serving {
    use std::net::{IpAddr, SocketAddr};

    use super::{Failure, LiveFlags, Role, Serving, Session, Showing, ShownRole};
    use crate::figures::captions::{foreign_label, label};
    use crate::live_branch::compute;
    use crate::output;
    use resonarm::realtime::unix_time_ns;
    use resonarm::recording::Recording;
    use resonarm::recording::channels::Channels;
    use resonarm::run::watch;
    use resonarm::scenario::Scenario;
    use resonarm_live::{
        About, Action, Live, LiveError, Model, Options, Origins, Play, SPEEDS, Shown, Source, Steering, UnderTest,
        play, serve,
    };

    /// Serves the live view of a session, and prints its URL.
    pub fn of_session(
        address: &str,
        origins: &[String],
        session: &Session,
        shown_role: &ShownRole,
    ) -> Result<Serving, Failure> {
        let scenario = session.scenario();
        let under_test = UnderTest::new(scenario, name(scenario)?, table(scenario)?)?;
        let role = match shown_role.role {
            Role::Plant => "plant",
            Role::Exciter => "exciter",
            Role::PlantAndExciter => "plant and exciter",
        };
        let mut about = About::new(role, shown_role.place.clone(), scenario, &under_test);
        about.actions = match shown_role.role {
            Role::Plant => vec![Action::Arm, Action::Disarm, Action::Reset],
            Role::Exciter | Role::PlantAndExciter => vec![Action::Disarm],
        };
        if let Some(steered) = &shown_role.steered {
            about.actions.push(Action::Set);
            about.steering = Some(Steering::new(steered.limit(), scenario.simulation.rate_hz));
        }
        let (watch, watcher) = watch();
        let responds = shown_role.role != Role::Plant;
        let shown = Shown {
            interface: shown_role.interface.clone(),
            // An exciter knows no coordinates, so nothing of the structure is drawn.
            drawing: under_test.drawing.clone().filter(|_| shown_role.role != Role::Exciter),
            model: Model::new(about, under_test),
            source: Source::Run(watcher),
            // A steered load is not that of the scenario.
            compute: if responds && shown_role.steered.is_none() { compute(scenario)? } else { None },
            range_hz: if responds { range_hz(scenario) } else { None },
            start_unix_ns: unix_time_ns(),
        };
        Ok(Serving { watch, live: begin(address, origins, shown, shown_role.json)? })
    }

    /// Serves a recording, and prints its URL; the view ends when the returned value is dropped.
    pub fn of_recording(flags: &LiveFlags, recording: Recording, showing: Showing) -> Result<Live, Failure> {
        let Showing { speed, times, wait } = showing;
        if !SPEEDS.contains(&speed) {
            let least = SPEEDS.start();
            let most = SPEEDS.end();
            return Err(Failure::value("--speed", speed, format!("with --live it must be from {least} to {most}")));
        }
        let scenario = Scenario::from_configuration(recording.configuration())?;
        let under_test = UnderTest::new(&scenario, name(&scenario)?, recording.channels().clone())?;
        let place = recording.path().display().to_string();
        let mut about = About::new("recording", place, &scenario, &under_test);
        about.rate_hz = 1.0 / recording.origin().dt_s;
        about.actions = vec![Action::Play];
        about.samples = recording.summary().samples;
        let shown = Shown {
            interface: recording.origin().interface.clone(),
            drawing: under_test.drawing.clone(),
            model: Model::new(about, under_test),
            compute: compute(&scenario)?,
            range_hz: range_hz(&scenario),
            start_unix_ns: recording.origin().log_start_ns(),
            source: play(recording, Play { speed, times: (times > 0).then_some(times), wait })?,
        };
        begin(flags.live.as_deref().unwrap_or("127.0.0.1"), &flags.live_origin, shown, false)
    }

    /// Returns the display name of the structure under test.
    fn name(scenario: &Scenario) -> Result<String, Failure> {
        if let Some(section) = scenario.foreign_structure() {
            return Ok(foreign_label(section));
        }
        Ok(label(scenario, &scenario.under_test()?))
    }

    /// Returns the channels of the scenario's plant.
    fn table(scenario: &Scenario) -> Result<Channels, Failure> {
        let plant = scenario.plant()?;
        Ok(Channels::of_structure(plant.structure()))
    }

    /// Begins to serve, and prints the URL of the page.
    fn begin(address: &str, origins: &[String], shown: Shown, json: bool) -> Result<Live, Failure> {
        let options = Options { address: parse(address)?, origins: Origins::new(origins)? };
        let live = serve(&options, shown)?;
        announcement(&live.url_with_token(), live.address(), json).iter().for_each(|line| output::note(line));
        Ok(live)
    }

    /// Returns the lines with the page's URL and a warning if other machines reach it.
    fn announcement(url: &str, address: SocketAddr, json: bool) -> Vec<String> {
        // The canonical form of ::ffff:127.0.0.1 is 127.0.0.1, which no other machine reaches.
        let warning = (!address.ip().to_canonical().is_loopback()).then(|| {
            let port = address.port();
            format!(
                "reachable from other machines on {address}, without encryption: anyone who reaches it can watch, and anyone who \
                 reads its traffic gets the token; listen on 127.0.0.1 instead, and tunnel it: \
                 `ssh -L {port}:127.0.0.1:{port} HOST`"
            )
        });
        if json {
            let event = match warning {
                Some(warning) => serde_json::json!({ "event": "live", "url": url, "warning": warning }),
                None => serde_json::json!({ "event": "live", "url": url }),
            };
            return vec![event.to_string()];
        }
        let page = format!("live view    {url} (for viewers who may only watch, leave out the part from # on)");
        [Some(page), warning.map(|warning| format!("live view    {warning}"))].into_iter().flatten().collect()
    }

    /// Parses an address with or without a port.
    fn parse(text: &str) -> Result<SocketAddr, LiveError> {
        // `[::1]` is neither an `IpAddr`, which has no brackets, nor a `SocketAddr`, which has a port.
        let bare = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).unwrap_or(text);
        let address = bare.parse::<IpAddr>().map(|ip| SocketAddr::new(ip, 0));
        address.or_else(|_not_bare| text.parse()).map_err(|_neither| LiveError::Address { got: text.to_owned() })
    }

    /// Returns the range of frequencies at which an open loop reads responses.
    fn range_hz(scenario: &Scenario) -> Option<(f64, f64)> {
        let profile = scenario.profile().ok()?;
        let windows = profile.windows().map(|window| (window.frequency_hz, window.frequency_hz));
        windows.reduce(|(low, high), (hz, _)| (low.min(hz), high.max(hz)))
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn listening_beyond_loopback_gives_a_warning() {
            let said = |address: &str| announcement("http://x/#t", address.parse().unwrap(), false);
            insta::assert_snapshot!(said("0.0.0.0:8080").join("\n"), @"
            live view    http://x/#t (for viewers who may only watch, leave out the part from # on)
            live view    reachable from other machines on 0.0.0.0:8080, without encryption: anyone who reaches it can watch, and anyone who reads its traffic gets the token; listen on 127.0.0.1 instead, and tunnel it: `ssh -L 8080:127.0.0.1:8080 HOST`
            ");
            for near in ["127.0.0.1:1", "127.8.0.1:1", "[::1]:1", "[::ffff:127.0.0.1]:1"] {
                assert_eq!(
                    said(near),
                    ["live view    http://x/#t (for viewers who may only watch, leave out the part from # on)"],
                    "{near}"
                );
            }
            for far in ["10.0.0.7:1", "[::]:1", "[2001:db8::1]:1"] {
                assert_eq!(said(far).len(), 2, "{far}");
            }
            let event = |address: &str| {
                let [line] = &announcement("u", address.parse().unwrap(), true)[..] else { panic!("one line") };
                serde_json::from_str::<serde_json::Value>(line).unwrap()
            };
            assert_eq!(event("127.0.0.1:1"), serde_json::json!({ "event": "live", "url": "u" }));
            assert!(event("0.0.0.0:1")["warning"].as_str().unwrap().starts_with("reachable from other machines"));
        }
    }
}
