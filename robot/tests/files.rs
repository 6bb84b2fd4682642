//! Robot and injection files as people write them: accepted, or refused in one line that helps.
#![allow(clippy::unwrap_used, reason = "a test may")]

use joint_model::rigid_body::{Chain, JointKind};
use robot::{
    ControlKind, Effect, Robot, RobotError, RobotFile, RobotJoint, Source, load, parse_injection,
    survey,
};

const BENCH: &str = r#"
name = "bench"
parameter_tolerance = { default = 0.03, mass_kg = 0.1 }

[[link]]
joint = "shoulder"
origin_m = [0.0, 0.0, 0.3]
axis = [0, 2, 0]
mass_kg = 2
centre_of_mass_m = [0.0, 0.0, 0.2]
inertia_kg_m2 = { xx = 0.02, yy = 0.02, zz = 0.004 }

[[link]]
joint = "elbow"
origin_m = [0.0, 0.0, 0.4]
axis = [0.0, 1.0, 0.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.1]
inertia_kg_m2 = { xx = 0.01, yy = 0.01, zz = 0.002 }

[[joint]]
name = "elbow"
gear_ratio = 50.0
rotor_inertia_kg_m2 = 1e-5
effects = [
  { effect = "payload", mass_kg = 0.5, centre_m = 0.25 },
  { effect = "coulomb_friction", coulomb_nm = 1.0 },
]

[[joint]]
name = "shoulder"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1.14e-5

[control]
rate_hz = 1000.0
kind = "pd_feedforward"
proportional_nm_rad = [10.0, 40.0]
derivative_nm_s_rad = [1.0, 4.0]
"#;

fn read(text: &str) -> Result<Robot, RobotError> {
    RobotFile::parse(text, "bench.toml")?.build(Source::File("bench.toml".into()))
}

/// The message for the bench file with one part replaced.
#[track_caller]
fn refused(part: &str, replacement: &str) -> String {
    assert!(BENCH.contains(part), "{part}");
    let message = read(&BENCH.replacen(part, replacement, 1))
        .unwrap_err()
        .to_string();
    assert!(!message.contains('\n'), "{message}");
    assert!(message.starts_with("bench.toml"), "{message}");
    message
}

#[track_caller]
fn assert_says(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "{word:?} is not in: {message}");
    }
}

#[test]
fn joints_and_gains_follow_the_chain() {
    let robot = read(BENCH).unwrap();
    assert_eq!(robot.joint_index("shoulder"), Some(0));
    assert_eq!(robot.joint_index("elbow"), Some(1));
    assert_eq!(robot.joints[0].gear_ratio, 100.0);
    assert_eq!(robot.control.unwrap().proportional_nm_rad, [40.0, 10.0]);
    assert_eq!(robot.tolerance.of("mass_kg"), 0.1);
    assert_eq!(robot.chain.links()[0].axis.y, 1.0);
}

#[test]
fn a_joint_without_drive_is_driven_directly() {
    let bare = BENCH
        .replace("gear_ratio = 50.0\n", "")
        .replace("rotor_inertia_kg_m2 = 1e-5\n", "");
    let elbow = &read(&bare).unwrap().joints[1];
    assert_eq!((elbow.gear_ratio, elbow.rotor_inertia_kg_m2), (1.0, 0.0));
}

/// The bench with another `[control]` table.
fn with_control(table: &str) -> String {
    let (start, _) = BENCH.split_once("[control]").unwrap();
    format!("{start}[control]\n{table}")
}

#[test]
fn an_unknown_controller_may_say_nothing_else() {
    assert_eq!(
        read(&with_control("kind = \"unknown\"")).unwrap().control,
        None
    );
    let with_rate = with_control("kind = \"unknown\"\nrate_hz = 500.0");
    let control = read(&with_rate).unwrap().control.unwrap();
    assert_eq!(
        (control.kind, control.rate_hz),
        (ControlKind::Unknown, 500.0)
    );
    for table in [
        "kind = \"unknown\"\ndelay_cycles = 2",
        "kind = \"open_loop_torque\"",
    ] {
        let message = read(&with_control(table)).unwrap_err().to_string();
        assert_says(&message, &["control", "rate_hz is missing"]);
    }
}

