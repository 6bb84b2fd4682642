//! The highest rate that the whole system holds without missing a deadline by its own fault, found by halving, then held for a
//! minute. A miss is the machine's where the hypervisor stole time, or where a thread of higher priority that does nothing was late
//! at the same time.

use std::collections::BTreeMap;

use rt_loop::report::ExplainedOverrun;

use crate::Extent;
use crate::run::flexspline;
use crate::witness::{Held, Witness};

/// Between the robot's rate and more than any core here can do.
const RATES_HZ: [u64; 2] = [1500, 16_000];
/// The search ends when it knows the rate to this.
const STEP_HZ: u64 = 250;
/// At the answer.
const HOLD_S: u64 = 60;
/// Less by this much, in percent, where the answer does not hold.
const BACK_PERCENT: u64 = 5;
/// The loop wakes this part of the period early, as much of it as 100 µs are at 2500 cycles a second.
const WAKE_EARLY_PERCENT: u64 = 25;
/// By the supervisor's start and the loop's first cycles, seconds.
const START_S: f64 = 0.5;

/// What a trial came to.
struct Trial {
    rate_hz: u64,
    cycles: u64,
    /// Missed deadlines by cause, and whether the machine held a core then.
    misses: BTreeMap<(String, bool), u64>,
    final_state: String,
}

impl Trial {
    fn ours(&self) -> u64 {
        self.of(false)
    }

    fn of(&self, machine: bool) -> u64 {
        let of_kind = self.misses.iter().filter(|((_, held), _)| *held == machine);
        of_kind.map(|(_, count)| count).sum()
    }

    fn show(&self) {
        let causes: Vec<String> = self
            .misses
            .iter()
            .map(|((cause, held), count)| {
                format!("{cause}{} {count}", if *held { " (machine)" } else { "" })
            })
            .collect();
        println!(
            "| {} | {} | {} | {} | {} | {} |",
            self.rate_hz,
            self.cycles,
            self.of(true),
            self.ours(),
            causes.join(", "),
            self.final_state
        );
    }

    /// In a trial of `seconds` a rate holds that misses nothing by itself.
    fn holds(&self) -> bool {
        self.ours() == 0 && self.final_state == "Running"
    }
}

pub fn report(extent: &Extent) {
    println!("trials of {} s; at the answer {HOLD_S} s\n", extent.seconds);
    println!(
        "| cycles a second | cycles | missed, machine | missed, ours | by cause | ended in |\n|---|---|---|---|---|---|"
    );
    let [mut holds_hz, mut fails_hz] = RATES_HZ;
    while fails_hz - holds_hz > STEP_HZ {
        let between_hz = (holds_hz + fails_hz) / 2;
        // A rate that holds does so in one of the rounds; what is ours would show in all.
        let held = (0..extent.rounds).any(|_| {
            let trial = trial(between_hz, extent.seconds);
            trial.show();
            trial.holds()
        });
        match held {
            true => holds_hz = between_hz,
            false => fails_hz = between_hz,
        }
    }
    println!();
    while holds_hz >= RATES_HZ[0] {
        let trial = trial(holds_hz, HOLD_S);
        trial.show();
        if trial.holds() {
            println!("\nheld for {HOLD_S} s: {holds_hz} cycles a second");
            return;
        }
        holds_hz -= holds_hz * BACK_PERCENT / 100;
    }
    println!("\nno rate held for {HOLD_S} s");
}

fn trial(rate_hz: u64, seconds: u64) -> Trial {
    let witness = Witness::start();
    let rate = rate_hz.to_string();
    let early_us = (1_000_000 / rate_hz * WAKE_EARLY_PERCENT / 100).to_string() + "us";
    let arguments = ["--rate", &rate, "--wake-early", &early_us];
    let run = flexspline(&arguments, seconds, None);
    let held = witness.finish();
    let overruns = run.report["timing"]["overruns"].clone();
    let overruns: Vec<ExplainedOverrun> = serde_json::from_value(overruns).unwrap_or_default();
    Trial {
        rate_hz,
        cycles: run.counter("cycles"),
        misses: sort(&overruns, &held, 1_000_000_000 / rate_hz),
        final_state: run.report["timing"]["final_state"]
            .as_str()
            .unwrap_or("no report")
            .to_owned(),
    }
}

/// The start does not count: processes join, and every page is touched for the first time.
fn sort(
    overruns: &[ExplainedOverrun],
    held: &Held,
    period_ns: u64,
) -> BTreeMap<(String, bool), u64> {
    let mut misses = BTreeMap::new();
    let begun_cycle = (START_S * 1e9) as u64 / period_ns;
    for overrun in overruns
        .iter()
        .filter(|overrun| overrun.cycle > begun_cycle)
    {
        let late_ns = (overrun.wakeup_lateness_us.max(overrun.finished_after_us) * 1e3) as u64;
        let from_ns = overrun.planned_ns.saturating_sub(period_ns + late_ns);
        let stolen = overrun.cause == rt_loop::attribution::Cause::Stolen;
        let machine = stolen || held.between(from_ns, overrun.planned_ns + late_ns + period_ns);
        let cause = overrun.cause.label().to_owned();
        *misses.entry((cause, machine)).or_default() += overrun.periods;
    }
    misses
}
