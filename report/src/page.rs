//! The page, and how its parts become HTML.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::{Chain, Figure, Table};

const STYLE: &str = include_str!("style.css");

/// One report.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    title: String,
    verdict: String,
    sections: Vec<Section>,
}

impl Page {
    /// A page that says its result first, in one sentence.
    pub fn new(title: impl Into<String>, verdict: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            verdict: verdict.into(),
            sections: Vec::new(),
        }
    }

    /// Adds a section, which also appears in the table of contents.
    #[must_use]
    pub fn section(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The whole file.
    #[must_use]
    pub fn to_html(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    h1 { (self.title) }
                    p.verdict { (self.verdict) }
                    nav { ol {
                        @for section in &self.sections {
                            li { a href={ "#" (section.id) } { (section.title) } }
                        }
                    } }
                    @for section in &self.sections { (section.html()) }
                }
            }
        };
        page.into_string()
    }
}

/// A titled part of a page, its blocks in the order they were added.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    id: String,
    title: String,
    blocks: Vec<Block>,
}

#[derive(Clone, Debug, PartialEq)]
enum Block {
    Heading(String),
    Paragraph(String),
    List(Vec<String>),
    Definitions(Vec<(String, String)>),
    Table(Table),
    Figure(Figure),
    Chain(Chain),
}

impl Section {
    /// An empty section. The id is what links to it end with: `report.html#id`.
    pub fn new(id: impl Into<String>, title: impl Into<String>) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            blocks: Vec::new(),
        }
    }

    /// Adds a heading below the section's own.
    #[must_use]
    pub fn heading(self, text: impl Into<String>) -> Self {
        self.with(Block::Heading(text.into()))
    }

    /// Adds a paragraph.
    #[must_use]
    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.with(Block::Paragraph(text.into()))
    }

    /// Adds a list with a dot before each item.
    #[must_use]
    pub fn list<T: Into<String>>(self, items: impl IntoIterator<Item = T>) -> Self {
        self.with(Block::List(items.into_iter().map(Into::into).collect()))
    }

    /// Adds terms, each with what it means.
    #[must_use]
    pub fn definitions<T: Into<String>, M: Into<String>>(
        self,
        pairs: impl IntoIterator<Item = (T, M)>,
    ) -> Self {
        let pairs = pairs.into_iter().map(|(t, m)| (t.into(), m.into()));
        self.with(Block::Definitions(pairs.collect()))
    }

    /// Adds a table.
    #[must_use]
    pub fn table(self, table: Table) -> Self {
        self.with(Block::Table(table))
    }

    /// Adds a figure.
    #[must_use]
    pub fn figure(self, figure: Figure) -> Self {
        self.with(Block::Figure(figure))
    }

    /// Adds a drawing of a chain of joints.
    #[must_use]
    pub fn chain(self, chain: Chain) -> Self {
        self.with(Block::Chain(chain))
    }

    fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    fn html(&self) -> Markup {
        html! {
            section id=(self.id) {
                h2 { (self.title) }
                @for block in &self.blocks { (block.html()) }
            }
        }
    }
}

impl Block {
    fn html(&self) -> Markup {
        match self {
            Self::Heading(text) => html! { h3 { (text) } },
            Self::Paragraph(text) => html! { p { (text) } },
            Self::List(items) => html! { ul { @for item in items { li { (item) } } } },
            Self::Definitions(pairs) => html! {
                dl { @for (term, meaning) in pairs { dt { (term) } dd { (meaning) } } }
            },
            Self::Table(table) => table.html(),
            Self::Figure(figure) => figure.html(),
            Self::Chain(chain) => chain.html(),
        }
    }
}
