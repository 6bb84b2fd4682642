//! The hands of somebody who rehearses: pushes on an emulated robot, typed while it is emulated.

use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use robot::Robot;

/// A torque about a joint's axis from now on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TypedPush {
    /// Index in the robot's order.
    pub joint: usize,
    /// Joint side.
    pub torque_nm: f64,
    pub duration_s: f64,
}

/// Lines of standard input, read beside the drives.
pub struct Hands {
    typed: Receiver<TypedPush>,
}

impl Hands {
    /// From now on, until the input or the process ends. A line that is none is told and left out.
    pub fn listen(robot: &Robot) -> Self {
        let (sender, typed) = channel();
        let names: Vec<String> = robot.joint_names().into_iter().map(str::to_owned).collect();
        thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                match read(&line, &names) {
                    Ok(Some(push)) if sender.send(push).is_err() => return,
                    Ok(_) => (),
                    Err(told) => eprintln!("flexspline: {told}"),
                }
            }
        });
        Self { typed }
    }

    /// What was typed since.
    pub fn take(&self) -> impl Iterator<Item = TypedPush> {
        self.typed.try_iter()
    }
}

/// `joint1 5.5 2s`; nothing on an empty line.
fn read(line: &str, names: &[String]) -> Result<Option<TypedPush>, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [name, torque, time] = words[..] else {
        return match words.is_empty() {
            true => Ok(None),
            false => Err(format!(
                "push `{}`: write JOINT TORQUE_NM TIME, as {} 5.5 2s",
                line.trim(),
                names.first().map_or("joint1", String::as_str)
            )),
        };
    };
    let joint = names
        .iter()
        .position(|known| known == name)
        .ok_or_else(|| format!("push: no joint `{name}`; there are {}", names.join(", ")))?;
    let torque_nm = torque
        .parse()
        .ok()
        .filter(|torque_nm: &f64| torque_nm.is_finite())
        .ok_or_else(|| format!("push: `{torque}` is no torque in Nm"))?;
    let duration = humantime::parse_duration(time)
        .map_err(|_| format!("push: `{time}` is no time; write it as 500ms or 2s"))?;
    Ok(Some(TypedPush {
        joint,
        torque_nm,
        duration_s: duration.as_secs_f64(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pushes_are_read_as_they_are_typed_and_others_are_told() {
        let names = ["base".to_owned(), "elbow".to_owned()];
        let read = |line| read(line, &names);
        assert_eq!(
            read(" elbow -5.5 500ms"),
            Ok(Some(TypedPush {
                joint: 1,
                torque_nm: -5.5,
                duration_s: 0.5
            }))
        );
        assert_eq!(read("  "), Ok(None));
        for (line, part) in [
            ("elbow", "base 5.5 2s"),
            ("wrist 1 1s", "base, elbow"),
            ("elbow much 1s", "`much`"),
            ("elbow nan 1s", "`nan`"),
            ("elbow 1 2", "500ms"),
        ] {
            let told = read(line).expect_err(line);
            assert!(told.contains(part) && told.lines().count() == 1, "{told}");
        }
    }
}
