//! The core the loop would get, and what disturbs it.

use super::finding::{Finding, Rule, Verdict};

const OWN_CORE: Rule = Rule {
    about: "cores",
    wanted: "two or more, the last one for the loop alone",
    mend: "give this process more cores: CPUAffinity in the unit file, cpuset of the container, or taskset",
    cost: "loop and services take turns on one core: the loop waits for whoever is in the kernel",
};

/// Whether the loop gets a core of its own, of the `usable` ones.
pub fn own_core(usable: &[usize], loop_core: Option<usize>) -> Finding {
    match loop_core {
        Some(core) => OWN_CORE.finds(
            Verdict::Good,
            format!("{} usable, the loop takes core {core}", usable.len()),
        ),
        None => OWN_CORE.finds(Verdict::Weak, format!("{} usable", usable.len())),
    }
}

const ISOLATION: Rule = Rule {
    about: "isolated core",
    wanted: "the loop's core is kept free of everybody else",
    mend: "",
    cost: "the kernel puts other processes and its own chores on the loop's core",
};

/// Whether the kernel keeps others off the loop's core; `isolated` is the kernel's list, as `2-3,7`.
pub fn isolation(isolated: Option<&str>, loop_core: Option<usize>) -> Finding {
    let Some(cores) = isolated.and_then(core_list) else {
        return Finding {
            mend: None,
            ..ISOLATION.finds_nothing("/sys/devices/system/cpu/isolated")
        };
    };
    let named = if cores.is_empty() {
        "no core is isolated".to_owned()
    } else {
        format!("isolated: {}", isolated.unwrap_or_default().trim())
    };
    let good = loop_core.is_some_and(|core| cores.contains(&core));
    let mend = loop_core.map(|core| {
        format!(
            "add isolcpus=managed_irq,domain,{core} nohz_full={core} rcu_nocbs={core} to the kernel's command line, and \
             name that core last in CPUAffinity of the unit: isolated cores are given to nobody who does not ask"
        )
    });
    Finding {
        mend,
        ..ISOLATION.finds_good_if(good, Verdict::Weak, named)
    }
}

/// The numbers of a kernel's list of cores.
fn core_list(text: &str) -> Option<Vec<usize>> {
    let mut cores = Vec::new();
    for part in text.trim().split(',').filter(|part| !part.is_empty()) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
        if last >= CORES_MAX {
            return None;
        }
        cores.extend(first..=last);
    }
    Some(cores)
}

/// More than any kernel knows: a list beyond it is no list of cores.
const CORES_MAX: usize = 65_536;

const SIBLINGS: Rule = Rule {
    about: "hyper-threads",
    wanted: "the loop's core computes for nobody else",
    mend: "echo off > /sys/devices/system/cpu/smt/control, or keep the sibling idle with isolcpus",
    cost: "whatever runs on the sibling takes part of the core's speed and of its caches",
};

/// Whether the loop's core is one of several threads of a physical core.
pub fn siblings(siblings: Option<&str>, loop_core: Option<usize>) -> Finding {
    let (Some(cores), Some(loop_core)) = (siblings.and_then(core_list), loop_core) else {
        return SIBLINGS.finds_nothing("the loop core's topology");
    };
    let others: Vec<String> = cores
        .iter()
        .filter(|&&core| core != loop_core)
        .map(usize::to_string)
        .collect();
    if others.is_empty() {
        return SIBLINGS.finds(Verdict::Good, "none on the loop's core");
    }
    SIBLINGS.finds(
        Verdict::Weak,
        format!(
            "core {loop_core} shares its physical core with {}",
            others.join(", ")
        ),
    )
}

const GOVERNOR: Rule = Rule {
    about: "frequency governor",
    wanted: "performance",
    mend: "cpupower frequency-set -g performance, at every boot: systemctl enable cpupower.service",
    cost: "the core slows down while the loop sleeps, and every cycle begins slowly",
};

/// How the loop's core chooses its speed.
pub fn governor(governor: Option<&str>) -> Finding {
    match governor.map(str::trim) {
        None => Finding {
            mend: None,
            ..GOVERNOR.finds(
                Verdict::Unknown,
                "not shown; in a virtual machine it is the host's",
            )
        },
        Some(governor) => {
            GOVERNOR.finds_good_if(governor == "performance", Verdict::Weak, governor)
        }
    }
}

