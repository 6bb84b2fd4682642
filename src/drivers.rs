//! The drivers that this program has: those that come with it, and those its `main` adds.

use std::sync::OnceLock;

use rt_loop::driver::{Behind, DriverEntry};
use rt_loop::process::{DRIVERS, find_driver};

use crate::error::CliError;

/// Set once, before anything else: every process of an instance is this program and has the same.
static ALL: OnceLock<Vec<DriverEntry>> = OnceLock::new();

/// Adds drivers to those that come with the program.
///
/// # Errors
/// [`CliError::Input`] if two have one name, or this is done twice.
pub fn add(drivers: &[DriverEntry]) -> Result<(), CliError> {
    let all: Vec<DriverEntry> = DRIVERS.iter().chain(drivers).copied().collect();
    for (index, entry) in all.iter().enumerate() {
        if all[..index].iter().any(|other| other.name == entry.name) {
            let name = entry.name;
            return Err(CliError::Input(format!(
                "two drivers are called `{name}`; give each a name of its own"
            )));
        }
    }
    ALL.set(all)
        .map_err(|_| CliError::Input("main_with was called twice; call it once".to_owned()))
}

/// Every driver.
pub fn all() -> &'static [DriverEntry] {
    ALL.get().map_or(DRIVERS.as_slice(), Vec::as_slice)
}

/// The driver of that name.
///
/// # Errors
/// [`CliError::Input`] with those there are.
pub fn find(name: &str) -> Result<&'static DriverEntry, CliError> {
    find_driver(all(), name).map_err(CliError::input)
}

/// Whether the emulator stands behind the driver of that name.
pub fn is_emulated(name: &str) -> bool {
    find(name).is_ok_and(|entry| entry.behind == Behind::Emulator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_taken_is_refused_and_unknown_ones_are_told_those_there_are() {
        let told = add(&DRIVERS).unwrap_err().to_string();
        assert!(told.contains("emulator"), "{told}");
        let told = find("can").unwrap_err().to_string();
        assert!(
            told.contains("`can`") && told.contains("emulator"),
            "{told}"
        );
        assert!(is_emulated("emulator") && !is_emulated("can"));
    }
}
