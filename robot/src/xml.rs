//! XML elements with what errors need: file, line and name.

use roxmltree::{Document, Node};

use crate::error::{Place, RobotError};

/// Reads the text; `file` is what errors call it.
pub fn parse<'a>(text: &'a str, file: &str) -> Result<Document<'a>, RobotError> {
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
#[derive(Clone, Copy)]
pub struct Element<'a> {
    pub file: &'a str,
    node: Node<'a, 'a>,
}

impl<'a> Element<'a> {
    pub fn root(document: &'a Document<'a>, file: &'a str) -> Self {
        Self {
            file,
            node: document.root_element(),
        }
    }

    pub fn tag(&self) -> &'a str {
        self.node.tag_name().name()
    }

    pub fn namespace(&self) -> &'a str {
        self.node.tag_name().namespace().unwrap_or("")
    }

    pub fn line(&self) -> usize {
        let position = self.node.document().text_pos_at(self.node.range().start);
        position.row as usize
    }

    /// "joint `elbow`", or of an element without name what it is in: "limit in joint `elbow`".
    fn label(&self) -> String {
        match (self.attribute("name"), self.parent()) {
            (Some(name), _) => format!("{} `{name}`", self.tag()),
            (None, Some(parent)) if parent.attribute("name").is_some() => {
                format!("{} in {}", self.tag(), parent.label())
            }
            _ => self.tag().to_owned(),
        }
    }

    pub fn parent(&self) -> Option<Self> {
        let node = self.node.parent_element()?;
        Some(Self {
            file: self.file,
            node,
        })
    }

    pub fn place(&self) -> Place {
        Place {
            line: Some(self.line()),
            ..Place::new(self.file, self.label())
        }
    }

    pub fn invalid(&self, what: impl Into<String>) -> RobotError {
        self.place().invalid(what)
    }

    /// A note on this element: place and words.
    pub fn note(&self, words: &str) -> String {
        format!("{}: {words}", self.place())
    }

    pub fn children(&self) -> impl DoubleEndedIterator<Item = Self> + use<'a> {
        let file = self.file;
        self.node
            .children()
            .filter(Node::is_element)
            .map(move |node| Self { file, node })
    }

    pub fn all(&self, tag: &'a str) -> impl DoubleEndedIterator<Item = Self> + use<'a> {
        self.children().filter(move |child| child.tag() == tag)
    }

    /// The first child of this name, as readers of ROS take it.
    pub fn child(&self, tag: &'a str) -> Option<Self> {
        self.all(tag).next()
    }

    pub fn attribute(&self, key: &str) -> Option<&'a str> {
        self.node.attribute(key)
    }

    pub fn text(&self) -> &'a str {
        self.node.text().unwrap_or("").trim()
    }

    pub fn required(&self, key: &str) -> Result<&'a str, RobotError> {
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
