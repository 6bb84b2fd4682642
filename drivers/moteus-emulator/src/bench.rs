//! The whole bench: a robot whose joints are driven by virtual drives on one or more buses. No clock, no port.

use std::collections::VecDeque;
use std::time::Duration;

use plant_emulator::{Plant, PlantCommand, PlantError, PlantMode, PlantParameters, PlantTruth};
use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg32;
use robot::{Robot, RobotJoint};

use crate::config::Config;
use crate::controller::{Controller, Sensors};
use crate::fault::{Fault, FaultKind};
use crate::fdcanusb::{Adapter, Frame, Request};
use crate::servo::TORQUE_FACTOR;

const TAU: f64 = core::f64::consts::TAU;
/// Rate of the drives' control. Theirs is 15 to 30 kHz; at this one the joints move by less than a step of their encoders in
/// a step, and the emulated plant has two substeps.
const STEP_NS: u64 = 166_667;
/// A bench that was kept from its work for longer skips the rest of the time: catching up would keep it from answering.
const BEHIND_MAX_NS: u64 = 200_000_000;
const MILLISECOND_NS: u64 = 1_000_000;
/// Everybody's identifier (mjbots/mjlib, multiplex/micro_server.cc, `kBroadcastId`).
const BROADCAST: u8 = 0x7f;
/// Current limit of a drive whose motor's torque limit is not known: that of the maker's r4 (fw/bldc_servo_structs.h).
const CURRENT_MAX_A: f64 = 100.0;
/// Torque constant where the robot file has none; the maker's default.
const TORQUE_CONSTANT_NM_A: f64 = 0.1;
/// Phase resistance. A robot file has none; typical of motors that a moteus drives (assumed).
const RESISTANCE_OHM: f64 = 0.1;
/// Stiffness and damping of joints whose robot file has no `[control]`: 4 Hz, well damped, with the reflected rotor alone.
const STIFFNESS_RAD_S: f64 = TAU * 4.0;

/// How a bench is set up.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Where the joints stand, joint side.
    pub initial_position_rad: Vec<f64>,
    /// How many buses the joints are spread over, in their order.
    pub buses: usize,
    /// Whether drives without an encoder at the joint have been told their output position since power-on.
    pub is_homed: bool,
    /// Of the plant's deviations and noise, and of frames that are lost.
    pub seed: u64,
    /// What breaks.
    pub faults: Vec<Fault>,
}

/// Why a bench cannot be set up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BenchError {
    /// The plant cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// As many buses are asked for as there are joints for.
    #[error("--buses {buses}: the robot has {joints} joints; give 1 to {joints} buses")]
    Buses {
        /// As asked.
        buses: usize,
        /// Of the robot.
        joints: usize,
    },
    /// A fault is for a bus or a drive that there is not.
    #[error("--fault: there is no {what} {number}; {last} is the last")]
    NoSuchPlace {
        /// Bus or drive.
        what: &'static str,
        /// As asked.
        number: usize,
        /// The largest there is.
        last: usize,
    },
}

/// One bus with its adapter.
#[derive(Debug)]
struct Bus {
    adapter: Adapter,
    /// Answers with the instant from which they may be read.
    answers: VecDeque<(u64, Vec<u8>)>,
    random: Pcg32,
}

/// A robot on virtual drives.
#[derive(Debug)]
pub struct Bench {
    plant: Plant,
    controllers: Vec<Controller>,
    bus_of: Vec<usize>,
    buses: Vec<Bus>,
    gear_ratios: Vec<f64>,
    faults: Vec<Fault>,
    /// The instant up to which everything has moved.
    now_ns: Option<u64>,
    first_line_ns: Option<u64>,
    next_millisecond_ns: u64,
}

