//! How well the loop keeps its time, beside yardsticks on the same machine in the same minutes: each round has every case once,
//! so that all share the machine's moods. Nothing is asserted: it reports. As root: without real-time rights neither side is
//! worth comparing.
//!
//! ```sh
//! cargo bench --bench timing -- jitter       # wake-ups beside cyclictest, cores swapped, without and with load
//! cargo bench --bench timing -- exchange     # sample to command beside a bare exchange of equal messages
//! cargo bench --bench timing -- rate         # the highest rate held
//! cargo bench --bench timing -- scaling      # over joints and observers
//! ```
//! After the name: rounds, seconds of each case, folder. `cyclictest` is in Debian's rt-tests, the load is Debian's stress-ng.
//! The folder (target/timing) gets HdrHistogram's `.hgrm` files and a page with plots, NAME.html.
#![allow(missing_docs, reason = "a program, not a library")]

mod echo;
mod exchange;
mod histograms;
mod jitter;
mod page;
mod rate;
mod run;
mod scaling;
mod witness;
mod yardstick;

use std::path::PathBuf;

/// Rounds, seconds of each case, and where files go.
pub struct Extent {
    pub rounds: u64,
    pub seconds: u64,
    pub folder: PathBuf,
}

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    if let [flag, name, wait] = words.as_slice()
        && flag == echo::FLAG
    {
        return echo::answer(name, wait);
    }
    if let [flag, name] = words.as_slice()
        && flag == scaling::FLAG
    {
        return scaling::observe(name);
    }
    let number = |index: usize, default: u64| {
        words
            .get(index)
            .and_then(|word| word.parse().ok())
            .unwrap_or(default)
    };
    let extent = Extent {
        rounds: number(1, 3),
        seconds: number(2, 10),
        folder: PathBuf::from(words.get(3).map_or("target/timing", String::as_str)),
    };
    std::fs::create_dir_all(&extent.folder).expect("a folder");
    match words.first().map_or("jitter", String::as_str) {
        "jitter" => jitter::report(&extent),
        "exchange" => exchange::report(&extent),
        "rate" => rate::report(&extent),
        "scaling" => scaling::report(&extent),
        other => println!("unknown bench `{other}`; known: jitter, exchange, rate, scaling"),
    }
}
