//! MATLAB's files: version 5 as `save` writes it, packed or not, and version 7.3, which is HDF5.
#![allow(clippy::unwrap_used, reason = "a test may")]

use flate2::read::ZlibEncoder;
use proptest::prelude::*;
use recording::{ReadProblem, Recording, Signal, read};
use std::io::Read;
use std::path::PathBuf;
use std::sync::LazyLock;

const ROWS: usize = 40;
/// Written by h5py: `write_v73.py` beside this file.
const V73: &[u8] = include_bytes!("data/v73.mat");

/// An element, filled up to eight bytes.
fn element(kind: u32, bytes: &[u8]) -> Vec<u8> {
    let mut element = [kind, bytes.len() as u32].map(u32::to_le_bytes).concat();
    element.extend(bytes);
    element.resize(element.len().next_multiple_of(8), 0);
    element
}

/// An element of up to four bytes, beside its kind and length.
fn small(kind: u16, bytes: &[u8]) -> Vec<u8> {
    let mut element = [kind, bytes.len() as u16].map(u16::to_le_bytes).concat();
    element.extend(bytes);
    element.resize(8, 0);
    element
}

fn matrix(name: &str, class: u8, axes: [u32; 2], values: &[Vec<u8>]) -> Vec<u8> {
    let name = match name.len() {
        0..=4 => small(1, name.as_bytes()),
        _ => element(1, name.as_bytes()),
    };
    let head = [
        element(6, &[class, 0, 0, 0, 0, 0, 0, 0]),
        element(5, &axes.map(u32::to_le_bytes).concat()),
        name,
    ];
    element(14, &[head.concat(), values.concat()].concat())
}

fn doubles(name: &str, width: usize, value: impl Fn(usize, usize) -> f64) -> Vec<u8> {
    let values = (0..width).flat_map(|column| (0..ROWS).map(move |row| (row, column)));
    let values: Vec<u8> = values
        .flat_map(|(row, column)| value(row, column).to_le_bytes())
        .collect();
    matrix(name, 6, [ROWS as u32, width as u32], &[element(9, &values)])
}

fn structure(name: &str, axes: [u32; 2], fields: &[&str], values: &[Vec<u8>]) -> Vec<u8> {
    let mut names = Vec::new();
    for field in fields {
        names.extend(field.as_bytes());
        names.resize(names.len().next_multiple_of(8), 0);
    }
    let parts = [
        small(5, &8_u32.to_le_bytes()),
        element(1, &names),
        values.concat(),
    ];
    matrix(name, 2, axes, &parts)
}

fn packed(variable: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    ZlibEncoder::new(variable, flate2::Compression::fast())
        .read_to_end(&mut bytes)
        .unwrap();
    // Not filled up.
    let length = (bytes.len() as u32).to_le_bytes();
    [&15_u32.to_le_bytes(), &length, &bytes[..]].concat()
}

fn file(variables: &[Vec<u8>]) -> Vec<u8> {
    let mut head = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".to_vec();
    head.resize(124, b' ');
    head.extend(b"\x00\x01IM");
    [head, variables.concat()].concat()
}

fn time_s(row: usize) -> f64 {
    row as f64 * 0.004
}

fn angle_rad(row: usize, column: usize) -> f64 {
    row as f64 + 100.0 * column as f64
}

/// Whole numbers that are written as bytes, as MATLAB does with doubles that fit.
fn settled() -> Vec<u8> {
    matrix("q_des", 6, [ROWS as u32, 2], &[element(2, &[7; 2 * ROWS])])
}

fn variables() -> Vec<Vec<u8>> {
    vec![
        doubles("t", 1, |row, _| time_s(row)),
        doubles("q", 2, angle_rad),
        settled(),
        matrix("label", 4, [1, 2], &[element(4, &[0x70, 0, 0x61, 0])]),
        matrix("masses", 6, [1, 3], &[element(2, &[1, 2, 3])]),
    ]
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join("log.mapping.toml"),
            "joints = ['shoulder', 'elbow']",
        )
        .unwrap();
        Self(folder)
    }

    fn write(&self, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join("log.mat");
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn read(&self, bytes: &[u8]) -> Recording {
        read(&self.write(bytes)).unwrap()
    }

    fn refusal(&self, bytes: &[u8]) -> String {
        read(&self.write(bytes)).unwrap_err().problem.to_string()
    }
}

#[test]
fn matrices_of_version_five_are_the_joints_whether_packed_or_in_a_struct() {
    let folder = Folder::new();
    let plain = folder.read(&file(&variables()));
    assert_eq!((plain.rows(), plain.truncated), (ROWS, false));
    assert_eq!(plain.time_s[3], time_s(3));
    let elbow = |signal| plain.signal("elbow", signal).unwrap()[5];
    assert_eq!(elbow(Signal::LinkPositionRad), angle_rad(5, 1));
    assert_eq!(elbow(Signal::ReferencePositionRad), 7.0);
    assert_eq!(
        plain.metadata["arrays_of_other_lengths_left_out"],
        "masses (3)"
    );
    let variables = variables();
    let packed: Vec<Vec<u8>> = variables.iter().map(|variable| packed(variable)).collect();
    assert!(folder.read(&file(&packed)).same_table(&plain));
    let fields = ["t", "q", "q_des", "label", "masses"];
    let whole = structure("log", [1, 1], &fields, &variables);
    assert!(folder.read(&file(&[whole])).same_table(&plain));
}