impl Bench {
    /// A robot at rest with its drives stopped.
    ///
    /// # Errors
    /// [`BenchError`].
    pub fn new(robot: &Robot, setup: &Setup) -> Result<Self, BenchError> {
        let joints = robot.joints.len();
        if setup.buses == 0 || setup.buses > joints {
            return Err(BenchError::Buses {
                buses: setup.buses,
                joints,
            });
        }
        check_faults(&setup.faults, setup.buses, joints)?;
        let parameters = PlantParameters::for_robot(robot)?;
        let plant = Plant::new(
            robot,
            &parameters,
            &[],
            setup.seed,
            &setup.initial_position_rad,
            STEP_NS as f64 * 1e-9,
        )?;
        let gear_ratios: Vec<f64> = robot.joints.iter().map(|joint| joint.gear_ratio).collect();
        let shown = sensors(&plant, &gear_ratios);
        let controllers = robot.joints.iter().enumerate().map(|(index, joint)| {
            let gains = robot.control.as_ref().and_then(|control| {
                Some((
                    *control.proportional_nm_rad.get(index)?,
                    *control.derivative_nm_s_rad.get(index)?,
                ))
            });
            let uuid = uuid(setup.seed, index);
            let config = configured(joint, index, gains, uuid, !shown[index].link_rev.is_nan());
            Controller::new(uuid, config, shown[index], setup.is_homed)
        });
        Ok(Self {
            controllers: controllers.collect(),
            bus_of: (0..joints)
                .map(|index| index * setup.buses / joints)
                .collect(),
            buses: (0..setup.buses)
                .map(|bus| Bus {
                    adapter: Adapter::default(),
                    answers: VecDeque::new(),
                    random: Pcg32::seed_from_u64(setup.seed.wrapping_add(bus as u64)),
                })
                .collect(),
            plant,
            gear_ratios,
            faults: setup.faults.clone(),
            now_ns: None,
            first_line_ns: None,
            next_millisecond_ns: 0,
        })
    }

    /// The joints on a bus with the identifiers of their drives.
    pub fn joints_on(&self, bus: usize) -> Vec<(usize, u8)> {
        let on_bus = |(_, of): &(usize, &usize)| **of == bus;
        let joints = self.bus_of.iter().enumerate().filter(on_bus);
        joints
            .map(|(joint, _)| (joint, self.controllers[joint].id()))
            .collect()
    }

    /// The drive of a joint.
    pub fn controller(&self, joint: usize) -> &Controller {
        &self.controllers[joint]
    }

    /// The robot as it truly is.
    pub fn truth(&self) -> PlantTruth {
        self.plant.truth()
    }

    /// Breaks something now, for so long. What is of a bus or drive that there is not does nothing.
    pub fn inject(&mut self, kind: FaultKind, for_ns: u64) {
        let (Some(first_ns), Some(now_ns)) = (self.first_line_ns, self.now_ns) else {
            return;
        };
        self.faults.push(Fault {
            kind,
            start: Duration::from_nanos(now_ns.saturating_sub(first_ns)),
            duration: Some(Duration::from_nanos(for_ns)),
        });
    }

    /// Pushes a joint from now on, joint side. What names a joint that is not there does nothing.
    pub fn push(&mut self, joint: usize, torque_nm: f64, duration_s: f64) {
        self.plant.push(joint, torque_nm, duration_s);
    }

    /// Where the links really are, joint side.
    pub fn link_position_rad(&self, joint: usize) -> f64 {
        self.plant.truth().link_position_rad[joint]
    }

    /// Whether the port of a bus is there.
    pub fn is_open(&self, bus: usize) -> bool {
        !self
            .active()
            .any(|kind| kind == FaultKind::PtyClosed { bus })
    }

    /// Lets time pass up to an instant.
    pub fn advance_to(&mut self, now_ns: u64) {
        let Some(mut reached_ns) = self.now_ns else {
            self.now_ns = Some(now_ns);
            self.next_millisecond_ns = now_ns + MILLISECOND_NS;
            return;
        };
        if now_ns.saturating_sub(reached_ns) > BEHIND_MAX_NS {
            reached_ns = now_ns - BEHIND_MAX_NS;
            self.next_millisecond_ns = reached_ns;
        }
        while reached_ns + STEP_NS <= now_ns {
            reached_ns += STEP_NS;
            self.now_ns = Some(reached_ns);
            self.step();
            while self.next_millisecond_ns <= reached_ns {
                self.next_millisecond_ns += MILLISECOND_NS;
                self.controllers.iter_mut().for_each(Controller::tick);
            }
        }
    }

