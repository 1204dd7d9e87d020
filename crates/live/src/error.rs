//! Errors of the live view.

use std::io;
use std::net::SocketAddr;

use thiserror::Error;

/// Error of starting the live view.
#[derive(Debug, Error)]
pub enum LiveError {
    /// The address can't be listened on.
    #[error("--live can't listen on {address}: {source}; {fix}", fix = fix(source))]
    Listen {
        /// Address on which the server was to listen.
        address: SocketAddr,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The text is not an address.
    #[error("--live is `{got}`: expected an address such as 127.0.0.1, 127.0.0.1:8080 or [::1]:8080")]
    Address {
        /// Text that is not an address.
        got: String,
    },
    /// The text is not an origin.
    #[error("--live-origin is `{got}`: expected an origin such as https://app.foxglove.dev or http://bench:8080")]
    Origin {
        /// Text that is not an origin.
        got: String,
    },
    /// The system gives no random numbers for the token.
    #[error("can't get random numbers for the token of the live view: {0}")]
    Random(io::Error),
    /// The thread can't be started.
    #[error("can't start the thread of the live view: {0}")]
    Thread(io::Error),
}

fn fix(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::AddrInUse => "another program uses this port: give another port, or leave it out for a free one",
        io::ErrorKind::AddrNotAvailable => "give an address of this machine: `ip address` lists them",
        io::ErrorKind::PermissionDenied => "ports below 1024 need root: give one from 1024 on",
        _ => "give another address",
    }
}
