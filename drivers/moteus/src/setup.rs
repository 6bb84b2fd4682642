//! What is asked of the drives before anything moves: who is there, whether each is set up for its joint, its watchdog.
//!
//! Nothing here makes a torque: frames only read, and the diagnostic stream sets one number, the watchdog's, and reads it
//! back. May take a second.

use std::time::Duration;

use moteus_protocol::diagnostic::{
    MAX_WRITE, parse_server_to_client, write_client_poll, write_client_to_server,
};
use moteus_protocol::{
    CURRENT_REGISTER_MAP_VERSION, CanFdFrame, Subframe, SubframeType, Value,
    calculate_arbitration_id, parse_arbitration_id, parse_frame,
};
use robot::Robot;
use rt_loop::driver::OpenError;

use crate::host::Host;
use crate::port::{Port, wait};
use crate::settings::Settings;

/// A drive answers within less than a millisecond; a serial port and a busy machine may add some.
const ANSWER_NS: u64 = 100_000_000;
/// How long drives are listened for that answer to everybody's identifier.
const LISTEN_NS: u64 = 200_000_000;
/// A frame that is lost is sent again so often.
const TRIES: usize = 3;
/// Pieces of the diagnostic stream that an answer may come in: one number has at most two.
const POLLS: usize = 50;
/// Everybody's identifier.
const BROADCAST: i8 = 0x7f;
/// The diagnostic channel (moteus, protocol/diagnostic.md).
const CHANNEL: u8 = 1;
/// How far the drive's ratio may be from the robot file's: rounding, nothing else.
const RATIO_TOLERANCE: f64 = 0.005;
/// How far the watchdog that is read back may be from what was set: six digits are printed.
const WATCHDOG_TOLERANCE_S: f64 = 1e-5;
/// Torque of one ampere times the motor's speed constant in turns a minute and volt (fw/bldc_servo.cc, `kTorqueFactor`).
const TORQUE_FACTOR: f64 = 1.5 / 1.732_050_807_568_877_2 * 60.0 / core::f64::consts::TAU;

/// What a joint's drive was found to be.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    /// For people.
    pub device: String,
    /// Largest torque its current limit allows, motor side.
    pub motor_torque_max_nm: f64,
    /// Counts of the rotor's encoder in a turn.
    pub rotor_counts: f64,
    /// Whether it reports an encoder at the joint as its source 1.
    pub has_link_encoder: bool,
    /// Which way its output counts with the rotor, 1 or -1.
    pub output_sign: f64,
    /// What it adds to its encoders' readings.
    pub output_offset_rev: f64,
    /// As set and read back.
    pub watchdog: Duration,
    /// Register 0x00c.
    pub home: i32,
}

/// Looks at every drive of the robot, in its order.
///
/// # Errors
/// [`OpenError::Hardware`]: which joint, what is wrong, what to change.
pub(crate) fn set_up(
    host: &dyn Host,
    ports: &mut [Port],
    settings: &Settings,
    robot: &Robot,
) -> Result<Vec<Found>, OpenError> {
    let mut present: Vec<Vec<u8>> = Vec::new();
    for port in ports.iter_mut() {
        present.push(drives_on(host, port)?);
    }
    let mut found = Vec::new();
    for (joint, table) in robot.joints.iter().zip(&settings.joints) {
        let port = &mut ports[table.bus - 1];
        let ids = &present[table.bus - 1];
        if !ids.contains(&table.id) {
            return Err(OpenError::Hardware(format!(
                "joint `{}`: no drive answers to id {} on {}; there {}",
                joint.name,
                table.id,
                port.path(),
                told_ids(ids)
            )));
        }
        let place = format!("joint `{}`, id {} on {}", joint.name, table.id, port.path());
        let mut drive = Drive {
            host,
            port,
            id: table.id,
            place,
        };
        let watchdog = Duration::from_millis(settings.bus.watchdog_ms.into());
        found.push(drive.look(joint, watchdog)?);
    }
    Ok(found)
}

fn told_ids(ids: &[u8]) -> String {
    if ids.is_empty() {
        return "is nobody; check supply, cable and termination".to_owned();
    }
    let ids: Vec<String> = ids.iter().map(u8::to_string).collect();
    format!(
        "are ids {}; set id.id of the drive, or the robot file's id",
        ids.join(", ")
    )
}

