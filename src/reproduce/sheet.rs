//! A table that is the same on the terminal and on the page.

use comfy_table::{CellAlignment, TableComponent, presets};
use report::{Cell, Column, number};

/// Heading of a row or column with the paper's numbers.
pub const PAPER: &str = "paper";

/// A table as text.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    title: String,
    columns: Vec<String>,
    /// So many columns are words, to the left; numbers follow, to the right.
    pub words: usize,
    /// As many cells each as columns.
    pub rows: Vec<Vec<String>>,
    /// Below the table.
    pub notes: Vec<String>,
}

impl Sheet {
    /// Without rows; the first column is words.
    pub fn new<T: Into<String>>(
        title: impl Into<String>,
        columns: impl IntoIterator<Item = T>,
    ) -> Self {
        Self {
            title: title.into(),
            columns: columns.into_iter().map(Into::into).collect(),
            words: 1,
            rows: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// For the terminal.
    pub fn text(&self) -> String {
        let mut table = comfy_table::Table::new();
        table
            .load_preset(presets::UTF8_HORIZONTAL_ONLY)
            .remove_style(TableComponent::HorizontalLines)
            .remove_style(TableComponent::MiddleIntersections)
            .set_header(&self.columns)
            .add_rows(&self.rows);
        for column in table.column_iter_mut().skip(self.words) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let notes: String = self
            .notes
            .iter()
            .map(|note| format!("  {note}\n"))
            .collect();
        format!("{}\n{table}\n{notes}", self.title)
    }

    /// For the page.
    pub fn html(&self) -> report::Table {
        let words = self.columns.iter().take(self.words).map(Column::text);
        let numbers = self.columns.iter().skip(self.words).map(Column::number);
        let mut table = report::Table::new(&self.title, words.chain(numbers));
        for row in &self.rows {
            let is_paper = row.first().is_some_and(|name| name == PAPER);
            table.row(row.iter().zip(&self.columns).map(|(text, column)| {
                if is_paper || column == PAPER {
                    Cell::published(text)
                } else {
                    Cell::from(text.as_str())
                }
            }));
        }
        for note in &self.notes {
            table.note(note);
        }
        table
    }
}

/// The value; of several their mean and range, with so many digits; of none nothing.
pub fn mean_and_range(values: &[f64], digits: usize) -> String {
    if values.is_empty() {
        return String::new();
    }
    let mean = number(values.iter().sum::<f64>() / values.len() as f64, digits);
    if values.len() < 2 {
        return mean;
    }
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    format!(
        "{mean} ({} to {})",
        number(low, digits),
        number(high, digits)
    )
}
