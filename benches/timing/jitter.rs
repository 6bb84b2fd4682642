//! How late the loop wakes up, beside `cyclictest` on the same core with the same priority, period and latency setting: asleep to
//! the instant, and waking early to watch the clock. Each core in turn, without and with load.

use std::collections::BTreeMap;

use realtime::cores::usable_cores;
use rt_loop::process::FIFO_PRIORITY;

use crate::Extent;
use crate::histograms::{Times, cells, empty, quantiles_us, ratios, write_hgrm};
use crate::page;
use crate::run::{Run, flexspline};
use crate::yardstick::{Load, PERIOD_US, cyclictest};

const SIDES: [&str; 3] = ["cyclictest", "loop", "loop, waking early"];
const LOADS: [&str; 2] = ["no load", "stress-ng"];

/// One side under one load: quantiles of each round and core, and all of it.
struct Side {
    rounds: Vec<[f64; 3]>,
    all: Times,
}

impl Side {
    fn add(&mut self, times: &Times) {
        self.rounds.push(quantiles_us(times));
        self.all += times;
    }
}

pub fn report(extent: &Extent) {
    let cores = usable_cores();
    let own_cores: Vec<usize> = cores.iter().rev().take(2).copied().collect();
    println!(
        "{} rounds of {} s for each case, cores {own_cores:?} in turn, SCHED_FIFO {FIFO_PRIORITY}, {PERIOD_US} µs\n",
        extent.rounds, extent.seconds
    );
    let side = || Side {
        rounds: Vec::new(),
        all: empty(),
    };
    let mut results = LOADS.map(|_| SIDES.map(|_| side()));
    let mut causes = LOADS.map(|_| BTreeMap::new());
    for round in 1..=extent.rounds {
        for &core in &own_cores {
            for (index, name) in LOADS.into_iter().enumerate() {
                let load = match index {
                    0 => Some(Load::none()),
                    _ => Load::start(),
                };
                let Some(_load) = load else {
                    println!("{name} is not installed");
                    continue;
                };
                let place = format!("{}-core{core}-round{round}", name.replace(' ', "-"));
                let sides = &mut results[index];
                if let Some(times) = cyclictest(core, extent.seconds) {
                    sides[0].add(&times);
                    let file = format!("jitter-cyclictest-{place}.hgrm");
                    write_hgrm(&extent.folder.join(file), &times);
                }
                for (side, early) in [(1, "0s"), (2, "100us")] {
                    let core = core.to_string();
                    let log = format!("jitter-early-{early}-{place}");
                    let run = flexspline(
                        &["--loop-core", &core, "--wake-early", early],
                        extent.seconds,
                        Some((&extent.folder, &log)),
                    );
                    sides[side].add(&run.lateness);
                    count_causes(&mut causes[index], &run);
                }
            }
        }
    }
    for (name, sides) in LOADS.iter().zip(&results) {
        show(name, sides);
        for (side, result) in SIDES.iter().zip(sides) {
            let file = format!("jitter-{name}-{side}.hgrm").replace([' ', ','], "-");
            write_hgrm(&extent.folder.join(file), &result.all);
        }
    }
    for (name, causes) in LOADS.iter().zip(&causes) {
        println!("missed deadlines by cause, {name}: {causes:?}");
    }
    let panels = LOADS.iter().zip(&results).map(|(name, sides)| {
        let cases = SIDES.iter().zip(sides);
        page::percentiles(name, cases.map(|(name, side)| (*name, &side.all)))
    });
    let figure = page::figure("Late at wake-up, all rounds and cores.", panels.collect());
    page::write(&extent.folder.join("jitter.html"), "Wake-ups", vec![figure]);
}

fn show(load: &str, sides: &[Side; 3]) {
    println!("| {load}: late, µs | p50 | p99 | p99.9 | max |\n|---|---|---|---|---|");
    for (name, side) in SIDES.iter().zip(sides) {
        let max_us = side.all.max() as f64 * 1e-3;
        println!("| {name} | {} | {max_us:.0} |", cells(&side.rounds, 1));
    }
    for index in [1, 2] {
        let over = ratios(&sides[index].rounds, &sides[0].rounds);
        println!(
            "| {} over cyclictest | {} | |",
            SIDES[index],
            cells(&over, 2)
        );
    }
    println!();
}

fn count_causes(causes: &mut BTreeMap<String, u64>, run: &Run) {
    let counted = run.report["timing"]["overrun_causes"].as_object();
    for (cause, count) in counted.into_iter().flatten() {
        *causes.entry(cause.clone()).or_default() += count.as_u64().unwrap_or(0);
    }
    *causes.entry("of all cycles".to_owned()).or_default() += run.counter("cycles");
}
