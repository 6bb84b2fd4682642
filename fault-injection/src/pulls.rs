//! Cables pulled out of a moving robot and put back, again and again, at random places and for random times.

use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg32;
use rt_loop::cycle::Orders;
use serde::Serialize;
use shm_types::messages::LoopState;
use virtual_drives::{BusFault, EthercatFault, Kind, MoteusFault};

use crate::bench::{Bench, BenchError, FaultyLoop};
use crate::outcome::Account;
use crate::scenarios::Scenario;

/// A cable is out for 0.1 ms to 500 ms, short times as often as long ones.
const SHORTEST_NS: f64 = 1e5;
const LONGEST_NS: f64 = 5e8;
/// Cycles of `Running` before the next pull: 0.1 s to 0.4 s.
const CALM_CYCLES: (u64, u64) = (150, 600);
/// Somebody looks at a stop for a third of a second, then resets; a reset that does not help is tried again after two seconds.
const LOOK_CYCLES: u64 = 500;
const AGAIN_CYCLES: u64 = 3000;
/// Not running so long after a pull, half a minute, is counted as never.
const NEVER_CYCLES: u64 = 45_000;

/// What the pulls came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Pulls {
    /// How many.
    pub pulls: u64,
    /// After so many the run went on by itself.
    pub went_on: u64,
    /// So many ended in a safe stop and ran again after a reset.
    pub reset: u64,
    /// After so many a joint was broken: the next ones are of a new start.
    pub faulted: u64,
    /// So many did not run again.
    pub never: u64,
    /// Longest time from a pull until it ran again by itself.
    pub longest_cycles: u64,
    /// Longest stretch of cycles in which a drive followed a torque although the loop asked for brakes and nothing else.
    pub unasked_torque_cycles: u64,
}

/// How one pull ended.
enum Ending {
    WentOn(u64),
    Reset,
    Faulted,
    Never,
}

/// Pulls so many cables.
///
/// # Errors
/// [`BenchError`].
pub fn pull(bench: &Bench, pulls: u64, seed: u64) -> Result<Pulls, BenchError> {
    let calm = Scenario::calm();
    let mut random = Pcg32::seed_from_u64(seed);
    let mut sums = Pulls::default();
    let mut puller = Puller::start(bench, &calm)?;
    for _ in 0..pulls {
        let calm_cycles = CALM_CYCLES.0 + below(&mut random, CALM_CYCLES.1 - CALM_CYCLES.0);
        sums.pulls += 1;
        let ending = puller.pull(bench, calm_cycles, &mut random);
        match ending {
            Ending::WentOn(cycles) => {
                sums.went_on += 1;
                sums.longest_cycles = sums.longest_cycles.max(cycles);
            }
            Ending::Reset => sums.reset += 1,
            Ending::Faulted => sums.faulted += 1,
            Ending::Never => sums.never += 1,
        }
        if matches!(ending, Ending::Faulted | Ending::Never) {
            let ended = std::mem::replace(&mut puller, Puller::start(bench, &calm)?);
            sums.add(&ended);
        }
    }
    sums.add(&puller);
    Ok(sums)
}

impl Pulls {
    fn add(&mut self, puller: &Puller<'_>) {
        let longest = &mut self.unasked_torque_cycles;
        *longest = (*longest).max(puller.account.unasked_torque_cycles());
    }
}

fn below(random: &mut Pcg32, end: u64) -> u64 {
    u64::from(random.next_u32()) % end.max(1)
}

/// A loop under way.
struct Puller<'a> {
    loop_: FaultyLoop<'a>,
    account: Account,
    cycle: u64,
}

impl<'a> Puller<'a> {
    fn start(bench: &'a Bench, calm: &Scenario) -> Result<Self, BenchError> {
        Ok(Self {
            loop_: bench.start(calm)?,
            account: bench.account(calm),
            cycle: 0,
        })
    }

    fn step(&mut self, orders: Orders) -> LoopState {
        self.loop_.cycle(self.cycle, orders, &mut self.account);
        self.cycle += 1;
        self.loop_.state()
    }

    /// Runs calmly, pulls, and goes on until it runs calmly again.
    fn pull(&mut self, bench: &Bench, calm_cycles: u64, random: &mut Pcg32) -> Ending {
        let mut calm = 0;
        while calm < calm_cycles {
            calm = match self.step(Orders::default()) {
                LoopState::Running => calm + 1,
                LoopState::Faulted => return Ending::Faulted,
                _ if self.cycle > NEVER_CYCLES && calm == 0 => return Ending::Never,
                _ => 0,
            };
        }
        let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
        let out_ns = (SHORTEST_NS * (LONGEST_NS / SHORTEST_NS).powf(share)) as u64;
        let out_cycles = out_ns / bench.period_ns() + 1;
        self.loop_.break_now(cable(bench, out_ns, random));
        let begun = self.cycle;
        let (mut stopped_at, mut was_reset) = (None, false);
        loop {
            let since = self.cycle - begun;
            let looked = stopped_at.map_or(0, |at| self.cycle - at);
            let reset =
                looked >= LOOK_CYCLES && (looked - LOOK_CYCLES).is_multiple_of(AGAIN_CYCLES);
            let state = self.step(Orders {
                reset,
                ..Orders::default()
            });
            was_reset |= reset;
            match state {
                LoopState::Faulted => return Ending::Faulted,
                _ if since > NEVER_CYCLES => return Ending::Never,
                LoopState::SafeStop => {
                    stopped_at.get_or_insert(self.cycle);
                }
                // The cable is in, and whatever it did is over.
                LoopState::Running if since > out_cycles + LOOK_CYCLES => {
                    return match was_reset {
                        true => Ending::Reset,
                        false => Ending::WentOn(self.account.last_left().saturating_sub(begun)),
                    };
                }
                _ => stopped_at = None,
            }
        }
    }
}

/// A cable of the bus, out for so long.
fn cable(bench: &Bench, for_ns: u64, random: &mut Pcg32) -> BusFault {
    let joint = below(random, bench.joints() as u64) as usize;
    if bench.kind() != Kind::Moteus {
        // before the slave of this joint
        return BusFault::Ethercat(EthercatFault::CableOut {
            after: joint,
            for_ns,
        });
    }
    let is_port = random.next_u32().is_multiple_of(4);
    let fault = if is_port {
        // the first bus is that of every robot
        MoteusFault::PtyClosed { bus: 0 }
    } else {
        MoteusFault::Silent {
            id: joint as u8 + 1,
        }
    };
    BusFault::Moteus(fault, for_ns)
}
