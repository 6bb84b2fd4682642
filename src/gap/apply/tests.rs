//! What is written loads again, says what the report says, and leaves everything else as it was.

use gap_report::{JointTorque, Report, TorqueSource};
use robot::{Effect, RobotFile, Source};
use serde_json::{Value, json};

use super::links::with_links;
use super::with_effects;

pub const ROBOT: &str = r#"# a bench
name = "bench"                     # its name

[[link]]
joint = "shoulder"
axis = [0.0, 1.0, 0.0]
mass_kg = 2.0
centre_of_mass_m = [0.0, 0.0, 0.2]
inertia_kg_m2 = { xx = 0.02, yy = 0.02, zz = 0.004 }

[[joint]]
name = "shoulder"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1.14e-5      # wave generator included
torque_limit_nm = 0.5
effects = [
  { effect = "coulomb_friction", coulomb_nm = 2.0 },  # slow sliding
  { effect = "torsional_compliance", stiffness_nm_rad = 8333.0 },
]
"#;

pub fn report(effects: Value, shared: Value) -> Report {
    serde_json::from_value(json!({
        "schema": 2, "robot": "bench", "recordings": [], "samples": 1, "seconds": 1.0,
        "sample_rate_hz": 1500.0, "twin": "closed_loop", "compute_seconds": 1.0,
        "shared_effects": shared,
        "joints": [{
            "joint": "shoulder", "verdict": "explained", "effects": effects, "candidates": [],
            "confusable": [], "where": { "stage": null, "signals": [], "regimes": [], "bands": [] },
            "gap": {
                "torque_rms_nm": { "before": 1.0, "after": 0.1, "noise_floor": 0.1, "held_out": true },
                "position_rms_rad": { "before": 1.0, "after": 0.1, "noise_floor": 0.1, "held_out": true },
                "shrink": 1.0, "shrink_low": 0.9, "shrink_high": 1.0
            },
            "remaining": "white"
        }]
    }))
    .unwrap()
}

/// An effect as a report has it, from how a robot file has it.
pub fn found(effect: &Effect) -> Value {
    let Value::Object(fields) = serde_json::to_value(effect).unwrap() else {
        panic!("an effect is an object");
    };
    let number = |value: f64| json!({ "value": value, "std": 0.1, "at_bound": false });
    let mut parameters = serde_json::Map::new();
    let mut side = Value::Null;
    for (name, value) in fields {
        match value {
            Value::Array(point) => {
                // as reports have it: the distance along z under the point's own name too
                parameters.insert(name.clone(), number(point[2].as_f64().unwrap()));
                for (axis, value) in ["x", "y", "z"].iter().zip(point) {
                    parameters.insert(format!("{name}_{axis}"), number(value.as_f64().unwrap()));
                }
            }
            Value::Number(value) => {
                parameters.insert(name, number(value.as_f64().unwrap()));
            }
            value if name == "side" => side = value,
            _ => {}
        }
    }
    let mut entry = json!({
        "effect": effect.name(), "probability": 0.9, "parameters": parameters, "shrink_alone": 0.9
    });
    if !side.is_null() {
        entry["side"] = side;
    }
    entry
}

fn built(text: &str) -> robot::Robot {
    let file = RobotFile::parse(text, "new.toml").unwrap();
    file.build(Source::File("new.toml".into())).unwrap()
}

fn torque(source: TorqueSource, motor_per_recorded: f64) -> Option<JointTorque> {
    Some(JointTorque {
        source,
        unit: 1.0,
        motor_per_recorded,
    })
}

#[test]
fn a_change_is_added_to_the_entry_there_is_and_comments_stay() {
    let change = found(&Effect::CoulombFriction { coulomb_nm: -0.31 });
    let (text, changes) = with_effects(ROBOT, &report(json!([change]), json!([]))).unwrap();
    assert_eq!(text, ROBOT.replace("coulomb_nm = 2.0", "coulomb_nm = 1.69"));
    assert_eq!(changes[0].done, "coulomb_nm 2 -> 1.69");
}

#[test]
fn beside_a_torque_constant_torques_are_the_motor_s() {
    let named = [
        Effect::TorqueConstantError { gain: 0.8 },
        Effect::CoulombFriction { coulomb_nm: 0.5 },
        Effect::StribeckFriction {
            stribeck_nm: 1.0,
            stribeck_velocity_rad_s: 0.1,
        },
    ];
    let mut report = report(json!(named.each_ref().map(found)), json!([]));
    report.joints[0].torque = torque(TorqueSource::Drive, 0.8);
    let (text, _) = with_effects(ROBOT, &report).unwrap();
    let effects = &built(&text).joints[0].effects;
    assert!(effects.contains(&Effect::CoulombFriction { coulomb_nm: 2.4 }));
    assert!(effects.contains(&named[0]));
    let stribeck = Effect::StribeckFriction {
        stribeck_nm: 0.8,
        stribeck_velocity_rad_s: 0.1,
    };
    assert!(effects.contains(&stribeck), "{text}");
}

