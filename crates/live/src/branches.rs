//! The computed branch, on its own thread of the lowest priority.

use std::sync::mpsc;
use std::thread;

use super::message::BranchLines;
use crate::error::LiveError;

/// Computes the branch from the lowest to the highest of these frequencies, Hz, and a little beyond; `None` if it can't
/// be traced.
pub type ComputeBranch = Box<dyn Fn(f64, f64) -> Option<BranchLines> + Send>;

/// Reduction of the thread's share of processor time against others (nice(2)): the least share.
const NICE: i32 = 19;

/// Asks for branches as the responses spread.
pub struct Branches {
    wanted: mpsc::Sender<(f64, f64)>,
    computed: mpsc::Receiver<BranchLines>,
    /// The range requested last.
    asked_hz: Option<(f64, f64)>,
}

impl Branches {
    /// Starts the thread that computes branches.
    ///
    /// # Errors
    /// [`LiveError::Thread`] if it can't be started.
    pub fn start(compute: ComputeBranch) -> Result<Branches, LiveError> {
        let (wanted, asked) = mpsc::channel();
        let (done, computed) = mpsc::channel();
        thread::Builder::new()
            .name(String::from("live-branch"))
            .spawn(move || {
                lower_priority(NICE);
                while let Ok(first) = asked.recv() {
                    // The last range requested is the widest.
                    let (low_hz, high_hz) = asked.try_iter().last().unwrap_or(first);
                    // An error of `send` means that the view has gone. A branch that can't be traced leaves the one
                    // before on the page.
                    if compute(low_hz, high_hz).is_some_and(|branch| done.send(branch).is_err()) {
                        break;
                    }
                }
            })
            .map_err(LiveError::Thread)?;
        Ok(Branches { wanted, computed, asked_hz: None })
    }

    /// Asks for a branch over these frequencies, unless one that covers them was requested before.
    pub fn want(&mut self, (low_hz, high_hz): (f64, f64)) {
        let holds = |(from_hz, to_hz): (f64, f64)| from_hz <= low_hz && high_hz <= to_hz;
        if !self.asked_hz.is_some_and(holds) {
            self.asked_hz = Some((low_hz, high_hz));
            // A thread that has ended computes no more.
            let _ended = self.wanted.send((low_hz, high_hz));
        }
    }

    /// The newest branch computed since the last call.
    pub fn computed(&self) -> Option<BranchLines> {
        self.computed.try_iter().last()
    }
}

/// Gives the calling thread less processor time than others. If that fails, the thread works all the same.
pub fn lower_priority(nice: i32) {
    if let Err(error) = rustix::process::nice(nice) {
        tracing::debug!("can't lower the priority of a thread of the live view: {error}");
    }
}
