//! XML elements with what errors need: file, line and name.

use std::rc::Rc;

use roxmltree::{Document, Node};

use crate::error::{Place, RobotError};

/// How deep elements may be nested: further than any robot, and not so far that following them fills a stack.
const DEPTH_MAX: usize = 200;

/// Reads the text; `file` is what errors call it.
pub fn parse(text: &str, file: &str) -> Result<Element, RobotError> {
    let document = document(text, file)?;
    let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1));
    let text = Text {
        file: file.into(),
        line_starts: line_starts.collect(),
    };
    text.element(document.root_element(), None, 0)
}

/// The text as the library of XML reads it; `file` is what errors call it.
pub fn document<'t>(text: &'t str, file: &str) -> Result<Document<'t>, RobotError> {
    Document::parse(text).map_err(|error| {
        if text.contains("<xacro:") {
            return refuse_xacro(file);
        }
        let place = Place {
            line: Some(error.pos().row as usize),
            ..Place::new(file, "")
        };
        let what = match error {
            roxmltree::Error::DtdDetected => "a DOCTYPE is not read; remove it".to_owned(),
            error => format!("not valid XML: {error}"),
        };
        RobotError::Syntax {
            place: Box::new(place),
            what,
        }
    })
}

/// The text that elements come from.
struct Text {
    file: Rc<str>,
    line_starts: Vec<usize>,
}

impl Text {
    fn element(
        &self,
        node: Node,
        around: Option<&str>,
        depth: usize,
    ) -> Result<Element, RobotError> {
        let tag = node.tag_name().name().to_owned();
        let start = node.range().start;
        let label = match (node.attribute("name"), around) {
            (Some(name), _) => format!("{tag} `{name}`"),
            (None, Some(around)) => format!("{tag} in {around}"),
            (None, None) => tag.clone(),
        };
        let attributes = node
            .attributes()
            .map(|attribute| (attribute.name().to_owned(), attribute.value().to_owned()));
        let mut element = Element {
            file: Rc::clone(&self.file),
            line: self.line_starts.partition_point(|begin| *begin <= start),
            at: start,
            label,
            tag,
            namespace: node.tag_name().namespace().unwrap_or("").to_owned(),
            attributes: attributes.collect(),
            text: node.text().unwrap_or("").trim().to_owned(),
            children: Vec::new(),
        };
        if depth > DEPTH_MAX {
            return Err(element.invalid(format!("elements are nested deeper than {DEPTH_MAX}")));
        }
        // an element without name is told by the nearest one around it that has one
        let named = element.attribute("name").is_some();
        let around = if named {
            Some(element.label.clone())
        } else {
            around.map(str::to_owned)
        };
        for child in node.children().filter(Node::is_element) {
            let child = self.element(child, around.as_deref(), depth + 1)?;
            element.children.push(child);
        }
        Ok(element)
    }
}

/// Macros must be expanded before anything can be read.
pub fn refuse_xacro(file: &str) -> RobotError {
    let expanded = match file.strip_suffix(".xacro") {
        Some(name) if name.ends_with(".urdf") => name.to_owned(),
        Some(name) => format!("{name}.urdf"),
        None => format!("{file}.expanded.urdf"),
    };
    RobotError::Syntax {
        place: Box::new(Place::new(file, "")),
        what: format!("this is xacro, which must be expanded first: xacro {file} > {expanded}"),
    }
}

/// The first element's name, of text that may be XML: what the text is taken for.
pub fn root_name(text: &str) -> Option<&str> {
    let mut rest = text.trim_start_matches('\u{feff}').trim_start();
    loop {
        let end = if rest.starts_with("<?") {
            "?>"
        } else if rest.starts_with("<!--") {
            "-->"
        } else if rest.starts_with("<!") {
            ">"
        } else {
            break;
        };
        rest = rest[rest.find(end)? + end.len()..].trim_start();
    }
    let name = rest.strip_prefix('<')?;
    let end = name.find(|c: char| !c.is_alphanumeric() && c != '_')?;
    Some(&name[..end]).filter(|name| !name.is_empty())
}

