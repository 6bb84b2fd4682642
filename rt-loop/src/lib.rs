//! The control loop: one cycle as a pure function, and the process around it.
