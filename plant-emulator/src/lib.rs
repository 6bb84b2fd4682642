//! The emulated robot: harmonic-drive plant, servo driver, sensors, injected effects.
//!
//! [`Plant`] stands in for a real arm, so it is *not* the model that feedforward knows: its parameters deviate from the
//! robot file by a seeded few per cent, its friction has bristles ([`joint_model::friction::LuGre`]) and its gears have
//! what a robot file leaves out (three-slope stiffness, soft wind-up, hysteresis, kinematic error, friction that
//! varies with the motor angle). Time, seed and commands are arguments; equal arguments give equal bits.
//!
//! ```
//! use plant_emulator::{Plant, PlantCommand, PlantMode, PlantParameters};
//!
//! let robot = robot::load("pa10")?;
//! let parameters = PlantParameters::for_robot(&robot)?;
//! let mut plant = Plant::new(&robot, &parameters, &[], 1, &[0.0; 7], 1.0 / 1500.0)?;
//! let mut command = PlantCommand { mode: PlantMode::Velocity, ..PlantCommand::default() };
//! command.joint_velocity_rad_s[3] = 0.1;
//! for _ in 0..150 {
//!     plant.step(&command);
//! }
//! assert!(plant.sample().motor_position_rad[3] > 0.05);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # One joint
//!
//! Rotor and link are two inertias joined by the gear (Spong, Trans. ASME J. Dynamic Systems 109 (1987) 310–319: the
//! rotor's kinetic energy is that of its own spin alone). With motor angle `θ_m`, ratio `N`, link angle `q`:
//!
//! ```text
//! torsion      δ   = θ_m/N + e(θ_m) - q                         e: kinematic error
//! gear         τ   = spring(δ) + hysteresis + damping(δ̇)        this is what the joint torque sensor sees
//! rotor        J·N²·(θ̈_m/N) = N·τ_m - τ·(1 + de/d(θ_m/N)) - friction
//! links        M(q)·q̈ + c(q, q̇) + g(q) = τ - springs and gravity added by effects
//! ```
//!
//! Friction acts at the rotor and is written joint side: bristles whose steady level is the robot file's friction plus
//! the added effects, and which depends on load by a rounded form of PA10-05 Table V; viscous drag beside them.
//!
//! # One period
//!
//! Substeps of at most 83 µs and at most 0.6 of the fastest torsional mode's radian; semi-implicit Euler in torsion,
//! backward Euler in bristles, drag and torsional damping. The command acts on the drive at the beginning of the
//! period, the sensors latch at its end.
#![forbid(unsafe_code)]

mod cia402;
mod deviation;
mod disturbance;
pub mod drives;
mod error;
mod inject;
mod latch;
mod mechanics;
mod noise;
mod parameters;
mod plant;
pub mod process;
mod sensors;
mod servo;
mod signals;

pub use disturbance::{ArmMotion, Disturbance};
pub use error::PlantError;
pub use parameters::{JointPlantParameters, PlantParameters};
pub use plant::Plant;
pub use signals::{DriveState, JointCommand, PlantCommand, PlantMode, PlantSample, PlantTruth};
