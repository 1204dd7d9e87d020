//! The server: the page, its updates and the Foxglove stream, on its own thread.

use core::time::Duration;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::{Semaphore, broadcast, oneshot};
use tokio::time::MissedTickBehavior;

use super::admission::{Origins, Token};
use super::branches::{Branches, ComputeBranch, lower_priority};
use super::connections::{self, LIMITS};
use super::foxglove::{self, Stream};
use super::model::Model;
use super::shared::{Shared, lock};
use super::source::Source;
use super::{page, viewer};
use crate::error::LiveError;
use resonarm_files::drawing::Drawing;

/// Interval between updates: thirty a second.
const BEAT: Duration = Duration::from_millis(33);
/// Spectra, and what a test has reached, are sent with every so many updates.
const SPECTRUM_BEATS: u64 = 8;
/// Messages queued for a slow viewer: two seconds of updates.
const WAITING: usize = 128;
/// Most viewers at once. Each holds one update that is sent and a buffer of [`LONGEST`] bytes.
const VIEWERS: usize = 64;
/// Most viewers at once that are sent all that is kept of the run, up to 3 MB each; others wait. So all viewers together
/// hold less than 64 MiB.
const GREETINGS: usize = 16;
/// Time that viewers have to receive the last messages.
const FAREWELL: Duration = Duration::from_millis(300);
/// Reduction of the thread's share of processor time against others (nice(2)).
const NICE: i32 = 10;
/// The longest message and frame that a viewer may send, bytes: memory for a frame is reserved when its head has come.
const LONGEST: usize = 4096;

/// Address of the server, and origins that it accepts.
#[derive(Clone, Debug)]
pub struct Options {
    /// Address to listen at; port 0 picks a free one.
    pub address: SocketAddr,
    /// Further origins from which a browser may connect.
    pub origins: Origins,
}

/// The run or recording to show.
pub struct Shown {
    /// The model that later viewers are served from.
    pub model: Model,
    /// Source of the records shown.
    pub source: Source,
    /// Computes the branch on which responses should lie.
    pub compute: Option<ComputeBranch>,
    /// Frequencies at which responses will be read, if known, Hz.
    pub range_hz: Option<(f64, f64)>,
    /// Time of sample 0, ns of the UNIX epoch.
    pub start_unix_ns: u64,
    /// The name of the bus in recordings.
    pub interface: String,
    /// Drawing for 3D views; `None` where the coordinates are unknown.
    pub drawing: Option<Drawing>,
}

/// A server at work; it ends when this is dropped.
#[derive(Debug)]
pub struct Live {
    address: SocketAddr,
    token: Token,
    /// Whether the run is over, while the view goes on.
    is_over: Arc<AtomicBool>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Serves the run or recording, from now on.
///
/// # Errors
/// [`LiveError`] if the address can't be listened on, or the thread can't be started.
pub fn serve(options: &Options, shown: Shown) -> Result<Live, LiveError> {
    let failed = |source| LiveError::Listen { address: options.address, source };
    // Bound here and not on the thread, so that a wrong address is an error of the command.
    let listener = TcpListener::bind(options.address).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let token = Token::new()?;
    // One thread for all tasks: nice(2) acts on a thread, and so on the whole server.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(LiveError::Thread)?;
    let branches = shown.compute.map(Branches::start).transpose()?;
    let dt_s = 1.0 / shown.model.about.rate_hz;
    let table = shown.model.under_test.table.clone();
    let stream = Stream::new(dt_s, shown.start_unix_ns, &shown.interface, shown.drawing, table);
    let shared = Arc::new(Shared {
        model: Mutex::new(shown.model),
        source: Mutex::new(shown.source),
        updates: broadcast::Sender::new(WAITING),
        published: broadcast::Sender::new(WAITING),
        token: token.clone(),
        lost_updates: AtomicU64::new(0),
        viewers: AtomicUsize::new(0),
        greetings: Semaphore::new(GREETINGS),
        session: shown.start_unix_ns.to_string(),
        channels: stream.channels.clone(),
        origins: options.origins.clone(),
    });
    let is_over = Arc::new(AtomicBool::new(false));
    let beats = Beats {
        shared: Arc::clone(&shared),
        branches,
        range_hz: shown.range_hz,
        stream,
        count: 0,
        is_over: Arc::clone(&is_over),
    };
    let (stop, stopped) = oneshot::channel();
    let thread = thread::Builder::new()
        .name(String::from("live"))
        .spawn(move || {
            lower_priority(NICE);
            if let Err(error) = runtime.block_on(run(listener, shared, beats, stopped)) {
                tracing::error!("the live view has ended: {error}");
            }
        })
        .map_err(LiveError::Thread)?;
    Ok(Live { address, token, is_over, stop: Some(stop), thread: Some(thread) })
}

impl Live {
    /// The address it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Tells the viewers that the run is over; they still see what is kept of it.
    pub fn run_is_over(&self) {
        self.is_over.store(true, Ordering::Release);
    }