    /// Takes a line that came from the computer on a bus at an instant.
    pub fn take_line(&mut self, bus: usize, now_ns: u64, line: &[u8]) {
        self.first_line_ns.get_or_insert(now_ns);
        self.advance_to(now_ns);
        let mut line = line.to_vec();
        self.garble(bus, &mut line);
        let asked = self.buses[bus].adapter.read(&line);
        match asked {
            Ok(None) => {}
            Ok(Some(Request::Status)) => {
                let off = self.active().any(|kind| kind == FaultKind::BusOff { bus });
                self.answer(
                    bus,
                    now_ns,
                    &format!("lec=0 dlec=0 err=0 warn=0 busoff={}", u8::from(off)),
                );
                self.answer(bus, now_ns, "OK");
            }
            Ok(Some(Request::Send(frame))) => {
                self.answer(bus, now_ns, "OK");
                self.send(bus, now_ns, &frame);
            }
            Err(error) => self.answer(bus, now_ns, &format!("ERR {error}")),
        }
    }

    /// What the computer can read from a bus by an instant; appended.
    pub fn read(&mut self, bus: usize, now_ns: u64, out: &mut Vec<u8>) {
        let is_due = |(due_ns, _): &(u64, Vec<u8>)| *due_ns <= now_ns;
        while self.buses[bus].answers.front().is_some_and(is_due) {
            if let Some((_, line)) = self.buses[bus].answers.pop_front() {
                let begin = out.len();
                out.extend(line);
                self.garble(bus, &mut out[begin..]);
            }
        }
    }

    /// When there is next something to be read, if nothing is said before.
    pub fn next_answer_ns(&self) -> Option<u64> {
        let first = |bus: &Bus| bus.answers.front().map(|(due_ns, _)| *due_ns);
        self.buses.iter().filter_map(first).min()
    }

    fn answer(&mut self, bus: usize, due_ns: u64, content: &str) {
        let Bus {
            adapter, answers, ..
        } = &mut self.buses[bus];
        let mut line = Vec::new();
        adapter.write(content, &mut line);
        answers.push_back((due_ns, line));
    }

    /// A frame goes over the bus, and the answers to it come back.
    fn send(&mut self, bus: usize, now_ns: u64, frame: &Frame) {
        if self.active().any(|kind| kind == FaultKind::BusOff { bus }) {
            return;
        }
        let route = frame.route();
        for joint in 0..self.controllers.len() {
            let drive = &self.controllers[joint];
            let (id, is_powered) = (drive.id(), drive.is_powered());
            let is_meant = route.prefix == drive.prefix()
                && (route.destination == id || route.destination == BROADCAST);
            let is_silent = self.active().any(|kind| kind == FaultKind::Silent { id });
            if self.bus_of[joint] != bus || !is_meant || !is_powered || is_silent {
                continue;
            }
            let reply = self.controllers[joint].process(&frame.data, route.reply);
            if let (true, Some(reply)) = (route.reply, reply) {
                let id =
                    u32::from(route.prefix) << 16 | u32::from(id) << 8 | u32::from(route.source);
                self.receive(bus, now_ns, id, &reply);
            }
        }
    }

    /// A frame comes back from the bus.
    fn receive(&mut self, bus: usize, now_ns: u64, id: u32, reply: &[u8]) {
        let mut frame = Frame {
            id,
            data: reply.iter().copied().collect(),
        };
        pad(&mut frame);
        let (mut due_ns, mut copies) = (now_ns, 1);
        for kind in self.active().collect::<Vec<_>>() {
            match kind {
                FaultKind::Lost { bus: at, share } if at == bus && self.chance(bus, share) => {
                    copies = 0
                }
                FaultKind::Doubled { bus: at, share } if at == bus && self.chance(bus, share) => {
                    copies *= 2
                }
                FaultKind::Delayed { bus: at, by } if at == bus => due_ns += by.as_nanos() as u64,
                _ => {}
            }
        }
        let Bus {
            adapter, answers, ..
        } = &mut self.buses[bus];
        for _ in 0..copies {
            let mut line = Vec::new();
            adapter.write_frame(&frame, &mut line);
            answers.push_back((due_ns, line));
        }
    }

