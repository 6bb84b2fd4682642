//! What the kernel was built and booted with: preemption, throttling of real-time threads, its clock, its host.

use super::finding::{Finding, Rule, Verdict};

const PREEMPTION: Rule = Rule {
    about: "kernel preemption",
    wanted: "full, or better PREEMPT_RT",
    mend: "install a real-time kernel (Debian: apt install linux-image-rt-amd64), or add preempt=full to the kernel's \
           command line where the kernel is PREEMPT_DYNAMIC",
    cost: "a system call of any other process on the loop's core holds up its wake-up until it ends",
};

/// How willing the kernel is to interrupt itself. `version` is `/proc/version`, `chosen` the scheduler's debug file,
/// `command_line` what it was booted with, `config` what it was built with.
pub fn preemption(
    version: Option<&str>,
    chosen: Option<&str>,
    command_line: Option<&str>,
    config: Option<&str>,
) -> Finding {
    let Some(version) = version else {
        return PREEMPTION.finds_nothing("/proc/version");
    };
    if version.contains("PREEMPT_RT") || version.contains("PREEMPT RT") {
        return PREEMPTION.finds(Verdict::Good, "PREEMPT_RT");
    }
    let dynamic = version.contains("PREEMPT_DYNAMIC");
    let model = if dynamic {
        chosen
            .and_then(in_parentheses)
            .or_else(|| command_line.and_then(|line| setting(line, "preempt=")))
            .or_else(|| config.and_then(built_model))
    } else if version.contains("PREEMPT") {
        Some("full")
    } else {
        config.and_then(built_model).or(Some("none or voluntary"))
    };
    let Some(model) = model else {
        return PREEMPTION.finds(
            Verdict::Unknown,
            "PREEMPT_DYNAMIC, choice not shown; root sees it in /sys/kernel/debug/sched/preempt",
        );
    };
    let of_choice = if dynamic { " (PREEMPT_DYNAMIC)" } else { "" };
    PREEMPTION.finds_good_if(
        model == "full",
        Verdict::Weak,
        format!("{model}{of_choice}"),
    )
}

/// The chosen word of `none voluntary (full) lazy`.
fn in_parentheses(text: &str) -> Option<&str> {
    text.split_once('(')?
        .1
        .split_once(')')
        .map(|(word, _)| word)
}

fn setting<'a>(command_line: &'a str, key: &str) -> Option<&'a str> {
    command_line
        .split_whitespace()
        .find_map(|word| word.strip_prefix(key))
}

fn built_model(config: &str) -> Option<&'static str> {
    let is_set = |key: &str| config.lines().any(|line| line.trim() == format!("{key}=y"));
    [
        ("CONFIG_PREEMPT_NONE", "none"),
        ("CONFIG_PREEMPT_VOLUNTARY", "voluntary"),
        ("CONFIG_PREEMPT_LAZY", "lazy"),
        ("CONFIG_PREEMPT", "full"),
    ]
    .into_iter()
    .find_map(|(key, model)| is_set(key).then_some(model))
}

const THROTTLING: Rule = Rule {
    about: "real-time throttling",
    wanted: "off (kernel.sched_rt_runtime_us = -1)",
    mend: "deploy/sysctl/60-flexspline.conf into /etc/sysctl.d/, or sysctl -w kernel.sched_rt_runtime_us=-1",
    cost: "a real-time thread that does not sleep, as with --wait spin, is stopped for the rest of every period; \
           off, a real-time thread that hangs takes its core for good",
};

/// Whether the kernel takes the processor from a busy real-time thread.
pub fn throttling(runtime_us: Option<&str>, period_us: Option<&str>) -> Finding {
    let parse = |text: Option<&str>| text.and_then(|text| text.trim().parse::<i64>().ok());
    let Some(runtime_us) = parse(runtime_us) else {
        return THROTTLING.finds_nothing("/proc/sys/kernel/sched_rt_runtime_us");
    };
    if runtime_us < 0 {
        return THROTTLING.finds(Verdict::Good, "off");
    }
    let is = match parse(period_us) {
        Some(period_us) => format!("{runtime_us} µs in every {period_us} µs"),
        None => format!("{runtime_us} µs in every period"),
    };
    THROTTLING.finds_good_if(runtime_us < 0, Verdict::Weak, is)
}

const GROUP_SHARE: Rule = Rule {
    about: "real-time share of the control group",
    wanted: "more than 0 (cpu.rt_runtime_us)",
    mend: "write a share to the group's cpu.rt_runtime_us, or boot with rt_group_sched=0",
    cost: "SCHED_FIFO is refused whatever the user's limits are",
};

/// Where the kernel shares real-time out to control groups, whether ours has any; nothing where it does not.
pub fn group_share(runtime_us: Option<&str>) -> Option<Finding> {
    let runtime_us: i64 = runtime_us?.trim().parse().ok()?;
    Some(GROUP_SHARE.finds_good_if(
        runtime_us != 0,
        Verdict::Missing,
        format!("{runtime_us} µs"),
    ))
}

/// The control group that holds our share of processor time, from `/proc/self/cgroup`: version 1, which alone shares
/// out real time.
pub fn cpu_group(cgroup: &str) -> Option<&str> {
    cgroup.lines().find_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        let controllers = fields.next()?;
        let group = fields.next()?;
        controllers
            .split(',')
            .any(|name| name == "cpu")
            .then_some(group)
    })
}