/// The identifiers that answer on a bus.
fn drives_on(host: &dyn Host, port: &mut Port) -> Result<Vec<u8>, OpenError> {
    // An adapter that knows no checksums refuses the first line and takes the second.
    for _ in 0..TRIES {
        let mut query = CanFdFrame::new();
        query.arbitration_id = calculate_arbitration_id(0, BROADCAST, 0, true);
        // read the mode, in one byte
        query.data[..2].copy_from_slice(&[0x11, 0x00]);
        query.size = 2;
        let mut ids = Vec::new();
        exchange(host, port, &query, LISTEN_NS, |frame| {
            ids.push(parse_arbitration_id(frame.arbitration_id).0 as u8);
            false
        })?;
        ids.sort_unstable();
        if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(OpenError::Hardware(format!(
                "{}: two drives answer to id {}; unplug one and give the other another id.id",
                port.path(),
                pair[0]
            )));
        }
        if !ids.is_empty() {
            return Ok(ids);
        }
    }
    Ok(Vec::new())
}

/// Sends a frame and hands over what comes until `take` has what it wants or the time is over; whether it had.
fn exchange(
    host: &dyn Host,
    port: &mut Port,
    frame: &CanFdFrame,
    wait_ns: u64,
    mut take: impl FnMut(&CanFdFrame) -> bool,
) -> Result<bool, OpenError> {
    let gone =
        |path: &str| OpenError::Hardware(format!("{path}: the port is gone; check the adapter"));
    let until_ns = host.now_ns() + wait_ns;
    if port.queue(frame).is_err() || port.send().is_err() {
        return Err(gone(port.path()));
    }
    let mut done = false;
    loop {
        let received = port.receive(|frame| done |= take(frame));
        received.map_err(|_| gone(port.path()))?;
        let now_ns = host.now_ns();
        if done || now_ns >= until_ns {
            return Ok(done);
        }
        wait(host, std::slice::from_ref(port), until_ns - now_ns);
    }
}

/// One drive, before it is used.
struct Drive<'a> {
    host: &'a dyn Host,
    port: &'a mut Port,
    id: u8,
    place: String,
}

