//! Whatever goes over the cable between a driver and its virtual drives: neither panics nor hangs, and what the driver tells is
//! numbers. `.ci/fuzz` runs many more.

mod common;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use common::{Loop, PERIOD_NS};
use ethercat_wire::frame::for_each_datagram;
use proptest::prelude::*;
use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg32;
use rt_loop::driver::Object;
use shm_types::messages::{DriveMode, DriveRequest, PerJoint};
use virtual_drives::{Kind, Noise, VirtualDrives, VirtualError, open_noisy, run_config};

/// Of seven joints, and of one.
const ARM: &str = "pa10";
const JOINT: &str = "shd17";
/// Cycles of a case.
const CYCLES: u64 = 400;

/// What is done to what goes over the cable, to one in `one_in`; 0 is nothing.
#[derive(Clone, Copy, Debug)]
struct Mangling {
    seed: u64,
    one_in: u32,
    /// Frames stay frames with their numbers: only what the slaves have put in is changed.
    keeps_frames: bool,
}

/// Frames, lines or readings that went over the cable, and those of them that were changed.
#[derive(Default)]
struct Counted {
    went: AtomicU64,
    changed: AtomicU64,
}

impl Counted {
    fn tell(&self, what: &str) {
        let (went, changed) = (&self.went, &self.changed);
        println!(
            "{what}: {} went, {} of them changed",
            went.load(Ordering::Relaxed),
            changed.load(Ordering::Relaxed)
        );
    }
}

fn mangle(bytes: &mut Vec<u8>, random: &mut Pcg32) {
    let mut upto = |most: usize| random.next_u32() as usize % most.max(1);
    match upto(6) {
        0 => bytes.truncate(upto(bytes.len())),
        1 => {
            let from = upto(bytes.len());
            bytes[from..]
                .iter_mut()
                .for_each(|byte| *byte = upto(256) as u8);
        }
        2 => *bytes = (0..upto(256)).map(|_| upto(256) as u8).collect(),
        3 => {
            let from = upto(bytes.len());
            bytes.drain(from..(from + 1 + upto(8)).min(bytes.len()));
        }
        _ => {
            for _ in 0..=upto(4) {
                let at = upto(bytes.len());
                bytes[at] ^= 1 << upto(8);
            }
        }
    }
}

/// Changes what slaves have put into a frame: data and working counters.
fn mangle_contents(bytes: &mut [u8], random: &mut Pcg32) {
    for_each_datagram(bytes, |mut datagram| {
        for byte in datagram.data.iter_mut() {
            if random.next_u32().is_multiple_of(8) {
                *byte = random.next_u32() as u8;
            }
        }
        if random.next_u32().is_multiple_of(16) {
            datagram.count(random.next_u32() as u16 % 4);
        }
    });
}

/// Noise that is what `mangling` says at the time.
fn noise(mangling: &Arc<Mutex<Mangling>>, counted: &Arc<Counted>) -> Noise {
    let (mangling, counted) = (Arc::clone(mangling), Arc::clone(counted));
    let mut random = Pcg32::seed_from_u64(mangling.lock().expect("nobody panics").seed);
    Noise(Box::new(move |bytes| {
        let mangling = *mangling.lock().expect("nobody panics");
        counted.went.fetch_add(1, Ordering::Relaxed);
        if mangling.one_in == 0
            || bytes.is_empty()
            || !random.next_u32().is_multiple_of(mangling.one_in)
        {
            return;
        }
        counted.changed.fetch_add(1, Ordering::Relaxed);
        match mangling.keeps_frames {
            true => mangle_contents(bytes, &mut random),
            false => mangle(bytes, &mut random),
        }
    }))
}

fn open(
    kind: Kind,
    robot: &str,
    mangling: &Arc<Mutex<Mangling>>,
    counted: &Arc<Counted>,
) -> Result<Box<dyn VirtualDrives>, VirtualError> {
    let robot = robot::load(robot).expect("shipped");
    let noise = noise(mangling, counted);
    let run = run_config(robot.joints.len(), PERIOD_NS);
    open_noisy(kind, &robot, &run, noise)
}

/// A loop that commands one thing after the other, and looks at what it is told.
fn cycles(bench: &mut Loop, seed: u64) -> Result<(), TestCaseError> {
    let mut random = Pcg32::seed_from_u64(seed);
    bench.command.mode = DriveMode::Torque as u32;
    for cycle in 0..CYCLES {
        bench.command.request = match cycle % 100 {
            0..90 => DriveRequest::Enable as u32,
            _ => DriveRequest::ResetFault as u32,
        };
        let torque_nm = f64::from(random.next_u32() % 10) * 1e-3;
        bench.command.motor_torque_nm.fill(torque_nm);
        let _ = bench.cycle();
        let (last, joints) = (&bench.last, bench.last.header.joint_count as usize);
        for joint in 0..joints {
            // a joint of which nothing came yet has no position
            if last.drives.age_cycles[joint] == 0 {
                let of = |numbers: &PerJoint| numbers[joint].is_finite();
                prop_assert!(of(&last.readings.motor_position_rad));
                prop_assert!(of(&last.readings.motor_velocity_rad_s));
                prop_assert!(of(&last.readings.motor_torque_nm));
            }
        }
    }
    Ok(())
}

