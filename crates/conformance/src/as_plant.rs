//! The tester as a plant: it sends samples, and follows requests.

use super::source::{ACCELERATION_END_M_S2, FORCE_END_N, Samples};
use super::stop::Stop;
use super::tester::Tester;
use resonarm_protocol::timing::sample_period_ns;
use resonarm_protocol::{
    Acceleration, Frame, ImpedanceHead, Measured, Message, Node, NodeState, OperatorRequest, Profile, SensorPair,
    SensorValues, Sensors, Transmitter,
};

impl Tester<'_> {
    /// Sends the sample that is due. After a stall the schedule has moved, like that of a plant that slips.
    pub(super) fn send_sample(&mut self, now_ns: u64) -> Result<(), Stop> {
        if now_ns < self.source.next_ns() {
            return Ok(());
        }
        let period_ns = sample_period_ns(self.hello.rate_hz);
        self.source.sent_ns = now_ns;
        self.source.due_ns = match self.source.samples {
            Samples::Awaited => u64::MAX,
            // At least half a period later: a sample that was late is not followed by a burst.
            _ => (self.source.due_ns + period_ns).max(now_ns + period_ns / 2),
        };
        let index = self.source.index;
        if self.source.samples != Samples::Standing {
            self.source.index = index.wrapping_add(1);
        }
        let samples = self.draw(index);
        let mut messages = self.messages(samples, index);
        if let Samples::Without(lost) = samples {
            messages.remove(lost.min(messages.len().saturating_sub(1)));
        }
        let Some((whole, parts)) = messages.split_last() else { return Ok(()) };
        for part in parts {
            self.send(part)?;
        }
        let make = |transmitter: &mut Transmitter| transmitter.frame(whole).ok();
        let frame: Option<Frame> = match samples {
            Samples::Off => return Ok(()),
            Samples::Damaged(damage) => {
                self.source.damaged += 1;
                damage.apply(&mut self.ends, self.settings.seed.wrapping_add(self.source.damaged), make)
            }
            _ => {
                // Kept so that a later frame can repeat the counter of this one.
                self.ends.before = self.ends.transmitter.clone();
                make(&mut self.ends.transmitter)
            }
        };
        frame.map_or(Ok(()), |frame| self.send_frame(&frame))
    }

    /// Chooses how a sample is sent. A bad one must not be answered.
    fn draw(&mut self, index: u16) -> Samples {
        let samples = match (self.source.samples, &mut self.soak) {
            (Samples::Soak, Some(soak)) => soak.samples(self.network.profile()),
            (samples, _) => samples,
        };
        // The last frame with an index decides: a bad one closes it, a good one opens it again.
        match samples {
            Samples::Without(_) | Samples::Damaged(_) => self.source.closed.insert(index),
            _ => self.source.closed.remove(&index),
        };
        samples
    }

    /// The messages for a sample: none for the first of a pair.
    fn messages(&mut self, samples: Samples, index: u16) -> Vec<Message> {
        if core::mem::take(&mut self.source.is_half) {
            return pair(index.wrapping_sub(1));
        }
        let is_armed = self.state == NodeState::Operational;
        self.source.is_half = samples == Samples::Pairs && is_armed && index.is_multiple_of(2);
        if self.source.is_half { Vec::new() } else { sample(self.network.profile(), index, samples) }
    }

    /// Takes a command for a sample.
    pub(super) fn commanded(&mut self, sample: u16) -> Result<(), Stop> {
        // Modulo 2¹⁶: the upper half of the range is behind.
        if sample.wrapping_sub(self.source.index) < 0x8000 {
            self.source.unsent = Some(sample);
        }
        if self.source.samples == Samples::Awaited && sample == self.source.index.wrapping_sub(1) {
            self.source.due_ns = self.source.sent_ns + sample_period_ns(self.hello.rate_hz);
        }
        // `insert` returns `false` if the sample is closed: it was bad, or has been answered.
        if self.source.samples == Samples::Soak && !self.source.closed.insert(sample) {
            self.source.wrong = Some(sample);
        }
        Ok(())
    }

    /// Follows a request as a plant does.
    pub(super) fn follow(&mut self, request: OperatorRequest) -> Result<(), Stop> {
        match (request, self.source.arms) {
            (OperatorRequest::Arm, false) => return Ok(()),
            (OperatorRequest::Arm, true) if self.source.samples == Samples::Awaited => self.source.due_ns = 0,
            _ => {}
        }
        match self.state.next(request.event()) {
            Some(state) if self.tested == Node::Exciter && state != NodeState::BootUp => self.send_state(state),
            _ => Ok(()),
        }
    }
}

/// The message of two samples at rest.
fn pair(sample: u16) -> Vec<Message> {
    vec![Message::SensorPair(SensorPair { values: [SensorValues::default(); 2], sample })]
}

/// The messages of a sample at rest, or with all readings at the end of their range.
fn sample(profile: Profile, sample: u16, samples: Samples) -> Vec<Message> {
    let saturated = samples == Samples::Clipped;
    let [force_n, acceleration_m_s2] = if saturated { [FORCE_END_N, ACCELERATION_END_M_S2] } else { [0.0; 2] };
    let acceleration = Acceleration {
        acceleration_x_m_s2: acceleration_m_s2,
        acceleration_y_m_s2: acceleration_m_s2,
        x_saturated: saturated,
        y_saturated: saturated,
        sample,
    };
    let head = ImpedanceHead {
        force_x_n: force_n,
        force_y_n: force_n,
        x_saturated: saturated,
        y_saturated: saturated,
        sample,
    };
    let measured = |value| [Measured { value, saturated }; 2];
    let values = SensorValues {
        force_n: measured(force_n),
        acceleration_b_m_s2: measured(acceleration_m_s2),
        acceleration_c_m_s2: measured(acceleration_m_s2),
    };
    match profile {
        Profile::Classic => {
            vec![Message::Head(head), Message::AccelerometerB(acceleration), Message::AccelerometerC(acceleration)]
        }
        Profile::Fd => vec![Message::Sensors(Sensors { values, sample })],
    }
}
