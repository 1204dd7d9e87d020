//! The bus load of a network: the sum over a table of frames and their rates.

use crate::bits::{self, BitRates, Bits, IdFormat, Stuffing};
use crate::frame::FrameFormat;
use crate::kind::{Cycle, MessageKind};
use crate::message::SamplesPerFrame;
use crate::network::Profile;

/// A kind of frame, and its rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    /// The format of its identifier.
    pub id: IdFormat,
    /// The format of the frame.
    pub format: FrameFormat,
    /// Length of the data, bytes.
    pub len: usize,
    /// Number of frames per second.
    pub per_second: u64,
}

/// The frames of a running network: with each frame of samples one command and the sensor messages; and the
/// heartbeats, hellos and other periodic messages of both nodes.
pub fn streams(profile: Profile, rate_hz: u16, samples: SamplesPerFrame) -> impl Iterator<Item = Stream> {
    const SECOND_NS: u64 = 1_000_000_000;
    let unused = match samples {
        SamplesPerFrame::One => MessageKind::SensorPair,
        SamplesPerFrame::Two => MessageKind::Sensors,
    };
    MessageKind::ALL.into_iter().filter_map(move |kind| {
        let form = kind.form(profile)?;
        let per_second = match (kind, kind.cycle()) {
            // A sample has one command, of force or of torque, with the same length: the force stands for both.
            // Events are rare.
            (MessageKind::Torque, _) | (_, Cycle::Event) => return None,
            (kind, _) if kind == unused => return None,
            (_, Cycle::Sample) => u64::from(rate_hz).div_ceil(samples as u64),
            (_, Cycle::Period { period_ns }) => SECOND_NS / period_ns,
        };
        Some(Stream { id: IdFormat::Standard, format: form.format, len: form.length, per_second })
    })
}

/// The total bits per second.
pub fn bits_per_second(streams: impl Iterator<Item = Stream>, stuffing: Stuffing) -> Bits {
    streams.fold(Bits::default(), |sum, Stream { id, format, len, per_second }| {
        sum.plus(bits::bounds(id, format, len, stuffing).times(per_second))
    })
}

/// The fraction of time for which these bits per second occupy the bus. Above 0.8 single frames wait noticeably; above
/// 1 they can't all be sent.
pub fn share(per_second: Bits, rates: BitRates) -> f64 {
    per_second.nominal as f64 / f64::from(rates.nominal_hz) + per_second.data as f64 / f64::from(rates.data_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_takes_four_frames() {
        let bits = |rate_hz| bits_per_second(streams(Profile::Classic, rate_hz, SamplesPerFrame::One), Stuffing::None);
        // A command and three sensor messages, of 8 bytes each: 111 bits without stuff bits, intermission included.
        assert_eq!(bits(2000).nominal - bits(1000).nominal, 1000 * 4 * 111);
        assert_eq!(bits(1000), Bits { nominal: 1000 * 4 * 111 + 2 * 111 + 20 * 55, data: 0 });
    }

    /// A command of 16 bytes and one frame of 32, and two of 16 bytes a second.
    #[test]
    fn a_sample_of_the_fd_profile_takes_two_frames() {
        let bits = |rate_hz| bits_per_second(streams(Profile::Fd, rate_hz, SamplesPerFrame::One), Stuffing::None);
        // ESI and DLC, data, stuff count with CRC, their fixed stuff bits, and the CRC delimiter: the bits at the
        // data bit rate.
        let command = 5 + 128 + 21 + 6 + 1;
        let sensors = 5 + 256 + 25 + 7 + 1;
        let once = Bits { nominal: 2 * 29 + 2 * 111 + 20 * 55, data: 2 * command };
        assert_eq!(bits(1000), Bits { nominal: 1000 * 2 * 29, data: 1000 * (command + sensors) }.plus(once));
    }

    #[test]
    fn two_samples_a_frame_halve_the_frames() {
        let bits = |rate_hz, samples| bits_per_second(streams(Profile::Fd, rate_hz, samples), Stuffing::None);
        let pair = 5 + 512 + 25 + 7 + 1;
        let one = bits(1000, SamplesPerFrame::One);
        let two = bits(1000, SamplesPerFrame::Two);
        assert_eq!(one.nominal - two.nominal, 1000 * 29);
        assert_eq!(bits(3000, SamplesPerFrame::Two).data - two.data, 1000 * (pair + 161));
    }

    #[test]
    fn the_share_counts_each_phase_at_its_rate() {
        let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
        let stream = Stream { id: IdFormat::Standard, format, len: 64, per_second: 1000 };
        let bits = bits_per_second([stream, stream].into_iter(), Stuffing::Worst);
        assert_eq!(bits, Bits { nominal: 64_000, data: 1_358_000 });
        let share = share(bits, BitRates { nominal_hz: 1_000_000, data_hz: 4_000_000 });
        assert!((share - (0.064 + 0.3395)).abs() < 1e-12, "{share}");
    }
}