#[test]
fn structs_in_a_row_have_numbers_and_columns_that_do_not_fit_are_named() {
    let folder = Folder::new();
    let runs = [doubles("", 2, angle_rad), doubles("", 2, |_, _| 0.5)];
    let runs = structure("run", [1, 2], &["q"], &runs);
    let refusal = folder.refusal(&file(&[doubles("t", 1, |row, _| time_s(row)), runs]));
    assert!(
        refusal.contains("`run(1).q[0]`, `run(1).q[1]`, `run(2).q[0]`"),
        "{refusal}"
    );
    let short = matrix("tau", 6, [39, 2], &[element(2, &[0; 78])]);
    let refusal = folder.refusal(&file(&[variables(), vec![short]].concat()));
    assert!(
        refusal.contains("`tau[0]` has 39 rows, but `t` 40"),
        "{refusal}"
    );
}

#[test]
fn what_ends_early_is_read_as_far_as_it_goes_and_what_lies_is_refused() {
    let folder = Folder::new();
    let whole = file(&variables());
    for length in [whole.len() - 60, whole.len() - 20] {
        let cut = folder.read(&whole[..length]);
        assert!(cut.truncated, "{length}");
        assert!(cut.signal("elbow", Signal::ReferencePositionRad).is_ok());
    }
    let endless = structure("log", [u32::MAX, u32::MAX], &[], &[element(9, &[0; 64])]);
    let refusal = folder.refusal(&file(&[endless]));
    assert!(refusal.contains("no column `time_s`"), "{refusal}");
    let lies = matrix("q", 6, [40, 2], &[element(9, &[0; 16])]);
    assert!(
        folder
            .refusal(&file(&[lies]))
            .contains("`q` does not have its values")
    );
    let many = matrix("q", 6, [u32::MAX, 2], &[element(9, &[0; 16])]);
    assert!(
        folder
            .refusal(&file(&[many]))
            .contains("4294967295 rows of 2 columns")
    );
    let zeros = packed(&element(14, &vec![0; 1 << 29]));
    assert!(
        folder
            .refusal(&file(&[zeros]))
            .contains("unpacks to more than")
    );
    let other = packed(&element(9, &[0; 64]));
    assert!(
        folder
            .refusal(&file(&[other]))
            .contains("does not begin as one")
    );
}

fn cells(name: &str, axes: [u32; 2], of: &[Vec<u8>]) -> Vec<u8> {
    matrix(name, 1, axes, of)
}

fn row_of(values: &[f64]) -> Vec<u8> {
    let bytes: Vec<u8> = values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    matrix("", 6, [values.len() as u32, 1], &[element(9, &bytes)])
}

#[test]
fn cells_with_a_row_each_are_a_matrix_and_others_are_named() {
    let folder = Folder::new();
    let plain = folder.read(&file(&variables()));
    let rows = (0..ROWS).map(|row| row_of(&[angle_rad(row, 0), angle_rad(row, 1)]));
    let rows: Vec<Vec<u8>> = rows.collect();
    let joint = |joint| -> Vec<f64> { (0..ROWS).map(|row| angle_rad(row, joint)).collect() };
    let joints = [row_of(&joint(0)), row_of(&joint(1))];
    for q in [
        cells("q", [ROWS as u32, 1], &rows),
        cells("q", [1, ROWS as u32], &rows),
        cells("q", [1, 2], &joints),
    ] {
        let mut variables = variables();
        variables[1] = q;
        assert!(folder.read(&file(&variables)).same_table(&plain));
    }
    let mut uneven = rows.clone();
    uneven[7] = row_of(&[1.0, 2.0, 3.0]);
    let time = doubles("t", 1, |row, _| time_s(row));
    for (axes, of, expected) in [
        ([ROWS as u32, 1], &uneven[..], "`q` (a cell array"),
        ([ROWS as u32 / 2, 2], &rows[..], "`q` (a cell array"),
        ([2, 1], &[row_of(&[1.0]), settled()][..], "`cell2mat`"),
        (
            [ROWS as u32 + 1, 1],
            &rows[..],
            "`q` ends before its last cell",
        ),
        ([u32::MAX, 1], &rows[..], "4294967295 rows of 2 columns"),
    ] {
        let q = cells("q", axes, of);
        let refusal = folder.refusal(&file(&[time.clone(), q]));
        assert!(refusal.contains(expected), "{refusal}");
    }
}

