//! Files of the libraries that own the formats go in and come out with the same bits.
#![allow(clippy::unwrap_used, reason = "a test may")]

use recording::{Recording, Signal, read};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// An interpreter that has the libraries: the one named in `FLEXSPLINE_PYTHON`, or `python3`.
fn python() -> Option<String> {
    let python = std::env::var("FLEXSPLINE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let libraries = "rosbags, numpy, scipy, h5py, pandas, pyarrow";
    let imports = Command::new(&python)
        .args(["-c", &format!("import {libraries}")])
        .output();
    if imports.is_ok_and(|imports| imports.status.success()) {
        return Some(python);
    }
    eprintln!(
        "skipped: {python} cannot import {libraries}; name one that can in FLEXSPLINE_PYTHON"
    );
    None
}

/// Numbers by their bits.
fn numbers(bits: &Value) -> Vec<f64> {
    let bits = bits
        .as_array()
        .unwrap()
        .iter()
        .map(|bits| bits.as_str().unwrap());
    bits.map(|bits| f64::from_bits(u64::from_str_radix(bits, 16).unwrap()))
        .collect()
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

/// How many values of a file are compared, and how many of them have other bits than were written.
fn compared(recording: &Recording, file: &Value) -> (usize, usize) {
    let (mut values, mut other) = (0, 0);
    let mut compare = |read: &[f64], written: &[f64]| {
        assert_eq!(read.len(), written.len(), "{}", file["file"]);
        values += read.len();
        other += read
            .iter()
            .zip(written)
            .filter(|(a, b)| !same(**a, **b))
            .count();
    };
    match &file["nanoseconds"] {
        Value::Array(clock_ns) => {
            let clock_ns: Vec<i64> = clock_ns.iter().map(|ns| ns.as_i64().unwrap()).collect();
            assert_eq!(recording.metadata["start_unix_ns"], clock_ns[0].to_string());
            let rounded = |time_s: &f64| (time_s * 1e9).round();
            let since_start = clock_ns.iter().map(|ns| (ns - clock_ns[0]) as f64);
            let read: Vec<f64> = recording.time_s.iter().map(rounded).collect();
            compare(&read, &since_start.collect::<Vec<_>>());
        }
        _ => compare(&recording.time_s, &numbers(&file["seconds"])),
    }
    for (column, bits) in file["columns"].as_object().unwrap() {
        let (joint, signal) = column.rsplit_once('.').unwrap();
        let signal = Signal::from_name(signal).unwrap();
        compare(recording.signal(joint, signal).unwrap(), &numbers(bits));
    }
    (values, other)
}

fn manifest(python: &str, folder: &Path) -> Vec<Value> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/write_as_owners.py");
    let output = Command::new(python)
        .arg(script)
        .arg(folder)
        .output()
        .unwrap();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{complaint}");
    let manifest = std::fs::read(folder.join("manifest.json")).unwrap();
    serde_json::from_slice(&manifest).unwrap()
}

#[test]
fn what_their_owners_write_comes_out_with_the_same_bits() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut table: BTreeMap<(String, String), (usize, usize)> = BTreeMap::new();
    for file in manifest(&python, folder.path()) {
        let text = |key: &str| file[key].as_str().unwrap().to_owned();
        let recording = read(&folder.path().join(text("file")));
        let recording = recording.unwrap_or_else(|error| panic!("{}: {error}", text("kind")));
        assert!(!recording.truncated, "{}", text("kind"));
        table.insert((text("writer"), text("kind")), compared(&recording, &file));
    }
    println!("| written by | file | values | other bits |\n|---|---|---|---|");
    for ((writer, kind), (values, other)) in &table {
        println!("| {writer} | {kind} | {values} | {other} |");
    }
    assert!(table.len() > 30, "{}", table.len());
    assert!(table.values().all(|(_, other)| *other == 0));
}
