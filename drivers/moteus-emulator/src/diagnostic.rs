//! The diagnostic channel's commands: `conf`, `tel` and `d`, answered as the drive's firmware answers.
//!
//! Source: moteus, protocol/diagnostic.md; texts of refusals: mjbots/mjlib, micro/persistent_config.cc and
//! micro/telemetry_manager.cc, and fw/board_debug.cc. Not emulated are the commands that calibrate, flash or set voltages:
//! they are refused as unknown.

use crate::channels::{NAMES, blob};
use crate::config::leading_number;
use crate::controller::Controller;
use crate::servo::{Command, Mode};

/// The fastest that a channel speaks of its own accord, from this on `tel rate` means at every change of it; the emulated
/// drive then says it every millisecond (micro/telemetry_manager.cc, `kMinRateMs`).
const RATE_MIN_MS: u32 = 10;

const OK: &[u8] = b"OK\r\n";
const UNKNOWN_COMMAND: &str = "unknown command";
const UNKNOWN_SUBCOMMAND: &str = "unknown subcommand";

impl Controller {
    /// Does what a line says and puts the answer into the stream.
    pub fn diagnose(&mut self, line: &str) {
        let (word, rest) = split(line);
        let answer = match word {
            "conf" => self.conf(rest),
            "tel" => self.tel(rest),
            "d" => self.debug(rest),
            "" => return,
            _ => Err(UNKNOWN_COMMAND.to_owned()),
        };
        match answer {
            Ok(bytes) => self.tunnel.say(&bytes),
            Err(reason) => self.tunnel.say(format!("ERR {reason}\r\n").as_bytes()),
        }
    }

    fn conf(&mut self, text: &str) -> Result<Vec<u8>, String> {
        let (word, rest) = split(text);
        let refused = |error: crate::config::ConfigError| error.to_string();
        match word {
            "get" => self
                .config
                .get(rest)
                .map(|value| format!("{value}\r\n").into_bytes())
                .map_err(refused),
            "set" => {
                let (name, value) = split(rest);
                self.config.set(name, value).map_err(refused)?;
                self.reconfigured();
                Ok(OK.to_vec())
            }
            "enumerate" => {
                let lines = self.config.enumerate(rest).map_err(refused)?;
                Ok((lines + "OK\r\n").into_bytes())
            }
            "list" => Ok(listed(&self.config.groups())),
            "write" => {
                self.config.save();
                Ok(OK.to_vec())
            }
            "load" => {
                self.config.load();
                self.reconfigured();
                Ok(OK.to_vec())
            }
            "default" => {
                self.config.reset();
                self.reconfigured();
                Ok(OK.to_vec())
            }
            _ => Err(UNKNOWN_SUBCOMMAND.to_owned()),
        }
    }

    fn tel(&mut self, text: &str) -> Result<Vec<u8>, String> {
        let (word, rest) = split(text);
        let (name, argument) = split(rest);
        let place = NAMES.iter().position(|known| *known == name);
        let channel = || place.ok_or_else(|| "unknown name".to_owned());
        match word {
            "list" => Ok(listed(&NAMES)),
            "get" => Ok(self.emitted(channel()?, name)),
            "schema" => Ok(blob("schema", name, &self.channel(channel()?).schema())),
            "fmt" => {
                self.channels[channel()?].is_text = leading_number(argument) != 0.0;
                Ok(OK.to_vec())
            }
            "rate" => {
                let channel = &mut self.channels[channel()?];
                channel.every_ms = match leading_number(argument) as u32 {
                    0 => 0,
                    1..RATE_MIN_MS => 1,
                    every_ms => every_ms,
                };
                channel.next_ms = channel.every_ms;
                Ok(OK.to_vec())
            }
            "stop" => {
                self.channels
                    .iter_mut()
                    .for_each(|channel| channel.every_ms = 0);
                Ok(OK.to_vec())
            }
            "text" => {
                self.channels
                    .iter_mut()
                    .for_each(|channel| channel.is_text = true);
                Ok(OK.to_vec())
            }
            _ => Err(UNKNOWN_SUBCOMMAND.to_owned()),
        }
    }

