//! What is compared: the same few torques, made from a recording and from its simulation by the same formulas.
//!
//! Every channel is a torque at the joint side, low-passed without delay and thinned to just above the band:
//!
//! - [`Channel::Motor`], the disturbance torque `τ - (J + M)·q̈ - s·(q - q₀)`: what is left of the drive's torque when
//!   the rigid joint's is taken off (`J` rotor, `M` link inertia, `s` slope of gravity about the recorded angle `q₀`).
//!   A simulation's torque is the drive's and what holds it on the recorded motion.
//! - [`Channel::Drive`], `τ - u`: reported less commanded torque.
//! - [`Channel::Torsion`], `k·(q_motor - q_link)` with the robot file's stiffness.
//! - [`Channel::Link`], `τ_sensor - M·q̈ - s·(q - q₀)`: what the torque sensor has beyond the rigid link.
//!
//! Taken of a recording and of its simulation alike, their difference is the torque that one of them knows and the other
//! does not, whatever the controller made of it.

use joint_model::filter::FilterError;
use serde::{Deserialize, Serialize};

use crate::joint::JointModel;
use crate::load::Load;
use crate::signal::band::up_to;
use crate::signal::smooth::{low_pass_together, second_difference};
use crate::simulate::{Substeps, Trace};
use crate::stretch::JointStretch;

/// Above this nothing is compared: friction, gravity and inertia of an arm lie below.
const CUTOFF_HZ: f64 = 15.0;
/// Half the time over which the low-pass spreads what happens in an instant.
pub const SPREAD_S: f64 = 0.06;
/// Samples per second for each hertz of the band: above the two that a band needs, because the filter is no wall.
const SAMPLES_PER_BAND: f64 = 3.0;

/// A torque that is compared.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Motor torque and motor encoder.
    #[default]
    Motor,
    /// Reported and commanded motor torque.
    Drive,
    /// Both encoders.
    Torsion,
    /// Torque sensor.
    Link,
}

impl Channel {
    /// The signal of a recording that shows it.
    pub fn signal(self) -> &'static str {
        match self {
            Self::Motor => "motor_torque_nm",
            Self::Drive => "command_torque_nm",
            Self::Torsion => "link_position_rad",
            Self::Link => "joint_torque_nm",
        }
    }
}

/// So many channels are made at a time: as many as a processor has in one register.
const TOGETHER: usize = 2;

/// Where channels are made, sample by sample.
pub(crate) type Room = Vec<[f64; TOGETHER]>;

/// How signals become channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Above this nothing is compared.
    pub cutoff_hz: f64,
    /// Of the signals.
    pub rate_hz: f64,
}

/// Signals at a constant rate, joint side, measured or simulated.
struct Seen<'a> {
    motor_rad: &'a [f64],
    link_rad: Option<&'a [f64]>,
    torque_nm: &'a [f64],
    /// Of a simulation: what holds it on the recorded motion.
    holding_nm: Option<&'a [f64]>,
    command_nm: &'a [f64],
    joint_torque_nm: Option<&'a [f64]>,
}

/// The channels a joint's recording has.
pub fn channels(stretch: &JointStretch) -> Vec<Channel> {
    let mut there = vec![Channel::Motor];
    if stretch.has_torque_beside_command {
        there.push(Channel::Drive);
    }
    if stretch.link_rad.is_some() {
        there.push(Channel::Torsion);
    }
    if stretch.joint_torque_nm.is_some() {
        there.push(Channel::Link);
    }
    there
}

impl Band {
    /// For signals at a rate.
    pub fn at(rate_hz: f64) -> Self {
        Self {
            cutoff_hz: up_to(CUTOFF_HZ, rate_hz),
            rate_hz,
        }
    }

    /// Every so many samples one is kept: of those that a run in coarse substeps is made at.
    pub fn stride(&self) -> usize {
        let every = self.every_coarse();
        let samples = self.rate_hz / (SAMPLES_PER_BAND * self.cutoff_hz);
        (samples as usize / every * every).max(1)
    }

    /// Every so many samples a run in coarse substeps has one.
    pub(crate) fn every_coarse(&self) -> usize {
        ((Substeps::Coarse.longest_s() * self.rate_hz) as usize).max(1)
    }