    /// What noise makes of a line.
    fn garble(&mut self, bus: usize, line: &mut [u8]) {
        let noise = self.active().find_map(|kind| match kind {
            FaultKind::Noise { bus: at, share } if at == bus => Some(share),
            _ => None,
        });
        if let Some(share) = noise
            && self.chance(bus, share)
            && !line.is_empty()
        {
            let random = &mut self.buses[bus].random;
            let at = random.next_u32() as usize % line.len();
            line[at] ^= 1 << (random.next_u32() % 8);
        }
    }

    fn chance(&mut self, bus: usize, share: f64) -> bool {
        f64::from(self.buses[bus].random.next_u32()) < share * f64::from(u32::MAX)
    }

    /// What is broken now.
    fn active(&self) -> impl Iterator<Item = FaultKind> {
        let since = match (self.first_line_ns, self.now_ns) {
            (Some(first_ns), Some(now_ns)) => {
                Some(Duration::from_nanos(now_ns.saturating_sub(first_ns)))
            }
            _ => None,
        };
        let faults = self.faults.iter();
        faults
            .filter(move |fault| since.is_some_and(|since| fault.is_active(since)))
            .map(|fault| fault.kind)
    }

    fn step(&mut self) {
        self.break_drives();
        let shown = sensors(&self.plant, &self.gear_ratios);
        let mut command = PlantCommand {
            mode: PlantMode::Torque,
            ..PlantCommand::default()
        };
        for (joint, controller) in self.controllers.iter_mut().enumerate() {
            command.motor_torque_nm[joint] = controller.step(shown[joint], STEP_NS as f64 * 1e-9);
            // Until its drive is first enabled, a joint is held by whoever set up the arm.
            if !controller.servo().was_enabled() {
                command.joint_mode[joint] = Some(PlantMode::Braked);
            }
        }
        self.plant.step(&command);
    }

    fn break_drives(&mut self) {
        if self.faults.is_empty() {
            return;
        }
        let active: Vec<FaultKind> = self.active().collect();
        for (
            bus,
            Bus {
                adapter, answers, ..
            },
        ) in self.buses.iter_mut().enumerate()
        {
            if active.contains(&FaultKind::PtyClosed { bus }) {
                // what an adapter holds goes with its supply
                *adapter = Adapter::default();
                answers.clear();
            }
        }
        for controller in &mut self.controllers {
            let id = controller.id();
            controller.power(!active.contains(&FaultKind::BrownOut { id }));
            let code = active.iter().find_map(|kind| match kind {
                FaultKind::Drive { id: at, code } if *at == id => Some(*code),
                _ => None,
            });
            controller.servo.inject(code.unwrap_or(0));
        }
    }
}

fn check_faults(faults: &[Fault], buses: usize, joints: usize) -> Result<(), BenchError> {
    for fault in faults {
        let (what, number, last) = match fault.kind {
            FaultKind::Silent { id } | FaultKind::Drive { id, .. } | FaultKind::BrownOut { id } => {
                ("drive", usize::from(id), joints)
            }
            FaultKind::BusOff { bus }
            | FaultKind::PtyClosed { bus }
            | FaultKind::Lost { bus, .. }
            | FaultKind::Doubled { bus, .. }
            | FaultKind::Noise { bus, .. }
            | FaultKind::Delayed { bus, .. } => ("bus", bus + 1, buses),
        };
        if number > last {
            return Err(BenchError::NoSuchPlace { what, number, last });
        }
    }
    Ok(())
}

/// A frame has one of the lengths of CAN-FD; the rest is filled with what means nothing.
fn pad(frame: &mut Frame) {
    let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
    let length = lengths
        .into_iter()
        .find(|length| *length >= frame.data.len());
    while frame.data.len() < length.unwrap_or(frame.data.capacity()) {
        frame.data.push(0x50);
    }
}

