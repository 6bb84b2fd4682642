//! The emulated robot: harmonic-drive plant, servo driver, sensors, injected effects.
