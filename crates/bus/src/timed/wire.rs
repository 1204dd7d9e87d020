//! The wire between the controllers: arbitration, frames that take their bits, error frames. Time is an argument.

use resonarm_protocol::bits::{self, BitRates, Bits, INTERMISSION, Level};
use resonarm_protocol::{Frame, FrameFormat, Id};

use super::controller::{Controller, ErrorCause, ErrorState, Outcome};
use super::{Spec, Traffic};
use resonarm_numeric::noise::Noise;

/// The stream of a wire's bit errors; those of the network's faults come after it.
const STREAM: u64 = (1 << 33) - 1;
/// Bits of an error flag, and of the delimiter behind all flags.
const ERROR_FLAG: u64 = 6;
const ERROR_DELIMITER: u64 = 8;
/// End of frame and ACK delimiter: the bits of a frame behind the ACK slot.
const BEHIND_ACK: u64 = 7 + 1;
/// Bits that a passive controller waits after it has sent.
const SUSPENSION: u64 = 8;
/// Nominal bits behind the data phase of an FD frame with BRS, intermission included.
const FD_TAIL: u64 = 2 + 7 + INTERMISSION;
/// Recessive bits that count for the recovery from bus-off: ACK delimiter, end of frame and intermission, or idle time.
const RECESSIVE: u64 = 11;

/// The shared medium: arbitration, bit errors and the time that frames take.
pub(super) struct Wire {
    rates: BitRates,
    bit_error_rate: f64,
    chance: Noise,
    pub controllers: Vec<Controller>,
    sending: Option<Sending>,
    /// Time from which on a frame may start, ns.
    free_ns: u64,
    pub traffic: Traffic,
}

/// A frame on the bus.
#[derive(Clone, Copy)]
struct Sending {
    by: usize,
    bits: Bits,
    /// The end of the frame or of its error frame, before the intermission, ns.
    end_ns: u64,
    error: Option<Failure>,
}

/// A frame that an error ends.
#[derive(Clone, Copy)]
struct Failure {
    /// The bit at which its sender sees the error.
    bit: u64,
    cause: ErrorCause,
    /// Number of bits after which the other nodes see the error, too, if they do.
    noticed_after: Option<u64>,
}

impl Wire {
    pub fn new(nodes: usize, spec: &Spec) -> Wire {
        Wire {
            rates: spec.rates,
            bit_error_rate: spec.bit_error_rate,
            chance: Noise::new(spec.seed, STREAM),
            controllers: (0..nodes).map(|_| Controller::new(spec.mailboxes)).collect(),
            sending: None,
            free_ns: 0,
            traffic: Traffic::default(),
        }
    }

    /// Advances to `now_ns`, including a frame that ends then. A frame that can start at `now_ns` has not started:
    /// another that is queued at the same instant may win.
    pub fn advance(&mut self, now_ns: u64) {
        while let Some(at_ns) = self.next_ns().filter(|at_ns| *at_ns <= now_ns) {
            if self.sending.is_none() && at_ns == now_ns && self.recovered_ns().is_none_or(|ns| ns > now_ns) {
                break;
            }
            self.step();
        }
    }

    /// Returns the time of the next event, ns, with what has been queued up to `now_ns`: a frame that can start then
    /// does.
    pub fn next_event_ns(&mut self, now_ns: u64) -> Option<u64> {
        self.advance(now_ns);
        while self.next_ns()? <= now_ns {
            self.step();
        }
        self.next_ns()
    }

    /// Returns the time at which a frame ends or starts, or a controller has recovered.
    fn next_ns(&self) -> Option<u64> {
        let start_ns = self.contest().map(|(_, start_ns)| start_ns);
        match self.sending {
            // While a frame is on the bus nothing else can begin, and the idle time of a recovery does not pass.
            Some(sending) => Some(sending.end_ns),
            None => [start_ns, self.recovered_ns()].into_iter().flatten().min(),
        }
    }

    fn step(&mut self) {
        if let Some(sending) = self.sending.take() {
            return self.finish(sending);
        }
        match (self.contest(), self.recovered_ns()) {
            // A node that recovers from bus-off by then takes part in the contest, so its recovery comes first.
            (Some((by, start_ns)), recovered_ns) if recovered_ns.is_none_or(|ns| ns > start_ns) => {
                self.pass_idle(start_ns);
                self.start(by, start_ns);
            }
            (_, Some(ns)) => self.pass_idle(ns),
            (_, None) => {}
        }
    }

