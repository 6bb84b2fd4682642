//! Errors as exceptions: the same line that the command prints.

use std::fmt::Display;

use flexspline::library::CliError;
use pyo3::PyErr;

mod python {
    pyo3::import_exception!(flexspline._errors, InputError);
    pyo3::import_exception!(flexspline._errors, NegativeError);
}

/// Bad input, from any error that says so in one line.
pub fn input(error: impl Display) -> PyErr {
    python::InputError::new_err(error.to_string())
}

/// Bad input, or a result that is no.
pub fn raised(error: CliError) -> PyErr {
    match error {
        CliError::Input(line) => python::InputError::new_err(line),
        CliError::Negative(line) => python::NegativeError::new_err(line),
    }
}
