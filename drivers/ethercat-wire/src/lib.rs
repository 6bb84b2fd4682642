//! What a master and a slave on EtherCAT share: frames as bytes, and a raw socket for them.

pub mod frame;
pub mod link;
pub mod socket;
