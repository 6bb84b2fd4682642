//! Effects in the files of other simulators: they read back as they were meant, and the rest of the file is as it was.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fs;
use std::path::Path;

use robot::{Effect, Outcome, Robot, Simulator, SimulatorFile, load};

const MODEL: &str = r#"<mujoco model="arm">
  <compiler angle="degree"/>
  <!-- what the user wrote stays -->
  <default><joint armature="0.1" damping="0.5"/></default>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder"  axis="0 1 0" frictionloss='0.2'/>
      <inertial pos="0 0 -0.25" mass="2" diaginertia="0.025 0.025 0.004"/>
      <body name="lower" pos="0 0 -0.5">
        <joint name="elbow" axis="0 1 0" pos="0 0.1 0"/>
        <inertial pos="0 0 -0.2" mass="1" diaginertia="0.01 0.01 0.002"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="m" joint="shoulder" gear="50" ctrlrange="-1 1"/>
    <position name="p" joint="elbow" kp="300" kv="30" forcerange="-60 60"/>
  </actuator>
</mujoco>
"#;

const URDF: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial><origin xyz="0 0 -0.25"/><mass value="2.0"/>
      <inertia ixx="0.025" iyy="0.025" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="meshes/upper.stl"/></geometry></visual>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/>
  </joint>
</robot>
"#;

struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn with(name: &str, text: &str) -> Self {
        let files = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        files.write(name, text);
        files
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.folder.path().join(name), text).unwrap();
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().unwrap().to_owned()
    }

    /// The robot of one file with these effects, written into another: its text, what became of each, and the notes.
    fn apply(
        &self,
        from: &str,
        simulator: Simulator,
        out: &str,
        effects: &[(Option<usize>, Effect)],
    ) -> (String, Vec<Outcome>, Vec<String>) {
        let robot = load(&self.path(from)).unwrap();
        let out = self.path(out);
        let mut file =
            SimulatorFile::of(&robot, &self.path(from), simulator, Path::new(&out)).unwrap();
        let outcomes = effects
            .iter()
            .map(|(joint, effect)| file.add(*joint, effect));
        let outcomes = outcomes.collect();
        let text = file.text().unwrap();
        fs::write(&out, &text).unwrap();
        (text, outcomes, file.notes)
    }
}

fn said(robot: &Robot, joint: usize) -> Vec<String> {
    let effects = robot.joints[joint].effects.iter();
    effects.map(|effect| format!("{effect:?}")).collect()
}

#[test]
fn without_effects_a_model_stays_to_the_byte() {
    let files = Files::with("arm.xml", MODEL);
    let (text, ..) = files.apply("arm.xml", Simulator::Mjcf, "new.xml", &[]);
    assert_eq!(text, MODEL);
    files.write("arm.urdf", URDF);
    let (text, ..) = files.apply("arm.urdf", Simulator::Urdf, "new.urdf", &[]);
    assert_eq!(text, URDF);
}

#[test]
fn friction_inertia_and_springs_read_back_from_mjcf() {
    let files = Files::with("arm.xml", MODEL);
    let effects = [
        (Some(0), Effect::CoulombFriction { coulomb_nm: 2.8 }),
        (
            Some(0),
            Effect::ViscousFriction {
                viscous_nm_s_rad: 1.5,
            },
        ),
        (
            Some(0),
            Effect::RotorInertia {
                inertia_kg_m2: 0.05,
            },
        ),
        (
            Some(1),
            Effect::JointSpring {
                stiffness_nm_rad: 4.0,
                rest_rad: 0.5,
            },
        ),
        (Some(1), Effect::TorqueOffset { offset_nm: 1.0 }),
        (Some(1), Effect::AsymmetricFriction { asymmetry_nm: 0.4 }),
    ];
    let (text, outcomes, _) = files.apply("arm.xml", Simulator::Mjcf, "new.xml", &effects);
    let all_written = outcomes
        .iter()
        .all(|outcome| matches!(outcome, Outcome::Written(_)));
    assert!(all_written, "{outcomes:?}");
    assert!(text.contains("<!-- what the user wrote stays -->"));
    assert!(text.contains("<joint name=\"shoulder\"  axis=\"0 1 0\" frictionloss='3' damping=\"2\" armature=\"0.15\"/>"), "{text}");
    let robot = load(&files.path("new.xml")).unwrap();
    assert_eq!(
        said(&robot, 0),
        [
            "CoulombFriction { coulomb_nm: 3.0 }",
            "ViscousFriction { viscous_nm_s_rad: 2.0 }"
        ]
    );
    assert_eq!(robot.joints[0].rotor_inertia_kg_m2, 0.15);
    // 4·0.5 + 1.0 - 0.4 at zero, of one spring of 4 Nm/rad, in degrees
    let Effect::JointSpring {
        stiffness_nm_rad,
        rest_rad,
    } = robot.joints[1].effects[1]
    else {
        panic!("{:?}", robot.joints[1].effects);
    };
    assert_eq!(stiffness_nm_rad, 4.0);
    assert!(
        (stiffness_nm_rad * rest_rad - 2.6).abs() < 1e-4,
        "{rest_rad}"
    );
}