const CLOCK: Rule = Rule {
    about: "clock source",
    wanted: "tsc, or the hypervisor's equal (kvm-clock, hyperv); arch_sys_counter on Arm",
    mend: "write tsc to /sys/devices/system/clocksource/clocksource0/current_clocksource; if it is not among \
           available_clocksource, add tsc=reliable to the kernel's command line",
    cost: "every look at the clock, several in a cycle, is a slow access to a device",
};

/// What the monotonic clock is read from.
pub fn clock(current: Option<&str>) -> Finding {
    let Some(current) = current.map(str::trim) else {
        return CLOCK.finds_nothing("/sys/devices/system/clocksource");
    };
    let fast = ["tsc", "kvm-clock", "arch_sys_counter"].contains(&current)
        || current.starts_with("hyperv");
    CLOCK.finds_good_if(fast, Verdict::Weak, current)
}

const HOST: Rule = Rule {
    about: "hypervisor",
    wanted: "none",
    mend: "run on the machine itself, or give the guest cores of its own on the host",
    cost: "the host stops cores when it likes: the largest delays are its, and no setting in here removes them",
};

/// Whether somebody else shares out the cores. `cpu_info` is `/proc/cpuinfo`, `stolen_s` the time taken since boot.
pub fn host(cpu_info: Option<&str>, stolen_s: Option<f64>) -> Finding {
    let Some(cpu_info) = cpu_info else {
        return HOST.finds_nothing("/proc/cpuinfo");
    };
    let virtual_machine = cpu_info
        .lines()
        .filter(|line| line.starts_with("flags"))
        .any(|line| line.split_whitespace().any(|flag| flag == "hypervisor"));
    if !virtual_machine {
        return HOST.finds(Verdict::Good, "none seen");
    }
    let stolen = stolen_s.map_or(String::new(), |stolen_s| {
        format!("; {stolen_s:.2} s stolen from all cores since boot")
    });
    HOST.finds(Verdict::Weak, format!("a virtual machine{stolen}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DYNAMIC: &str = "Linux version 6.12 (gcc 14) #1 SMP PREEMPT_DYNAMIC Debian";

    #[test]
    fn the_running_choice_outweighs_boot_and_build() {
        let judge = |chosen, line, config| preemption(Some(DYNAMIC), chosen, line, config);
        let build = Some("CONFIG_PREEMPT_NONE=y\n# CONFIG_PREEMPT is not set\n");
        let full = judge(Some("none voluntary (full) lazy\n"), None, build);
        assert_eq!(
            (full.verdict, full.is.as_str()),
            (Verdict::Good, "full (PREEMPT_DYNAMIC)")
        );
        let booted = judge(None, Some("quiet preempt=voluntary ro"), build);
        assert_eq!(
            (booted.verdict, booted.is.as_str()),
            (Verdict::Weak, "voluntary (PREEMPT_DYNAMIC)")
        );
        assert_eq!(
            judge(None, Some("quiet"), build).is,
            "none (PREEMPT_DYNAMIC)"
        );
        assert_eq!(judge(None, None, None).verdict, Verdict::Unknown);
    }

    #[test]
    fn kernels_without_choice_are_told_by_their_version() {
        let judge = |version| preemption(Some(version), None, None, None);
        assert_eq!(
            judge("Linux version 6.12-rt #1 SMP PREEMPT_RT x").is,
            "PREEMPT_RT"
        );
        assert_eq!(
            judge("Linux version 5.10-rt #1 SMP PREEMPT RT x").verdict,
            Verdict::Good
        );
        assert_eq!(
            judge("Linux version 5.4 #1 SMP PREEMPT x").verdict,
            Verdict::Good
        );
        assert_eq!(judge("Linux version 5.4 #1 SMP x").verdict, Verdict::Weak);
        assert_eq!(preemption(None, None, None, None).verdict, Verdict::Unknown);
    }

    #[test]
    fn throttling_is_off_only_when_negative() {
        assert_eq!(
            throttling(Some("-1\n"), Some("1000000\n")).verdict,
            Verdict::Good
        );
        let on = throttling(Some("950000\n"), Some("1000000\n"));
        assert_eq!(
            (on.verdict, on.is.as_str()),
            (Verdict::Weak, "950000 µs in every 1000000 µs")
        );
        assert_eq!(throttling(Some("text"), None).verdict, Verdict::Unknown);
    }

    #[test]
    fn only_an_empty_share_of_a_group_is_a_fault() {
        assert_eq!(group_share(None), None);
        assert_eq!(
            group_share(Some("0\n")).map(|finding| finding.verdict),
            Some(Verdict::Missing)
        );
        assert_eq!(
            group_share(Some("950000")).map(|finding| finding.verdict),
            Some(Verdict::Good)
        );
        let both = "12:cpuset:/x\n4:cpu,cpuacct:/docker/ab\n0::/\n";
        assert_eq!(cpu_group(both), Some("/docker/ab"));
        assert_eq!(cpu_group("0::/user.slice\n"), None, "version 2");
    }

    #[test]
    fn slow_clocks_and_hosts_are_named() {
        assert_eq!(clock(Some("tsc\n")).verdict, Verdict::Good);
        assert_eq!(clock(Some("hpet\n")).verdict, Verdict::Weak);
        assert_eq!(clock(None).verdict, Verdict::Unknown);
        let guest = host(
            Some("model name : x\nflags\t\t: fpu hypervisor sse\n"),
            Some(1.5),
        );
        assert_eq!(guest.verdict, Verdict::Weak);
        assert!(guest.is.contains("1.50 s"), "{}", guest.is);
        assert_eq!(host(Some("flags : fpu sse\n"), None).verdict, Verdict::Good);
    }
}