#[test]
fn pd_is_feedback_with_nothing_fed_forward() {
    let gains =
        "proportional_nm_rad = [10.0, 40.0]\nderivative_nm_s_rad = [1.0, 4.0]\nrate_hz = 500.0";
    let pd = read(&with_control(&format!("kind = \"pd\"\n{gains}")));
    let same = read(&with_control(&format!(
        "kind = \"pd_feedforward\"\nfeedforward = \"none\"\n{gains}"
    )));
    assert_eq!(pd.unwrap().control, same.unwrap().control);
}

#[test]
fn links_may_slide_and_hang_on_any_link_before_them() {
    let elbow = "joint = \"elbow\"";
    let slide = BENCH.replacen(elbow, &format!("{elbow}\nkind = \"prismatic\""), 1);
    let links = read(&slide).unwrap().chain.links().to_vec();
    assert_eq!(
        (links[1].kind, links[1].parent),
        (JointKind::Prismatic, Some(0))
    );
    let on = |parent: &str| BENCH.replacen(elbow, &format!("{elbow}\nparent = \"{parent}\""), 1);
    assert_eq!(read(&on("base")).unwrap().chain.links()[1].parent, None);
    assert_eq!(
        read(&on("shoulder")).unwrap().chain.links()[1].parent,
        Some(0)
    );
    assert_says(
        &read(&on("sholder")).unwrap_err().to_string(),
        &[
            "link `elbow`",
            "unknown parent among the links before it `sholder`",
            "did you mean `shoulder`?",
        ],
    );
}

#[test]
fn what_resists_a_slide_is_mass() {
    let elbow = "joint = \"elbow\"";
    let slide = BENCH.replacen(elbow, &format!("{elbow}\nkind = \"prismatic\""), 1);
    let coulomb = "{ effect = \"coulomb_friction\", coulomb_nm = 1.0 }";
    let heavier = slide.replacen(
        coulomb,
        "{ effect = \"link_inertia\", inertia_kg_m2 = 3.0 }",
        1,
    );
    let robot = read(&heavier).unwrap();
    let force_n = |chain: &Chain| {
        let mut force_n = [0.0; 2];
        chain.inverse_dynamics(&[0.3, 0.1], &[0.0; 2], &[0.0, 1.0], &mut force_n);
        let mut holding_n = [0.0; 2];
        chain.gravity_torque(&[0.3, 0.1], &mut holding_n);
        force_n[1] - holding_n[1]
    };
    // 1 kg of the link and a payload of 0.5 kg
    assert!((force_n(&robot.chain) - 1.0).abs() < 1e-12);
    assert!((force_n(&robot.loaded_chain().unwrap()) - 4.5).abs() < 1e-12);
}

#[test]
fn a_payload_is_the_arms_wherever_it_is_written() {
    let robot = read(BENCH).unwrap();
    assert_eq!(
        robot.shared_effects,
        [Effect::Payload {
            mass_kg: 0.5,
            centre_m: [0.0, 0.0, 0.25]
        }]
    );
    assert_eq!(
        robot.joints[1].effects,
        [Effect::CoulombFriction { coulomb_nm: 1.0 }]
    );
}

#[test]
fn unknown_keys_are_named_with_place_and_nearest_key() {
    let top = refused("parameter_tolerance", "parameter_tolerence");
    assert_says(
        &top,
        &[
            "line 3",
            "top level",
            "`parameter_tolerence`",
            "did you mean `parameter_tolerance`?",
        ],
    );
    let joint = refused("gear_ratio = 50.0", "gear_ration = 50.0");
    assert_says(
        &joint,
        &[
            "line 23",
            "joint `elbow`",
            "`gear_ration`",
            "did you mean `gear_ratio`?",
        ],
    );
    let parameter = refused("coulomb_nm = 1.0", "coulomb = 1.0");
    assert_says(
        &parameter,
        &[
            "joint `elbow`",
            "coulomb_friction",
            "`coulomb`",
            "did you mean `coulomb_nm`?",
        ],
    );
    let effect = refused("\"coulomb_friction\"", "\"columb_friction\"");
    assert_says(
        &effect,
        &[
            "joint `elbow`",
            "`columb_friction`",
            "did you mean `coulomb_friction`?",
        ],
    );
    let inertia = refused("zz = 0.002", "zy = 0.002");
    assert_says(&inertia, &["link `elbow`", "inertia_kg_m2", "`zy`"]);
    let kind = refused("pd_feedforward", "pd_feed_forward");
    assert_says(
        &kind,
        &[
            "control, kind",
            "`pd_feed_forward`",
            "did you mean `pd_feedforward`?",
        ],
    );
    let tolerance = refused("mass_kg = 0.1 }", "mass = 0.1 }");
    assert_says(
        &tolerance,
        &["parameter_tolerance", "`mass`", "did you mean `mass_kg`?"],
    );
}

