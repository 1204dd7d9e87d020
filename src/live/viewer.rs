//! A viewer: a browser with the page, or a client of the Foxglove stream.
//!
//! Messages are made once and shared by all. Who is too slow for them loses some, which is counted, and is told
//! everything anew; who takes none for seconds is let go.

use core::time::Duration;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::extract::ws::{Message, WebSocket};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;

use super::foxglove::{self, Subscriptions};
use super::message::{Asked, Told};
use super::model::text;
use super::server::{Shared, lock};

/// How long a viewer may take for a message.
const PATIENCE: Duration = Duration::from_secs(10);
/// Messages without sense after which a viewer is let go.
const NONSENSE: u32 = 16;

/// A viewer, counted as long as it is there.
pub struct Counted {
    shared: Arc<Shared>,
}

impl Counted {
    /// Counts one more, if there are less than `most`.
    pub fn new(shared: &Arc<Shared>, most: usize) -> Option<Counted> {
        let counted = Counted { shared: Arc::clone(shared) };
        (shared.viewers.fetch_add(1, Ordering::Relaxed) < most).then_some(counted)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.shared.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Why a viewer is told no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LetGo {
    /// It has left, or says nothing that makes sense.
    Gone,
    /// It takes nothing.
    TooSlow,
}

/// Sends messages, one after the other.
async fn send(socket: &mut WebSocket, messages: impl IntoIterator<Item = Message>) -> Result<(), LetGo> {
    for message in messages {
        match tokio::time::timeout(PATIENCE, socket.send(message)).await {
            Ok(sent) => sent.map_err(|_closed| LetGo::Gone)?,
            Err(_elapsed) => return Err(LetGo::TooSlow),
        }
    }
    Ok(())
}

/// Tells a page what happens, and takes what it asks for.
pub async fn view(mut socket: WebSocket, counted: Counted) {
    let shared = &counted.shared;
    let mut nonsense = 0;
    loop {
        let (introduction, mut updates) = {
            let (model, source) = (lock(&shared.model), lock(&shared.source));
            (model.introduction(source.lost()), shared.updates.subscribe())
        };
        let told = match send(&mut socket, introduction).await {
            Ok(()) => tell(&mut socket, shared, &mut updates, &mut nonsense).await,
            Err(let_go) => Err(let_go),
        };
        let lost = match told {
            Ok(lost) => lost,
            Err(LetGo::TooSlow) => updates.len() as u64,
            Err(LetGo::Gone) => 0,
        };
        shared.lost_updates.fetch_add(lost, Ordering::Relaxed);
        if told.is_err() {
            return;
        }
    }
}

/// Tells a page the updates until it has lost some: how many.
async fn tell(
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
            said = socket.recv() => match said {
                Some(Ok(Message::Text(asked))) => answer(shared, &asked, nonsense),
                Some(Ok(Message::Binary(_))) => refuse("a request is text", nonsense),
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

/// Hands a request on, if it may be made.
fn answer(shared: &Shared, asked: &str, nonsense: &mut u32) -> Option<Message> {
    let Asked { token, request } = match serde_json::from_str(asked) {
        Ok(asked) => asked,
        Err(error) => return refuse(&format!("that is no request: {error}"), nonsense),
    };
    if !shared.token.is(&token) {
        return refuse("the token is wrong: open the page by the address that the terminal shows", nonsense);
    }
    let order = request.order(lock(&shared.model).about());
    match order.and_then(|order| lock(&shared.source).order(order)) {
        Ok(()) => text(&Told::Taken),
        Err(why) => text(&Told::Refused { why: &why }),
    }
}

fn refuse(why: &str, nonsense: &mut u32) -> Option<Message> {
    *nonsense += 1;
    text(&Told::Refused { why })
}

/// Tells a Foxglove client what it has subscribed to.
pub async fn stream(mut socket: WebSocket, counted: Counted) {
    let shared = &counted.shared;
    let introduction =
        foxglove::introduction(lock(&shared.model).about(), shared.channels, &shared.table, &shared.session);
    let mut published = shared.published.subscribe();
    let (mut subscriptions, mut nonsense) = (Subscriptions::new(shared.channels), 0);
    if send(&mut socket, introduction).await.is_err() {
        return;
    }
    loop {
        let messages = tokio::select! {
            batch = published.recv() => match batch {
                Ok(batch) => batch.iter().flat_map(|message| subscriptions.frames(message)).collect(),
                Err(RecvError::Lagged(lost)) => {
                    shared.lost_updates.fetch_add(lost, Ordering::Relaxed);
                    continue;
                }
                Err(RecvError::Closed) => return,
            },
            said = socket.recv() => {
                let answer = match said {
                    Some(Ok(Message::Text(said))) => subscriptions.said(&said),
                    Some(Ok(Message::Binary(_))) => Some(foxglove::status("resonarm takes no binary messages")),
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => None,
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                };
                nonsense += u32::from(answer.is_some());
                Vec::from_iter(answer)
            },
        };
        let sent = send(&mut socket, messages).await;
        if sent == Err(LetGo::TooSlow) {
            shared.lost_updates.fetch_add(published.len() as u64, Ordering::Relaxed);
        }
        if nonsense > NONSENSE || sent.is_err() {
            return;
        }
    }
}