#[test]
fn what_is_a_torque_sensor_s_is_left_out_and_said() {
    let offset = found(&Effect::TorqueOffset { offset_nm: 0.4 });
    let friction = found(&Effect::CoulombFriction { coulomb_nm: 0.5 });
    let mut alone = report(json!([offset]), json!([]));
    alone.joints[0].torque = torque(TorqueSource::Sensor, 1.0);
    let mut beside = report(json!([offset, friction]), json!([]));
    beside.joints[0].torque = torque(TorqueSource::Sensor, 1.0);
    let source = Source::File("bench.toml".into());
    let robot = super::RobotText {
        text: ROBOT,
        source: &source,
        name: "bench.toml",
    };
    let mended = super::mended(&robot, beside, "report.json", false, None).unwrap();
    assert_eq!(
        mended.text,
        ROBOT.replace("coulomb_nm = 2.0", "coulomb_nm = 2.5")
    );
    assert!(
        mended.left_out[0].contains("shoulder: torque_offset: left out, it is the torque sensor's")
    );
    let refused = super::mended(&robot, alone, "report.json", false, None).unwrap_err();
    assert!(
        refused
            .to_string()
            .contains("nothing to add: shoulder: torque_offset"),
        "{refused}"
    );
}

#[test]
fn an_inertia_that_the_link_does_not_have_is_left_out_and_said() {
    let less = Effect::LinkInertia {
        inertia_kg_m2: -0.5,
    };
    let friction = Effect::CoulombFriction { coulomb_nm: 1.0 };
    let report = report(json!([found(&less), found(&friction)]), json!([]));
    let source = Source::File("bench.toml".into());
    let robot = super::RobotText {
        text: ROBOT,
        source: &source,
        name: "bench.toml",
    };
    let mended = super::mended(&robot, report, "report.json", false, None).unwrap();
    assert_eq!(mended.changes.len(), 1);
    assert_eq!(mended.changes[0].effect, "coulomb_friction");
    let [left_out] = &mended.left_out[..] else {
        panic!("{:?}", mended.left_out);
    };
    assert!(
        left_out.starts_with("shoulder: -5.000e-1 kg m²"),
        "{left_out}"
    );
}

#[test]
fn a_payload_that_takes_more_than_the_last_link_is_left_out_and_said() {
    let friction = Effect::CoulombFriction { coulomb_nm: 1.0 };
    let payload = |mass_kg: f64| Effect::Payload {
        mass_kg,
        centre_m: [0.0, 0.0, 0.1],
    };
    let mended = |mass_kg: f64| {
        let mut shared = found(&payload(mass_kg));
        shared["joints"] = json!(["shoulder"]);
        let report = report(json!([found(&friction)]), json!([shared]));
        let source = Source::File("bench.toml".into());
        let robot = super::RobotText {
            text: ROBOT,
            source: &source,
            name: "bench.toml",
        };
        super::mended(&robot, report, "report.json", false, None).unwrap()
    };
    let there = mended(0.5);
    assert_eq!((there.changes.len(), there.left_out.len()), (2, 0));
    let missing = mended(-2.5);
    assert_eq!(missing.changes.len(), 1);
    let left_out = &missing.left_out[0];
    assert!(
        left_out.starts_with("arm: a payload of -2.500 kg"),
        "{left_out}"
    );
}

#[test]
fn rotor_inertia_is_the_file_s_own_value() {
    let change = found(&Effect::RotorInertia {
        inertia_kg_m2: 1e-6,
    });
    let (text, _) = with_effects(ROBOT, &report(json!([change]), json!([]))).unwrap();
    assert_eq!(text, ROBOT.replace("1.14e-5 ", "0.0000124 "));
}

#[test]
fn another_effect_gets_a_line_of_its_own() {
    let new = found(&Effect::StribeckFriction {
        stribeck_nm: 0.7,
        stribeck_velocity_rad_s: 0.05,
    });
    let (text, changes) = with_effects(ROBOT, &report(json!([new]), json!([]))).unwrap();
    let (before, after) = ROBOT.split_once("8333.0 },\n").unwrap();
    assert!(text.starts_with(before) && text.ends_with(after), "{text}");
    assert!(text.contains("# slow sliding"), "{text}");
    assert!(changes[0].done.starts_with("added, "), "{changes:?}");
    assert_eq!(built(&text).joints[0].effects.len(), 3);
}