    /// The idle bus from when it was free to `until_ns` lets controllers recover.
    fn pass_idle(&mut self, until_ns: u64) {
        let times = until_ns.saturating_sub(self.free_ns) / self.time_ns(RECESSIVE);
        self.controllers.iter_mut().for_each(|controller| controller.idle(times));
        // Idle time that has counted for a recovery must not count again.
        self.free_ns = self.free_ns.max(until_ns);
    }

    /// Returns the time at which the next controller comes back from bus-off if the bus stays idle, ns.
    fn recovered_ns(&self) -> Option<u64> {
        let left = self.controllers.iter().filter_map(|controller| controller.recovery).min()?;
        Some(self.free_ns + left * self.time_ns(RECESSIVE))
    }

    /// Returns the node that wins the bus next, and the time: of those that can start first, the one with the lowest
    /// identifier.
    fn contest(&self) -> Option<(usize, u64)> {
        let ready = |controller: &Controller| {
            let (frame, since_ns) = controller.mailboxes.front()?;
            Some((arbitration(frame), (*since_ns).max(self.free_ns).max(controller.suspended_until_ns)))
        };
        // A frame that becomes ready while another is on the bus takes part only in the next contest, so the earliest
        // start decides first, and then the identifier.
        let start_ns = self.controllers.iter().filter_map(ready).map(|(_, ready_ns)| ready_ns).min()?;
        let contenders = self.controllers.iter().enumerate().filter_map(|(node, controller)| {
            let (key, ready_ns) = ready(controller)?;
            (ready_ns <= start_ns).then_some((key, node))
        });
        // The lowest key wins, as its dominant bits override those of the others. Equal keys are decided by the
        // number of the node, so that a run is reproducible.
        contenders.min().map(|(_, node)| (node, start_ns))
    }

    fn start(&mut self, by: usize, start_ns: u64) {
        let hit = self.first_bit_error();
        self.begin(by, start_ns, hit);
    }

    /// Begins a frame of which bit `hit` is not what was sent, if the frame has so many.
    pub(super) fn begin(&mut self, by: usize, start_ns: u64, hit: Option<u64>) {
        let Some((frame, _)) = self.controllers[by].mailboxes.front() else { return };
        let whole = bits::of(frame);
        let on_wire = whole.total() - INTERMISSION;
        let hit = hit.filter(|bit| *bit < on_wire).map(|bit| (bit, ErrorCause::Bit));
        // Without a listening node the ACK slot stays recessive, which is an error for the sender.
        let unheard =
            self.others(by).next().is_none().then_some((on_wire - BEHIND_ACK - 1, ErrorCause::Acknowledgement));
        // The first error ends the frame, of whichever kind it is.
        let error = hit.into_iter().chain(unheard).min_by_key(|(bit, _)| *bit);
        let error = error.map(|(bit, cause)| Failure { bit, cause, noticed_after: self.noticed_after(by, frame, bit) });
        let before = match error {
            None => Bits { nominal: whole.nominal - INTERMISSION, ..whole },
            Some(failure) => prefix(whole, failure.bit + 1).plus(self.error_frame(by, whole, failure)),
        };
        let bits = before.plus(Bits { nominal: INTERMISSION, data: 0 });
        self.sending = Some(Sending { by, bits, end_ns: start_ns + before.time_ns(self.rates), error });
        self.free_ns = start_ns + bits.time_ns(self.rates);
    }

    /// The other nodes that take part.
    fn others(&self, by: usize) -> impl Iterator<Item = &Controller> {
        self.controllers
            .iter()
            .enumerate()
            .filter(move |(node, other)| *node != by && other.listens())
            .map(|(_, other)| other)
    }

    /// Returns how many bits after the sender of `frame` others see the error at `bit`: they have its error flag before
    /// them.
    fn noticed_after(&self, by: usize, frame: &Frame, bit: u64) -> Option<u64> {
        let flag = match self.controllers[by].counters.state() {
            ErrorState::Active => Level::Dominant,
            ErrorState::Passive | ErrorState::BusOff => Level::Recessive,
        };
        self.others(by).next().and_then(|_| bits::noticed_after(frame, bit, flag))
    }

