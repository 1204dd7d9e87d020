//! A bus in real time, as the cases use it.

use core::time::Duration;

use super::case::Case;
use super::evidence::Evidence;
use super::finding::Finding;
use super::inject::{Controller, Process};
use super::wire::{BusOff, Stopped, Wire};
use resonarm_bus::{Bus, BusError, Received, Sent};
use resonarm_protocol::Frame;
use resonarm_realtime::{Clock, SystemClock};

/// A bus in real time.
pub struct BusWire<'b> {
    bus: &'b mut dyn Bus,
    clock: SystemClock,
    /// Records the frames, if wanted.
    pub evidence: Option<Evidence>,
    /// The controller of the interface, if it is a virtual one.
    controller: Option<Controller>,
    /// The process of the node under test, if known.
    process: Option<Process>,
    /// Whether this end has yet to receive its own bus-off.
    has_gone_off: bool,
}

impl<'b> BusWire<'b> {
    /// The end of a bus, with the monotonic clock.
    pub fn new(bus: &'b mut dyn Bus, evidence: Option<Evidence>) -> BusWire<'b> {
        BusWire { bus, clock: SystemClock, evidence, controller: None, process: None, has_gone_off: false }
    }

    /// With the name of the interface, on which error frames are sent if it is virtual, and the process of the node
    /// under test, if known, which is stopped and resumed.
    pub fn with_means(self, interface: Option<&str>, pid: Option<rustix::process::Pid>) -> BusWire<'b> {
        BusWire { controller: interface.and_then(Controller::of), process: pid.map(Process::new), ..self }
    }

    /// Restarts the controller and resumes the process when it is time. A process that has ended is ignored: the cases
    /// find the node missing.
    fn undo(&mut self) {
        let now_ns = self.now_ns();
        if let Some(process) = self.process.as_mut().filter(|p| p.resumes_at_ns.is_some_and(|at_ns| at_ns <= now_ns)) {
            drop(process.resume());
        }
        if let Some(controller) = self.controller.as_mut().filter(|c| c.on_at_ns.is_some_and(|at_ns| at_ns <= now_ns)) {
            drop(controller.restart());
        }
    }

    /// The next frame, except this end's own error frames.
    fn next(&mut self) -> Result<Option<Received>, BusError> {
        match self.bus.receive() {
            Err(BusError::BusOff { .. }) if self.has_gone_off => {
                self.has_gone_off = false;
                self.bus.receive()
            }
            received => received,
        }
    }

    /// Records the beginning of a case.
    pub fn begin<S>(&mut self, case: &Case<S>) {
        if let Some(evidence) = &mut self.evidence {
            evidence.begin(case);
        }
    }

    /// Records the end of a case.
    pub fn end<S>(&mut self, case: &Case<S>, finding: &Finding) {
        if let Some(evidence) = &mut self.evidence {
            evidence.end(case, finding);
        }
    }
}

/// Time to wait for space in a full transmit queue, ns.
const FULL_NS: u64 = 100_000_000;

impl Wire for BusWire<'_> {
    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let give_up_ns = self.now_ns() + FULL_NS;
        // A frame that can't be sent is lost, as on any bus: the cases notice the effect.
        while self.bus.send(frame)? == Sent::QueueFull {
            if self.now_ns() >= give_up_ns {
                return Ok(());
            }
            self.clock.sleep_until_ns(self.now_ns() + 1_000_000);
        }
        if let Some(evidence) = &mut self.evidence {
            evidence.sent(frame);
        }
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Frame>, BusError> {
        loop {
            self.undo();
            if let Some(received) = self.next()? {
                if let Some(evidence) = &mut self.evidence {
                    evidence.received(received);
                }
                return Ok(Some(received.frame));
            }
            let left_ns = until_ns.saturating_sub(self.now_ns());
            if left_ns == 0 {
                return Ok(None);
            }
            self.bus.wait(Duration::from_nanos(left_ns))?;
        }
    }

    fn take_off(&mut self, for_ns: u64) -> BusOff {
        let until_ns = self.now_ns() + for_ns;
        match self.controller.as_mut().map(|controller| controller.go_off(until_ns)) {
            Some(Ok(())) => {
                self.has_gone_off = true;
                BusOff::Done
            }
            Some(Err(_)) | None => BusOff::Impossible,
        }
    }

    fn stop_node(&mut self, for_ns: u64) -> Stopped {
        let until_ns = self.now_ns() + for_ns;
        match self.process.as_mut().map(|process| process.stop(until_ns)) {
            Some(Ok(())) => Stopped::Done,
            Some(Err(error)) => Stopped::Impossible(format!("its process can't be stopped: {error}")),
            None => Stopped::Impossible(String::from("its process is not known (--pid)")),
        }
    }
}