#[test]
fn a_shared_effect_is_the_whole_arm_s() {
    let effect = Effect::Payload {
        mass_kg: 1.5,
        centre_m: [0.0, 0.1, 0.2],
    };
    let mut shared = found(&effect);
    shared["joints"] = json!(["shoulder"]);
    let (text, changes) = with_effects(ROBOT, &report(json!([]), json!([shared]))).unwrap();
    assert_eq!(changes[0].joint, None);
    assert_eq!(built(&text).shared_effects, [effect]);
}

#[test]
fn a_payload_found_before_a_joint_that_nobody_recorded_is_written_on_the_last_link() {
    let effect = Effect::Payload {
        mass_kg: 1.5,
        centre_m: [0.0, 0.1, 0.2],
    };
    let mut shared = found(&effect);
    shared["joints"] = json!(["shoulder"]);
    let mut report = report(json!([]), json!([shared]));
    let gripper = "[[link]]\njoint = \"finger\"\nkind = \"prismatic\"\norigin_m = [0.0, 0.0, 0.5]\naxis = [1.0, 0.0, 0.0]\n\
                   mass_kg = 0.1\ncentre_of_mass_m = [0.0, 0.0, 0.0]\ninertia_kg_m2 = { xx = 1e-4, yy = 1e-4, zz = 1e-4 }\n";
    let text = ROBOT.replacen("[[joint]]", &format!("{gripper}[[joint]]"), 1);
    let text = format!("{text}[[joint]]\nname = \"finger\"\n");
    let robot = built(&text);
    super::put_payloads_on_last_link(&mut report, &robot);
    let (text, _) = with_effects(&text, &report).unwrap();
    let mended = built(&text);
    let [Effect::Payload { centre_m, .. }] = mended.shared_effects[..] else {
        panic!("{text}");
    };
    assert!(
        (centre_m[2] + 0.3).abs() < 1e-6 && centre_m[1] == 0.1,
        "{centre_m:?}"
    );
    // diagnosed again it is where it was found
    let moving = mended.moving_only(&["shoulder"]).unwrap();
    let [Effect::Payload { centre_m, .. }] = moving.shared_effects[..] else {
        panic!("{:?}", moving.shared_effects);
    };
    assert!((centre_m[2] - 0.2).abs() < 1e-6, "{centre_m:?}");
}

#[test]
fn lists_written_as_tables_take_one_more_and_a_joint_without_a_list_gets_one() {
    let new = found(&Effect::TorqueOffset { offset_nm: 0.4 });
    let (list, _) = ROBOT.split_once("effects = [").unwrap();
    let tables =
        format!("{list}[[joint.effects]]\neffect = \"coulomb_friction\"\ncoulomb_nm = 2.0\n");
    for (text, effects) in [(tables.as_str(), 2), (list, 1)] {
        let (text, _) = with_effects(text, &report(json!([new]), json!([]))).unwrap();
        assert_eq!(built(&text).joints[0].effects.len(), effects, "{text}");
    }
}

#[test]
fn every_effect_of_the_list_comes_back_as_it_was() {
    let sample = |name: &str| -> Effect {
        let mut entry = serde_json::Map::new();
        entry.insert("effect".to_owned(), name.into());
        // parameters are learned from what is said to be missing
        for _ in 0..12 {
            match serde_json::from_value::<Effect>(entry.clone().into()) {
                Ok(effect) => return effect,
                Err(error) => {
                    let error = error.to_string();
                    let field = error.split('`').nth(1).unwrap().to_owned();
                    let value = match field.as_str() {
                        "centre_m" => json!([0.1, 0.2, 0.3]),
                        "side" => json!("motor"),
                        "fraction" | "exponent" => json!(0.5),
                        _ => json!(0.25),
                    };
                    entry.insert(field, value);
                }
            }
        }
        panic!("{name}");
    };
    for name in Effect::names() {
        let mut effect = sample(name);
        if let Effect::ThermalFrictionDrift { drift_nm_s, .. } = &mut effect {
            *drift_nm_s = Some(0.01);
        }
        let mut entry = found(&effect);
        let (own, shared) = if effect.is_whole_arm() {
            entry["joints"] = json!(["shoulder"]);
            (json!([]), json!([entry]))
        } else {
            (json!([entry]), json!([]))
        };
        let (text, _) = with_effects(ROBOT, &report(own, shared)).unwrap();
        let robot = built(&text);
        let there =
            robot.joints[0].effects.contains(&effect) || robot.shared_effects.contains(&effect);
        let added = ["coulomb_friction", "torsional_compliance", "rotor_inertia"];
        assert!(there || added.contains(name), "{name}: {text}");
    }
}