/// As MATLAB writes a table: its name and class among the variables, its values in the subsystem data.
fn with_object(class: &str, variables: &[Vec<u8>]) -> Vec<u8> {
    let reference = matrix("", 13, [1, 1], &[element(6, &[0; 24])]);
    let words = ["run1", "MCOS", class].map(|word| element(1, word.as_bytes()));
    let flags = element(6, &[17, 0, 0, 0, 0, 0, 0, 0]);
    let object = element(14, &[flags, words.concat(), reference].concat());
    let variables = [&[object], variables].concat().concat();
    let subsystem_at = 128 + variables.len() as u64;
    let subsystem = matrix("", 9, [1, 3000], &[element(2, &[1; 3000])]);
    let mut bytes = file(&[variables, packed(&subsystem)]);
    bytes[116..124].copy_from_slice(&subsystem_at.to_le_bytes());
    bytes
}

#[test]
fn a_table_of_matlab_is_told_with_what_writes_it_as_one_that_is_read() {
    let folder = Folder::new();
    for (class, remedy) in [
        ("table", "`writetable(run1, 'run1.csv')`"),
        ("timetable", "`writetimetable(run1, 'run1.csv')`"),
        (
            "timeseries",
            "`writematrix([run1.Time, run1.Data], 'run1.csv')`",
        ),
        ("string", "save its numbers as a matrix"),
    ] {
        let refusal = folder.refusal(&with_object(class, &[]));
        let expected = format!("`run1` (a MATLAB {class}; ");
        assert!(
            refusal.contains(&expected) && refusal.contains(remedy),
            "{refusal}"
        );
        assert!(!refusal.contains("rows"), "{refusal}");
    }
    // What is beside it is read, and what is not is told.
    let recording = folder.read(&with_object("table", &variables()));
    assert_eq!(recording.rows(), ROWS);
    assert!(recording.metadata["not_read"].starts_with("`run1` (a MATLAB table"));
    let refusal = folder.refusal(&with_object(
        "table",
        &[doubles("t", 1, |row, _| time_s(row))],
    ));
    assert!(
        refusal.contains("its columns are `t`; what was not read: `run1`"),
        "{refusal}"
    );
}

#[test]
fn version_seven_point_three_is_the_same() {
    let folder = Folder::new();
    let recording = folder.read(V73);
    assert_eq!(recording.rows(), ROWS);
    let elbow = |signal, row: usize| recording.signal("elbow", signal).unwrap()[row];
    for row in 0..ROWS {
        assert_eq!(recording.time_s[row], time_s(row));
        let cosine = time_s(row).cos();
        assert!((elbow(Signal::LinkPositionRad, row) - cosine).abs() < 1e-15);
        let from_the_end = f64::from(time_s(ROWS - 1 - row).cos() as f32);
        assert_eq!(elbow(Signal::JointTorqueNm, row), from_the_end);
        assert_eq!(elbow(Signal::ReferencePositionRad, row), 7.0);
    }
    assert_eq!(
        recording.metadata["arrays_of_other_lengths_left_out"],
        "masses (7)"
    );
    let refusal = folder.refusal(&V73[..V73.len() / 2]);
    assert!(
        refusal.contains("is an HDF5 file") && refusal.contains("h5repack"),
        "{refusal}"
    );
}

fn damaged(mut bytes: Vec<u8>, damage: &[(f64, u8)]) -> Vec<u8> {
    for (place, byte) in damage {
        let place = (place * bytes.len() as f64) as usize;
        bytes[place] = *byte;
    }
    bytes
}

proptest! {
    #[test]
    fn damage_is_read_or_refused(
        damage in prop::collection::vec((0.0..1.0, prop_oneof![any::<u8>(), Just(0), Just(0xff)]), 1..6),
    ) {
        static FOLDER: LazyLock<Folder> = LazyLock::new(Folder::new);
        static WHOLE: LazyLock<[Vec<u8>; 4]> = LazyLock::new(|| {
            let variables = variables();
            let fields = ["t", "q", "q_des", "label", "masses"];
            let packed = variables.iter().map(|variable| packed(variable)).collect::<Vec<_>>();
            let rows = (0..ROWS).map(|row| row_of(&[angle_rad(row, 0), angle_rad(row, 1)]));
            let cells = cells("current", [ROWS as u32, 1], &rows.collect::<Vec<_>>());
            let of_objects = with_object("table", &[variables.clone(), vec![cells]].concat());
            [file(&[structure("log", [1, 1], &fields, &variables)]), file(&packed), of_objects, V73.to_vec()]
        });
        for bytes in &*WHOLE {
            match read(&FOLDER.write(&damaged(bytes.clone(), &damage))) {
                Ok(recording) => prop_assert!(recording.rows() <= 100 * ROWS),
                Err(error) if matches!(error.problem, ReadProblem::Io(_)) => prop_assert!(false, "{error}"),
                Err(error) => prop_assert!(!error.to_string().contains('\n'), "{error}"),
            }
        }
    }
}