#[test]
fn a_constant_torque_alone_is_a_spring_bent_so_far_that_it_is_constant() {
    let files = Files::with("arm.xml", MODEL);
    let effects = [(Some(0), Effect::TorqueOffset { offset_nm: -1.5 })];
    files.apply("arm.xml", Simulator::Mjcf, "new.xml", &effects);
    let robot = load(&files.path("new.xml")).unwrap();
    let Some(Effect::JointSpring {
        stiffness_nm_rad,
        rest_rad,
    }) = robot.joints[0].effects.last()
    else {
        panic!("{:?}", robot.joints[0].effects);
    };
    for position_rad in [-3.0, 0.0, 3.0] {
        let torque_nm = stiffness_nm_rad * (rest_rad - position_rad);
        assert!((torque_nm + 1.5).abs() < 1e-4, "{torque_nm}");
    }
}

#[test]
fn actuators_take_gains_limits_and_delays() {
    let files = Files::with("arm.xml", MODEL);
    let effects = [
        (Some(0), Effect::TorqueConstantError { gain: 0.8 }),
        (Some(1), Effect::TorqueConstantError { gain: 0.9 }),
        (Some(0), Effect::TorqueSaturation { limit_nm: 20.0 }),
        (None, Effect::CommandDelay { delay_s: 0.01 }),
        (
            Some(1),
            Effect::CurrentLoopLag {
                time_constant_s: 0.02,
            },
        ),
    ];
    let (text, outcomes, _) = files.apply("arm.xml", Simulator::Mjcf, "new.xml", &effects);
    assert!(matches!(outcomes[0], Outcome::Written(_)));
    assert!(text.contains("gear=\"40\""), "{text}");
    assert!(
        text.contains("kp=\"270\" kv=\"27\" forcerange=\"-54 54\""),
        "{text}"
    );
    assert!(
        text.contains("forcerange=\"-0.4 0.4\" forcelimited=\"true\""),
        "{text}"
    );
    assert_eq!(
        text.matches("delay=\"0.01\" nsample=\"7\" interp=\"linear\"")
            .count(),
        2
    );
    assert!(
        matches!(outcomes[3], Outcome::InPart(..)),
        "the elbow is told a position"
    );
    assert!(
        matches!(outcomes[4], Outcome::Cannot(_)),
        "MuJoCo would filter the position"
    );
    let lag = [(
        Some(0),
        Effect::CurrentLoopLag {
            time_constant_s: 0.02,
        },
    )];
    let (text, ..) = files.apply("arm.xml", Simulator::Mjcf, "lag.xml", &lag);
    assert!(text.contains("<general name=\"m\" joint=\"shoulder\" gear=\"50\" ctrlrange=\"-1 1\" dyntype=\"filterexact\" dynprm=\"0.02\""), "{text}");
    assert!(load(&files.path("lag.xml")).is_ok());
}

fn torque_nm(robot: &Robot) -> Vec<f64> {
    let count = robot.joints.len();
    let values = |scale: f64| -> Vec<f64> { (1..=count).map(|k| scale * k as f64).collect() };
    let mut torque_nm = vec![0.0; count];
    let chain = robot.loaded_chain().unwrap();
    chain.inverse_dynamics(&values(0.3), &values(-0.7), &values(1.9), &mut torque_nm);
    torque_nm
}