#[test]
fn a_joint_that_is_not_there_is_named() {
    let change = found(&Effect::TorqueOffset { offset_nm: 1.0 });
    let mut report = report(json!([change]), json!([]));
    report.joints[0].joint = "elbow".to_owned();
    let refused = with_effects(ROBOT, &report).unwrap_err();
    assert!(refused.contains("`elbow`"), "{refused}");
}

#[test]
fn links_that_weigh_other_than_the_file_says_are_written_into_their_tables() {
    let number = |value: f64| json!({ "value": value, "std": 0.01, "at_bound": false });
    let weighs = Effect::GravityTorque {
        sin_nm: 1.0,
        cos_nm: 0.0,
    };
    let mut effect = found(&weighs);
    effect["of_links"] = true.into();
    let mut report = report(json!([effect]), json!([]));
    report.links = serde_json::from_value(json!([{
        "joint": "shoulder", "mass_kg": number(0.5), "inertia_part": number(-0.5),
        "centre_of_mass_m": [number(0.0), number(0.01), number(-0.05)]
    }]))
    .unwrap();
    // what links do to a joint is no effect of its own
    let (_, changes) = with_effects(ROBOT, &report).unwrap();
    assert!(changes.is_empty(), "{changes:?}");
    let mended = with_links(ROBOT, &built(ROBOT), &report, None).unwrap();
    assert_eq!(mended.changes.len(), 1);
    let link = built(&mended.text).chain.links()[0];
    assert_eq!(link.mass_kg, 2.5);
    assert_eq!(link.centre_of_mass_m.as_slice(), [0.0, 0.01, 0.15]);
    assert_eq!(link.inertia_kg_m2[(2, 2)], 0.002);
    assert!(mended.text.contains("# its name"), "{}", mended.text);
    // what the file says hangs on the link, or is fixed to it, is part of what was told
    let hung = ROBOT
        .replace("name = \"bench\"", "name = \"bench\"\nshared_effects = [{ effect = \"payload\", mass_kg = 1, centre_m = [0, 0.1, 0.4] }]")
        .replace("\neffects = [", "\neffects = [\n  { effect = \"link_inertia\", inertia_kg_m2 = 0.03 },")
        + "[[link]]\njoint = \"finger\"\nkind = \"prismatic\"\norigin_m = [0.0, 0.0, 0.5]\naxis = [1.0, 0.0, 0.0]\nmass_kg = 0.1\n\
           centre_of_mass_m = [0.0, 0.0, 0.0]\ninertia_kg_m2 = { xx = 1e-4, yy = 1e-4, zz = 1e-4 }\n[[joint]]\nname = \"finger\"\n";
    let mended = with_links(&hung, &built(&hung), &report, None).unwrap();
    let link = |text: &str| {
        let moving = built(text).moving_only(&["shoulder"]).unwrap();
        moving.loaded_chain().unwrap().links()[0]
    };
    let (before, after) = (link(&hung), link(&mended.text));
    assert!((after.mass_kg - before.mass_kg - 0.5).abs() < 1e-9);
    let moved_m = after.centre_of_mass_m - before.centre_of_mass_m;
    let missed = moved_m
        .iter()
        .zip([0.0, 0.01, -0.05])
        .map(|(m, wanted)| (m - wanted).abs());
    assert!(missed.sum::<f64>() < 1e-9, "{moved_m}");
    let inertia = after.inertia_kg_m2 - 0.5 * before.inertia_kg_m2;
    assert!(
        inertia.norm() < 1e-9 * before.inertia_kg_m2.norm(),
        "{inertia}"
    );
}

#[test]
fn a_report_of_other_links_is_refused_in_one_line() {
    let number = |value: f64| json!({ "value": value, "std": 0.01, "at_bound": false });
    for (joint, mass_kg) in [("elbow", 0.5), ("shoulder", -2.0)] {
        let mut report = report(json!([]), json!([]));
        report.links = serde_json::from_value(json!([{
            "joint": joint, "mass_kg": number(mass_kg), "inertia_part": number(0.0),
            "centre_of_mass_m": [number(0.0), number(0.0), number(0.0)]
        }]))
        .unwrap();
        let refused = with_links(ROBOT, &built(ROBOT), &report, None).unwrap_err();
        assert!(
            refused.contains(joint) && !refused.contains('\n'),
            "{refused}"
        );
    }
}