#[test]
fn malformed_text_is_refused_with_its_line() {
    assert_says(
        &refused("gear_ratio = 50.0", "gear_ratio = "),
        &["line 23", "not valid TOML"],
    );
    assert_says(
        &refused("gear_ratio = 50.0", "gear_ratio = \"fifty\""),
        &["line 23", "joint `elbow`, gear_ratio"],
    );
    assert_says(
        &refused("mass_kg = 1.0\n", "\n"),
        &["link `elbow`", "`mass_kg` is missing, add it"],
    );
    assert_says(
        &refused("[0, 2, 0]", "[0, 2]"),
        &["link `shoulder`, axis", "array of length 3"],
    );
}

#[test]
fn impossible_values_are_named_with_what_is_allowed() {
    for (part, replacement, words) in [
        (
            "gear_ratio = 50.0",
            "gear_ratio = 0",
            ["joint `elbow`", "gear_ratio = 0 must be above zero"],
        ),
        (
            "gear_ratio = 50.0",
            "gear_ratio = nan",
            ["joint `elbow`", "gear_ratio = NaN must be above zero"],
        ),
        (
            "mass_kg = 2\n",
            "mass_kg = -2\n",
            ["link `shoulder`", "mass_kg = -2 must be zero or above"],
        ),
        (
            "mass_kg = 2\n",
            "mass_kg = inf\n",
            [
                "link `shoulder`",
                "mass_kg = inf must be zero or above and finite",
            ],
        ),
        (
            "[0, 2, 0]",
            "[0, 0, 0]",
            ["link `shoulder`", "must have a length above zero"],
        ),
        ("xx = 0.02,", "xx = 1.0,", ["link `shoulder`", "inertia"]),
        (
            "coulomb_nm = 1.0",
            "coulomb_nm = nan",
            ["joint `elbow`", "coulomb_nm = NaN must be a finite number"],
        ),
        (
            "rate_hz = 1000.0",
            "rate_hz = 0",
            ["control", "rate_hz is missing or 0; give"],
        ),
        (
            "[10.0, 40.0]",
            "[10.0]",
            [
                "control",
                "proportional_nm_rad has 1 values, give one for each of the 2 joints",
            ],
        ),
        (
            "rate_hz = 1000.0",
            "rate_hz = 300.0\nvelocity_filter_hz = 200",
            ["control", "below half of rate_hz"],
        ),
        (
            "name = \"bench\"",
            "name = \" \"",
            ["top level", "name must not be empty"],
        ),
        (
            "name = \"bench\"",
            "name = \"bench\"\nurdf = \"x.urdf\"",
            ["top level", "both urdf and [[link]]"],
        ),
    ] {
        assert_says(&refused(part, replacement), &words);
    }
}

#[test]
fn links_and_joints_must_match() {
    let message = refused("name = \"elbow\"", "name = \"elbo\"");
    assert_says(
        &message,
        &[
            "joint `elbo`",
            "no link moves with",
            "did you mean `elbow`?",
        ],
    );
    assert_says(
        &refused("name = \"elbow\"", "name = \"shoulder\""),
        &["two [[joint]] tables"],
    );
    assert_says(
        &refused("joint = \"elbow\"", "joint = \"shoulder\""),
        &["link `shoulder`", "two links"],
    );
    assert_says(
        &refused("name = \"elbow\"", "name = \"el bow\""),
        &["joint 1", "\"el bow\"", "spaces"],
    );
    let (start, rest) = BENCH.split_once("[[joint]]\nname = \"shoulder\"").unwrap();
    let one_joint = format!("{start}{}", rest.split_once("[control]").map_or("", |_| ""));
    let message = read(&one_joint).unwrap_err().to_string();
    assert_says(
        &message,
        &["link `shoulder`", "has no [[joint]] table, add one"],
    );
}

