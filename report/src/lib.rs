//! Self-contained HTML pages: one file that opens from disk, needs no network and runs no script.
//!
//! A [`Page`] has a title, its verdict in one sentence, and [`Section`]s of paragraphs, [`Table`]s, definitions,
//! [`Figure`]s and drawings of a [`Chain`]. Everything is plain data; [`Page::to_html`] is a pure function of it: the same page gives the same bytes.
//! Text is escaped, and values that are not finite leave a gap in a figure.
//!
//! ```
//! use report::{Axis, Column, Figure, Page, Panel, Section, Series, Table, number};
//!
//! let mut table = Table::new("Friction", [Column::text("joint"), Column::number("F0, Nm")]);
//! table.row(["joint1".into(), number(34.96, 3).into()]);
//! let panel = Panel::new(Axis::new("velocity", "rad/s"), Axis::new("friction", "Nm"))
//!     .series(Series::line("fit", [[0.0, 30.0], [0.4, 45.0]]))
//!     .series(Series::points("measured", [[0.2, 38.0]]).with_errors([1.5]));
//! let section = Section::new("friction", "Friction")
//!     .paragraph("Each point is the mean of five trials.")
//!     .table(table)
//!     .figure(Figure::new("Friction over velocity").panel(panel));
//! let page = Page::new("Identification", "Friction of joint 1 is known within 0.2 Nm.").section(section);
//! assert!(page.to_html().starts_with("<!DOCTYPE html>"));
//! ```
#![forbid(unsafe_code)]

mod chain;
mod colours;
mod decimate;
mod draw;
mod figure;
mod marks;
mod number;
mod page;
mod scale;
mod table;

pub use chain::{Chain, Node};
pub use figure::{Axis, Figure, HeatMap, Panel, Series};
pub use number::{decimal, number, printed, with_error};
pub use page::{Page, Section};
pub use table::{Cell, Column, Table};
