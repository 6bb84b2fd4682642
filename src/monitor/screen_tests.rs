use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::*;
use crate::monitor::picture;
use crate::monitor::snapshot::{Bucket, JointEstimates, LoopCounters, LoopTimes, ProcessLine};

fn quantiles(count: u64, p50_us: f64) -> Quantiles {
    Quantiles {
        count,
        p50_us,
        p99_us: 2.0 * p50_us,
        p999_us: 4.0 * p50_us,
        max_us: 40.0 * p50_us,
    }
}

fn snapshot() -> Snapshot {
    let joint = |joint: &str, link_position_rad, limited| JointLine {
        joint: joint.to_owned(),
        link_position_rad: Some(link_position_rad),
        link_velocity_rad_s: Some(-0.25),
        motor_torque_nm: None,
        commanded_motor_torque_nm: Some(-0.5),
        joint_torque_nm: None,
        estimates: JointEstimates {
            residual_torque_nm: Some(12.345),
            fusion_torque_nm: Some(11.0),
            fusion_std_nm: Some(0.25),
            ..JointEstimates::default()
        },
        limited,
        position_limit_rad: Some([-1.0, 1.0]),
        velocity_limit_rad_s: Some(1.0),
        motor_torque_limit_nm: Some(2.0),
        drive: None,
    };
    Snapshot {
        instance: "arm1".to_owned(),
        robot: "pa10".to_owned(),
        driver: "emulator".to_owned(),
        trajectory: "lemniscate".to_owned(),
        mode: Mode::Realtime,
        heard: true,
        state: "Running".to_owned(),
        fault: Some("joint2: ran away".to_owned()),
        cycle: 3000,
        time_s: 2.0,
        asked_rate_hz: 1500.0,
        rate_hz: Some(1499.9),
        times: LoopTimes {
            late_at_wakeup: quantiles(1500, 14.0),
            own_compute: quantiles(1500, 10.0),
            sample_to_command: quantiles(1500, 30.0),
            exchange_with_drives: quantiles(0, 0.0),
        },
        lateness_buckets: (0..13)
            .map(|power| Bucket {
                up_to_us: 1 << power,
                count: if power == 4 { 1400 } else { power % 3 },
            })
            .collect(),
        lost_cycles: 1,
        counters: LoopCounters {
            missed_deadlines: 4,
            skipped_periods: 3,
            stale_commands: 2,
            refused_commands: 1,
        },
        joints: vec![joint("joint1", -0.5, false), joint("joint2", 1.2, true)],
        processes: vec![
            ProcessLine {
                role: "loop".to_owned(),
                process_id: 100,
                age_s: 2.1,
                restarts: 0,
                last_end: None,
            },
            ProcessLine {
                role: "relay".to_owned(),
                process_id: 123_456,
                age_s: 0.4,
                restarts: 2,
                last_end: Some("signal 9".to_owned()),
            },
        ],
    }
}

#[test]
fn the_screen_shows_what_the_snapshot_holds() {
    let shown = picture(&snapshot()).expect("a picture");
    let expected = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/src/monitor/screen_expected.txt"
    );
    let expected = std::fs::read_to_string(expected).expect("beside this file");
    assert!(shown == expected, "expected\n{expected}\nshown\n{shown}");
}

#[test]
fn a_small_terminal_is_no_reason_to_panic() {
    for (columns, rows) in [(1, 1), (20, 5), (80, 24), (300, 100)] {
        let mut terminal = Terminal::new(TestBackend::new(columns, rows)).expect("a terminal");
        terminal
            .draw(|frame| draw(frame, &snapshot(), "note"))
            .expect("drawn");
    }
}

#[test]
fn the_range_has_its_mark_outside_when_the_joint_is() {
    let limits = Some([-1.0, 1.0]);
    assert_eq!(range_gauge(Some(-1.0), limits), "├●────────┤");
    assert_eq!(range_gauge(Some(0.0), limits), "├────●────┤");
    assert_eq!(range_gauge(Some(1.0), limits), "├────────●┤");
    assert_eq!(range_gauge(Some(-1.1), limits), "●─────────┤");
    assert_eq!(range_gauge(Some(1.1), limits), "├─────────●");
    assert_eq!(range_gauge(None, limits), "-");
}