fn quiet(seed: u64) -> Arc<Mutex<Mangling>> {
    Arc::new(Mutex::new(Mangling {
        seed,
        one_in: 0,
        keeps_frames: false,
    }))
}

/// Part of the cases: each of ours is many frames.
fn part(of: u32) -> ProptestConfig {
    ProptestConfig::with_cases((ProptestConfig::default().cases / of).max(1))
}

fn one_in() -> impl Strategy<Value = u32> {
    prop_oneof![Just(1_u32), Just(3), Just(10), Just(100)]
}

#[test]
fn frames_of_any_kind_go_between_driver_and_slaves() {
    let counted = Arc::default();
    proptest!(part(4), |(seed: u64, one_in in one_in(), keeps_frames: bool)| {
        let mangling = quiet(seed);
        let mut bench = Loop::new(open(Kind::Ethercat, ARM, &mangling, &counted).expect("nothing is broken"));
        let broken = Mangling { seed, one_in, keeps_frames };
        *mangling.lock().expect("nobody panics") = broken;
        cycles(&mut bench, seed)?;
        bench.bus.shutdown();
    });
    counted.tell("EtherCAT in its cycles, frames");
}

#[test]
fn mailboxes_of_any_kind_go_between_driver_and_slaves() {
    let counted = Arc::default();
    proptest!(part(4), |(seed: u64, one_in in one_in(), keeps_frames: bool, index: u16, sub_index: u8)| {
        let mangling = quiet(seed);
        let mut bus = open(Kind::Ethercat, JOINT, &mangling, &counted).expect("nothing is broken");
        let broken = Mangling { seed, one_in, keeps_frames };
        *mangling.lock().expect("nobody panics") = broken;
        let mut acyclic = bus.acyclic().expect("a channel");
        let known = [0x1008, 0x1018, 0x6041, 0x6064, 0x6076];
        for index in known.into_iter().chain([index]) {
            let mut bytes = [0; 64];
            if let Ok(length) = acyclic.read(0, Object { index, sub_index }, &mut bytes) {
                prop_assert!(length <= bytes.len());
            }
        }
        bus.shutdown();
    });
    counted.tell("EtherCAT mailboxes, frames");
}

#[test]
fn lines_of_any_kind_go_between_driver_and_moteus_drives() {
    let counted = Arc::default();
    proptest!(part(4), |(seed: u64, one_in in one_in())| {
        let mangling = quiet(seed);
        let mut bench = Loop::new(open(Kind::Moteus, ARM, &mangling, &counted).expect("nothing is broken"));
        mangling.lock().expect("nobody panics").one_in = one_in;
        cycles(&mut bench, seed)?;
        bench.bus.shutdown();
    });
    counted.tell("moteus in its cycles, lines and readings");
}

/// Drives that are found among noise, or refused in one line.
fn set_up(kind: Kind, mangling: Mangling, counted: &Arc<Counted>) -> Result<(), TestCaseError> {
    match open(kind, JOINT, &Arc::new(Mutex::new(mangling)), counted) {
        Ok(mut bus) => bus.shutdown(),
        Err(refused) => {
            let told = refused.to_string();
            prop_assert!(!told.is_empty() && told.lines().count() == 1, "{}", told);
        }
    }
    Ok(())
}

#[test]
fn moteus_drives_are_found_among_noise_or_refused_in_one_line() {
    let counted = Arc::default();
    proptest!(part(4), |(seed: u64, one_in in one_in())| {
        let mangling = Mangling { seed, one_in, keeps_frames: false };
        set_up(Kind::Moteus, mangling, &counted)?;
    });
    counted.tell("moteus at set-up, lines and readings");
}

/// EEPROMs, mailboxes and registers as they are read when drives are looked for. ethercrab waits by the clock of the machine for
/// what does not come, so these are few.
#[test]
fn ethercat_drives_are_found_among_noise_or_refused_in_one_line() {
    let counted = Arc::default();
    proptest!(part(32), |(seed: u64, one_in in prop_oneof![Just(100_u32), Just(1000), Just(4000)])| {
        let mangling = Mangling { seed, one_in, keeps_frames: true };
        set_up(Kind::Ethercat, mangling, &counted)?;
    });
    counted.tell("EtherCAT at set-up, frames");
}
