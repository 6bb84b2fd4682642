//! One control period of the emulated arms. Real time at 1.5 kHz is 667 µs; lockstep runs as fast as this allows.
#![allow(missing_docs, reason = "the macros make undocumented functions")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use plant_emulator::{Plant, PlantCommand, PlantMode, PlantParameters};

fn plant_step(criterion: &mut Criterion) {
    for name in ["pa10", "shd17"] {
        let robot = robot::load(name).expect("a shipped robot");
        let parameters = PlantParameters::for_robot(&robot).expect("a shipped plant file");
        let position_rad = vec![0.3; robot.joints.len()];
        let plant = Plant::new(&robot, &parameters, &[], 1, &position_rad, 1.0 / 1500.0);
        let mut plant = plant.expect("a valid plant");
        let mut command = PlantCommand {
            mode: PlantMode::Velocity,
            ..PlantCommand::default()
        };
        // slow enough to stay in range for as long as the benchmark runs
        command.joint_velocity_rad_s.fill(0.01);
        let title = format!("{name}, {} substeps", plant.substeps());
        criterion.bench_function(&title, |bench| {
            bench.iter(|| black_box(plant.step(black_box(&command))))
        });
    }
}

criterion_group!(benches, plant_step);
criterion_main!(benches);
