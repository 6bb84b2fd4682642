//! Whether the loop keeps its time with more joints, more signals recorded, and more observers.

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use realtime::process::user_id;
use shm_types::bus::Bus;
use shm_types::instance::Instance;
use shm_types::topics::{self, Role};

use crate::Extent;
use crate::histograms::{cells, empty, spreads, write_hgrm};
use crate::page;
use crate::run::{Run, flexspline, instance_name, stay_off};

const JOINTS: [usize; 6] = [1, 2, 4, 8, 12, 16];
/// Beside the supervisor, which has the eighth place.
const OBSERVERS: [usize; 5] = [0, 1, 2, 4, 7];
/// Told to a copy of this program that observes.
pub const FLAG: &str = "--observe";
/// Between two looks; the topics hold 43 ms.
const LOOK: Duration = Duration::from_millis(10);

/// All rounds of one case.
#[derive(Default)]
struct Case {
    varied: usize,
    runs: Vec<Run>,
}

impl Case {
    fn rounds(&self, time: &str) -> Vec<[f64; 3]> {
        self.runs.iter().map(|run| run.quantiles_us(time)).collect()
    }

    fn show(&self) {
        let largest = |time| {
            let all = self.runs.iter().map(|run| run.max_us(time));
            all.fold(0.0, f64::max)
        };
        let missed: Vec<String> = self
            .runs
            .iter()
            .map(|run| run.counter("missed_deadlines").to_string())
            .collect();
        println!(
            "| {} | {} | {} | {:.0} | {} | {} | {} |",
            self.varied,
            self.runs.last().map_or(0, |run| run.signals),
            cells(&self.rounds("wakeup_lateness"), 1),
            largest("wakeup_lateness"),
            cells(&self.rounds("compute"), 1),
            cells(&self.rounds("command_latency"), 1),
            missed.join(" / ")
        );
    }
}

pub fn report(extent: &Extent) {
    println!(
        "{} rounds of {} s for each case\n",
        extent.rounds, extent.seconds
    );
    let folder = tempfile::tempdir().expect("a temporary directory");
    let case = |varied: usize| Case {
        varied,
        runs: Vec::new(),
    };
    let (mut joints, mut observers) = (JOINTS.map(case), OBSERVERS.map(case));
    for round in 1..=extent.rounds {
        for case in &mut joints {
            let path = folder.path().join(format!("chain{}.toml", case.varied));
            std::fs::write(&path, chain(case.varied)).expect("the folder is ours");
            let robot = path.display().to_string();
            let log = format!("scaling-joints{}-round{round}", case.varied);
            let arguments = ["--robot", &robot, "--trajectory", "sine"];
            let log = Some((extent.folder.as_path(), log.as_str()));
            case.runs.push(flexspline(&arguments, extent.seconds, log));
        }
        for case in &mut observers {
            case.runs.push(observed(case.varied, extent.seconds));
        }
    }
    show("joints", &joints);
    show("observers", &observers);
    for case in &joints {
        let mut all = empty();
        case.runs.iter().for_each(|run| all += &run.lateness);
        let file = format!("scaling-joints{}.hgrm", case.varied);
        write_hgrm(&extent.folder.join(file), &all);
    }
    let figures = [("joints", &joints[..]), ("observers", &observers[..])].map(|(name, cases)| {
        let curve = |time: &str| {
            let points = cases.iter().map(|case| {
                let medians = spreads(&case.rounds(time)).map(|spread| spread.median);
                (case.varied as f64, medians)
            });
            points.collect::<Vec<_>>()
        };
        let panels = vec![
            page::curve("late at wake-up", name, &curve("wakeup_lateness")),
            page::curve("sample to command", name, &curve("command_latency")),
        ];
        page::figure(&format!("Over {name}: medians of the rounds."), panels)
    });
    page::write(
        &extent.folder.join("scaling.html"),
        "Scaling",
        figures.into(),
    );
}

