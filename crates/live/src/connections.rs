//! The connections of the server: how many at once, and how long each may last. A client that connects and
//! sends or reads nothing does not block others for long.

use core::time::Duration;
use std::io;
use std::sync::Arc;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};

/// Bytes that the system buffers for a viewer: about a second of updates.
const HELD_BYTES: usize = 1 << 16;
/// Most bytes of the head of a request, and of an answer that waits to be sent: less than hyper's 400 kB each.
const BUFFERED_BYTES: usize = 1 << 16;
/// Time to wait if the system has no file descriptor for another connection.
const RETRY: Duration = Duration::from_secs(1);

/// Limits of connections that are not, or not yet, a viewer's.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Number of connections at once; others wait until one of them ends.
    pub connections: usize,
    /// Time that the head of a request may take, from the opening of the connection or the previous answer.
    pub head: Duration,
    /// Time that a connection may last. A WebSocket may last forever.
    pub whole: Duration,
}

/// Limits that a browser at the far end of a slow tunnel meets.
pub const LIMITS: Limits = Limits { connections: 64, head: Duration::from_secs(5), whole: Duration::from_secs(60) };

/// Accepts connections and answers their requests, forever.
pub async fn serve(listener: TcpListener, router: Router, limits: Limits) {
    let free = Arc::new(Semaphore::new(limits.connections));
    // The semaphore is never closed.
    while let Ok(permit) = Arc::clone(&free).acquire_owned().await {
        // The permit comes first: beyond the limit clients wait in the system's queue and cost nothing here.
        match listener.accept().await {
            Ok((stream, _from)) => {
                prepare(&stream);
                tokio::spawn(answer(stream, router.clone(), limits, permit));
            }
            // The client left before it was accepted.
            Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => {}
            Err(error) => {
                tracing::warn!("the live view can't accept a connection: {error}");
                sleep(RETRY).await;
            }
        }
    }
}

/// Answers the requests of a connection until one asks for a WebSocket (whose task takes over the connection), the
/// client leaves, or a limit is reached.
async fn answer(stream: TcpStream, router: Router, limits: Limits, _permit: OwnedSemaphorePermit) {
    let service = TowerToHyperService::new(router);
    let answering = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.head)
        .max_buf_size(BUFFERED_BYTES)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    // An upgrade to a WebSocket ends this future, and with it the permit: viewers have a limit of their own.
    match timeout(limits.whole, answering).await {
        Ok(Ok(())) => {}
        Ok(Err(error)) => tracing::debug!("a connection of the live view: {error}"),
        Err(_elapsed) => tracing::debug!("a connection of the live view has lasted {:?}", limits.whole),
    }
}

/// Makes the system buffer little of what a viewer does not read, so that a slow viewer is noticed, and send new data
/// at once. If that fails, the connection works all the same.
fn prepare(stream: &TcpStream) {
    let held = rustix::net::sockopt::set_socket_send_buffer_size(stream, HELD_BYTES);
    if let Err(error) = held.map_err(io::Error::from).and_then(|()| stream.set_nodelay(true)) {
        tracing::debug!("a connection of the live view: {error}");
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::SocketAddr;

    use axum::routing::get;

    use super::*;

    /// One connection at once, and short times.
    const SHORT: Limits =
        Limits { connections: 1, head: Duration::from_millis(100), whole: Duration::from_millis(400) };
    /// More than the system buffers for a connection at both of its ends.
    const LONG_BYTES: usize = 1 << 24;

    /// Serves a short and a long answer while `work` runs.
    fn served(work: impl FnOnce(SocketAddr) + Send + 'static) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
            let address = listener.local_addr().unwrap();
            let router = Router::new().route("/", get("here")).route("/long", get("x".repeat(LONG_BYTES)));
            let client = tokio::task::spawn_blocking(move || work(address));
            tokio::select! {
                () = serve(listener, router, SHORT) => panic!("it has no end"),
                ended = client => ended.unwrap(),
            }
        });
    }

    fn connected(address: SocketAddr, sent: &str) -> std::net::TcpStream {
        let mut stream = std::net::TcpStream::connect(address).unwrap();
        stream.write_all(sent.as_bytes()).unwrap();
        stream
    }

    fn all_of(mut stream: std::net::TcpStream) -> Vec<u8> {
        let mut bytes = Vec::new();
        // A connection that is cut may end in a reset.
        let _reset = stream.read_to_end(&mut bytes);
        bytes
    }

    #[test]
    fn a_client_that_sends_no_whole_request_is_dropped_and_others_get_their_answer() {
        served(|address| {
            let slow: Vec<_> =
                ["", "GET / HT", "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"].map(|half| connected(address, half)).into();
            let answer = all_of(connected(address, "GET / HTTP/1.0\r\n\r\n"));
            assert!(answer.ends_with(b"here"), "{}", String::from_utf8_lossy(&answer));
            slow.into_iter().for_each(|stream| assert_eq!(all_of(stream), b""));
        });
    }

    #[test]
    fn a_client_that_does_not_read_the_answer_is_dropped() {
        served(|address| {
            let long = connected(address, "GET /long HTTP/1.0\r\n\r\n");
            let answer = all_of(connected(address, "GET / HTTP/1.0\r\n\r\n"));
            assert!(answer.ends_with(b"here"), "{}", String::from_utf8_lossy(&answer));
            assert!(all_of(long).len() < LONG_BYTES);
        });
    }
}
