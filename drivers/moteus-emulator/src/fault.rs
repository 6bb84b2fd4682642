//! Faults at known times: what breaks on a bus and at its drives, for a test or a rehearsal.
//!
//! Written as `KIND:WHERE@START[+DURATION]`; without a duration it stays. Times count from the first line that came on any
//! bus, so that they do not depend on when the other side was started.
//!
//! | text | meaning |
//! |---|---|
//! | `silent:3@2s+500ms` | drive 3 neither hears nor answers, as with its cable out |
//! | `bus-off:1@2s` | nothing passes on bus 1; the adapter still takes lines |
//! | `pty-closed:1@2s+1s` | the port of bus 1 goes away, as with its USB cable out |
//! | `drive-fault:3/33@2s+1s` | drive 3 faults with code 33 and keeps faulting |
//! | `brown-out:3@2s+200ms` | drive 3 loses its supply, and comes back as after power-on |
//! | `lost:1/0.05@2s` | 5 % of the frames from bus 1 are lost on their way to the computer |
//! | `doubled:1/0.05@2s` | 5 % come twice |
//! | `delayed:1/2ms@2s` | all come 2 ms late |
//! | `noise:1/0.05@2s` | 5 % of the lines at the port of bus 1 have a wrong character, both ways |

use std::str::FromStr;
use std::time::Duration;

/// What breaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// The drive neither hears nor answers.
    Silent {
        /// Its identifier.
        id: u8,
    },
    /// Nothing passes on the bus.
    BusOff {
        /// Which, from 0.
        bus: usize,
    },
    /// The port of the bus is gone.
    PtyClosed {
        /// Which, from 0.
        bus: usize,
    },
    /// The drive faults and keeps faulting.
    Drive {
        /// Its identifier.
        id: u8,
        /// Register 0x00f.
        code: u8,
    },
    /// The drive has no supply.
    BrownOut {
        /// Its identifier.
        id: u8,
    },
    /// Frames from the bus are lost.
    Lost {
        /// Which, from 0.
        bus: usize,
        /// Share of them.
        share: f64,
    },
    /// Frames from the bus come twice.
    Doubled {
        /// Which, from 0.
        bus: usize,
        /// Share of them.
        share: f64,
    },
    /// Lines at the port have a wrong character, both ways.
    Noise {
        /// Which, from 0.
        bus: usize,
        /// Share of them.
        share: f64,
    },
    /// Frames from the bus come late.
    Delayed {
        /// Which, from 0.
        bus: usize,
        /// By how much.
        by: Duration,
    },
}

/// A fault with its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// What breaks.
    pub kind: FaultKind,
    /// When, from the first line on any bus.
    pub start: Duration,
    /// For how long; for good where there is none.
    pub duration: Option<Duration>,
}

/// Why a text is no fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultError {
    /// The text has another shape.
    #[error("{text}: a fault is written KIND:WHERE@START[+DURATION], as silent:3@2s+500ms")]
    Shape {
        /// As given.
        text: String,
    },
    /// There is no such kind.
    #[error(
        "{kind}: no such fault; there are silent, bus-off, pty-closed, drive-fault, brown-out, lost, doubled, delayed, noise"
    )]
    Kind {
        /// As given.
        kind: String,
    },
    /// A part of the text is no number, time or share.
    #[error("{text}: {part} is no {must}")]
    Part {
        /// The whole text.
        text: String,
        /// What is wrong.
        part: String,
        /// What it must be.
        must: &'static str,
    },
}

impl Fault {
    /// Whether it is broken so long after the first line.
    pub fn is_active(&self, since_start: Duration) -> bool {
        let Some(within) = since_start.checked_sub(self.start) else {
            return false;
        };
        self.duration.is_none_or(|duration| within < duration)
    }
}

