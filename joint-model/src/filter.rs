//! Digital filters that run once a cycle.
