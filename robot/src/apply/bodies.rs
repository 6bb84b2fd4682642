//! Masses, centres and inertias of bodies, where descriptions say them.

use nalgebra::{Matrix3, Vector3};
use roxmltree::{Document, Node};

use super::text::Changes;
use crate::links::Reshaped;
use crate::mass::MassProperties;
use crate::model::Body;

/// A body of a description, its link, and what its own mass properties come to.
type Part<'a> = (&'a Body, &'a Reshaped, MassProperties);

/// What MuJoCo's compiler may do to masses as they are written, and how it does not.
const AS_WRITTEN: [(&str, &str); 5] = [
    ("inertiafromgeom", "auto"),
    ("boundmass", "0"),
    ("boundinertia", "0"),
    ("balanceinertia", "false"),
    ("settotalmass", "-1"),
];

/// Writes them into each link's `<inertial>`; what has none has no mass.
pub fn of_urdf(document: &Document, parts: &[Part<'_>], changes: &mut Changes) {
    for (body, link, mass) in parts {
        let Some(inertial) = child(element(document, body.at), "inertial") else {
            continue;
        };
        let place_m = mass.centre_m.as_slice();
        match child(Some(inertial), "origin") {
            Some(origin) => set(changes, origin, "xyz", place_m),
            None if mass.centre_m == Vector3::zeros() => {}
            None => {
                let origin = format!("<origin xyz=\"{}\"/>", numbers(place_m));
                changes.add_child(inertial.range().start, origin);
            }
        }
        if let Some(own) = child(Some(inertial), "mass") {
            set(changes, own, "value", &[mass.mass_kg]);
        }
        if let Some(own) = child(Some(inertial), "inertia") {
            for key in ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"] {
                multiply(changes, own, key, link.inertia);
            }
        }
    }
}

/// Writes them into each body's `<inertial>`. A body that has the mass of its geoms gets one; and where the compiler does something to masses
/// it is told not to, and they are written as it made them.
pub fn of_mjcf(document: &Document, parts: &[Part<'_>], changes: &mut Changes) {
    let root = document.root_element();
    let mut is_as_written = true;
    for compiler in root.children().filter(|node| node.has_tag_name("compiler")) {
        for (key, neutral) in AS_WRITTEN {
            let said = compiler.attribute(key);
            // without any inertia from geoms there is none but as written
            if said
                .is_some_and(|said| said != neutral && (key, said) != ("inertiafromgeom", "false"))
            {
                is_as_written = false;
                changes.set(compiler.range().start, key, neutral);
            }
        }
    }
    for (body, link, mass) in parts {
        let anchor_m = match &body.joint {
            // the body's mass is with its last joint
            Some(joint) if joint.element.is_followed => continue,
            Some(joint) => joint.element.anchor_m,
            None => Vector3::zeros(),
        };
        let place_m = mass.centre_m + anchor_m;
        let inertial = child(element(document, body.at), "inertial");
        if let Some(inertial) = inertial.filter(|_| is_as_written) {
            set(changes, inertial, "pos", place_m.as_slice());
            set(changes, inertial, "mass", &[mass.mass_kg]);
            for key in ["diaginertia", "fullinertia"] {
                multiply(changes, inertial, key, link.inertia);
            }
            continue;
        }
        let i = mass.inertia_kg_m2;
        let i = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|at| i[at]);
        let new = format!(
            "<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
            numbers(place_m.as_slice()),
            numbers(&[mass.mass_kg]),
            numbers(&i)
        );
        match inertial {
            Some(inertial) => changes.replace(inertial.range().start, new),
            None if mass.mass_kg != 0.0 || mass.inertia_kg_m2 != Matrix3::zeros() => {
                changes.add_child(body.at, new)
            }
            None => {}
        }
    }
}

fn element<'a, 'd>(document: &'a Document<'d>, at: usize) -> Option<Node<'a, 'd>> {
    let mut nodes = document.descendants();
    nodes.find(|node| node.is_element() && node.range().start == at)
}

/// Of repeated elements the first counts.
fn child<'a, 'd>(node: Option<Node<'a, 'd>>, tag: &str) -> Option<Node<'a, 'd>> {
    node?.children().find(|child| child.has_tag_name(tag))
}

/// What says the same stays as it was written.
fn set(changes: &mut Changes, node: Node, key: &str, new: &[f64]) {
    let zeros = || Some(vec![0.0; new.len()]);
    if node.attribute(key).map_or_else(zeros, read).as_deref() != Some(new) {
        changes.set(node.range().start, key, numbers(new));
    }
}

fn multiply(changes: &mut Changes, node: Node, key: &str, factor: f64) {
    if let Some(values) = node.attribute(key).and_then(read) {
        let scaled: Vec<f64> = values.iter().map(|value| factor * value).collect();
        set(changes, node, key, &scaled);
    }
}

fn read(text: &str) -> Option<Vec<f64>> {
    let words = text.split_whitespace();
    words.map(|word| word.parse().ok()).collect()
}

/// With so many digits that a sum of several bodies reads back within a billionth.
fn numbers(values: &[f64]) -> String {
    let written = |value: &f64| {
        let rounded: f64 = format!("{value:.11e}").parse().unwrap_or(*value);
        rounded.to_string()
    };
    values.iter().map(written).collect::<Vec<_>>().join(" ")
}