    fn debug(&mut self, text: &str) -> Result<Vec<u8>, String> {
        let (word, rest) = split(text);
        let value = || (!rest.is_empty()).then(|| leading_number(rest));
        match word {
            "stop" => self.command(Command::default()),
            "brake" => self.command(Command {
                mode: Mode::Brake,
                ..Command::default()
            }),
            "pos" => self.command(aimed(Mode::Position, rest)?),
            "tmt" => self.command(aimed(Mode::Timeout, rest)?),
            "zero" => self.command(aimed(Mode::ZeroVelocity, rest)?),
            "within" => self.command(within(rest)?),
            "dq" => self.command(current(rest)?),
            "nearest" | "rezero" => self.set_nearest(value().unwrap_or(0.0)),
            "exact" | "index" => self.set_exact(value().ok_or("missing index value")?),
            "cfg-set-output" => {
                self.configure_output(value().unwrap_or(0.0));
            }
            "req-reindex" => self.require_reindex(),
            "recapture" => self.servo.recapture(),
            "reset" => {
                self.power(false);
                self.power(true);
                return Ok(Vec::new());
            }
            _ => return Err(UNKNOWN_COMMAND.to_owned()),
        }
        Ok(OK.to_vec())
    }
}

/// Without a timeout, as all commands of the diagnostic channel are unless they say otherwise.
fn without_timeout(mode: Mode) -> Command {
    Command {
        mode,
        timeout_s: f64::NAN,
        ..Command::default()
    }
}

/// `<position> <velocity> <maximum torque> [options...]`
fn aimed(mode: Mode, text: &str) -> Result<Command, String> {
    let mut words = text.split_whitespace();
    let [position, velocity, torque] = [(); 3].map(|()| words.next().map(leading_number));
    let (Some(position_rev), Some(velocity_rev_s), Some(max_torque_nm)) =
        (position, velocity, torque)
    else {
        return Err("missing p/v/i".to_owned());
    };
    let mut command = Command {
        position_rev,
        velocity_rev_s,
        max_torque_nm,
        ..without_timeout(mode)
    };
    words.try_for_each(|word| option(&mut command, word, "pdisftavb"))?;
    Ok(command)
}

/// `<lower bound> <upper bound> <maximum torque> [options...]`
fn within(text: &str) -> Result<Command, String> {
    let mut words = text.split_whitespace();
    let [least, most, torque] = [(); 3].map(|()| words.next().map(leading_number));
    let (Some(least_rev), Some(most_rev), Some(max_torque_nm)) = (least, most, torque) else {
        return Err("missing min/max/t".to_owned());
    };
    let mut command = Command {
        bounds_rev: [least_rev, most_rev],
        max_torque_nm,
        ..without_timeout(Mode::StayWithin)
    };
    words.try_for_each(|word| option(&mut command, word, "pditfb"))?;
    Ok(command)
}

/// `<d current> <q current>`
fn current(text: &str) -> Result<Command, String> {
    let mut words = text.split_whitespace();
    let (Some(d_current), Some(q_current)) = (words.next(), words.next()) else {
        return Err("missing d/q current".to_owned());
    };
    Ok(Command {
        d_current_a: leading_number(d_current),
        q_current_a: leading_number(q_current),
        ..without_timeout(Mode::Current)
    })
}

/// A letter and a number (moteus, protocol/diagnostic.md, `d pos`).
fn option(command: &mut Command, word: &str, allowed: &str) -> Result<(), String> {
    let mut characters = word.chars();
    let letter = characters.next().filter(|letter| allowed.contains(*letter));
    let value = leading_number(characters.as_str());
    match letter {
        Some('p') => command.kp_scale = value,
        Some('d') => command.kd_scale = value,
        Some('i') => command.ilimit_scale = value,
        Some('s') => command.stop_position_rev = value,
        Some('f') => command.feedforward_nm = value,
        Some('t') => command.timeout_s = value,
        Some('a') => command.acceleration_limit_rev_s2 = value,
        Some('v') => command.velocity_limit_rev_s = value,
        Some('b') => command.ignore_bounds = value != 0.0,
        _ => return Err("unknown option".to_owned()),
    }
    Ok(())
}

