//! What lies between motor and link: stiffness, hysteresis, damping, kinematic error. One effect, one file.
