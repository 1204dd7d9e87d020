//! Both ends of a bus for a host that keeps the time and carries the frames: a simulation tool in which they are FMUs.
//!
//! The host does the work of the loop of [`free`](super::Mode::Free), in the same order, so that the states are
//! bit-identical:
//!
//! ```text
//! start, exchange at 0; measure sample 0, exchange;  then for each sample: advance, measure, exchange at its time
//! between samples, when a frame comes: take, exchange at its time
//! ```

use std::collections::VecDeque;

use core::time::Duration;

use super::bench::Bench;
use super::error::RunError;
use super::session::Session;
use resonarm_bench::control::ResponsePoint;
use resonarm_bench::node::{ExciterInterface, PlantInterface};
use resonarm_bench::plant::Plant;
use resonarm_bus::{Bus, BusError, Filter, Received, Sent, Statistics};
use resonarm_files::recording::Record;
use resonarm_protocol::Frame;
use resonarm_realtime::SampleRate;

/// An end of a bus whose other end is the host.
#[derive(Clone, Debug, Default)]
pub struct HostPort {
    /// Frames for the host to fetch.
    outgoing: Vec<Frame>,
    /// Frames from the host.
    incoming: VecDeque<Frame>,
    /// Whether the host reports that the node's controller is bus-off.
    is_off: bool,
    statistics: Statistics,
}

impl HostPort {
    /// Takes a frame from the host, which the next exchange reads.
    pub fn take(&mut self, frame: Frame) {
        self.incoming.push_back(frame);
    }

    /// Sets whether the node's controller is bus-off.
    pub fn set_bus_off(&mut self, is_off: bool) {
        self.is_off = is_off;
    }

    /// Returns the frames that were sent since the last call.
    pub fn sent(&mut self) -> Vec<Frame> {
        core::mem::take(&mut self.outgoing)
    }

    fn bus_off(&self) -> BusError {
        BusError::BusOff { interface: self.name() }
    }
}

impl Bus for HostPort {
    fn name(&self) -> String {
        String::from("host")
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        if self.is_off {
            return Err(self.bus_off());
        }
        self.outgoing.push(*frame);
        self.statistics.sent += 1;
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        // Frames that came in before the controller went off are still read, as from a kernel's queue.
        let Some(frame) = self.incoming.pop_front() else {
            return if self.is_off { Err(self.bus_off()) } else { Ok(None) };
        };
        self.statistics.received += 1;
        Ok(Some(Received { frame, timestamp_ns: None }))
    }

    fn wait(&mut self, _timeout: Duration) -> Result<bool, BusError> {
        Ok(!self.incoming.is_empty())
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        self.statistics
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// The plant's node on a host's bus. Times are in ns from the start of the simulation and don't decrease.
pub struct HostedPlant {
    bench: Bench<'static>,
    /// End of the bus.
    pub port: HostPort,
    /// Sample rate, which gives the time of each sample.
    rate: SampleRate,
}

impl Clone for HostedPlant {
    fn clone(&self) -> HostedPlant {
        HostedPlant { bench: self.bench.unwatched_copy(), port: self.port.clone(), rate: self.rate }
    }
}

impl core::fmt::Debug for HostedPlant {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("HostedPlant").field("sample", &self.bench.sample()).finish_non_exhaustive()
    }
}

impl Session {
    /// Makes the plant's node for a host, at sample 0 and not yet started. It keeps its records.
    ///
    /// # Errors
    /// [`RunError`] if the scenario has no such node.
    pub fn hosted_plant(&self) -> Result<HostedPlant, RunError> {
        Ok(HostedPlant { bench: self.hosted_bench()?, port: HostPort::default(), rate: self.rate })
    }

