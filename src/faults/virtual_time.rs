//! Faults in virtual time: every figure comes out the same every time.

use fault_injection::bench::Bench;
use fault_injection::outcome::{Outcome, SetUp};
use fault_injection::pulls::{Pulls, pull};
use fault_injection::scenarios::{self, Scenario};
use serde::Serialize;
use virtual_drives::Kind;

use crate::cli::FaultsArguments;
use crate::error::CliError;

/// Cables pulled on each bus.
const PULLS: u64 = 1000;
const PULLS_SHORT: u64 = 20;
/// Seed of where, when and for how long.
const PULLS_SEED: u64 = 1;

/// What one fault came to.
#[derive(Debug, Serialize)]
pub struct VirtualOutcome {
    /// Its name.
    #[serde(rename = "name")]
    pub fault: &'static str,
    /// Whether it ended as documented.
    pub as_documented: bool,
    /// The account.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What came of looking for drives of which something is broken.
#[derive(Debug, Serialize)]
pub struct SetUpOutcome {
    /// Its name.
    #[serde(rename = "name")]
    pub fault: &'static str,
    /// Whether it is as documented.
    pub as_documented: bool,
    /// The account.
    #[serde(flatten)]
    pub outcome: SetUp,
}

/// Every fault on drives of one kind.
#[derive(Debug, Serialize)]
pub struct OnDrives {
    /// Their name.
    pub drives: &'static str,
    /// Between loop, driver, controller and operator.
    pub around_the_loop: Vec<VirtualOutcome>,
    /// On the bus and in its drives.
    pub of_the_bus: Vec<VirtualOutcome>,
    /// What is broken when the drives are looked for, before a run.
    pub at_set_up: Vec<SetUpOutcome>,
    /// Cables pulled, where there are any.
    pub pulls: Option<Pulls>,
}

impl OnDrives {
    /// Whatever ended otherwise than documented, for people.
    pub fn wrong(&self) -> impl Iterator<Item = String> {
        let outcomes = self.around_the_loop.iter().chain(&self.of_the_bus);
        let wrong = outcomes.filter(|outcome| !outcome.as_documented);
        let set_up = self
            .at_set_up
            .iter()
            .filter(|outcome| !outcome.as_documented);
        let never = self.pulls.iter().any(|pulls| pulls.never > 0);
        wrong
            .map(|outcome| format!("{} on {}", outcome.fault, self.drives))
            .chain(set_up.map(|outcome| format!("at set-up, {} on {}", outcome.fault, self.drives)))
            .chain(never.then(|| format!("cable pulls on {}", self.drives)))
    }
}

/// Runs every scenario on a robot, with drives of every kind. The short suite leaves out what the buses share.
///
/// # Errors
/// [`CliError::Input`] if the robot cannot be used.
pub fn run(arguments: &FaultsArguments) -> Result<Vec<OnDrives>, CliError> {
    Kind::ALL
        .into_iter()
        .map(|kind| on_drives(arguments, kind))
        .collect()
}

fn on_drives(arguments: &FaultsArguments, kind: Kind) -> Result<OnDrives, CliError> {
    let bench = Bench::new(&arguments.robot, kind).map_err(CliError::input)?;
    let outcome = |scenario: Scenario| {
        let outcome = bench.run(&scenario).map_err(CliError::input)?;
        Ok(VirtualOutcome {
            fault: scenario.name,
            as_documented: outcome.is_as_documented(&scenario, kind),
            outcome,
        })
    };
    let around = match arguments.short && kind != Kind::Emulator {
        true => Vec::new(),
        false => scenarios::all(),
    };
    let pulls = if arguments.short { PULLS_SHORT } else { PULLS };
    let pulls = match kind {
        Kind::Emulator => None,
        _ => Some(pull(&bench, pulls, PULLS_SEED).map_err(CliError::input)?),
    };
    Ok(OnDrives {
        drives: kind.name(),
        around_the_loop: around
            .into_iter()
            .map(outcome)
            .collect::<Result<_, CliError>>()?,
        of_the_bus: scenarios::of_bus(kind, bench.robot())
            .into_iter()
            .map(outcome)
            .collect::<Result<_, CliError>>()?,
        at_set_up: scenarios::at_set_up(kind, bench.robot())
            .iter()
            .map(|broken| {
                let outcome = bench.set_up(broken).map_err(CliError::input)?;
                Ok(SetUpOutcome {
                    fault: broken.name,
                    as_documented: outcome.is_as_documented(broken),
                    outcome,
                })
            })
            .collect::<Result<_, CliError>>()?,
        pulls,
    })
}
