//! Faults to put into a segment, and how they are written.

use std::str::FromStr;

/// What breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The cable behind so many slaves is out: 0 is the master's own.
    CableOut {
        /// Slaves before it.
        after: usize,
        /// How long.
        for_ns: u64,
    },
    /// Frames do not come back.
    FrameLost {
        /// How many.
        count: u32,
    },
    /// Frames come back twice.
    FrameDoubled {
        /// How many.
        count: u32,
    },
    /// Frames come back late.
    FrameDelayed {
        /// How many.
        count: u32,
        /// By how much.
        by_ns: u64,
    },
    /// A slave passes process data on without serving them.
    CounterShort {
        /// Which slave.
        slave: usize,
        /// How many datagrams.
        count: u32,
    },
    /// A slave starts anew.
    SlaveReset {
        /// Which slave.
        slave: usize,
    },
    /// A drive reports a fault.
    DriveFault {
        /// The robot's joint behind it.
        joint: usize,
        /// Error code (0x603f).
        code: u16,
        /// How long its cause stays.
        for_ns: u64,
    },
    /// High voltage of a slave's axes breaks down.
    BrownOut {
        /// Which slave.
        slave: usize,
        /// How long.
        for_ns: u64,
    },
    /// SYNC0 does not reach a drive.
    DcLost {
        /// Which slave.
        slave: usize,
        /// How long.
        for_ns: u64,
    },
    /// A slave takes requests into its mailbox and answers none.
    MailboxSilent {
        /// Which slave.
        slave: usize,
        /// How long.
        for_ns: u64,
    },
}

/// A fault and when it comes, counted from the moment all slaves were first in OP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedFault {
    /// When.
    pub at_ns: u64,
    /// What.
    pub fault: Fault,
}

/// Kinds by name, with the keys of each.
const KINDS: [(&str, &[&str]); 10] = [
    ("cable-out", &["after", "for"]),
    ("frame-lost", &["count"]),
    ("frame-doubled", &["count"]),
    ("frame-delayed", &["count", "by"]),
    ("counter-short", &["slave", "count"]),
    ("slave-reset", &["slave"]),
    ("drive-fault", &["joint", "code", "for"]),
    ("brown-out", &["slave", "for"]),
    ("dc-lost", &["slave", "for"]),
    ("mailbox-silent", &["slave", "for"]),
];

impl FromStr for TimedFault {
    type Err = String;

    /// Reads `KIND:KEY=VALUE,KEY=VALUE@TIME`, as `cable-out:after=1,for=500ms@3s`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (what, at) = text
            .rsplit_once('@')
            .ok_or_else(|| format!("fault `{text}`: no time; write it as {text}@3s"))?;
        let (kind, given) = what.split_once(':').unwrap_or((what, ""));
        let (_, keys) = KINDS
            .iter()
            .find(|(name, _)| *name == kind)
            .ok_or_else(|| {
                let names = KINDS.map(|(name, _)| name).join(", ");
                format!("fault `{kind}` is unknown; known: {names}")
            })?;
        let pairs = pairs(kind, given, keys)?;
        let at_ns = duration_ns(at)?;
        let number = |key: &str, otherwise: u64| match pairs.iter().find(|(name, _)| *name == key) {
            Some((_, value)) => number(kind, key, value),
            None => Ok(otherwise),
        };
        let time = |key: &str, otherwise: &str| {
            let found = pairs.iter().find(|(name, _)| *name == key);
            duration_ns(found.map_or(otherwise, |(_, value)| value))
        };
        let index = |key: &str| number(key, 0).map(|value| value as usize);
        let count = || number("count", 1).map(|value| value.min(u64::from(u32::MAX)) as u32);
        let fault = match kind {
            "cable-out" => Fault::CableOut {
                after: index("after")?,
                for_ns: time("for", "1s")?,
            },
            "frame-lost" => Fault::FrameLost { count: count()? },
            "frame-doubled" => Fault::FrameDoubled { count: count()? },
            "frame-delayed" => Fault::FrameDelayed {
                count: count()?,
                by_ns: time("by", "1ms")?,
            },
            "counter-short" => Fault::CounterShort {
                slave: index("slave")?,
                count: count()?,
            },
            "slave-reset" => Fault::SlaveReset {
                slave: index("slave")?,
            },
            "drive-fault" => Fault::DriveFault {
                joint: index("joint")?,
                code: number("code", 0x2310)? as u16,
                for_ns: time("for", "0s")?,
            },
            "brown-out" => Fault::BrownOut {
                slave: index("slave")?,
                for_ns: time("for", "100ms")?,
            },
            "dc-lost" => Fault::DcLost {
                slave: index("slave")?,
                for_ns: time("for", "1s")?,
            },
            _ => Fault::MailboxSilent {
                slave: index("slave")?,
                for_ns: time("for", "1s")?,
            },
        };
        Ok(Self { at_ns, fault })
    }
}

fn pairs<'a>(kind: &str, given: &'a str, keys: &[&str]) -> Result<Vec<(&'a str, &'a str)>, String> {
    given
        .split(',')
        .filter(|pair| !pair.is_empty())
        .map(|pair| {
            let (key, value) = pair
                .split_once('=')
                .ok_or_else(|| format!("fault {kind}: `{pair}` has no value; write {pair}=1"))?;
            if keys.contains(&key) {
                Ok((key, value))
            } else {
                let known = keys.join(", ");
                Err(format!("fault {kind}: `{key}` is unknown; known: {known}"))
            }
        })
        .collect()
}

fn number(kind: &str, key: &str, value: &str) -> Result<u64, String> {
    let parsed = match value.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16),
        None => value.parse(),
    };
    parsed.map_err(|_| format!("fault {kind}: {key}={value} is no number"))
}

/// Reads `500us`, `1.5ms` or `3s`.
fn duration_ns(text: &str) -> Result<u64, String> {
    let units = [("us", 1e3), ("ms", 1e6), ("s", 1e9)];
    units
        .iter()
        .find_map(|(unit, ns)| {
            let value: f64 = text.strip_suffix(unit)?.parse().ok()?;
            let duration_ns = value * ns;
            (0.0..1e18)
                .contains(&duration_ns)
                .then_some(duration_ns as u64)
        })
        .ok_or_else(|| format!("`{text}` is no time; write it as 500us, 1.5ms or 3s"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_written() {
        let read = |text: &str| text.parse::<TimedFault>();
        assert_eq!(
            read("cable-out:after=1,for=500ms@3s"),
            Ok(TimedFault {
                at_ns: 3_000_000_000,
                fault: Fault::CableOut {
                    after: 1,
                    for_ns: 500_000_000
                },
            })
        );
        assert_eq!(
            read("drive-fault:joint=2,code=0x3210@1.5s"),
            Ok(TimedFault {
                at_ns: 1_500_000_000,
                fault: Fault::DriveFault {
                    joint: 2,
                    code: 0x3210,
                    for_ns: 0
                },
            })
        );
        for (kind, _) in KINDS {
            assert!(read(&format!("{kind}@0s")).is_ok(), "{kind}");
        }
    }

    #[test]
    fn what_is_wrong_is_said() {
        let cases = [
            ("frame-lost", "no time"),
            ("frame-lots@1s", "known: cable-out"),
            ("frame-lost:n=1@1s", "known: count"),
            ("frame-lost:count@1s", "no value"),
            ("frame-lost:count=x@1s", "no number"),
            ("frame-lost@1h", "no time"),
            ("frame-lost@-1s", "no time"),
        ];
        for (text, part) in cases {
            let error = text.parse::<TimedFault>().expect_err(text);
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