fn listed(names: &[&str]) -> Vec<u8> {
    let lines: String = names.iter().map(|name| format!("{name}\r\n")).collect();
    (lines + "OK\r\n").into_bytes()
}

/// The first word, and what follows it.
fn split(text: &str) -> (&str, &str) {
    let text = text.trim();
    let (word, rest) = text.split_once(' ').unwrap_or((text, ""));
    (word, rest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::controller::Sensors;

    fn controller() -> Controller {
        Controller::new([1; 16], Config::factory([1; 16]), Sensors::default(), true)
    }

    fn said(controller: &mut Controller, line: &str) -> String {
        controller.diagnose(line);
        String::from_utf8_lossy(&controller.tunnel.piece(usize::MAX)).into_owned()
    }

    #[test]
    fn configuration_is_read_and_set() {
        let mut drive = controller();
        assert_eq!(
            said(&mut drive, "conf get servo.default_timeout_s"),
            "0.100000\r\n"
        );
        assert_eq!(said(&mut drive, "conf set id.id 9"), "OK\r\n");
        assert_eq!(drive.id(), 9);
        assert_eq!(said(&mut drive, "conf get id.id"), "9\r\n");
        assert_eq!(
            said(&mut drive, "conf get id.name"),
            "ERR error reading\r\n"
        );
        assert_eq!(
            said(&mut drive, "conf set id.name 1"),
            "ERR error setting\r\n"
        );
        assert_eq!(
            said(&mut drive, "conf enumerate nothing"),
            "ERR unknown group\r\n"
        );
        assert_eq!(
            said(&mut drive, "conf nothing"),
            "ERR unknown subcommand\r\n"
        );
        assert_eq!(said(&mut drive, "nothing"), "ERR unknown command\r\n");
    }

    #[test]
    fn position_is_commanded_with_its_options() {
        let mut drive = controller();
        assert_eq!(
            said(&mut drive, "d pos nan 0.5 2 p0.5 d0.25 f-1 t0.2 a3 v4 b1"),
            "OK\r\n"
        );
        let command = drive.servo().commanded();
        assert!(command.position_rev.is_nan() && command.ignore_bounds);
        let numbers = [
            command.velocity_rev_s,
            command.max_torque_nm,
            command.kp_scale,
            command.kd_scale,
            command.feedforward_nm,
            command.timeout_s,
            command.acceleration_limit_rev_s2,
            command.velocity_limit_rev_s,
        ];
        assert_eq!(numbers, [0.5, 2.0, 0.5, 0.25, -1.0, 0.2, 3.0, 4.0]);
        assert_eq!(said(&mut drive, "d pos 0 0"), "ERR missing p/v/i\r\n");
        assert_eq!(said(&mut drive, "d pos 0 0 1 x3"), "ERR unknown option\r\n");
        assert_eq!(said(&mut drive, "d stop"), "OK\r\n");
    }

    #[test]
    fn telemetry_is_listed_and_comes_of_its_own_accord_where_asked() {
        let mut drive = controller();
        assert!(said(&mut drive, "tel list").starts_with("firmware\r\n"));
        assert_eq!(said(&mut drive, "tel get nothing"), "ERR unknown name\r\n");
        said(&mut drive, "tel text");
        said(&mut drive, "tel rate firmware 20");
        for _ in 0..19 {
            drive.tick();
        }
        assert!(drive.tunnel.piece(usize::MAX).is_empty());
        drive.tick();
        assert!(said(&mut drive, "tel stop").starts_with("firmware.version 65792\r\n"));
        (0..100).for_each(|_| drive.tick());
        assert!(drive.tunnel.piece(usize::MAX).is_empty());
    }
}
