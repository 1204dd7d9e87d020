//! Many frames in one system call: `recvmmsg(2)` and `sendmmsg(2)`.
//!
//! With every frame that comes in the kernel gives one control message, its time stamps (`SO_TIMESTAMPING`).

use core::ffi::{c_int, c_long, c_uint};
use core::{mem, ptr};
use std::io;
use std::os::fd::{AsRawFd, BorrowedFd};

use libc::{MSG_CTRUNC, MSG_DONTWAIT, MSG_WAITFORONE, SCM_TIMESTAMPING, SOL_SOCKET, iovec, mmsghdr};
use resonarm_protocol::Frame;

use super::frame::{KernelFrame, RawFrame};

/// Frames in one call: several times what a sample of 1 ms has at 1 Mbit/s, which are 9.
pub(super) const FRAMES: usize = 32;

/// The kernel's `struct cmsghdr` and `struct scm_timestamping`: the time stamps of a frame as a control message. The
/// first stamp is the kernel's own, of the UNIX epoch; the others are those of hardware.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct Stamps {
    len: usize,
    level: c_int,
    kind: c_int,
    stamps: [[c_long; 2]; 3],
}

/// Room for an incoming frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub frame: KernelFrame,
    control: Stamps,
    is_stamped: bool,
}

impl Slot {
    /// A slot without a frame.
    pub const EMPTY: Slot = Slot {
        frame: KernelFrame::NONE,
        control: Stamps { len: 0, level: 0, kind: 0, stamps: [[0; 2]; 3] },
        is_stamped: false,
    };

    /// Returns the time at which the kernel saw the frame, ns of the UNIX epoch.
    pub fn timestamp_ns(&self) -> Option<u64> {
        let Stamps { level, kind, stamps: [[s, ns], ..], .. } = self.control;
        // A stamp that was not taken is left at zero.
        let is_stamp = self.is_stamped && (level, kind) == (SOL_SOCKET, SCM_TIMESTAMPING) && (s, ns) != (0, 0);
        let s = u64::try_from(s).ok()?;
        let ns = u64::try_from(ns).ok()?;
        s.checked_mul(1_000_000_000)?.checked_add(ns).filter(|_| is_stamp)
    }
}

/// Behaviour of a receiving call if there is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum IfNone {
    /// Return at once, without sleeping.
    Return,
    /// Sleep until one comes, for the socket's receive timeout at most.
    Sleep,
}

/// Receives the frames that have arrived, at most one for each slot, and returns how many. None is an error of the kind
/// [`io::ErrorKind::WouldBlock`].
#[allow(unsafe_code, reason = "recvmmsg(2) has no safe wrapper that keeps its memory from call to call")]
pub(super) fn receive(socket: BorrowedFd<'_>, slots: &mut [Slot; FRAMES], if_none: IfNone) -> io::Result<usize> {
    // With MSG_WAITFORONE the kernel sleeps for the first frame only, and then adds those that are there already.
    let flags = match if_none {
        IfNone::Return => MSG_DONTWAIT,
        IfNone::Sleep => MSG_WAITFORONE,
    };
    let mut vectors = [NO_VECTOR; FRAMES];
    let mut headers = no_headers();
    for ((slot, vector), header) in slots.iter_mut().zip(&mut vectors).zip(&mut headers) {
        *vector = iovec { iov_base: (&raw mut slot.frame.raw).cast(), iov_len: mem::size_of::<RawFrame>() };
        header.msg_hdr.msg_iov = vector;
        header.msg_hdr.msg_iovlen = 1;
        header.msg_hdr.msg_control = (&raw mut slot.control).cast();
        header.msg_hdr.msg_controllen = mem::size_of::<Stamps>() as _;
    }
    // SAFETY: the socket is open as long as it is borrowed. Each header names one vector, and vector and control
    // message are in memory of the length stated, borrowed mutably until the call is over. What the kernel writes there
    // are numbers, of which every bit pattern is one.
    let count = unsafe {
        libc::recvmmsg(socket.as_raw_fd(), headers.as_mut_ptr(), FRAMES as c_uint, flags as _, ptr::null_mut())
    };
    let count = usize::try_from(count).map_err(|_negative| io::Error::last_os_error())?;
    for (slot, header) in slots.iter_mut().zip(&headers[..count]) {
        slot.frame.size = header.msg_len as usize;
        // The kernel sets the length to what it wrote, and MSG_CTRUNC if there was not room for all.
        slot.is_stamped = header.msg_hdr.msg_controllen >= mem::size_of::<Stamps>() as _
            && header.msg_hdr.msg_flags & MSG_CTRUNC == 0;
    }
    Ok(count)
}

/// Queues frames for sending, from the first on, as many as the kernel takes in one go, and returns how many. On an
/// error it took none.
#[allow(unsafe_code, reason = "sendmmsg(2), as recvmmsg(2)")]
pub(super) fn send(socket: BorrowedFd<'_>, frames: &[Frame]) -> io::Result<usize> {
    // The arrays live on the stack, so that sending allocates nothing; the caller goes on with the rest.
    let count = frames.len().min(FRAMES);
    let mut kernel_frames = [KernelFrame::NONE; FRAMES];
    let mut vectors = [NO_VECTOR; FRAMES];
    let mut headers = no_headers();
    let parts = kernel_frames.iter_mut().zip(&mut vectors).zip(&mut headers);
    for (frame, ((kernel_frame, vector), header)) in frames.iter().zip(parts) {
        *kernel_frame = KernelFrame::from(frame);
        *vector = iovec { iov_base: (&raw mut kernel_frame.raw).cast(), iov_len: kernel_frame.size };
        header.msg_hdr.msg_iov = vector;
        header.msg_hdr.msg_iovlen = 1;
    }
    // SAFETY: as in `receive`; the kernel reads the frames, and writes to the headers alone.
    let sent = unsafe { libc::sendmmsg(socket.as_raw_fd(), headers.as_mut_ptr(), count as c_uint, MSG_DONTWAIT as _) };
    usize::try_from(sent).map_err(|_negative| io::Error::last_os_error())
}

const NO_VECTOR: iovec = iovec { iov_base: ptr::null_mut(), iov_len: 0 };

/// Headers without an address, a vector or a control message.
#[allow(unsafe_code, reason = "some C libraries pad the structure with fields that only they can name")]
fn no_headers() -> [mmsghdr; FRAMES] {
    // SAFETY: numbers and pointers, for which zero is a value.
    unsafe { mem::zeroed() }
}