    /// Makes the exciter's node with its controller for a host, not yet started. It is made for the plant of the same
    /// scenario: unless `network.plant_converter` states another converter, it corrects readings for `rig.converter`.
    ///
    /// # Errors
    /// [`RunError`] if the scenario has no such node, or no controller.
    pub fn hosted_exciter(&self) -> Result<HostedExciter, RunError> {
        let converter = self.scenario.network.plant_converter.unwrap_or(self.scenario.rig.converter);
        let node = self.exciter_node(converter)?;
        Ok(HostedExciter { node, port: HostPort::default(), responses: Vec::new() })
    }
}

impl HostedPlant {
    /// Boots the node, at time 0.
    pub fn start(&mut self) {
        self.bench.start(0, 0);
    }

    /// Measures and publishes the plant's current sample: sample 0.
    ///
    /// # Errors
    /// [`RunError::Encode`] if it can't be published.
    pub fn measure(&mut self) -> Result<(), RunError> {
        self.bench.measure()
    }

    /// Returns the time of the next sample, ns.
    pub fn due_ns(&self) -> u64 {
        self.rate.offset_ns(self.bench.sample() + 1)
    }

    /// Advances to the next sample with the load that is held, and measures it.
    ///
    /// # Errors
    /// [`RunError::Plant`] if it can't be advanced, [`RunError::Encode`] if the sample can't be published.
    pub fn next_sample(&mut self) -> Result<(), RunError> {
        self.bench.advance(self.due_ns())?;
        self.bench.measure()
    }

    /// Reads incoming frames, does the work that is due, and sends.
    ///
    /// # Errors
    /// [`RunError::Bus`] if the bus is off for too long.
    pub fn exchange(&mut self, now_ns: u64) -> Result<(), RunError> {
        self.bench.handle_deadline(now_ns);
        loop {
            // The plant may answer a frame within the same instant: it is served until nothing moves any more, as in
            // `free`.
            let before = (self.port.statistics.sent, self.port.statistics.received);
            self.bench.transmit(now_ns, &mut self.port)?;
            self.bench.receive(now_ns, &mut self.port)?;
            self.bench.handle_deadline(now_ns);
            if (self.port.statistics.sent, self.port.statistics.received) == before {
                return Ok(());
            }
        }
    }

    /// Returns the records that were kept since the last call.
    pub fn take_records(&mut self) -> Vec<Record> {
        self.bench.take_records()
    }

    /// Records the last state of the run.
    pub fn record_end(&mut self) {
        self.bench.record_end();
    }

    /// Returns the simulated plant.
    pub fn plant(&self) -> &Plant {
        &self.bench.plant
    }

    /// Returns the node of the plant.
    pub fn node(&self) -> &dyn PlantInterface {
        &*self.bench.node
    }

    /// Returns the counts of frames.
    pub fn statistics(&self) -> Statistics {
        self.port.statistics
    }
}

/// The exciter's node with its controller on a host's bus.
#[derive(Debug)]
pub struct HostedExciter {
    node: Box<dyn ExciterInterface>,
    /// End of the bus.
    pub port: HostPort,
    responses: Vec<ResponsePoint>,
}

impl HostedExciter {
    /// Boots the node, at time 0.
    pub fn start(&mut self) {
        self.node.start(0);
    }

    /// Reads incoming frames, does the work that is due, and sends.
    pub fn exchange(&mut self, now_ns: u64) {
        self.node.handle_deadline(now_ns);
        while let Some(frame) = self.port.incoming.pop_front() {
            self.port.statistics.received += 1;
            self.node.handle_frame(now_ns, &frame);
        }
        if self.port.is_off {
            self.node.bus_lost(now_ns);
            return;
        }
        while let Some(frame) = self.node.next_frame() {
            self.port.outgoing.push(frame);
            self.port.statistics.sent += 1;
            self.node.frame_sent();
        }
        self.responses.extend(core::iter::from_fn(|| self.node.carried_mut().poll_response()));
    }

    /// Returns the node of the exciter.
    pub fn node(&self) -> &dyn ExciterInterface {
        &*self.node
    }

    /// Returns the responses that were read.
    pub fn responses(&self) -> &[ResponsePoint] {
        &self.responses
    }
}
