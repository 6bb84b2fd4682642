//! Reference trajectories and the PA-10's inverse kinematics.
