//! Tables: numbers to the right, published values told from one's own by their type. On a narrow screen each row is a block of its
//! own, every cell beside its column's title.

use maud::{Markup, html};

/// A column's title and the side its cells keep to.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    title: String,
    is_number: bool,
}

impl Column {
    /// Words, to the left.
    pub fn text(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            is_number: false,
        }
    }

    /// Numbers, to the right. The title ends with the unit.
    pub fn number(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            is_number: true,
        }
    }

    fn class(&self) -> Option<&'static str> {
        self.is_number.then_some("number")
    }
}

/// One cell's text and how it is set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    text: String,
    class: Option<&'static str>,
}

impl Cell {
    /// A value that somebody else printed, set apart from one's own.
    pub fn published(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            class: Some("published"),
        }
    }

    /// The one that counts.
    pub fn strong(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            class: Some("strong"),
        }
    }
}

impl Cell {
    fn html(&self, column: &Column) -> Markup {
        html! {
            td class=[column.class()] data-title=(column.title) {
                @match self.class {
                    Some(class) => span class=(class) { (self.text) },
                    None => (self.text),
                }
            }
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self { text, class: None }
    }
}

/// Rows under titled columns, with a caption above and notes below. A column without a single text is not shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
    notes: Vec<String>,
}

impl Table {
    /// A table without rows.
    pub fn new(caption: impl Into<String>, columns: impl IntoIterator<Item = Column>) -> Self {
        Self {
            caption: caption.into(),
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Adds a row; cells beyond the last column are dropped, missing ones stay empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        let mut row: Vec<Cell> = cells.into_iter().collect();
        row.resize(self.columns.len(), Cell::default());
        self.rows.push(row);
    }

    /// Adds a line below the table.
    pub fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    /// Columns that are shown, with their places.
    fn shown(&self) -> Vec<(usize, &Column)> {
        let is_empty = |place: usize| self.rows.iter().all(|row| row[place].text.is_empty());
        let all = self.columns.iter().enumerate();
        all.filter(|(place, _)| self.rows.is_empty() || !is_empty(*place))
            .collect()
    }

    pub(crate) fn html(&self) -> Markup {
        let columns = self.shown();
        html! {
            div.table {
                p.caption { (self.caption) }
                table {
                    thead { tr {
                        @for (_, column) in &columns { th class=[column.class()] { (column.title) } }
                    } }
                    tbody {
                        @for row in &self.rows {
                            tr { @for (place, column) in &columns { (row[*place].html(column)) } }
                        }
                    }
                }
                @for note in &self.notes { p.note { (note) } }
            }
        }
    }
}
