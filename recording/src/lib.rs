//! Recordings: MCAP files written and read, foreign CSV logs read.
