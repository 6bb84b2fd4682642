//! No text makes the readers panic, and every refusal is one line.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::sync::LazyLock;

use proptest::prelude::*;
use robot::{Robot, RobotFile, Source, load, parse_injection};

const ROBOT: &str = include_str!("../../robots/shd17.toml");
const INJECTION: &str =
    "[[effect]]\njoint = \"joint1\"\neffect = \"backlash\"\ngap_rad = 0.01\nstart_s = 5\n";
static SHD17: LazyLock<Robot> = LazyLock::new(|| load("shd17").expect("shipped"));

/// The text with some stretches removed, doubled or overwritten.
fn mangle(text: &str, wounds: &[(prop::sample::Index, usize, String)]) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for (at, length, insert) in wounds {
        let start = at.index(chars.len() + 1);
        let end = (start + length).min(chars.len());
        chars.splice(start..end, insert.chars());
    }
    chars.into_iter().collect()
}

fn wounds() -> impl Strategy<Value = Vec<(prop::sample::Index, usize, String)>> {
    let scrap = prop_oneof![
        Just(String::new()),
        Just("nan".to_owned()),
        Just("-1e400".to_owned()),
        Just("[[joint]]\n".to_owned()),
        Just("\"".to_owned()),
        Just("}, {".to_owned()),
        "[-0-9.eE\\[\\]{}=\"'`\\\\\n a-z_ä😀]{0,12}",
    ];
    prop::collection::vec((any::<prop::sample::Index>(), 0usize..30, scrap), 1..6)
}

proptest! {
    #[test]
    fn mangled_robot_files(wounds in wounds()) {
        let text = mangle(ROBOT, &wounds);
        let robot = RobotFile::parse(&text, "x.toml").and_then(|file| file.build(Source::File("x.toml".into())));
        if let Err(error) = robot {
            prop_assert!(!error.to_string().contains('\n'), "{error}");
        }
    }

    #[test]
    fn mangled_injection_files(wounds in wounds()) {
        if let Err(error) = parse_injection(&mangle(INJECTION, &wounds), "x.toml", &SHD17) {
            prop_assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
}
