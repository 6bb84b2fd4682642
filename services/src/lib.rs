//! The processes beside the loop: torque estimator, feedforward controller, relay.
