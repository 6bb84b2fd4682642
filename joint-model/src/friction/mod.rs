//! Friction of a harmonic-drive joint, joint side: one law, one file.