    /// Error flags and delimiter. The flags of the others, if one is active, begin where they see the error, so that
    /// all together are of 6 to 12 bits. Up to there they count bits of the phase in which the error is.
    fn error_frame(&self, by: usize, whole: Bits, Failure { bit, noticed_after, .. }: Failure) -> Bits {
        let is_answered = self.others(by).any(|other| other.counters.state() == ErrorState::Active);
        let later = noticed_after.filter(|_| is_answered).unwrap_or(0);
        let flag = Bits { nominal: ERROR_FLAG + ERROR_DELIMITER, data: 0 };
        // The bit is one of the data phase if the frame up to it has one bit of that phase more than the frame before
        // it.
        let is_data = prefix(whole, bit + 1).data > prefix(whole, bit).data;
        flag.plus(if is_data { Bits { nominal: 0, data: later } } else { Bits { nominal: later, data: 0 } })
    }

    /// The place of the first bit error from here on: geometrically distributed.
    fn first_bit_error(&mut self) -> Option<u64> {
        if self.bit_error_rate <= 0.0 {
            return None;
        }
        // The number of correct bits before the first error has a geometric distribution. Inverting it takes
        // one random number per frame in place of one per bit, and log1p keeps the digits of a small error
        // rate.
        let bits = libm::log1p(-self.chance.uniform()) / libm::log1p(-self.bit_error_rate);
        Some(libm::floor(bits) as u64)
    }

    fn finish(&mut self, sending: Sending) {
        let Sending { by, bits, error, .. } = sending;
        self.traffic.bits = self.traffic.bits.plus(bits);
        // The frame ends with 11 recessive bits for those who wait for that, but not for a node that leaves with it.
        let pass = |controllers: &mut [Controller]| controllers.iter_mut().for_each(|controller| controller.idle(1));
        match error {
            None => {
                self.traffic.frames += 1;
                self.deliver(by);
                pass(&mut self.controllers);
            }
            Some(Failure { cause, noticed_after, .. }) => {
                self.traffic.error_frames += 1;
                pass(&mut self.controllers);
                let frame = self.controllers[by].mailboxes.front().map(|(frame, _)| *frame);
                let others =
                    self.controllers.iter_mut().enumerate().filter(|(node, other)| *node != by && other.listens());
                let notice = others.filter(|_| noticed_after.is_some());
                let destroyed = |is_own| frame.map(|frame| Outcome::Destroyed { frame, cause, is_own });
                notice.for_each(|(_, other)| {
                    other.counters.receive_error();
                    destroyed(false).into_iter().for_each(|outcome| other.note(outcome));
                });
                destroyed(true).into_iter().for_each(|outcome| self.controllers[by].note(outcome));
                self.controllers[by].counters.transmit_error(cause);
                self.controllers[by].judge();
            }
        }
        // After sending, an error-passive node waits 8 more bits before it sends again (suspend transmission,
        // ISO 11898-1).
        let is_passive = self.controllers[by].counters.state() == ErrorState::Passive;
        let suspension_ns = if is_passive { self.time_ns(SUSPENSION) } else { 0 };
        self.controllers[by].suspended_until_ns = self.free_ns + suspension_ns;
    }

    fn deliver(&mut self, by: usize) {
        let Some((frame, _)) = self.controllers[by].mailboxes.pop_front() else { return };
        self.controllers[by].counters.sent();
        self.controllers[by].note(Outcome::Sent(frame));
        let others = self.controllers.iter_mut().enumerate().filter(|(node, other)| *node != by && other.listens());
        others.for_each(|(_, other)| other.take(&frame));
    }

    fn time_ns(&self, nominal: u64) -> u64 {
        Bits { nominal, data: 0 }.time_ns(self.rates)
    }
}

/// The first `count` bits of a frame of these bits.
fn prefix(whole: Bits, count: u64) -> Bits {
    if whole.data == 0 {
        return Bits { nominal: count, data: 0 };
    }
    // The nominal bits of an FD frame are before and behind its data phase. The tail has a known length, and the rest
    // is the head.
    let head = whole.nominal - FD_TAIL;
    let data = count.saturating_sub(head).min(whole.data);
    Bits { nominal: count - data, data }
}

/// The arbitration key, the lowest wins: 11 bits of the identifier, RTR or SRR, IDE, the other 18 bits, RTR,
/// with dominant as 0. In an FD frame the place of RTR is dominant.
fn arbitration(frame: &Frame) -> u32 {
    let request = u32::from(frame.format() == FrameFormat::Remote);
    match frame.id() {
        Id::Standard(id) => u32::from(id) << 21 | request << 20,
        // SRR and IDE are recessive, so that a frame with a standard identifier wins against an extended one of the
        // same first 11 bits.
        Id::Extended(id) => (id >> 18) << 21 | 0b11 << 19 | (id & 0x3_FFFF) << 1 | request,
    }
}
