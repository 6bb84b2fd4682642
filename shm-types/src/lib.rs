//! Messages and topics of the control loop over shared memory.
