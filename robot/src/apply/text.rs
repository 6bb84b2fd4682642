//! Changes of an XML text that leave everything else as it was written.

use std::collections::BTreeMap;
use std::ops::Range;

use roxmltree::Node;

use crate::error::RobotError;
use crate::xml;

/// Changes, by the byte at which the element begins.
#[derive(Clone, Default)]
pub struct Changes {
    attributes: BTreeMap<usize, Vec<(String, String)>>,
    tags: BTreeMap<usize, String>,
    children: BTreeMap<usize, Vec<String>>,
    whole: BTreeMap<usize, String>,
}

impl Changes {
    /// Sets an attribute; the last value of one that is set again counts.
    pub fn set(&mut self, at: usize, key: &str, value: impl Into<String>) {
        let own = self.attributes.entry(at).or_default();
        own.retain(|(known, _)| known != key);
        own.push((key.to_owned(), value.into()));
    }

    /// Puts another element in its place, which has none within it that changes.
    pub fn replace(&mut self, at: usize, text: impl Into<String>) {
        self.whole.insert(at, text.into());
    }

    /// Calls the element something else.
    pub fn rename(&mut self, at: usize, tag: &str) {
        self.tags.insert(at, tag.to_owned());
    }

    /// Adds an element as the last child.
    pub fn add_child(&mut self, at: usize, text: impl Into<String>) {
        self.children.entry(at).or_default().push(text.into());
    }

    /// Adds an element as the last child, in the place of one that was added before and begins so.
    pub fn replace_child(&mut self, at: usize, begins: &str, text: impl Into<String>) {
        let own = self.children.entry(at).or_default();
        own.retain(|known| !known.starts_with(begins));
        own.push(text.into());
    }

    /// The text with all changes.
    pub fn apply(&self, text: &str, file: &str) -> Result<String, RobotError> {
        let document = xml::document(text, file)?;
        let mut edits: Vec<(Range<usize>, String)> = Vec::new();
        for node in document.descendants().filter(Node::is_element) {
            self.edits(text, node, &mut edits);
        }
        edits.sort_by_key(|(range, _)| (range.start, range.end));
        let mut changed = String::with_capacity(text.len());
        let mut done = 0;
        for (range, new) in edits {
            changed += &text[done..range.start];
            changed += &new;
            done = range.end;
        }
        Ok(changed + &text[done..])
    }

    fn edits(&self, text: &str, node: Node, edits: &mut Vec<(Range<usize>, String)>) {
        let at = node.range().start;
        if let Some(new) = self.whole.get(&at) {
            edits.push((node.range(), new.clone()));
            return;
        }
        // behind `<` and the name
        let name = at + 1..end_of_name(text, at + 1);
        if let Some(tag) = self.tags.get(&at) {
            edits.push((name.clone(), tag.clone()));
            if let Some(end) = end_tag(text, node) {
                edits.push((end + 2..end_of_name(text, end + 2), tag.clone()));
            }
        }
        let last = node.attributes().map(|own| own.range().end).max();
        let mut added = String::new();
        for (key, value) in self.attributes.get(&at).into_iter().flatten() {
            match node.attributes().find(|own| own.name() == key) {
                Some(own) => edits.push((own.range_value(), value.clone())),
                None => added += &format!(" {key}=\"{value}\""),
            }
        }
        if !added.is_empty() {
            let behind = last.unwrap_or(name.end);
            edits.push((behind..behind, added));
        }
        if let Some(children) = self.children.get(&at) {
            edits.push(self.children_of(text, node, children));
        }
    }

    fn children_of(&self, text: &str, node: Node, children: &[String]) -> (Range<usize>, String) {
        let indent = indent_of(text, node.range().start);
        let inside = format!("\n{indent}  ");
        let mut new = String::new();
        for child in children {
            new += &inside;
            new += &child.replace('\n', &inside);
        }
        match end_tag(text, node) {
            // behind what is there, before the blanks that the end stands on
            Some(end) => {
                let behind = text[..end].trim_end().len();
                let closing = if text[behind..end].contains('\n') {
                    String::new()
                } else {
                    format!("\n{indent}")
                };
                (behind..behind, new + &closing)
            }
            None => {
                let tag = &text[node.range().start + 1..end_of_name(text, node.range().start + 1)];
                let open = node.range().end - 2;
                let behind = text[..open].trim_end().len();
                (
                    behind..node.range().end,
                    format!(">{new}\n{indent}</{tag}>"),
                )
            }
        }
    }
}

/// Where the end tag begins; none of an element that is closed at once.
fn end_tag(text: &str, node: Node) -> Option<usize> {
    let range = node.range();
    let whole = &text[range.clone()];
    (!whole.ends_with("/>")).then(|| range.start + whole.rfind("</").unwrap_or_default())
}

fn end_of_name(text: &str, start: usize) -> usize {
    let rest = &text[start..];
    let length = rest.find(|c: char| c.is_whitespace() || c == '>' || c == '/');
    start + length.unwrap_or(rest.len())
}

/// The blanks before an element on its line.
fn indent_of(text: &str, at: usize) -> &str {
    let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let before = &text[line..at];
    &before[..before.len() - before.trim_start().len()]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn everything_else_stays_as_it_was() {
        let text =
            "<a>\n  <!-- b is a -->\n  <b x = '1'/>\n  <c   y=\"2\" ><d/></c>\n  <e/>\n</a>\n";
        let at = |what: &str| text.find(what).unwrap();
        let mut changes = Changes::default();
        changes.set(at("<b"), "x", "3");
        changes.set(at("<b"), "z", "4");
        changes.set(at("<b"), "z", "5");
        changes.rename(at("<c"), "cc");
        changes.add_child(at("<c"), "<n/>");
        changes.add_child(at("<e"), "<f>\n  <g/>\n</f>");
        changes.set(at("<e"), "k", "1");
        let new = changes.apply(text, "a.xml").unwrap();
        assert_eq!(
            new,
            "<a>\n  <!-- b is a -->\n  <b x = '3' z=\"5\"/>\n  <cc   y=\"2\" ><d/>\n    <n/>\n  </cc>\n  \
             <e k=\"1\">\n    <f>\n      <g/>\n    </f>\n  </e>\n</a>\n"
        );
    }

    #[test]
    fn without_changes_nothing_changes() {
        let text = "<?xml version='1.0'?>\n<a  b='1'>&amp;<c/></a>";
        assert_eq!(Changes::default().apply(text, "a.xml").unwrap(), text);
    }
}