/// An arm of one joint whose link is two bodies, and a report that it weighs more, which is a part of the gap.
fn described(folder: &std::path::Path) -> (String, Report) {
    let body = |name: &str, z: f64, mass: f64| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0 0 {z}\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"0.02\" iyy=\"0.02\" izz=\"0.01\"/></inertial></link>"
        )
    };
    let urdf = format!(
        "<robot name=\"bench\"><link name=\"base\"/>{}{}\
         <joint name=\"shoulder\" type=\"continuous\"><parent link=\"base\"/><child link=\"arm\"/><axis xyz=\"0 1 0\"/></joint>\
         <joint name=\"weld\" type=\"fixed\"><parent link=\"arm\"/><child link=\"tool\"/><origin xyz=\"0 0 0.3\"/></joint></robot>",
        body("arm", 0.2, 2.0),
        body("tool", 0.0, 0.5)
    );
    std::fs::write(folder.join("arm.urdf"), urdf).unwrap();
    let robot = folder.join("arm.toml");
    std::fs::write(&robot, "name = \"bench\"\nurdf = \"arm.urdf\"\n").unwrap();
    let number = |value: f64| json!({ "value": value, "std": 0.01, "at_bound": false });
    let weighs = Effect::GravityTorque {
        sin_nm: 1.0,
        cos_nm: 0.0,
    };
    let mut effect = found(&weighs);
    effect["of_links"] = true.into();
    effect["share"] = 1.0.into();
    let mut report = report(json!([effect]), json!([]));
    report.links = serde_json::from_value(json!([{
        "joint": "shoulder", "mass_kg": number(0.7), "inertia_part": number(0.2),
        "centre_of_mass_m": [number(0.02), number(0.0), number(-0.03)]
    }]))
    .unwrap();
    let path = folder.join("report.json");
    std::fs::write(&path, serde_json::to_string(&report).unwrap()).unwrap();
    (robot.display().to_string(), report)
}

#[test]
fn links_of_a_description_go_into_a_new_one_whatever_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let (robot, _) = described(folder.path());
    let link = |path: &str| robot::load(path).unwrap().chain.links()[0];
    let before = link(&robot);
    let formats = [
        (crate::cli::ApplyFormat::Toml, "mended.toml"),
        (crate::cli::ApplyFormat::Urdf, "mended.urdf"),
        (crate::cli::ApplyFormat::Mjcf, "mended.xml"),
    ];
    for (format, out) in formats {
        let told = folder.path().join("told.json");
        let arguments = crate::cli::GapApplyArguments {
            report: folder.path().join("report.json"),
            robot: robot.clone(),
            out: folder.path().join(out),
            format,
            remaining: false,
            json: Some(told.clone()),
        };
        super::apply(&arguments).unwrap();
        let after = link(&arguments.out.display().to_string());
        assert!((after.mass_kg - before.mass_kg - 0.7).abs() < 1e-9, "{out}");
        let moved_m = after.centre_of_mass_m - before.centre_of_mass_m;
        assert!((moved_m.x - 0.02).abs() < 1e-9 && (moved_m.z + 0.03).abs() < 1e-9);
        let inertia = after.inertia_kg_m2 - 1.2 * before.inertia_kg_m2;
        assert!(inertia.norm() < 1e-9 * before.inertia_kg_m2.norm(), "{out}");
        let told = std::fs::read_to_string(told).unwrap();
        assert!(told.contains("mass_kg 2.5 -> 3.2"), "{told}");
        assert!(!told.contains("cannot_say\": \""), "{told}");
    }
    // what was there is as it was
    assert_eq!(link(&robot).mass_kg, 2.5);
    let mended = std::fs::read_to_string(folder.path().join("mended.toml")).unwrap();
    assert!(mended.contains("urdf = \"mended_links.urdf\""), "{mended}");
    // without a place for a new description they stay, and that is said
    let (text, source) = robot::load_text(&robot).unwrap();
    let given = super::RobotText {
        text: &text,
        source: &source,
        name: &robot,
    };
    let (_, report) = described(folder.path());
    let refused = super::mended(&given, report, "report.json", false, None).unwrap_err();
    assert!(
        refused.to_string().contains("what the links weigh"),
        "{refused}"
    );
}
