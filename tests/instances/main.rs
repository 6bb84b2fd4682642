//! Running instances as other processes meet them: who may touch one, readers, an operator, the monitor.

mod access;
mod monitor;
mod observers;
mod operator;
#[path = "../support/mod.rs"]
mod support;