#[test]
fn effects_of_one_kind_add_up_and_their_sum_must_be_possible() {
    let stiffness = |values: &str| {
        BENCH.replacen(
            "{ effect = \"coulomb_friction\", coulomb_nm = 1.0 }",
            values,
            1,
        )
    };
    let held = r#"{ effect = "torsional_compliance", stiffness_nm_rad = 8000.0 }"#;
    let change =
        |value: f64| format!("{{ effect = \"torsional_compliance\", stiffness_nm_rad = {value} }}");
    assert!(read(&stiffness(&format!("{held}, {}", change(-1000.0)))).is_ok());
    let message = read(&stiffness(&format!("{held}, {}", change(-9000.0))))
        .unwrap_err()
        .to_string();
    assert_says(
        &message,
        &[
            "torsional_compliance",
            "stiffness_nm_rad = -1000 must be above zero",
        ],
    );
    let shape =
        r#"{ effect = "stribeck_friction", stribeck_nm = 1.0, stribeck_velocity_rad_s = 0 }"#;
    assert_says(
        &read(&stiffness(shape)).unwrap_err().to_string(),
        &["stribeck_velocity_rad_s = 0 must be above zero"],
    );
    let incomplete = r#"{ effect = "thermal_friction_drift", time_constant_s = 60.0 }"#;
    assert_says(
        &read(&stiffness(incomplete)).unwrap_err().to_string(),
        &["thermal_friction_drift", "change_nm"],
    );
}

#[test]
fn tables_are_read_and_checked() {
    let with = |table: &str| {
        BENCH.replacen(
            "rotor_inertia_kg_m2 = 1.14e-5",
            &format!("rotor_inertia_kg_m2 = 1e-5\n{table}"),
            1,
        )
    };
    let row = "{ slopes = [0.2, 4.0, 0.1], knees_nm = [-5.0, -3.0], zero_load_nm = 0.8 }";
    let robot = read(&with(&format!(
        "load_torque = {{ positive = {row}, negative = {row} }}"
    )))
    .unwrap();
    assert_eq!(
        robot.joints[0].load_torque.unwrap().positive.slopes,
        [0.2, 4.0, 0.1]
    );
    let swapped = row.replace("-5.0, -3.0", "-3.0, -5.0");
    let message = read(&with(&format!(
        "load_torque = {{ positive = {row}, negative = {swapped} }}"
    )))
    .unwrap_err();
    assert_says(
        &message.to_string(),
        &[
            "joint `shoulder`",
            "load_torque.negative.knees_nm",
            "ascending, swap them",
        ],
    );
    let row = "{ f0_nm = 3.0, fv_nm_s_rad = 1.0, fs_nm = 0.5, vc_rad_s = -0.1 }";
    let message = read(&with(&format!(
        "direction_friction = {{ positive = {row}, negative = {row} }}"
    )))
    .unwrap_err();
    assert_says(
        &message.to_string(),
        &["direction_friction.positive.vc_rad_s = -0.1 must be above zero"],
    );
}

fn with_friction_table(positive_nm: &str, negative_nm: &str) -> Result<Robot, RobotError> {
    let table = format!(
        "friction_table = {{ positive_nm = [{positive_nm}], negative_nm = [{negative_nm}] }}"
    );
    let key = "rotor_inertia_kg_m2 = 1.14e-5";
    read(&BENCH.replacen(key, &format!("{key}\n{table}"), 1))
}

#[test]
fn a_friction_table_is_friction_over_the_motor_angle() {
    let robot = with_friction_table("3.0, 1.0, 2.0, 2", "0.5, 0.5, 0.5, 4.5").unwrap();
    let friction = robot.joints[0].steady_friction();
    let drag_nm = |velocity_rad_s, motor_position_rad| {
        friction.drag_nm(velocity_rad_s, 0.0, motor_position_rad, 0.0)
    };
    let quarter_rad = std::f64::consts::FRAC_PI_2;
    assert_eq!(drag_nm(0.1, 0.0), 3.0);
    assert!((drag_nm(0.1, 0.5 * quarter_rad) - 2.0).abs() < 1e-12);
    assert!((drag_nm(-0.1, 3.0 * quarter_rad) + 4.5).abs() < 1e-12);
}

#[test]
fn a_rotor_is_its_own_number_and_what_effects_add() {
    let mut joint = robot::load("shd17").unwrap().joints.remove(0);
    joint.effects.clear();
    let own_kg_m2 = joint.reflected_inertia_kg_m2();
    assert_eq!(own_kg_m2, joint.rotor_inertia_kg_m2 * 1e4);
    joint.effects.push(Effect::RotorInertia {
        inertia_kg_m2: 3e-5,
    });
    assert!((joint.reflected_inertia_kg_m2() - own_kg_m2 - 0.3).abs() < 1e-12);
}

