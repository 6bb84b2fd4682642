//! What `flexspline`, the Python package, calls: robots, recordings and diagnoses of the Rust crates, by the functions that the command
//! line calls. Python classes around it are in `src/flexspline`; they take what people have and hand over arrays and texts.

#![deny(unsafe_code)]

mod diagnosis;
mod errors;
mod experiments;
mod live;
mod recording;
mod robot;
mod work;

use ::recording::Signal;
use gap_diagnosis::Options;
use pyo3::prelude::*;

/// Everything that Python sees.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("SIGNALS", Signal::ALL.map(Signal::name))?;
    module.add("MATERIALITY", Options::default().materiality)?;
    module.add_class::<robot::Robot>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<diagnosis::Diagnosis>()?;
    module.add_function(wrap_pyfunction!(diagnosis::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(diagnosis::mended, module)?)?;
    module.add_function(wrap_pyfunction!(diagnosis::words, module)?)?;
    module.add_class::<live::Attachment>()?;
    module.add_class::<live::Watch>()?;
    module.add_function(wrap_pyfunction!(experiments::simulate_recording, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::simulate_trajectory, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::suggest, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::identify, module)?)?;
    module.add_function(wrap_pyfunction!(experiments::inverse_dynamics, module)?)?;
    Ok(())
}