#[test]
fn bodies_get_payloads_inertia_and_tilt_as_the_robot_file_has_them() {
    let effects = [
        (
            None,
            Effect::Payload {
                mass_kg: 1.5,
                centre_m: [0.1, 0.0, -0.3],
            },
        ),
        (
            Some(0),
            Effect::LinkInertia {
                inertia_kg_m2: 0.05,
            },
        ),
        (
            None,
            Effect::BaseTilt {
                roll_rad: 0.1,
                pitch_rad: -0.05,
            },
        ),
    ];
    let files = Files::with("arm.xml", MODEL);
    files.write("arm.urdf", URDF);
    for (from, simulator, out, count) in [
        ("arm.xml", Simulator::Mjcf, "new.xml", 3),
        ("arm.urdf", Simulator::Urdf, "new.urdf", 2),
    ] {
        let (text, outcomes, _) = files.apply(from, simulator, out, &effects[..count]);
        let all_written = outcomes
            .iter()
            .all(|outcome| matches!(outcome, Outcome::Written(_)));
        assert!(all_written, "{outcomes:?}");
        let mut expected = load(&files.path(from)).unwrap();
        for (joint, effect) in &effects[..count] {
            match joint {
                Some(joint) => expected.joints[*joint].effects.push(*effect),
                None => expected.shared_effects.push(*effect),
            }
        }
        let read = load(&files.path(out)).unwrap();
        for (ours, theirs) in torque_nm(&expected).iter().zip(torque_nm(&read)) {
            assert!(
                (ours - theirs).abs() < 1e-4 * ours.abs(),
                "{out}: {ours} {theirs}\n{text}"
            );
        }
    }
}

#[test]
fn a_urdf_has_friction_and_limits_and_says_what_it_has_not() {
    let files = Files::with("arm.urdf", URDF);
    let effects = [
        (Some(0), Effect::CoulombFriction { coulomb_nm: 3.0 }),
        (
            Some(0),
            Effect::ViscousFriction {
                viscous_nm_s_rad: 2.0,
            },
        ),
        (Some(0), Effect::TorqueSaturation { limit_nm: 40.0 }),
        (Some(0), Effect::RotorInertia { inertia_kg_m2: 0.1 }),
        (Some(0), Effect::CoulombFriction { coulomb_nm: -4.0 }),
    ];
    let (text, outcomes, _) = files.apply("arm.urdf", Simulator::Urdf, "new.urdf", &effects);
    assert!(matches!(&outcomes[3], Outcome::Cannot(why) if why.contains("before the gear")));
    assert!(matches!(&outcomes[4], Outcome::Cannot(why) if why.contains("below zero")));
    assert!(text.contains("<mesh filename=\"meshes/upper.stl\"/>"));
    let robot = load(&files.path("new.urdf")).unwrap();
    assert_eq!(robot.joints[0].torque_limit_nm, Some(40.0));
    assert_eq!(
        said(&robot, 0),
        [
            "CoulombFriction { coulomb_nm: 3.0 }",
            "ViscousFriction { viscous_nm_s_rad: 2.0 }"
        ]
    );
}

#[test]
fn from_another_folder_meshes_are_still_found() {
    let files = Files::with("arm.urdf", URDF);
    let mesh = "<asset><mesh name=\"m\" file=\"m.stl\"/></asset>";
    files.write(
        "arm.xml",
        &MODEL.replace("<worldbody>", &format!("{mesh}<worldbody>")),
    );
    fs::create_dir(files.folder.path().join("out")).unwrap();
    let folder = fs::canonicalize(files.folder.path()).unwrap();
    let folder = folder.display();
    let (text, ..) = files.apply("arm.urdf", Simulator::Urdf, "out/new.urdf", &[]);
    assert!(
        text.contains(&format!("filename=\"{folder}/meshes/upper.stl\"")),
        "{text}"
    );
    let (text, ..) = files.apply("arm.xml", Simulator::Mjcf, "out/new.xml", &[]);
    assert!(text.contains(&format!("meshdir=\"{folder}/\"")), "{text}");
}

#[test]
fn included_files_become_one() {
    let files = Files::with(
        "joints.xml",
        "<mujoco>\n<!-- defaults --><default><joint damping=\"2\"/></default></mujoco>",
    );
    files.write(
        "arm.xml",
        &MODEL.replace("<worldbody>", "<include file=\"joints.xml\"/><worldbody>"),
    );
    let effects = [(
        Some(0),
        Effect::ViscousFriction {
            viscous_nm_s_rad: 1.0,
        },
    )];
    let (text, ..) = files.apply("arm.xml", Simulator::Mjcf, "new.xml", &effects);
    assert!(
        text.contains("<!-- defaults -->") && !text.contains("<include"),
        "{text}"
    );
    let robot = load(&files.path("new.xml")).unwrap();
    assert!(said(&robot, 0).contains(&"ViscousFriction { viscous_nm_s_rad: 3.0 }".to_owned()));
}

