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
