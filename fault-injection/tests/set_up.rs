//! Drives of which something is broken when they are looked for, before there is a loop.

use fault_injection::bench::Bench;
use fault_injection::scenarios::at_set_up;
use virtual_drives::Kind;

#[test]
fn what_is_broken_at_set_up_is_refused_in_one_line_or_waited_for() {
    for (robot, kind) in [
        ("shd17", Kind::Ethercat),
        ("pa10", Kind::Ethercat),
        ("shd17", Kind::Moteus),
        ("pa10", Kind::Moteus),
    ] {
        let bench = Bench::new(robot, kind).expect("a shipped robot");
        let faults = at_set_up(kind, bench.robot());
        assert!(!faults.is_empty());
        for broken in faults {
            let told = bench.set_up(&broken).expect("runs");
            println!("{} on {}: {told:?}", broken.name, kind.name());
            assert!(told.is_as_documented(&broken), "{}: {told:?}", broken.name);
        }
    }
}
