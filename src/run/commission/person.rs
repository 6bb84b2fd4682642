//! The person at the terminal: told, asked, and heard while something runs.

use std::io::{BufRead, IsTerminal, Write};
use std::os::fd::AsRawFd;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use realtime::wait::readable;

/// Between two looks at Ctrl-C while an answer is waited for.
const LOOK_NS: u64 = 50_000_000;

/// What somebody says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Go on.
    Yes,
    /// Do not.
    No,
    /// Nobody is there any more, or Ctrl-C was pressed.
    Gone,
}

/// Reads lines from standard input, writes to standard error.
pub struct Person {
    bar: ProgressBar,
}

impl Person {
    /// Somebody who can be asked; `None` where standard input is no terminal.
    pub fn at_terminal() -> Option<Self> {
        if !std::io::stdin().is_terminal() {
            return None;
        }
        let bar = ProgressBar::new_spinner();
        let style = ProgressStyle::with_template("    {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        Some(Self { bar })
    }

    /// Says a line.
    pub fn tell(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    /// Shows what is seen now, in place of what was seen before.
    pub fn show(&self, hint: String) {
        if self.bar.message() != hint {
            self.bar.set_message(hint);
            self.bar.tick();
        }
    }

    /// Takes away what was shown.
    pub fn clear(&self) {
        self.bar.set_message(String::new());
        self.bar.suspend(|| ());
    }

    /// Asks, and waits for the answer. What was typed before the question is none.
    pub fn ask(&self, question: &str, stop: &AtomicBool) -> Answer {
        while let Some(before) = heard(0) {
            if before == Heard::Answer(Answer::Gone) {
                return Answer::Gone;
            }
        }
        loop {
            self.bar.suspend(|| {
                eprint!("{question} [y/n] ");
                // A terminal that cannot be written to is gone, and reading says so.
                let _ = std::io::stderr().flush();
            });
            loop {
                if stop.load(Ordering::Relaxed) {
                    return Answer::Gone;
                }
                match heard(LOOK_NS) {
                    Some(Heard::Answer(answer)) => return answer,
                    Some(Heard::Other) => break,
                    None => (),
                }
            }
        }
    }

    /// Whether somebody has said meanwhile that what is waited for does not come, or is gone.
    pub fn objects(&self) -> Option<Answer> {
        match heard(0) {
            Some(Heard::Answer(answer @ (Answer::No | Answer::Gone))) => Some(answer),
            _ => None,
        }
    }
}

/// A line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Heard {
    Answer(Answer),
    Other,
}

/// A line, if one comes in time. The terminal hands out whole lines, one at a time, so none waits in the reader's own memory.
fn heard(longest_ns: u64) -> Option<Heard> {
    let stdin = std::io::stdin();
    if !readable(stdin.as_raw_fd(), longest_ns) {
        return None;
    }
    let mut line = String::new();
    match stdin.lock().read_line(&mut line) {
        Ok(0) | Err(_) => Some(Heard::Answer(Answer::Gone)),
        Ok(_) => Some(understood(&line)),
    }
}

fn understood(line: &str) -> Heard {
    match line.trim().to_lowercase().as_str() {
        "y" | "yes" => Heard::Answer(Answer::Yes),
        "n" | "no" => Heard::Answer(Answer::No),
        _ => Heard::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_but_a_yes_is_a_yes() {
        for (line, answer) in [
            ("y\n", Answer::Yes),
            (" YES \n", Answer::Yes),
            ("n\n", Answer::No),
        ] {
            assert_eq!(understood(line), Heard::Answer(answer), "{line:?}");
        }
        for line in ["\n", "yy\n", "j\n", "1\n"] {
            assert_eq!(understood(line), Heard::Other, "{line:?}");
        }
    }
}
