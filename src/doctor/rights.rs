//! What this user may ask of the kernel, and what the system does with his files.

use super::finding::{Finding, Rule, Verdict};

const PRIORITY: Rule = Rule {
    about: "real-time priority",
    wanted: "limit rtprio at least the loop's priority, or CAP_SYS_NICE",
    mend: "deploy/limits/60-flexspline.conf into /etc/security/limits.d/, your user into group realtime, log in anew; \
           in a unit file LimitRTPRIO=95",
    cost: "the loop runs on the ordinary scheduler, and waits like every other process",
};

/// Whether SCHED_FIFO at `priority` is allowed. `limits` is `/proc/self/limits`, `status` is `/proc/self/status`.
pub fn priority(limits: Option<&str>, status: Option<&str>, priority: u8) -> Finding {
    let capable = status.is_some_and(|status| has_capability(status, CAP_SYS_NICE));
    let limit = limits.and_then(|limits| soft_limit(limits, "Max realtime priority"));
    match limit {
        _ if capable => PRIORITY.finds(Verdict::Good, "CAP_SYS_NICE"),
        None => PRIORITY.finds_nothing("/proc/self/limits"),
        Some(Limit::Unlimited) => PRIORITY.finds(Verdict::Good, "rtprio unlimited"),
        Some(Limit::At(limit)) => PRIORITY.finds_good_if(
            limit >= u64::from(priority),
            Verdict::Missing,
            format!("rtprio {limit}, the loop asks for {priority}"),
        ),
    }
}

const MEMORY: Rule = Rule {
    about: "locked memory",
    wanted: "limit memlock unlimited, or CAP_IPC_LOCK",
    mend: "deploy/limits/60-flexspline.conf into /etc/security/limits.d/, your user into group realtime, log in anew; \
           in a unit file LimitMEMLOCK=infinity",
    cost: "memory the loop touches may have been taken away: a page fault in the middle of a cycle",
};