#[test]
fn a_friction_table_survives_writing() {
    let joint = with_friction_table("3.0, -1.0", "0.5, 1e-3")
        .unwrap()
        .joints[0]
        .clone();
    let written = toml::to_string(&joint).unwrap();
    assert_eq!(
        robot::parse_toml::<RobotJoint>(&written, "").unwrap(),
        joint
    );
}

#[test]
fn an_impossible_friction_table_is_refused() {
    let refused = |positive_nm: &str, negative_nm: &str| {
        with_friction_table(positive_nm, negative_nm)
            .unwrap_err()
            .to_string()
    };
    assert_says(
        &refused("1.0", "1.0"),
        &[
            "joint `shoulder`",
            "friction_table.positive_nm has 1 points, give 2 to 4096",
        ],
    );
    assert_says(
        &refused("1.0, 2.0", &"1.0,".repeat(4097)),
        &["friction_table.negative_nm has 4097 points"],
    );
    assert_says(
        &refused("1.0, 2.0", "1.0, 2.0, 3.0"),
        &["2 points in positive_nm and 3 in negative_nm"],
    );
    assert_says(
        &refused("1.0, 2.0", "1.0, nan"),
        &["friction_table.negative_nm = NaN must be a finite number"],
    );
}

fn with_torque_tables(tables: &str) -> Result<Robot, RobotError> {
    let key = "rotor_inertia_kg_m2 = 1.14e-5";
    let text = format!("{key}\ntorque_tables = [{tables}]");
    read(&BENCH.replacen(key, &text, 1))
}

#[test]
fn torque_tables_are_drag_over_velocity_and_held_over_position_and_load() {
    let robot = with_torque_tables(
        "{ over = \"velocity\", at = [-1, 1], torque_nm = [-2.0, 4.0] }, \
         { over = \"position\", at = [0.0, 0.5], torque_nm = [0, 3] }, \
         { over = \"load\", at = [0.0, 8.0], torque_nm = [0, 0.8] }",
    )
    .unwrap();
    let friction = robot.joints[0].steady_friction();
    assert!((friction.fluid_drag_nm(0.5) - 1.5).abs() < 1e-12);
    assert!((friction.tables.held_nm(0.25, 4.0) - (1.0 + 1.5 + 0.4)).abs() < 1e-12);
    let written = toml::to_string(&robot.joints[0]).unwrap();
    assert_eq!(
        robot::parse_toml::<RobotJoint>(&written, "").unwrap(),
        robot.joints[0]
    );
}

#[test]
fn an_impossible_torque_table_is_refused() {
    for (table, says) in [
        (
            "at = [0.0, 1.0], torque_nm = [1.0]",
            "2 corners and torque_nm 1 values",
        ),
        ("at = [0.0], torque_nm = [1.0]", "1 corners"),
        (
            "at = [0.0, 0.0], torque_nm = [1.0, 2.0]",
            "corners must rise",
        ),
        (
            "at = [0.0, inf], torque_nm = [1.0, 2.0]",
            "must be a finite number",
        ),
        (
            "at = [0.0, 1.0], torque_nm = [1.0, nan]",
            "must be a finite number",
        ),
    ] {
        let table = format!("{{ over = \"load\", {table} }}");
        let refused = with_torque_tables(&table).unwrap_err().to_string();
        assert_says(&refused, &["joint `shoulder`", "torque_tables 1", says]);
    }
    let nine = "{ over = \"load\", at = [0, 1], torque_nm = [0, 1] },".repeat(9);
    let refused = with_torque_tables(&nine).unwrap_err().to_string();
    assert_says(&refused, &["has 9 tables, a joint takes at most 8"]);
}

#[test]
fn a_robot_that_is_not_there_is_looked_for_among_the_shipped_ones() {
    assert_says(
        &load("pa01").unwrap_err().to_string(),
        &[
            "pa01: cannot be read",
            "did you mean the shipped robot `pa10`?",
        ],
    );
    assert_says(
        &load("/nowhere/x.toml").unwrap_err().to_string(),
        &["shipped robots pa10, shd17"],
    );
}

#[test]
fn a_robot_without_gravity_is_no_doubt_and_one_with_another_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bench.toml");
    let surveyed = |gravity: &str| {
        std::fs::write(&path, format!("gravity_m_s2 = {gravity}\n{BENCH}")).unwrap();
        survey(path.to_str().unwrap()).unwrap()
    };
    let none = surveyed("[0.0, 0.0, 0.0]");
    assert!(none.doubtful.is_empty(), "{:?}", none.doubtful);
    assert_says(&none.known.join("\n"), &["no gravity", "gravity_m_s2"]);
    assert_says(
        &surveyed("[0.0, 0.0, -98.1]").doubtful.join("\n"),
        &["gravity is 98.1 m/s², on Earth it is 9.8"],
    );
}

