//! How a command ends when it does not succeed.

/// Either the input was bad, or the answer is no. One line each.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Nothing was done: what is wrong, where, and what to change. Exit code 2.
    #[error("{0}")]
    Input(String),
    /// The command ran, and its result is negative. Exit code 1.
    #[error("{0}")]
    Negative(String),
}

impl CliError {
    /// Bad input, from any error that says so in one line.
    pub fn input(error: impl std::fmt::Display) -> Self {
        Self::Input(error.to_string())
    }
}
