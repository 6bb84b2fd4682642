//! What recording costs the recorder, cycle by cycle: seven joints at 1500 Hz, with all their signals, the loop's
//! account and the plant's truth. The values are smooth and noisy as measured ones are, because the compressor's
//! time depends on them. Beside it, what reading the file back into a table costs.

use hdrhistogram::Histogram;
use recording::{CycleRow, Header, JointCycle, JointTruth, LoopCycle, Signal, Writer};
use std::collections::BTreeMap;
use std::time::Instant;

const RATE_HZ: u64 = 1500;
const CYCLES: u64 = 20 * RATE_HZ;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "ns per cycle, {CYCLES} cycles; chunks end once per {RATE_HZ} cycles, which the maximum shows"
    );
    println!(
        "{:24}{:>9}{:>9}{:>9}{:>9}{:>12}{:>9}{:>9}",
        "", "mean", "p50", "p99", "p99.9", "max", "MB/s", "read"
    );
    for (name, joints, truth) in [
        ("7 joints", 7, false),
        ("7 joints and truth", 7, true),
        ("16 joints and truth", 16, true),
    ] {
        run(name, joints, truth)?;
    }
    Ok(())
}

fn run(name: &str, joints: usize, with_truth: bool) -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("bench.mcap");
    let joint_names = (1..=joints).map(|joint| format!("joint{joint}")).collect();
    let header = Header {
        joint_names,
        sample_rate_hz: RATE_HZ as f64,
        metadata: BTreeMap::new(),
    };
    let mut writer = Writer::create(&path, &header)?;
    let mut cycle_ns = Histogram::<u64>::new(3)?;
    let mut noise = Noise(1);
    for cycle in 0..CYCLES {
        let joints: Vec<_> = (0..joints)
            .map(|joint| joint_cycle(cycle, joint, &mut noise))
            .collect();
        let truth = vec![
            JointTruth {
                link_position_rad: noise.next(),
                joint_torque_nm: 1.5,
                ..Default::default()
            };
            joints.len()
        ];
        let loop_cycle = LoopCycle {
            cycle,
            compute_ns: 20_000 + cycle as i64 % 999,
            ..Default::default()
        };
        let row = CycleRow {
            cycle,
            time_ns: cycle * 1_000_000_000 / RATE_HZ,
            loop_cycle: Some(&loop_cycle),
            joints: &joints,
            truth: with_truth.then_some(&truth),
        };
        let start = Instant::now();
        writer.write_cycle(&row)?;
        cycle_ns.record(start.elapsed().as_nanos() as u64)?;
    }
    writer.finish()?;
    let megabytes_per_s = std::fs::metadata(&path)?.len() as f64 / 1e6 / (CYCLES / RATE_HZ) as f64;
    let start = Instant::now();
    let rows = recording::read(&path)?.rows();
    let read_ns = start.elapsed().as_nanos() as f64 / rows as f64;
    let quantile = |share| cycle_ns.value_at_quantile(share);
    println!(
        "{name:24}{:>9.0}{:>9}{:>9}{:>9}{:>12}{megabytes_per_s:>9.2}{read_ns:>9.0}",
        cycle_ns.mean(),
        quantile(0.5),
        quantile(0.99),
        quantile(0.999),
        cycle_ns.max()
    );
    Ok(())
}

fn joint_cycle(cycle: u64, joint: usize, noise: &mut Noise) -> JointCycle {
    let mut sample = JointCycle {
        estimate_residual_torque_nm: Some(noise.next()),
        estimate_structural_damping_nm: Some(noise.next()),
        ..Default::default()
    };
    for signal in Signal::ALL {
        let smooth = (cycle as f64 / RATE_HZ as f64 * (joint + 1) as f64).sin();
        sample.set(signal, Some(smooth + 1e-3 * noise.next()));
    }
    sample
}

/// Uniform in ±0.5; the same in every run.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}