/// One element of a document.
#[derive(Debug)]
pub struct Element {
    file: Rc<str>,
    line: usize,
    at: usize,
    /// "joint `elbow`", or of an element without name what it is in: "limit in joint `elbow`".
    label: String,
    tag: String,
    namespace: String,
    attributes: Vec<(String, String)>,
    text: String,
    children: Vec<Self>,
}

impl Element {
    pub fn file(&self) -> &str {
        &self.file
    }

    pub fn tag(&self) -> &str {
        &self.tag
    }

    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    pub fn line(&self) -> usize {
        self.line
    }

    /// Byte of its file at which it begins.
    pub fn at(&self) -> usize {
        self.at
    }

    pub fn place(&self) -> Place {
        Place {
            line: Some(self.line),
            ..Place::new(&self.file, self.label.clone())
        }
    }

    pub fn invalid(&self, what: impl Into<String>) -> RobotError {
        self.place().invalid(what)
    }

    /// A note on this element: place and words.
    pub fn note(&self, words: &str) -> String {
        format!("{}: {words}", self.place())
    }

    /// Takes the children out, to put others in.
    pub fn take_children(&mut self) -> Vec<Self> {
        std::mem::take(&mut self.children)
    }

    pub fn put_children(&mut self, children: Vec<Self>) {
        self.children = children;
    }

    pub fn children(&self) -> std::slice::Iter<'_, Self> {
        self.children.iter()
    }

    pub fn all<'a>(&'a self, tag: &str) -> impl DoubleEndedIterator<Item = &'a Self> {
        self.children.iter().filter(move |child| child.tag == tag)
    }

    /// The first child of this name, as readers of ROS take it.
    pub fn child(&self, tag: &str) -> Option<&Self> {
        self.children.iter().find(|child| child.tag == tag)
    }

    pub fn attribute(&self, key: &str) -> Option<&str> {
        let mut attributes = self.attributes.iter();
        attributes.find_map(|(name, value)| (name == key).then_some(value.as_str()))
    }

    pub fn text(&self) -> &str {
        &self.text
    }

    pub fn required(&self, key: &str) -> Result<&str, RobotError> {
        self.attribute(key)
            .ok_or_else(|| self.invalid(format!("{key} is missing, add it")))
    }

    /// The numbers of an attribute, however many; none where it is absent.
    pub fn list(&self, key: &str) -> Result<Option<Vec<f64>>, RobotError> {
        self.attribute(key)
            .map(|text| numbers(self, key, text))
            .transpose()
    }

    /// As many numbers as asked for.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, RobotError> {
        let Some(values) = self.list(key)? else {
            return Ok(None);
        };
        let count = values.len();
        let values = values
            .try_into()
            .map_err(|_| self.invalid(format!("{key} has {count} numbers where {N} are needed")))?;
        Ok(Some(values))
    }

    /// A number that is not infinite: files write that for "none".
    pub fn finite(&self, key: &str) -> Result<Option<f64>, RobotError> {
        let infinite = |text: &str| text.trim().parse().is_ok_and(f64::is_infinite);
        if self.attribute(key).is_some_and(infinite) {
            return Ok(None);
        }
        self.number(key)
    }

    pub fn number(&self, key: &str) -> Result<Option<f64>, RobotError> {
        Ok(self.numbers::<1>(key)?.map(|[value]| value))
    }
}

/// Numbers between blanks.
pub fn numbers(element: &Element, key: &str, text: &str) -> Result<Vec<f64>, RobotError> {
    let number = |word: &str| {
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| {
            element.invalid(format!(
                "{key} = {text:?} must be finite numbers between blanks"
            ))
        })
    };
    text.split_whitespace().map(number).collect()
}