    /// The channels of a recording.
    ///
    /// # Errors
    /// [`FilterError`] for a cut-off outside zero to half the rate.
    pub fn measured(
        &self,
        nominal: &JointModel,
        stretch: &JointStretch,
        channels: &[Channel],
    ) -> Result<Vec<Vec<f64>>, FilterError> {
        let mut room = Vec::new();
        let seen = Seen {
            motor_rad: &stretch.drive.motor_rad,
            link_rad: stretch.link_rad.as_deref(),
            torque_nm: &stretch.torque_nm,
            holding_nm: None,
            command_nm: &stretch.drive.command_nm,
            joint_torque_nm: stretch.joint_torque_nm.as_deref(),
        };
        self.each(nominal, &stretch.load, &seen, channels, &mut room)
    }

    /// The same channels of a simulation under a load that the robot file tells; `reports` tells whether the drive reports its torque
    /// beside the command. `room` is to work in, whatever was there before.
    ///
    /// # Errors
    /// [`FilterError`] for a cut-off outside zero to half the rate.
    pub(crate) fn simulated(
        &self,
        nominal: &JointModel,
        (load, reports): (&Load, bool),
        trace: &Trace,
        channels: &[Channel],
        room: &mut Room,
    ) -> Result<Vec<Vec<f64>>, FilterError> {
        let seen = Seen {
            motor_rad: &trace.motor_rad,
            link_rad: Some(&trace.link_rad),
            torque_nm: if reports {
                &trace.torque_nm
            } else {
                &trace.command_nm
            },
            holding_nm: Some(&trace.holding_nm),
            command_nm: &trace.command_nm,
            joint_torque_nm: Some(&trace.joint_torque_nm),
        };
        self.each(nominal, load, &seen, channels, room)
    }

    fn each(
        &self,
        nominal: &JointModel,
        load: &Load,
        seen: &Seen<'_>,
        channels: &[Channel],
        room: &mut Room,
    ) -> Result<Vec<Vec<f64>>, FilterError> {
        let samples = seen.motor_rad.len();
        let link_rad = seen.link_rad.unwrap_or(seen.motor_rad);
        let sensed_nm = seen.joint_torque_nm.unwrap_or(seen.torque_nm);
        let period_s2 = (1.0 / self.rate_hz).powi(2);
        let rigid_nm = |k: usize, inertia_kg_m2: f64| {
            inertia_kg_m2 * (second_difference(seen.motor_rad, k) / period_s2)
                + load.slope_nm_rad[k] * (seen.motor_rad[k] - load.position_rad[k])
        };
        let mut thinned = Vec::with_capacity(channels.len());
        for pair in channels.chunks(TOGETHER) {
            let fill = |rows: &mut [[f64; TOGETHER]]| {
                for (place, channel) in pair.iter().enumerate() {
                    let values = rows.iter_mut().map(|row| &mut row[place]).enumerate();
                    match channel {
                        Channel::Motor => values.for_each(|(k, value)| {
                            let inertia = nominal.rotor_inertia_kg_m2 + load.inertia_kg_m2[k];
                            let holding_nm = seen.holding_nm.map_or(0.0, |held| held[k]);
                            *value = seen.torque_nm[k] + holding_nm - rigid_nm(k, inertia);
                        }),
                        Channel::Drive => values.for_each(|(k, value)| {
                            *value = seen.torque_nm[k] - seen.command_nm[k];
                        }),
                        Channel::Torsion => values.for_each(|(k, value)| {
                            *value = nominal.stiffness_nm_rad * (seen.motor_rad[k] - link_rad[k]);
                        }),
                        Channel::Link => values.for_each(|(k, value)| {
                            *value = sensed_nm[k] - rigid_nm(k, load.inertia_kg_m2[k]);
                        }),
                    }
                }
            };
            let band = [self.cutoff_hz, self.rate_hz];
            let smooth = low_pass_together(room, samples, fill, band)?;
            for place in 0..pair.len() {
                let kept = smooth.iter().step_by(self.stride());
                thinned.push(kept.map(|row| row[place]).collect());
            }
        }
        Ok(thinned)
    }
}