#[test]
fn injections_name_joint_effect_and_start() {
    let robot = load("pa10").unwrap();
    let text = r#"
        [[effect]]
        joint = "joint2"
        effect = "stribeck_friction"
        stribeck_nm = 4
        stribeck_velocity_rad_s = 0.05
        start_s = 5
        [[effect]]
        effect = "payload"
        mass_kg = 2.0
        centre_m = 0.1
        [[effect]]
        joint = "joint7"
        effect = "base_tilt"
        roll_rad = 0.01
        pitch_rad = 0.0
        [[effect]]
        effect = "command_delay"
        delay_s = 0.002
    "#;
    let injections = parse_injection(text, "inject.toml", &robot).unwrap();
    assert_eq!(injections[0].joint, Some(1));
    assert_eq!(injections[0].start_s, 5.0);
    assert_eq!(
        injections[1].effect,
        Effect::Payload {
            mass_kg: 2.0,
            centre_m: [0.0, 0.0, 0.1]
        }
    );
    assert!(
        injections[1..]
            .iter()
            .all(|injection| injection.joint.is_none() && injection.start_s == 0.0)
    );
}

#[test]
fn bad_injections_are_refused_in_one_line() {
    let robot = load("pa10").unwrap();
    for (entry, words) in [
        (
            "joint = \"joint8\"\neffect = \"backlash\"\ngap_rad = 0.01",
            &["effect 1 `backlash`", "`joint8`", "did you mean `joint"][..],
        ),
        (
            "joint = \"joint1\"\neffect = \"backlsh\"\ngap_rad = 0.01",
            &["`backlsh`", "did you mean `backlash`?"],
        ),
        (
            "joint = \"joint1\"\neffect = \"backlash\"\ngap_rd = 0.01",
            &["`gap_rd`", "did you mean `gap_rad`?"],
        ),
        (
            "joint = \"joint1\"\neffect = \"backlash\"\ngap_rad = 0.01\nstart = 3",
            &["`start`", "did you mean `start_s`?"],
        ),
        (
            "joint = \"joint1\"\neffect = \"backlash\"\ngap_rad = -0.01",
            &["gap_rad = -0.01 must be zero or above"],
        ),
        (
            "joint = \"joint1\"\neffect = \"backlash\"\ngap_rad = 0.01\nstart_s = -1",
            &["start_s = -1 must be zero"],
        ),
        (
            "joint = \"joint1\"\neffect = \"backlash\"\ngap_rad = 0.01\nstart_s = \"now\"",
            &["must be a number of seconds"],
        ),
        (
            "joint = 1\neffect = \"backlash\"\ngap_rad = 0.01",
            &["joint's name in quotes"],
        ),
        (
            "effect = \"backlash\"\ngap_rad = 0.01",
            &["joint is missing", "joint1"],
        ),
        (
            "joint = \"joint1\"\neffect = \"backlash\"",
            &["`gap_rad` is missing"],
        ),
        (
            "joint = \"joint1\"\neffect = \"torsional_compliance\"\nstiffness_nm_rad = -60000.0",
            &["stiffness_nm_rad"],
        ),
        ("joint = \"joint1\"", &["`effect` is missing"]),
    ] {
        let message = parse_injection(&format!("[[effect]]\n{entry}"), "inject.toml", &robot)
            .unwrap_err()
            .to_string();
        assert!(
            !message.contains('\n') && message.starts_with("inject.toml"),
            "{message}"
        );
        assert_says(&message, words);
    }
    assert_says(
        &parse_injection("", "inject.toml", &robot)
            .unwrap_err()
            .to_string(),
        &["no [[effect]] table"],
    );
    assert_says(
        &parse_injection("[[effects]]", "i", &robot)
            .unwrap_err()
            .to_string(),
        &["did you mean `effect`?"],
    );
}

#[test]
fn an_injected_stiffness_is_a_change_of_what_the_file_has() {
    let robot = load("pa10").unwrap();
    let text = "[[effect]]\njoint = \"joint1\"\neffect = \"torsional_compliance\"\nstiffness_nm_rad = -20000.0";
    assert!(parse_injection(text, "inject.toml", &robot).is_ok());
}