#[test]
fn a_robot_file_adds_to_its_model_and_says_what_the_model_cannot_hold() {
    let files = Files::with("arm.xml", MODEL);
    files.write(
        "arm.toml",
        "name = \"arm\"\nmjcf = \"arm.xml\"\n[[joint]]\nname = \"shoulder\"\ngear_ratio = 100.0\nrotor_inertia_kg_m2 = 2e-5\n\
         effects = [{ effect = \"coulomb_friction\", coulomb_nm = 1.0 }, { effect = \"backlash\", gap_rad = 0.001 }]\n",
    );
    let effects = [(
        Some(0),
        Effect::RotorInertia {
            inertia_kg_m2: 1e-5,
        },
    )];
    let (text, _, notes) = files.apply("arm.toml", Simulator::Mjcf, "new.xml", &effects);
    assert!(
        text.contains("frictionloss='1'") && text.contains("armature=\"0.3\""),
        "{text}"
    );
    assert!(
        notes[0].contains("shoulder: the robot file's backlash cannot be said"),
        "{notes:?}"
    );
}

#[test]
fn a_robot_of_another_kind_is_converted() {
    let files = Files::with("arm.urdf", URDF);
    let effects = [(Some(0), Effect::CoulombFriction { coulomb_nm: 3.0 })];
    let (text, ..) = files.apply("arm.urdf", Simulator::Mjcf, "new.xml", &effects);
    assert!(text.contains("frictionloss=\"3\""), "{text}");
    let (before, after) = (
        load(&files.path("arm.urdf")).unwrap(),
        load(&files.path("new.xml")).unwrap(),
    );
    for (ours, theirs) in torque_nm(&before).iter().zip(torque_nm(&after)) {
        assert!((ours - theirs).abs() < 1e-12, "{ours} {theirs}");
    }
}

#[test]
fn isaac_lab_gets_python_with_gains_and_friction() {
    let files = Files::with("arm.urdf", URDF);
    files.write(
        "arm.toml",
        "name = \"arm\"\nurdf = \"arm.urdf\"\n[control]\nkind = \"pd\"\nrate_hz = 500.0\nproportional_nm_rad = [100.0]\nderivative_nm_s_rad = [10.0]\n",
    );
    let effects = [
        (Some(0), Effect::CoulombFriction { coulomb_nm: 3.0 }),
        (Some(0), Effect::TorqueConstantError { gain: 0.9 }),
        (None, Effect::CommandDelay { delay_s: 0.015 }),
        (
            Some(0),
            Effect::StribeckFriction {
                stribeck_nm: 1.0,
                stribeck_velocity_rad_s: 0.1,
            },
        ),
    ];
    let (text, outcomes, _) = files.apply("arm.toml", Simulator::IsaacLab, "arm.py", &effects);
    assert!(matches!(outcomes[3], Outcome::Cannot(_)));
    let lines = [
        "from isaaclab.actuators import DelayedPDActuatorCfg",
        "DELAY_STEPS = round(0.015 / PHYSICS_DT_S)",
        "        stiffness={\n            \"shoulder\": 90.0,\n        },",
        "        damping={\n            \"shoulder\": 9.0,\n        },",
        "        effort_limit_sim={\n            \"shoulder\": 90.0,\n        },",
        "        friction={\n            \"shoulder\": 3.0,\n        },",
        "        min_delay=DELAY_STEPS,",
    ];
    for line in lines {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

#[test]
fn names_are_regular_expressions_for_isaac_lab() {
    let files = Files::with("arm.urdf", &URDF.replace("\"shoulder\"", "\"j(1)\""));
    let effects = [(Some(0), Effect::CoulombFriction { coulomb_nm: 3.0 })];
    let (text, ..) = files.apply("arm.urdf", Simulator::IsaacLab, "arm.py", &effects);
    assert!(text.contains(r#"joint_names_expr=["j\\(1\\)"]"#), "{text}");
    assert!(text.contains(r#""j\\(1\\)": 3.0"#), "{text}");
}