/// What the plant's sensors show, as drives count it.
fn sensors(plant: &Plant, gear_ratios: &[f64]) -> Vec<Sensors> {
    let sample = plant.sample();
    let truth = plant.truth();
    (0..gear_ratios.len())
        .map(|joint| {
            let reported_rad_s = sample.motor_velocity_rad_s[joint];
            let rotor_rad_s = if reported_rad_s.is_nan() {
                truth.motor_velocity_rad_s[joint]
            } else {
                reported_rad_s
            };
            Sensors {
                rotor_rev: sample.motor_position_rad[joint] / TAU,
                rotor_rev_s: rotor_rad_s / TAU,
                motor_torque_nm: sample.motor_torque_nm[joint],
                link_rev: sample.link_position_rad[joint] / TAU,
            }
        })
        .collect()
}

/// A drive that was set up for this joint: calibrated, with the gear's ratio, the joint's limits and the robot's gains.
fn configured(
    joint: &RobotJoint,
    index: usize,
    gains: Option<(f64, f64)>,
    uuid: [u8; 16],
    has_link_encoder: bool,
) -> Config {
    let mut config = Config::factory(uuid);
    let constant_nm_a = joint.torque_constant_nm_a.unwrap_or(TORQUE_CONSTANT_NM_A);
    let current_a = joint
        .torque_limit_nm
        .map(|limit_nm| limit_nm / constant_nm_a);
    let reflected_kg_m2 = joint.reflected_inertia_kg_m2();
    let (stiffness_nm_rad, damping_nm_s_rad) = gains.unwrap_or((
        reflected_kg_m2 * STIFFNESS_RAD_S * STIFFNESS_RAD_S,
        2.0 * reflected_kg_m2 * STIFFNESS_RAD_S,
    ));
    let [least_rad, most_rad] = joint.position_limit_rad.unwrap_or([f64::NAN; 2]);
    for (name, value) in [
        ("id.id", (index + 1) as f64),
        ("motor.poles", 14.0),
        ("motor.Kv", TORQUE_FACTOR / constant_nm_a),
        ("motor.resistance_ohm", RESISTANCE_OHM),
        ("servo.max_current_A", current_a.unwrap_or(CURRENT_MAX_A)),
        ("servo.pid_position.kp", stiffness_nm_rad * TAU),
        ("servo.pid_position.kd", damping_nm_s_rad * TAU),
        ("servopos.position_min", least_rad / TAU),
        ("servopos.position_max", most_rad / TAU),
        (
            "motor_position.rotor_to_output_ratio",
            1.0 / joint.gear_ratio,
        ),
        (
            "motor_position.rotor_to_output_override",
            f64::from(u8::from(joint.gear_ratio < 1.0)),
        ),
    ] {
        config.configure(name, value);
    }
    if has_link_encoder {
        for (name, value) in [
            ("motor_position.sources.1.aux_number", 2.0),
            ("motor_position.sources.1.type", 2.0),
            ("motor_position.sources.1.cpr", 4_194_304.0),
            ("motor_position.sources.1.reference", 1.0),
            ("motor_position.output.reference_source", 1.0),
        ] {
            config.configure(name, value);
        }
    }
    config
}

