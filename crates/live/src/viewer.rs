//! A viewer: a browser with the page, or a client of the Foxglove stream.
//!
//! Messages are made once and shared by all. A viewer that is too slow loses some, which are counted, and gets
//! everything again; one that takes none for seconds is dropped.

use core::time::Duration;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::extract::ws::{Message, WebSocket};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;

use super::foxglove::{self, Published, Subscriptions};
use super::message::{PageMessage, PageRequest};
use super::model::text;
use super::shared::{Shared, lock};

/// Time that a viewer may take to receive a message.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time that a viewer may take to receive all that is kept of the run.
const GREETING: Duration = Duration::from_secs(30);
/// A viewer is dropped after this many invalid messages.
const NONSENSE: u32 = 16;

/// A viewer, counted while it is connected.
pub struct Counted {
    shared: Arc<Shared>,
}

impl Counted {
    /// Counts one more, if there are fewer than `most`.
    pub fn new(shared: &Arc<Shared>, most: usize) -> Option<Counted> {
        // Made before the comparison: if there are too many, dropping it takes the count back.
        let counted = Counted { shared: Arc::clone(shared) };
        (shared.viewers.fetch_add(1, Ordering::Relaxed) < most).then_some(counted)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.shared.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Reason why a viewer is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LetGo {
    /// The viewer has left, or sends only nonsense.
    Gone,
    /// The viewer does not receive messages fast enough.
    TooSlow,
}

/// Sends messages one after the other; each must be received within [`PATIENCE`].
async fn send(socket: &mut WebSocket, messages: impl IntoIterator<Item = Message>) -> Result<(), LetGo> {
    for message in messages {
        match tokio::time::timeout(PATIENCE, socket.send(message)).await {
            Ok(sent) => sent.map_err(|_closed| LetGo::Gone)?,
            Err(_elapsed) => return Err(LetGo::TooSlow),
        }
    }
    Ok(())
}

/// Sends messages to a page, and answers its requests.
pub async fn view(mut socket: WebSocket, counted: Counted) {
    let shared = &counted.shared;
    let mut nonsense = 0;
    loop {
        // The semaphore is never closed.
        let turn = shared.greetings.acquire().await;
        let (introduction, mut updates) = {
            // Subscribed while both are locked: an update in between would be in neither the introduction nor the
            // updates.
            let model = lock(&shared.model);
            let source = lock(&shared.source);
            (model.introduction(source.lost()), shared.updates.subscribe())
        };
        let greeted = tokio::time::timeout(GREETING, send(&mut socket, introduction)).await;
        // The turn is for the introduction alone. Updates are made once for all viewers.
        drop(turn);
        let outcome = match greeted.unwrap_or(Err(LetGo::TooSlow)) {
            Ok(()) => send_updates(&mut socket, shared, &mut updates, &mut nonsense).await,
            Err(let_go) => Err(let_go),
        };
        // A viewer that has lost updates is greeted anew: with everything that is kept there is no gap.
        let lost = match outcome {
            Ok(lost) => lost,
            // What still waits for it will not be sent.
            Err(LetGo::TooSlow) => updates.len() as u64,
            Err(LetGo::Gone) => 0,
        };
        shared.lost_updates.fetch_add(lost, Ordering::Relaxed);
        if outcome.is_err() {
            return;
        }
    }
}

/// Sends updates to a page until it has lost some; returns how many.
async fn send_updates(
    socket: &mut WebSocket,
    shared: &Shared,
    updates: &mut Receiver<Message>,
    nonsense: &mut u32,
) -> Result<u64, LetGo> {
    loop {
        let message = tokio::select! {
            update = updates.recv() => match update {
                Ok(message) => Some(message),
                Err(RecvError::Lagged(lost)) => return Ok(lost),
                Err(RecvError::Closed) => return Err(LetGo::Gone),
            },
            received = socket.recv() => match received {
                Some(Ok(Message::Text(asked))) => answer(shared, &asked, nonsense),
                Some(Ok(Message::Binary(_))) => refuse("a request must be a text message, got a binary one", nonsense),
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => None,
                Some(Ok(Message::Close(_)) | Err(_)) | None => return Err(LetGo::Gone),
            },
        };
        send(socket, message).await?;
        if *nonsense > NONSENSE {
            return Err(LetGo::Gone);
        }
    }
}

/// Passes a request on, if it is permitted.
fn answer(shared: &Shared, asked: &str, nonsense: &mut u32) -> Option<Message> {
    let PageRequest { token, request } = match serde_json::from_str(asked) {
        Ok(asked) => asked,
        Err(error) => return refuse(&format!("this is not a request: {error}"), nonsense),
    };
    if !shared.token.is(&token) {
        return refuse("the token is wrong: open the page by the address that the terminal shows", nonsense);
    }
    let order = request.order(&lock(&shared.model).about);
    match order.and_then(|order| lock(&shared.source).order(order)) {
        Ok(()) => text(&PageMessage::Taken),
        // Not nonsense: it has the token, and may ask for what is impossible just now.
        Err(why) => text(&PageMessage::Refused { why: &why }),
    }
}

fn refuse(why: &str, nonsense: &mut u32) -> Option<Message> {
    *nonsense += 1;
    text(&PageMessage::Refused { why })
}

/// Sends a Foxglove client what it has subscribed to of a batch. Each frame is made when it is sent, so that a client with
/// many subscriptions of one channel takes no more memory than another.
async fn send_frames(socket: &mut WebSocket, batch: &[Published], subscriptions: &Subscriptions) -> Result<(), LetGo> {
    for message in batch {
        for frame in subscriptions.frames(message) {
            send(socket, [frame]).await?;
        }
    }
    Ok(())
}

/// Sends a Foxglove client the messages it has subscribed to.
pub async fn stream(mut socket: WebSocket, counted: Counted) {
    let shared = &counted.shared;
    let introduction = foxglove::introduction(&lock(&shared.model), &shared.channels, &shared.session);
    let mut published = shared.published.subscribe();
    let mut subscriptions = Subscriptions::new(shared.channels.len());
    let mut nonsense = 0;
    if send(&mut socket, introduction).await.is_err() {
        return;
    }
    loop {
        let sent = tokio::select! {
            batch = published.recv() => match batch {
                Ok(batch) => send_frames(&mut socket, &batch, &subscriptions).await,
                Err(RecvError::Lagged(lost)) => {
                    // Each message stands for itself, so the client continues with the next ones.
                    shared.lost_updates.fetch_add(lost, Ordering::Relaxed);
                    continue;
                }
                Err(RecvError::Closed) => return,
            },
            received = socket.recv() => {
                let answer = match received {
                    Some(Ok(Message::Text(text))) => subscriptions.receive(&text),
                    Some(Ok(Message::Binary(_))) => Some(foxglove::status("resonarm accepts only text messages, got a binary one")),
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => None,
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                };
                nonsense += u32::from(answer.is_some());
                send(&mut socket, answer).await
            },
        };
        if sent == Err(LetGo::TooSlow) {
            shared.lost_updates.fetch_add(published.len() as u64, Ordering::Relaxed);
        }
        if nonsense > NONSENSE || sent.is_err() {
            return;
        }
    }
}