fn show(name: &str, cases: &[Case]) {
    println!(
        "| {name} | signals recorded | late p50, µs | p99 | p99.9 | max | own compute p50 | p99 | p99.9 | sample to command p50 | p99 | p99.9 | missed deadlines |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    cases.iter().for_each(Case::show);
    println!();
}

/// A run with so many programs that read what the relay hands on.
fn observed(count: usize, seconds: u64) -> Run {
    let mut observers: Vec<Child> = Vec::new();
    std::thread::scope(|scope| {
        let run = scope.spawn(|| flexspline(&[], seconds, None));
        std::thread::sleep(Duration::from_secs(1));
        observers.extend((0..count).map(|_| observer()));
        let run = run.join().expect("the run ends");
        for observer in &mut observers {
            // It has ended with the run, as a rule.
            let _ = observer.kill();
            let _ = observer.wait();
        }
        run
    })
}

/// A copy of this program that reads what the relay hands on.
fn observer() -> Child {
    Command::new(std::env::current_exe().expect("this program"))
        .args([FLAG, &instance_name()])
        .stdin(Stdio::null())
        .spawn()
        .expect("this program starts")
}

/// Reads until it is killed. Off the loop's core, as any good observer.
pub fn observe(name: &str) {
    let instance = Instance::new(name, user_id()).expect("a good name");
    if let Ok(config) = instance.run_config()
        && let Some(core) = config.core_of(Role::Loop)
    {
        stay_off(core);
    }
    let bus = Bus::join(&instance).expect("the instance is ours");
    let statuses = bus.reader(&topics::OBSERVED_STATUS).expect("a place");
    let samples = bus.reader(&topics::OBSERVED_SAMPLE).expect("a place");
    loop {
        while statuses.take().is_some() || samples.take().is_some() {}
        std::thread::sleep(LOOK);
    }
}

/// A robot of so many equal joints that turn about the vertical, one above the other.
fn chain(joints: usize) -> String {
    let list = |value: &str| vec![value; joints].join(", ");
    let mut text = format!(
        "name = \"chain{joints}\"\ngravity_m_s2 = [0.0, 0.0, -9.81]\n\n[control]\nrate_hz = 1500.0\n\
         kind = \"pd_feedforward\"\nproportional_nm_rad = [{}]\nderivative_nm_s_rad = [{}]\nfeedback = \"motor\"\n\
         feedforward = \"model\"\nvelocity_filter_hz = 200.0\nvelocity_filter_order = 1\ndelay_cycles = 1\n",
        list("400.0"),
        list("20.0")
    );
    for joint in 1..=joints {
        text += &format!(
            "\n[[link]]\njoint = \"joint{joint}\"\norigin_m = [0.0, 0.0, 0.1]\norigin_rpy_rad = [0.0, 0.0, 0.0]\n\
             axis = [0.0, 0.0, 1.0]\nmass_kg = 1.0\ncentre_of_mass_m = [0.0, 0.0, 0.05]\n\
             inertia_kg_m2 = {{ xx = 0.01, yy = 0.01, zz = 0.01 }}\n"
        );
    }
    for joint in 1..=joints {
        text += &format!(
            "\n[[joint]]\nname = \"joint{joint}\"\ngear_ratio = 100.0\nrotor_inertia_kg_m2 = 1.14e-5\n\
             torque_limit_nm = 0.37\nmotor_encoder_resolution_rad = 1.534e-3\nposition_limit_rad = [-2.0, 2.0]\n\
             velocity_limit_rad_s = 3.0\neffects = [\n  {{ effect = \"coulomb_friction\", coulomb_nm = 2.0 }},\n  \
             {{ effect = \"viscous_friction\", viscous_nm_s_rad = 1.0 }},\n  \
             {{ effect = \"torsional_compliance\", stiffness_nm_rad = 8333.0 }},\n]\n"
        );
    }
    text
}