impl FromStr for Fault {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let shape = || FaultError::Shape {
            text: text.to_owned(),
        };
        let (what, when) = text.split_once('@').ok_or_else(shape)?;
        let (kind, place) = what.split_once(':').ok_or_else(shape)?;
        let (start, duration) = match when.split_once('+') {
            Some((start, duration)) => (start, Some(time(text, duration)?)),
            None => (when, None),
        };
        let (place, argument) = place.split_once('/').unwrap_or((place, ""));
        let id = || number(text, place, "drive identifier from 1 to 126", 1, 126);
        let bus =
            || number(text, place, "bus from 1 on", 1, u8::MAX).map(|bus| usize::from(bus) - 1);
        let kind = match kind {
            "silent" => FaultKind::Silent { id: id()? },
            "bus-off" => FaultKind::BusOff { bus: bus()? },
            "pty-closed" => FaultKind::PtyClosed { bus: bus()? },
            "drive-fault" => FaultKind::Drive {
                id: id()?,
                code: number(text, argument, "fault code from 32 to 95", 32, 95)?,
            },
            "brown-out" => FaultKind::BrownOut { id: id()? },
            "lost" => FaultKind::Lost {
                bus: bus()?,
                share: share(text, argument)?,
            },
            "doubled" => FaultKind::Doubled {
                bus: bus()?,
                share: share(text, argument)?,
            },
            "noise" => FaultKind::Noise {
                bus: bus()?,
                share: share(text, argument)?,
            },
            "delayed" => FaultKind::Delayed {
                bus: bus()?,
                by: time(text, argument)?,
            },
            _ => {
                return Err(FaultError::Kind {
                    kind: kind.to_owned(),
                });
            }
        };
        Ok(Self {
            kind,
            start: time(text, start)?,
            duration,
        })
    }
}

fn wrong(text: &str, part: &str, must: &'static str) -> FaultError {
    FaultError::Part {
        text: text.to_owned(),
        part: format!("`{part}`"),
        must,
    }
}

fn number(
    text: &str,
    part: &str,
    must: &'static str,
    least: u8,
    most: u8,
) -> Result<u8, FaultError> {
    let value = part
        .parse()
        .ok()
        .filter(|value| (least..=most).contains(value));
    value.ok_or_else(|| wrong(text, part, must))
}

fn share(text: &str, part: &str) -> Result<f64, FaultError> {
    let value = part
        .parse()
        .ok()
        .filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| wrong(text, part, "share from 0 to 1"))
}

/// Whole or broken seconds or milliseconds, at most an hour.
fn time(text: &str, part: &str) -> Result<Duration, FaultError> {
    let (digits, unit_s) = match part.strip_suffix("ms") {
        Some(digits) => (digits, 1e-3),
        None => (part.strip_suffix('s').unwrap_or(""), 1.0),
    };
    let value = digits.parse::<f64>().ok().map(|value| value * unit_s);
    value
        .filter(|seconds| (0.0..=3600.0).contains(seconds))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| wrong(text, part, "time, as 2s or 500ms"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_the_manual_are_faults() {
        let parsed = |text: &str| text.parse::<Fault>().expect(text);
        let fault = parsed("silent:3@2s+500ms");
        assert_eq!(fault.kind, FaultKind::Silent { id: 3 });
        let active = [1999, 2000, 2499, 2500].map(|ms| fault.is_active(Duration::from_millis(ms)));
        assert_eq!(active, [false, true, true, false]);
        assert!(parsed("bus-off:1@2s").is_active(Duration::from_secs(3000)));
        assert_eq!(
            parsed("pty-closed:1@2s+1s").kind,
            FaultKind::PtyClosed { bus: 0 }
        );
        assert_eq!(
            parsed("drive-fault:3/33@2s+1s").kind,
            FaultKind::Drive { id: 3, code: 33 }
        );
        assert_eq!(
            parsed("brown-out:3@2s+200ms").kind,
            FaultKind::BrownOut { id: 3 }
        );
        assert_eq!(
            parsed("lost:1/0.05@2s").kind,
            FaultKind::Lost {
                bus: 0,
                share: 0.05
            }
        );
        assert_eq!(
            parsed("doubled:2/1@2s").kind,
            FaultKind::Doubled { bus: 1, share: 1.0 }
        );
        assert_eq!(
            parsed("noise:1/0.5@2s").kind,
            FaultKind::Noise { bus: 0, share: 0.5 }
        );
        let by = Duration::from_millis(2);
        assert_eq!(
            parsed("delayed:1/2ms@0s").kind,
            FaultKind::Delayed { bus: 0, by }
        );
    }

    #[test]
    fn other_texts_are_told_what_is_wrong() {
        for (text, says) in [
            ("silent", "KIND:WHERE@START"),
            ("loud:3@2s", "no such fault"),
            ("silent:0@2s", "identifier from 1 to 126"),
            ("silent:3@2", "no time"),
            ("silent:3@-2s", "no time"),
            ("lost:1/2@2s", "share from 0 to 1"),
            ("lost:0/0.5@2s", "bus from 1"),
            ("drive-fault:3/102@1s", "fault code from 32 to 95"),
        ] {
            let error = text.parse::<Fault>().expect_err(text).to_string();
            assert!(
                error.contains(says) && !error.contains('\n'),
                "{text}: {error}"
            );
        }
    }
}
