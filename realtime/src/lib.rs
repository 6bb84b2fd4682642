//! Linux real-time calls behind safe functions.