/// Whether all memory may be locked.
pub fn locked_memory(limits: Option<&str>, status: Option<&str>) -> Finding {
    let capable = status.is_some_and(|status| has_capability(status, CAP_IPC_LOCK));
    let limit = limits.and_then(|limits| soft_limit(limits, "Max locked memory"));
    match limit {
        _ if capable => MEMORY.finds(Verdict::Good, "CAP_IPC_LOCK"),
        None => MEMORY.finds_nothing("/proc/self/limits"),
        Some(Limit::Unlimited) => MEMORY.finds(Verdict::Good, "memlock unlimited"),
        Some(Limit::At(bytes)) => {
            MEMORY.finds(Verdict::Missing, format!("memlock {} KiB", bytes / 1024))
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Limit {
    Unlimited,
    At(u64),
}

/// The limit that holds now; the hard one is only how far it could be raised.
fn soft_limit(limits: &str, name: &str) -> Option<Limit> {
    let line = limits.lines().find(|line| line.starts_with(name))?;
    match line[name.len()..].split_whitespace().next()? {
        "unlimited" => Some(Limit::Unlimited),
        number => number.parse().ok().map(Limit::At),
    }
}

/// Numbers of capabilities, from `linux/capability.h`.
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

fn has_capability(status: &str, number: u32) -> bool {
    let effective = status
        .lines()
        .find_map(|line| line.strip_prefix("CapEff:"))
        .and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok());
    effective.is_some_and(|bits| bits & (1 << number) != 0)
}

const LOGOUT: Rule = Rule {
    about: "shared memory after logout",
    wanted: "kept (RemoveIPC=no), or a system user runs the instance",
    mend: "deploy/logind/60-flexspline.conf into /etc/systemd/logind.conf.d/, then systemctl restart systemd-logind; or \
           run by deploy/systemd/flexspline@.service",
    cost: "when the user's last session ends, systemd removes his shared memory under the running loop: services that \
           are started again do not find it",
};

/// Users below this number are the system's; systemd leaves their shared memory alone.
const FIRST_ORDINARY_USER: u32 = 1000;

/// Whether systemd removes the user's shared memory when he logs out. `settings` are logind's files, the ones that
/// count more later; none where there is no logind.
pub fn logout(settings: Option<&[String]>, user_id: u32) -> Finding {
    let Some(settings) = settings else {
        return LOGOUT.finds(Verdict::Good, "no systemd here that would remove it");
    };
    if user_id < FIRST_ORDINARY_USER {
        return LOGOUT.finds(Verdict::Good, format!("user {user_id} is a system user"));
    }
    let chosen = settings
        .iter()
        .flat_map(|text| text.lines())
        .filter_map(|line| line.trim().strip_prefix("RemoveIPC="))
        .next_back();
    let removed = !chosen.is_some_and(|word| ["no", "false", "0", "off"].contains(&word.trim()));
    let is = chosen.map_or("RemoveIPC=yes, systemd's default".to_owned(), |word| {
        format!("RemoveIPC={word}")
    });
    LOGOUT.finds_good_if(!removed, Verdict::Weak, is)
}

const AGEING: Rule = Rule {
    about: "age of files in /tmp",
    wanted: "flexspline's files are left alone",
    mend: "deploy/tmpfiles/flexspline.conf into /etc/tmpfiles.d/",
    cost: "systemd removes files that nobody touched for so long: in a run that lasts longer, a service that is started \
           again does not find the run's settings",
};

/// Whether systemd cleans up `/tmp` by age. `settings` are the files of tmpfiles.d; none where there is no systemd.
pub fn ageing(settings: Option<&[String]>) -> Finding {
    let Some(settings) = settings else {
        return AGEING.finds(Verdict::Good, "no systemd here that would remove them");
    };
    let entries = || {
        settings
            .iter()
            .flat_map(|text| text.lines())
            .map(|line| line.split_whitespace().collect::<Vec<_>>())
            .filter(|fields| fields.first().is_some_and(|kind| !kind.starts_with('#')))
    };
    let spared = entries().any(|fields| {
        fields[0].eq_ignore_ascii_case("x")
            && fields
                .get(1)
                .is_some_and(|path| path.starts_with("/tmp/flexspline-"))
    });
    // Kind, path, mode, user, group, age.
    let age = entries()
        .filter(|fields| fields.get(1) == Some(&"/tmp"))
        .find_map(|fields| {
            fields
                .get(5)
                .filter(|&&age| age != "-")
                .map(|age| age.to_string())
        });
    match age {
        _ if spared => AGEING.finds(Verdict::Good, "spared by tmpfiles.d"),
        Some(age) => AGEING.finds(Verdict::Weak, format!("removed after {age}")),
        None => AGEING.finds(Verdict::Good, "not removed by age"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: &str = "\
Limit                     Soft Limit           Hard Limit           Units     
Max locked memory         8388608              unlimited            bytes     
Max realtime priority     0                    99                   
Max realtime timeout      unlimited            unlimited            us        
";
    const NO_CAPABILITIES: &str = "Name:\tx\nCapEff:\t0000000000000000\n";
    const ROOT: &str = "Name:\tx\nCapPrm:\t0\nCapEff:\t000001fffeffffff\n";

    #[test]
    fn the_soft_limit_decides_unless_a_capability_does() {
        let refused = priority(Some(LIMITS), Some(NO_CAPABILITIES), 80);
        assert_eq!(
            (refused.verdict, refused.is.as_str()),
            (Verdict::Missing, "rtprio 0, the loop asks for 80")
        );
        assert_eq!(
            priority(Some(LIMITS), Some(ROOT), 80).verdict,
            Verdict::Good
        );
        let granted = LIMITS.replace("priority     0 ", "priority     80");
        assert_eq!(priority(Some(&granted), None, 80).verdict, Verdict::Good);
        assert_eq!(priority(None, None, 80).verdict, Verdict::Unknown);
        assert_eq!(
            priority(Some(""), Some(NO_CAPABILITIES), 80).verdict,
            Verdict::Unknown
        );
    }

    #[test]
    fn memory_wants_no_limit_at_all() {
        let limited = locked_memory(Some(LIMITS), Some(NO_CAPABILITIES));
        assert_eq!(
            (limited.verdict, limited.is.as_str()),
            (Verdict::Missing, "memlock 8192 KiB")
        );
        let free = LIMITS.replace("memory         8388608  ", "memory         unlimited");
        assert_eq!(
            locked_memory(Some(&free), Some(NO_CAPABILITIES)).verdict,
            Verdict::Good
        );
        assert_eq!(
            locked_memory(Some(LIMITS), Some(ROOT)).verdict,
            Verdict::Good
        );
    }

    #[test]
    fn systemd_removes_shared_memory_of_ordinary_users_by_default() {
        let texts = |texts: &[&str]| {
            texts
                .iter()
                .map(|&text| text.to_owned())
                .collect::<Vec<_>>()
        };
        let default = texts(&["[Login]\n#RemoveIPC=yes\n"]);
        assert_eq!(logout(Some(&default), 1000).verdict, Verdict::Weak);
        assert_eq!(logout(Some(&default), 999).verdict, Verdict::Good);
        let kept = texts(&["[Login]\nRemoveIPC=yes\n", "[Login]\nRemoveIPC=no\n"]);
        assert_eq!(logout(Some(&kept), 1000).verdict, Verdict::Good);
        assert_eq!(logout(None, 1000).verdict, Verdict::Good);
    }

    #[test]
    fn an_age_of_tmp_counts_unless_our_files_are_spared() {
        let aged = "# comment\nq /tmp 1777 root root 10d\n".to_owned();
        let found = ageing(Some(std::slice::from_ref(&aged)));
        assert_eq!(
            (found.verdict, found.is.as_str()),
            (Verdict::Weak, "removed after 10d")
        );
        let spared = [aged, "x /tmp/flexspline-*\n".to_owned()];
        assert_eq!(ageing(Some(&spared)).verdict, Verdict::Good);
        let kept = ["D /tmp 1777 root root -\n".to_owned()];
        assert_eq!(ageing(Some(&kept)).verdict, Verdict::Good);
    }
}