    /// The address of the page with the token, which permits changes: after `#`, which a browser does not send.
    pub fn url_with_token(&self) -> String {
        let mut shown = self.address;
        // 0.0.0.0 and [::] are addresses to listen on, not to open in a browser.
        if shown.ip().is_unspecified() {
            let loopback = if shown.is_ipv4() { [127, 0, 0, 1].into() } else { std::net::Ipv6Addr::LOCALHOST.into() };
            shown.set_ip(loopback);
        }
        format!("http://{shown}/#{}", self.token.text())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ended_before = self.stop.take().map(|stop| stop.send(()));
        if self.thread.take().is_some_and(|thread| thread.join().is_err()) {
            tracing::error!("the live view ended in a panic; the message above says where");
        }
    }
}

async fn run(
    listener: TcpListener,
    shared: Arc<Shared>,
    mut beats: Beats,
    mut stopped: oneshot::Receiver<()>,
) -> std::io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let router = Router::new()
        .route("/", get(root))
        .route("/live", get(live))
        .merge(page::files())
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), admit))
        .with_state(shared);
    let serving = tokio::spawn(connections::serve(listener, router, LIMITS));
    let mut beat = tokio::time::interval(BEAT);
    // A late beat takes all that has come, so beats to catch up would have nothing to send.
    beat.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        tokio::select! {
            _ = beat.tick() => beats.beat(),
            _ = &mut stopped => break,
        }
    }
    // The viewers get the end of the run before the connections are closed.
    beats.end();
    tokio::time::sleep(FAREWELL).await;
    serving.abort();
    Ok(())
}

/// Headers that state what a browser may do with an answer of this server, refusals included: all that the page needs,
/// and nothing that another site could use.
const HEADERS: [(&str, &str); 10] = [
    (
        "content-security-policy",
        "default-src 'self'; style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; \
         object-src 'none'",
    ),
    ("cross-origin-embedder-policy", "require-corp"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    (
        "permissions-policy",
        "accelerometer=(), camera=(), display-capture=(), geolocation=(), gyroscope=(), hid=(), magnetometer=(), microphone=(), \
         midi=(), payment=(), serial=(), usb=()",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("x-permitted-cross-domain-policies", "none"),
    ("referrer-policy", "no-referrer"),
    ("cache-control", "no-store"),
];

/// Refuses requests that are not permitted, and sets what a browser may do with the answer.
async fn admit(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let mut response = match shared.origins.admit(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refused) => (refused.status(), format!("{refused}\n")).into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// A WebSocket that reserves no more memory for what a viewer sends than it may send.
fn bounded(upgrade: WebSocketUpgrade) -> WebSocketUpgrade {
    upgrade.max_message_size(LONGEST).max_frame_size(LONGEST).read_buffer_size(LONGEST)
}

/// The page; or the Foxglove stream, if a client asks for a WebSocket here.
async fn root(
    State(shared): State<Arc<Shared>>,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
) -> Response {
    let Ok(upgrade) = upgrade else { return page::index() };
    let upgrade = upgrade.protocols(foxglove::SUBPROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let names = foxglove::SUBPROTOCOLS.join(" or ");
        return (StatusCode::BAD_REQUEST, format!("the WebSocket has no known subprotocol: expected {names}\n"))
            .into_response();
    }
    match viewer::Counted::new(&shared, VIEWERS) {
        Some(counted) => bounded(upgrade).on_upgrade(|socket| viewer::stream(socket, counted)),
        None => crowded(),
    }
}

/// The updates of the page.
async fn live(State(shared): State<Arc<Shared>>, upgrade: WebSocketUpgrade) -> Response {
    match viewer::Counted::new(&shared, VIEWERS) {
        Some(counted) => bounded(upgrade).on_upgrade(|socket| viewer::view(socket, counted)),
        None => crowded(),
    }
}

fn crowded() -> Response {
    (StatusCode::SERVICE_UNAVAILABLE, format!("at most {VIEWERS} viewers at once\n")).into_response()
}

/// The work done thirty times a second.
struct Beats {
    shared: Arc<Shared>,
    branches: Option<Branches>,
    range_hz: Option<(f64, f64)>,
    stream: Stream,
    count: u64,
    is_over: Arc<AtomicBool>,
}

impl Beats {
    /// Takes new data, and sends them to all viewers.
    fn beat(&mut self) {
        self.count += 1;
        // Before the records are taken, so that those of the run's end are among them.
        let is_over = self.is_over.load(Ordering::Acquire);
        let shared = &self.shared;
        let mut model = lock(&shared.model);
        let mut source = lock(&shared.source);
        // Messages for Foxglove are made only while a client is connected.
        let is_wanted = shared.published.receiver_count() > 0;
        source.drain(&mut model, is_wanted.then_some(&mut self.stream));
        if let Some(branches) = &mut self.branches {
            let responses = model.response_range_hz();
            let both = responses.into_iter().chain(self.range_hz);
            let range_hz = both.reduce(|(low, high), (from, to)| (low.min(from), high.max(to)));
            range_hz.into_iter().for_each(|range_hz| branches.want(range_hz));
            branches.computed().into_iter().for_each(|branch| model.branch(branch));
        }
        if is_over {
            model.end();
        }
        let lost_updates = shared.lost_updates.load(Ordering::Relaxed);
        let viewers = shared.viewers.load(Ordering::Relaxed);
        source.viewed(viewers);
        let messages = model.take(source.lost(), lost_updates, viewers);
        let is_slow = self.count.is_multiple_of(SPECTRUM_BEATS);
        // Without a viewer as well: later ones see the whole sweep.
        let test = is_slow.then(|| model.test()).flatten();
        if shared.updates.receiver_count() > 0 {
            let spectra = is_slow.then(|| model.spectra()).flatten();
            // Having no viewers is not an error.
            messages.into_iter().chain(spectra).chain(test).for_each(|message| drop(shared.updates.send(message)));
        }
        let published = if is_wanted { self.stream.take() } else { Vec::new() };
        if !published.is_empty() {
            let _nobody = shared.published.send(Arc::new(published));
        }
    }

    /// Sends the end of the run.
    fn end(&mut self) {
        self.beat();
        // The beat before has taken the last records; the one after sends the end behind them.
        lock(&self.shared.model).end();
        self.beat();
    }
}
