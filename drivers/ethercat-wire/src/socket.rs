//! A raw socket (AF_PACKET) that sends and receives EtherCAT on one network interface.

use std::ffi::CString;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

use crate::frame::ETHERTYPE;

/// The longest Ethernet frame with a VLAN tag.
pub const FRAME_MAX: usize = 1522;

/// Why an interface cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// There is no such interface.
    #[error("no network interface `{name}`; there are: {known}")]
    NoInterface {
        /// As given.
        name: String,
        /// What there is.
        known: String,
    },
    /// The kernel refuses raw sockets.
    #[error(
        "interface `{name}`: not allowed to open a raw socket; run as root or give the program CAP_NET_RAW: setcap cap_net_raw+ep PROGRAM"
    )]
    NotAllowed {
        /// As given.
        name: String,
    },
    /// It is there and down.
    #[error("interface `{name}` is down; bring it up: ip link set {name} up")]
    Down {
        /// As given.
        name: String,
    },
    /// Anything else.
    #[error("interface `{name}`: {error}")]
    Other {
        /// As given.
        name: String,
        /// The kernel's answer.
        error: io::Error,
    },
}

/// A raw socket on one interface that receives EtherCAT only.
#[derive(Debug)]
pub struct RawSocket {
    socket: OwnedFd,
}

impl RawSocket {
    /// Opens it.
    ///
    /// # Errors
    /// [`SocketError`] in one line.
    pub fn open(name: &str) -> Result<Self, SocketError> {
        let other = |error: io::Error| SocketError::Other {
            name: name.to_owned(),
            error,
        };
        let c_name = CString::new(name).map_err(|error| other(error.into()))?;
        // SAFETY: the name is a C string that outlives the call.
        let index = unsafe { libc::if_nametoindex(c_name.as_ptr()) };
        if index == 0 {
            return Err(SocketError::NoInterface {
                name: name.to_owned(),
                known: interfaces(),
            });
        }
        if !is_up(name) {
            return Err(SocketError::Down {
                name: name.to_owned(),
            });
        }
        let protocol = i32::from(ETHERTYPE.to_be());
        let flags = libc::SOCK_RAW | libc::SOCK_NONBLOCK | libc::SOCK_CLOEXEC;
        // SAFETY: plain numbers go in, a new descriptor or -1 comes out.
        let raw = unsafe { libc::socket(libc::AF_PACKET, flags, protocol) };
        if raw < 0 {
            let error = io::Error::last_os_error();
            return Err(match error.raw_os_error() {
                Some(libc::EPERM | libc::EACCES) => SocketError::NotAllowed {
                    name: name.to_owned(),
                },
                _ => other(error),
            });
        }
        // SAFETY: the descriptor is new and nobody else's.
        let socket = unsafe { OwnedFd::from_raw_fd(raw) };
        let address = libc::sockaddr_ll {
            sll_family: libc::AF_PACKET as u16,
            sll_protocol: ETHERTYPE.to_be(),
            sll_ifindex: index as i32,
            sll_hatype: 0,
            sll_pkttype: 0,
            sll_halen: 0,
            sll_addr: [0; 8],
        };
        // SAFETY: the address is one of AF_PACKET and its length is its own.
        let bound = unsafe {
            libc::bind(
                socket.as_raw_fd(),
                (&raw const address).cast(),
                size_of::<libc::sockaddr_ll>() as u32,
            )
        };
        if bound < 0 {
            return Err(other(io::Error::last_os_error()));
        }
        let promiscuous = libc::packet_mreq {
            mr_ifindex: index as i32,
            mr_type: libc::PACKET_MR_PROMISC as u16,
            mr_alen: 0,
            mr_address: [0; 8],
        };
        // SAFETY: the option's value is the structure it takes, with its length.
        let joined = unsafe {
            libc::setsockopt(
                socket.as_raw_fd(),
                libc::SOL_PACKET,
                libc::PACKET_ADD_MEMBERSHIP,
                (&raw const promiscuous).cast(),
                size_of::<libc::packet_mreq>() as u32,
            )
        };
        if joined < 0 {
            return Err(other(io::Error::last_os_error()));
        }
        Ok(Self { socket })
    }

    /// A frame that came from outside, and its length; `None` if there is none. Never waits.
    pub fn receive(&self, buffer: &mut [u8; FRAME_MAX]) -> Option<usize> {
        loop {
            // SAFETY: an all-zero address is a valid one.
            let mut from: libc::sockaddr_ll = unsafe { std::mem::zeroed() };
            let mut length = size_of::<libc::sockaddr_ll>() as u32;
            // SAFETY: buffer and address are writable for the lengths given.
            let got = unsafe {
                libc::recvfrom(
                    self.socket.as_raw_fd(),
                    buffer.as_mut_ptr().cast(),
                    buffer.len(),
                    0,
                    (&raw mut from).cast(),
                    &raw mut length,
                )
            };
            let got = usize::try_from(got).ok()?;
            // The kernel shows our own frames too.
            if from.sll_pkttype != libc::PACKET_OUTGOING {
                return Some(got);
            }
        }
    }

    /// Sends a frame; whether the kernel took it. Never waits.
    pub fn send(&self, frame: &[u8]) -> bool {
        // SAFETY: the frame is readable for its length.
        let sent = unsafe {
            libc::send(
                self.socket.as_raw_fd(),
                frame.as_ptr().cast(),
                frame.len(),
                0,
            )
        };
        usize::try_from(sent) == Ok(frame.len())
    }

    /// Waits for a frame, at most so long.
    pub fn wait(&self, timeout_ns: u64) {
        let mut poll = libc::pollfd {
            fd: self.socket.as_raw_fd(),
            events: libc::POLLIN,
            revents: 0,
        };
        let timeout = libc::timespec {
            tv_sec: (timeout_ns / 1_000_000_000) as i64,
            tv_nsec: (timeout_ns % 1_000_000_000) as i64,
        };
        // SAFETY: one descriptor and a time, both live; no signal mask.
        unsafe {
            libc::ppoll(&raw mut poll, 1, &raw const timeout, std::ptr::null());
        }
    }
}

fn interfaces() -> String {
    let mut names: Vec<String> = std::fs::read_dir("/sys/class/net")
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    names.sort();
    names.join(", ")
}

/// Whether the interface is up; where the system does not say, opening it will.
fn is_up(name: &str) -> bool {
    let flags = std::fs::read_to_string(format!("/sys/class/net/{name}/flags"));
    let flags = flags
        .ok()
        .and_then(|text| u32::from_str_radix(text.trim().trim_start_matches("0x"), 16).ok());
    flags.is_none_or(|flags| flags & libc::IFF_UP as u32 != 0)
}

/// Nanoseconds of the monotonic clock.
pub fn now_ns() -> u64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: the time is writable; this clock is always there.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}