/// One sleep state of a core.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SleepState {
    /// The kernel's name.
    pub name: String,
    /// From being woken to working.
    pub latency_us: u64,
}

/// Waking takes no longer than this from a state that needs no mending.
const SHALLOW_US: u64 = 2;

const SLEEP: Rule = Rule {
    about: "sleep states",
    wanted: "held off while the loop runs (/dev/cpu_dma_latency)",
    mend: "deploy/udev/60-flexspline.rules into /etc/udev/rules.d/, and your user into group realtime; or run as root",
    cost: "the core has to wake up first, in every cycle",
};

/// Whether the loop can keep its core out of deep sleep.
pub fn sleep_states(states: Option<&[SleepState]>, can_hold: bool) -> Finding {
    let deepest = states.and_then(|states| states.iter().max_by_key(|state| state.latency_us));
    let is = match deepest {
        Some(state) => format!("deepest is {}, {} µs to wake", state.name, state.latency_us),
        None => "none shown".to_owned(),
    };
    let shallow = states.is_some() && deepest.is_none_or(|state| state.latency_us <= SHALLOW_US);
    if can_hold {
        SLEEP.finds(Verdict::Good, format!("{is}; may be held off"))
    } else if shallow {
        SLEEP.finds(Verdict::Good, is)
    } else {
        SLEEP.finds(
            Verdict::Weak,
            format!("{is}; /dev/cpu_dma_latency cannot be opened for writing"),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_cores_are_read_as_the_kernel_writes_them() {
        assert_eq!(core_list("\n"), Some(vec![]));
        assert_eq!(core_list("1,3-5\n"), Some(vec![1, 3, 4, 5]));
        assert_eq!(core_list("(null)"), None);
        assert_eq!(core_list("0-99999999999"), None);
    }

    #[test]
    fn only_the_loops_own_core_has_to_be_isolated() {
        assert_eq!(isolation(Some("2-3\n"), Some(3)).verdict, Verdict::Good);
        let other = isolation(Some("1\n"), Some(3));
        assert_eq!(other.verdict, Verdict::Weak);
        assert!(other.mend.is_some_and(|mend| mend.contains("nohz_full=3")));
        assert_eq!(isolation(None, Some(3)).verdict, Verdict::Unknown);
        assert_eq!(isolation(Some(""), None).mend, None, "no core to isolate");
    }

    #[test]
    fn a_sibling_is_named() {
        assert_eq!(siblings(Some("1\n"), Some(1)).verdict, Verdict::Good);
        let shared = siblings(Some("1,5\n"), Some(1));
        assert!(shared.is.ends_with("with 5"), "{}", shared.is);
        assert_eq!(siblings(None, Some(1)).verdict, Verdict::Unknown);
    }

    #[test]
    fn one_core_is_weak_and_a_saving_governor_too() {
        assert_eq!(own_core(&[0, 1], Some(1)).verdict, Verdict::Good);
        assert_eq!(own_core(&[0], None).verdict, Verdict::Weak);
        assert_eq!(governor(Some("performance\n")).verdict, Verdict::Good);
        assert_eq!(governor(Some("powersave\n")).verdict, Verdict::Weak);
        assert_eq!(governor(None).verdict, Verdict::Unknown);
    }

    #[test]
    fn deep_sleep_is_only_weak_where_it_cannot_be_held_off() {
        let states = [("POLL", 0), ("C6", 133)].map(|(name, latency_us)| SleepState {
            name: name.to_owned(),
            latency_us,
        });
        let deep = sleep_states(Some(&states), false);
        assert_eq!(deep.verdict, Verdict::Weak);
        assert!(deep.is.contains("C6, 133 µs"), "{}", deep.is);
        assert_eq!(sleep_states(Some(&states), true).verdict, Verdict::Good);
        assert_eq!(
            sleep_states(Some(&states[..1]), false).verdict,
            Verdict::Good
        );
        assert_eq!(sleep_states(None, false).verdict, Verdict::Weak);
    }
}
