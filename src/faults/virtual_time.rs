//! Faults in virtual time: every figure comes out the same every time.

use fault_injection::bench::Bench;
use fault_injection::outcome::Outcome;
use fault_injection::scenarios;
use serde::Serialize;

use crate::error::CliError;

/// What one fault came to.
#[derive(Debug, Serialize)]
pub struct VirtualOutcome {
    /// Its name.
    pub fault: &'static str,
    /// Whether it ended in the documented state.
    pub as_documented: bool,
    /// The account.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// Runs every scenario on a robot.
///
/// # Errors
/// [`CliError::Input`] if the robot cannot be used.
pub fn run(robot: &str) -> Result<Vec<VirtualOutcome>, CliError> {
    let bench = Bench::new(robot).map_err(CliError::input)?;
    let outcome = |scenario: scenarios::Scenario| {
        let outcome = bench.run(&scenario).map_err(CliError::input)?;
        Ok(VirtualOutcome {
            fault: scenario.name,
            as_documented: outcome.end_state == format!("{:?}", scenario.end_state),
            outcome,
        })
    };
    scenarios::all().into_iter().map(outcome).collect()
}
