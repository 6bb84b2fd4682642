//! One process of an instance: what runs behind `flexspline process ROLE`.
//!
//! All processes are this one executable, so that `cargo run` builds them all, and no process can be of another version
//! than its supervisor.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use realtime::process::{set_name, user_id};
use shm_types::instance::Instance;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::cli::{ProcessArguments, RoleArgument};
use crate::error::CliError;
use crate::supervisor::janitor;

/// Runs the process until it is told to stop.
pub fn run(arguments: &ProcessArguments) -> Result<(), CliError> {
    let instance = Instance::new(&arguments.instance, user_id()).map_err(CliError::input)?;
    if arguments.role == RoleArgument::Janitor {
        set_name("fs-janitor");
        return janitor::run(&instance).map_err(CliError::input);
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(CliError::input)?;
    }
    match arguments.role {
        RoleArgument::Loop => {
            set_name("fs-loop");
            rt_loop::process::run(&instance, &crate::drives::DRIVERS, &stop)
                .map_err(CliError::input)
        }
        RoleArgument::Emulator => {
            set_name("fs-emulator");
            plant_emulator::process::run(&instance, &stop).map_err(CliError::input)
        }
        RoleArgument::Estimator => {
            set_name("fs-estimator");
            services::estimator_process::run(&instance, &stop).map_err(CliError::input)
        }
        RoleArgument::Feedforward => {
            set_name("fs-feedforward");
            services::feedforward_process::run(&instance, &stop).map_err(CliError::input)
        }
        RoleArgument::Relay => {
            set_name("fs-relay");
            services::relay_process::run(&instance, &stop).map_err(CliError::input)
        }
        RoleArgument::Janitor => Ok(()),
    }
}
