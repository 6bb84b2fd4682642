//! Reads the sample topic of a running instance, as a third-party process would, and prints ten samples.
//!
//! ```text
//! cargo run --release -- run &
//! cargo run --release --example observe -- default
//! ```
//! Observers attach to the relay's topics (`observe/…`): however many there are, and however slow, the loop does not
//! notice.

use std::time::{Duration, Instant};

use shm_types::bus::Bus;
use shm_types::instance::Instance;
use shm_types::topics;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "default".to_owned());
    let instance = Instance::new(&name, realtime::process::user_id())?;
    let run = instance.run_config()?;
    let bus = Bus::join(&instance)?;
    let samples = bus.reader(&topics::OBSERVED_SAMPLE)?;
    let begun = Instant::now();
    let mut printed = 0;
    while printed < 10 {
        if begun.elapsed() > Duration::from_secs(10) {
            return Err(format!("no sample from instance `{name}` within 10 s").into());
        }
        let Some(sample) = samples.take_newest() else {
            std::thread::sleep(Duration::from_millis(20));
            continue;
        };
        if sample.header.session != run.session {
            continue;
        }
        let joints = sample.header.joint_count as usize;
        println!(
            "cycle {} motor_position_rad {:?}",
            sample.header.cycle,
            &sample.readings.motor_position_rad[..joints]
        );
        printed += 1;
    }
    Ok(())
}