/// An identity for each drive of each bench.
fn uuid(seed: u64, index: usize) -> [u8; 16] {
    let mut random = Pcg32::seed_from_u64(seed ^ (index as u64).rotate_left(32));
    let mut uuid = [0; 16];
    random.fill_bytes(&mut uuid);
    uuid
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bench(name: &str, faults: &[&str]) -> Bench {
        let robot = robot::load(name).expect("shipped");
        let setup = Setup {
            initial_position_rad: vec![0.0; robot.joints.len()],
            buses: 1,
            is_homed: true,
            seed: 1,
            faults: faults
                .iter()
                .map(|text| text.parse().expect("a fault"))
                .collect(),
        };
        Bench::new(&robot, &setup).expect("a bench")
    }

    /// Sends a frame and returns the lines that come at once.
    fn ask(bench: &mut Bench, now_ns: u64, line: &str) -> String {
        bench.take_line(0, now_ns, line.as_bytes());
        let mut out = Vec::new();
        bench.read(0, now_ns, &mut out);
        String::from_utf8(out).expect("text")
    }

    #[test]
    fn a_drive_answers_to_its_identifier_and_to_everybodys() {
        let mut bench = bench("pa10", &[]);
        assert_eq!(
            ask(&mut bench, 0, "can send 8002 1100"),
            "OK\r\nrcv 0200 210000\r\n"
        );
        assert_eq!(ask(&mut bench, 0, "can send 8009 1100"), "OK\r\n");
        assert_eq!(ask(&mut bench, 0, "can send 0002 1100"), "OK\r\n");
        let all = ask(&mut bench, 0, "can send 807f 1100");
        assert_eq!(all.matches("rcv").count(), 7);
        // another prefix is another bus's
        assert_eq!(ask(&mut bench, 0, "can send 18002 1100"), "OK\r\n");
    }

    #[test]
    fn a_joint_moves_where_it_is_sent_and_comes_to_rest_when_nobody_speaks() {
        let mut bench = bench("shd17", &[]);
        let mut now_ns = 0;
        // position mode, float: position 0.02 rev, velocity 0; velocity limit 0.1 rev/s
        let position = u32::from_le_bytes(0.02_f32.to_le_bytes()).swap_bytes();
        let limit = u32::from_le_bytes(0.1_f32.to_le_bytes()).swap_bytes();
        let line = format!("can send 8001 01000A0E20{position:08X}000000000D28{limit:08X}");
        for _ in 0..1000 {
            now_ns += 2_000_000;
            assert!(ask(&mut bench, now_ns, &line).starts_with("OK"));
        }
        let reached_rad = bench.link_position_rad(0);
        assert!((reached_rad - 0.02 * TAU).abs() < 0.01, "{reached_rad}");
        bench.advance_to(now_ns + 150_000_000);
        assert_eq!(
            ask(&mut bench, now_ns + 150_000_000, "can send 8001 1100"),
            "OK\r\nrcv 0100 21000B\r\n"
        );
    }

    #[test]
    fn faults_come_and_go() {
        let faults = [
            "silent:1@1s+100ms",
            "bus-off:1@2s+100ms",
            "pty-closed:1@3s+100ms",
            "brown-out:1@4s+100ms",
            "lost:1/1@5s+100ms",
            "doubled:1/1@6s+100ms",
            "delayed:1/50ms@7s+100ms",
        ];
        let mut bench = bench("shd17", &faults);
        let mut answers = |at_s: f64| {
            let now_ns = (at_s * 1e9) as u64;
            let open = bench.is_open(0);
            (
                ask(&mut bench, now_ns, "can send 8001 1100")
                    .matches("rcv")
                    .count(),
                open,
            )
        };
        answers(0.0);
        let expected = [
            (1.05, 0),
            (1.15, 1),
            (2.05, 0),
            (2.15, 1),
            (4.05, 0),
            (4.15, 1),
        ];
        for (at_s, count) in expected {
            assert_eq!(answers(at_s).0, count, "at {at_s} s");
        }
        assert_eq!(answers(5.05).0, 0);
        assert_eq!(answers(6.05).0, 2);
        assert_eq!(answers(7.05).0, 0);
        assert_eq!(answers(7.2).0, 2, "the late one and its own");
    }

    #[test]
    fn a_port_that_is_gone_comes_back() {
        let mut bench = bench("shd17", &["pty-closed:1@1s+100ms"]);
        ask(&mut bench, 0, "can send 8001 1100");
        let open = [900_000_000, 1_050_000_000, 1_150_000_000].map(|now_ns| {
            bench.advance_to(now_ns);
            bench.is_open(0)
        });
        assert_eq!(open, [true, false, true]);
    }

    #[test]
    fn joints_are_spread_over_buses_in_their_order() {
        let robot = robot::load("pa10").expect("shipped");
        let setup = |buses| Setup {
            initial_position_rad: vec![0.0; 7],
            buses,
            is_homed: true,
            seed: 1,
            faults: Vec::new(),
        };
        let bench = Bench::new(&robot, &setup(2)).expect("a bench");
        assert_eq!(bench.joints_on(0), [(0, 1), (1, 2), (2, 3), (3, 4)]);
        assert_eq!(bench.joints_on(1), [(4, 5), (5, 6), (6, 7)]);
        assert!(matches!(
            Bench::new(&robot, &setup(8)),
            Err(BenchError::Buses {
                buses: 8,
                joints: 7
            })
        ));
    }
}
