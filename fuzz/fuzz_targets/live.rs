//! Any bytes from a client of the live view: the server answers or closes the connection, and serves the next client.
//!
//! The first byte of the input chooses what the client does: it sends the rest as a request, or as bytes after a WebSocket
//! of the page or of Foxglove was opened, or in one text frame there. With `-malloc_limit_mb=8` a frame may not reserve
//! more memory than a viewer may send.
#![no_main]

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::LazyLock;
use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use resonarm::recording::channels::Channels;
use resonarm::run::{Watch, watch};
use resonarm::scenario::Scenario;
use resonarm_live::{About, Live, Model, Options, Origins, Shown, Source, UnderTest, serve};

/// Longer than a busy machine keeps the server from its turn.
const PATIENCE: Duration = Duration::from_secs(20);

/// A server of a run that has not begun.
static SERVER: LazyLock<(Live, Watch)> = LazyLock::new(|| {
    let scenario = Scenario::default();
    let under_test = UnderTest::new(&scenario, String::from("arm"), Channels::arm(false)).expect("what is under test");
    let about = About::new("plant", String::from("fuzz"), &scenario, &under_test);
    let (watched, watcher) = watch();
    let shown = Shown {
        interface: String::from("fuzz"),
        drawing: under_test.drawing.clone(),
        model: Model::new(about, under_test),
        source: Source::Run(watcher),
        compute: None,
        range_hz: None,
        start_unix_ns: 0,
    };
    let options = Options { address: ([127, 0, 0, 1], 0).into(), origins: Origins::default() };
    (serve(&options, shown).expect("a server"), watched)
});

/// A request for a WebSocket.
fn upgrade(path: &str, more: &str) -> Vec<u8> {
    format!(
        "GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n{more}\r\n"
    )
    .into_bytes()
}

/// A text frame with a mask of zeros (RFC 6455, section 5.2).
fn text_frame(text: &[u8]) -> Vec<u8> {
    let length = text.len() as u16;
    let mut frame = vec![0x81];
    match length {
        0..126 => frame.push(0x80 | length as u8),
        _ => {
            frame.push(0xFE);
            frame.extend(length.to_be_bytes());
        }
    }
    [&frame[..], &[0; 4], text].concat()
}

/// Sends bytes, and reads until the server closes the connection.
fn told(sent: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(SERVER.0.address()).expect("a connection");
    stream.set_read_timeout(Some(PATIENCE)).expect("a time limit");
    // A server that has closed the connection may reset it.
    let _ = stream.write_all(sent).and_then(|()| stream.shutdown(Shutdown::Write));
    let mut answer = Vec::new();
    if let Err(error) = stream.read_to_end(&mut answer) {
        assert!(!matches!(error.kind(), std::io::ErrorKind::WouldBlock), "the server does not close the connection");
    }
    answer
}

fuzz_target!(|input: &[u8]| {
    let Some((&first, rest)) = input.split_first() else { return };
    // `text_frame` writes the length in 16 bits.
    let rest = &rest[..rest.len().min(60_000)];
    let foxglove = "Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n";
    let sent = match first % 5 {
        0 => rest.to_vec(),
        1 => [upgrade("/live", ""), rest.to_vec()].concat(),
        2 => [upgrade("/", foxglove), rest.to_vec()].concat(),
        3 => [upgrade("/live", ""), text_frame(rest)].concat(),
        _ => [upgrade("/", foxglove), text_frame(rest)].concat(),
    };
    told(&sent);
    let page = told(b"GET / HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n");
    assert!(page.starts_with(b"HTTP/1.0 200"), "{}", String::from_utf8_lossy(&page));
});
