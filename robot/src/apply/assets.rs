//! Files that a model names beside itself, named from another folder.

use std::path::Path;

use super::text::Changes;
use super::{Simulator, folder};
use crate::error::RobotError;
use crate::{mjcf, xml};

/// The model as one text whose meshes are found from where `out` lies.
pub fn named_from(
    simulator: Simulator,
    text: String,
    path: &Path,
    out: &Path,
) -> Result<String, RobotError> {
    let text = match simulator {
        Simulator::Mjcf => mjcf::inlined(&text, path)?,
        Simulator::Urdf | Simulator::IsaacLab => text,
    };
    let from = folder(path);
    if from == folder(out) {
        return Ok(text);
    }
    let file = path.display().to_string();
    let document = xml::document(&text, &file)?;
    let mut changes = Changes::default();
    match simulator {
        Simulator::Mjcf => folders_of_mjcf(&document, &from, &mut changes),
        Simulator::Urdf | Simulator::IsaacLab => files_of_urdf(&document, &from, &mut changes),
    }
    changes.apply(&text, &file)
}

/// MuJoCo looks for files in folders that its compiler is told.
fn folders_of_mjcf(document: &roxmltree::Document, from: &Path, changes: &mut Changes) {
    let root = document.root_element();
    let is_file = |node: &roxmltree::Node| {
        let is_asset = ["mesh", "texture", "hfield", "skin"].contains(&node.tag_name().name());
        is_asset
            && node
                .attribute("file")
                .is_some_and(|file| !file.starts_with('/'))
    };
    if !root.descendants().any(|node| is_file(&node)) {
        return;
    }
    let compilers = root.children().filter(|node| node.has_tag_name("compiler"));
    let compilers: Vec<_> = compilers.collect();
    let said = |key: &str| {
        let mut values = compilers.iter().rev();
        values.find_map(|compiler| compiler.attribute(key))
    };
    let folders = ["meshdir", "texturedir"].map(|key| {
        let own = said(key).or(said("assetdir")).unwrap_or("");
        (key, from.join(own).display().to_string())
    });
    match compilers.last() {
        Some(last) => {
            for (key, folder) in folders {
                changes.set(last.range().start, key, escaped(&folder));
            }
        }
        None => {
            let said = folders.map(|(key, folder)| format!("{key}=\"{}\"", escaped(&folder)));
            let compiler = format!("<compiler {}/>", said.join(" "));
            changes.add_child(root.range().start, compiler);
        }
    }
}

/// URDF names each file by itself.
fn files_of_urdf(document: &roxmltree::Document, from: &Path, changes: &mut Changes) {
    for node in document.descendants() {
        let name = node.attribute("filename");
        let is_file = ["mesh", "texture"].contains(&node.tag_name().name());
        if let Some(name) =
            name.filter(|name| is_file && !name.contains("://") && !name.starts_with('/'))
        {
            let whole = from.join(name).display().to_string();
            changes.set(node.range().start, "filename", escaped(&whole));
        }
    }
}

fn escaped(path: &str) -> String {
    path.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
}
