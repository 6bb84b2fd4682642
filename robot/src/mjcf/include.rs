//! Included files, spliced in where they are named.

use std::path::{Path, PathBuf};

use crate::build::read_beside;
use crate::error::RobotError;
use crate::xml::{self, Element};

/// MuJoCo lets no file be included twice; so many are more than any model has.
const FILES_MAX: usize = 500;

/// The whole model.
pub fn read(text: &str, path: &Path) -> Result<Element, RobotError> {
    let mut root = xml::parse(text, &path.display().to_string())?;
    let mut included = vec![path.to_owned()];
    splice(
        &mut root,
        path.parent().unwrap_or(Path::new("")),
        &mut included,
    )?;
    Ok(root)
}

/// The text of the whole model, included files' text in the place of their names: what can be changed and still is one file.
pub fn inlined(text: &str, path: &Path) -> Result<String, RobotError> {
    // names, depth and number of files are checked there
    read(text, path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    inline(text, path, folder)
}

fn inline(text: &str, path: &Path, folder: &Path) -> Result<String, RobotError> {
    let document = xml::document(text, &path.display().to_string())?;
    let mut whole = String::new();
    let mut done = 0;
    let includes = document
        .descendants()
        .filter(|node| node.has_tag_name("include"));
    for include in includes {
        let range = include.range();
        let name = include.attribute("file").unwrap_or_default();
        let inside = folder.join(name);
        let as_what = format!("<include file={name:?}/>");
        let inner = read_beside(&inside, &path.display().to_string(), &as_what)?;
        let inner = inline(&inner, &inside, folder)?;
        whole += &text[done..range.start];
        whole += between_ends(&inner);
        done = range.end;
    }
    whole += &text[done..];
    Ok(whole)
}

/// What is between the first element's ends.
fn between_ends(text: &str) -> &str {
    let Ok(document) = roxmltree::Document::parse(text) else {
        return "";
    };
    let root = document.root_element();
    let children: Vec<_> = root.children().collect();
    match (children.first(), children.last()) {
        (Some(first), Some(last)) => &text[first.range().start..last.range().end],
        _ => "",
    }
}

fn splice(
    around: &mut Element,
    folder: &Path,
    included: &mut Vec<PathBuf>,
) -> Result<(), RobotError> {
    let mut children = Vec::new();
    for mut child in around.take_children() {
        if child.tag() != "include" {
            splice(&mut child, folder, included)?;
            children.push(child);
            continue;
        }
        let name = child.required("file")?;
        let path = folder.join(name);
        if included.contains(&path) {
            return Err(child.invalid(format!("{} is included twice", path.display())));
        }
        if included.len() == FILES_MAX {
            return Err(child.invalid(format!("more than {FILES_MAX} files are included")));
        }
        included.push(path.clone());
        let text = read_beside(&path, child.file(), &format!("<include file={name:?}/>"))?;
        let mut inside = xml::parse(&text, &path.display().to_string())?;
        // names are relative to the main model's folder, also in included files
        splice(&mut inside, folder, included)?;
        children.append(&mut inside.take_children());
    }
    around.put_children(children);
    Ok(())
}