impl Drive<'_> {
    fn wrong(&self, reason: String) -> OpenError {
        OpenError::Hardware(format!("{}: {reason}", self.place))
    }

    fn look(&mut self, joint: &robot::RobotJoint, watchdog: Duration) -> Result<Found, OpenError> {
        let map = self.register(0x102, 2)?.to_i32();
        if map != i32::from(CURRENT_REGISTER_MAP_VERSION) {
            return Err(self.wrong(format!(
                "register map {map}, this driver knows {CURRENT_REGISTER_MAP_VERSION}; update the drive's firmware"
            )));
        }
        let mode = self.register(0x000, 0)?.to_i32();
        if !matches!(mode, 0 | 1 | 11 | 15) {
            return Err(self.wrong(format!(
                "is driven already, in mode {mode}; end the program that does, or moteus_tool --stop"
            )));
        }
        let firmware = self.register(0x101, 2)?.to_i32();
        let home = self.register(0x00c, 0)?.to_i32();
        self.check_motor(joint)?;
        let torque_nm =
            self.number("servo.max_current_A")? * TORQUE_FACTOR / self.number("motor.Kv")?;
        let has_link_encoder = self.number("motor_position.sources.1.type")? != 0.0
            && self.number("motor_position.sources.1.reference")? == 1.0;
        if joint.link_encoder_resolution_rad.is_some() && !has_link_encoder {
            return Err(self.wrong(
                "the robot file has link_encoder_resolution_rad, the drive no encoder at the joint as \
                 motor_position.sources.1; set that up, or take the line out"
                    .to_owned(),
            ));
        }
        Ok(Found {
            device: format!(
                "moteus id {}, firmware {}.{}.{}",
                self.id,
                firmware >> 16 & 0xff,
                firmware >> 8 & 0xff,
                firmware & 0xff
            ),
            motor_torque_max_nm: torque_nm,
            rotor_counts: self.number("motor_position.sources.0.cpr")?,
            has_link_encoder: has_link_encoder && joint.link_encoder_resolution_rad.is_some(),
            output_sign: self.number("motor_position.output.sign")?,
            output_offset_rev: self.number("motor_position.output.offset")?,
            watchdog: self.set_watchdog(watchdog)?,
            home,
        })
    }

    fn check_motor(&mut self, joint: &robot::RobotJoint) -> Result<(), OpenError> {
        if self.number("motor.poles")? == 0.0 || self.number("motor.Kv")? <= 0.0 {
            return Err(
                self.wrong("the motor is not calibrated; run moteus_tool --calibrate".to_owned())
            );
        }
        let ratio = self.number("motor_position.rotor_to_output_ratio")?;
        let gear_ratio = joint.gear_ratio;
        if (ratio * gear_ratio - 1.0).abs() > RATIO_TOLERANCE {
            return Err(self.wrong(format!(
                "motor_position.rotor_to_output_ratio is {ratio}, a gear of {:.3}; the robot file has gear_ratio = {gear_ratio}; change one of them",
                1.0 / ratio
            )));
        }
        Ok(())
    }

    fn set_watchdog(&mut self, watchdog: Duration) -> Result<Duration, OpenError> {
        let asked_s = watchdog.as_secs_f64();
        let name = "servo.default_timeout_s";
        if (self.number(name)? - asked_s).abs() > WATCHDOG_TOLERANCE_S {
            self.say(&format!("conf set {name} {asked_s:.6}"))?;
        }
        let kept_s = self.number(name)?;
        if (kept_s - asked_s).abs() > WATCHDOG_TOLERANCE_S {
            return Err(self.wrong(format!(
                "{name} is {kept_s} after it was set to {asked_s}; set it with moteus_tool"
            )));
        }
        Ok(watchdog)
    }

    /// Reads a register in an encoding, 0 to 3.
    fn register(&mut self, register: u16, encoding: u8) -> Result<Value, OpenError> {
        let mut query = self.frame();
        query.data[0] = 0x11 | encoding << 2;
        query.size = 2;
        if register > 0x7f {
            query.data[1] = register as u8 | 0x80;
            query.data[2] = (register >> 7) as u8;
            query.size = 3;
        } else {
            query.data[1] = register as u8;
        }
        let mut read = None;
        self.ask(&query, |frame| {
            for subframe in parse_frame(frame.payload()) {
                if let Subframe::Register {
                    subframe_type: SubframeType::Response,
                    register: answered,
                    value: Some(value),
                    ..
                } = subframe
                    && answered == register
                {
                    read = Some(value);
                }
            }
            read.is_some()
        })?;
        read.ok_or_else(|| {
            self.wrong(format!(
                "does not answer for register {register:#05x}; check the cable"
            ))
        })
    }

    /// Reads a number of the configuration.
    fn number(&mut self, name: &str) -> Result<f64, OpenError> {
        let line = self.say(&format!("conf get {name}"))?;
        line.parse().map_err(|_| {
            self.wrong(format!(
                "says `{line}` to conf get {name}; update the drive's firmware"
            ))
        })
    }

    /// Says a line on the diagnostic channel; the first line of the answer.
    fn say(&mut self, line: &str) -> Result<String, OpenError> {
        // what somebody else has not read
        while !self.poll()?.is_empty() {}
        let text = format!("{line}\n");
        for part in text.as_bytes().chunks(MAX_WRITE) {
            let mut frame = self.frame();
            frame.arbitration_id = calculate_arbitration_id(0, self.id as i8, 0, false);
            frame.size = write_client_to_server(CHANNEL, part, &mut frame.data);
            exchange(self.host, self.port, &frame, 0, |_| true)?;
        }
        let mut answer = Vec::new();
        for _ in 0..POLLS {
            answer.extend(self.poll()?);
            if let Some(end) = answer.iter().position(|byte| matches!(byte, b'\r' | b'\n')) {
                return Ok(String::from_utf8_lossy(&answer[..end]).into_owned());
            }
        }
        Err(self.wrong(format!(
            "does not answer to `{line}` on the diagnostic channel; check the cable"
        )))
    }

    fn poll(&mut self) -> Result<Vec<u8>, OpenError> {
        let mut frame = self.frame();
        frame.size = write_client_poll(CHANNEL, MAX_WRITE as u8, &mut frame.data);
        let mut piece = None;
        self.ask(&frame, |frame| {
            piece = parse_server_to_client(frame.payload(), CHANNEL).map(<[u8]>::to_vec);
            piece.is_some()
        })?;
        piece.ok_or_else(|| {
            self.wrong("does not answer on the diagnostic channel; check the cable".to_owned())
        })
    }

    fn frame(&self) -> CanFdFrame {
        let mut frame = CanFdFrame::new();
        frame.arbitration_id = calculate_arbitration_id(0, self.id as i8, 0, true);
        frame
    }

    /// Asks until the drive answers what is wanted, a few times.
    fn ask(
        &mut self,
        query: &CanFdFrame,
        mut take: impl FnMut(&CanFdFrame) -> bool,
    ) -> Result<(), OpenError> {
        let id = self.id;
        for _ in 0..TRIES {
            let ours =
                |frame: &CanFdFrame| parse_arbitration_id(frame.arbitration_id).0 as u8 == id;
            if exchange(self.host, self.port, query, ANSWER_NS, |frame| {
                ours(frame) && take(frame)
            })? {
                break;
            }
        }
        Ok(())
    }
}
