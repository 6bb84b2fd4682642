//! Figures as data: panels with axes and series. How they are drawn is in `draw`.

use maud::{Markup, PreEscaped, html};

use crate::{colours, draw, number};

/// Part of its width to which a panel may shrink before it goes below the one before: with more, a wide page would not hold as many as
/// it should; with less, it would hold more.
const NARROWEST: f64 = 0.9;

/// One or several panels under a common legend and above a caption.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    pub(crate) caption: String,
    pub(crate) panels: Vec<Panel>,
    pub(crate) columns: usize,
    pub(crate) panel_height: u32,
}

impl Figure {
    /// A figure without panels. The caption defines every number shown.
    pub fn new(caption: impl Into<String>) -> Self {
        Self {
            caption: caption.into(),
            panels: Vec::new(),
            columns: 1,
            panel_height: 320,
        }
    }

    /// Adds a panel. Series of one name have one colour and one legend entry in all panels.
    #[must_use]
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Sets panels side by side, so many in a row where the page is wide enough; 1 if not said.
    #[must_use]
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns.max(1);
        self
    }

    /// Height of each panel on a page whose figures are 960 wide; 320 if not said.
    #[must_use]
    pub fn panel_height(mut self, height: u32) -> Self {
        self.panel_height = height.max(120);
        self
    }

    /// Names of the series that the legend explains, in the order of their colours.
    pub(crate) fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        names
    }

    /// Quantity, range and unit of the heat maps' colours, each once.
    fn heat_scales(&self) -> Vec<(&str, [f64; 2], &str)> {
        let mut scales = Vec::new();
        for map in self
            .panels
            .iter()
            .filter_map(|panel| panel.heat_map.as_ref())
        {
            let scale = (map.quantity.as_str(), map.range(), map.unit.as_str());
            if !scales.contains(&scale) {
                scales.push(scale);
            }
        }
        scales
    }

    pub(crate) fn html(&self) -> Markup {
        html! {
            figure {
                ul.legend {
                    @for (index, name) in self.names().iter().enumerate().filter(|(_, name)| !name.is_empty()) {
                        li { (swatch(self.first_of(name), index)) (name) }
                    }
                    @for (quantity, [low, high], unit) in self.heat_scales() {
                        li {
                            (quantity) ": " (number(low, 3))
                            span.scale style={ "background:" (colours::heat_gradient()) } {}
                            (number(high, 3)) " " (unit)
                        }
                    }
                }
                @let narrowest_px = NARROWEST * f64::from(draw::panel_width(self.columns));
                div class=(if self.columns == 1 { "panels wide" } else { "panels" })
                    style={ "--narrowest:" (narrowest_px) "px" } {
                    @for panel in &self.panels { (PreEscaped(draw::svg(self, panel))) }
                }
                figcaption { (self.caption) }
            }
        }
    }

    fn first_of(&self, name: &str) -> Option<&Series> {
        let mut all = self.panels.iter().flat_map(|panel| &panel.series);
        all.find(|series| series.name == name)
    }
}

/// The mark of a series in the legend.
fn swatch(series: Option<&Series>, index: usize) -> Markup {
    let colour = colours::css(colours::series(index));
    let shape = series.map_or(Shape::Line, |series| series.shape);
    html! {
        svg viewBox="0 0 28 12" {
            @match shape {
                Shape::Line => line x1="0" y1="6" x2="28" y2="6" stroke=(colour) stroke-width="2.5" {},
                Shape::Dashed => line x1="0" y1="6" x2="28" y2="6" stroke=(colour) stroke-width="2.5" stroke-dasharray="7 3.5" {},
                Shape::Points => circle cx="14" cy="6" r="4" fill=(colour) {},
                Shape::Bars => rect x="4" y="1" width="20" height="10" fill=(colour) {},
            }
        }
    }
}

/// Coordinates with what is drawn in them.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
    pub(crate) heat_map: Option<HeatMap>,
    pub(crate) verticals: Vec<(f64, String)>,
    pub(crate) horizontals: Vec<(f64, String)>,
    pub(crate) equal_aspect: bool,
}

impl Panel {
    /// An empty panel.
    #[must_use]
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            title: String::new(),
            x,
            y,
            series: Vec::new(),
            heat_map: None,
            verticals: Vec::new(),
            horizontals: Vec::new(),
            equal_aspect: false,
        }
    }

    /// Sets a title above the panel.
    #[must_use]
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Adds a series. Lines lie above bars and clouds of points, single points above lines, else later ones above
    /// earlier ones.
    #[must_use]
    pub fn series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Sets a heat map below the series.
    #[must_use]
    pub fn heat_map(mut self, map: HeatMap) -> Self {
        self.heat_map = Some(map);
        self
    }

    /// Marks a value of x with a line and a few letters.
    #[must_use]
    pub fn vertical(mut self, x: f64, label: impl Into<String>) -> Self {
        self.verticals.push((x, label.into()));
        self
    }

    /// Marks a value of y with a line and a few letters.
    #[must_use]
    pub fn horizontal(mut self, y: f64, label: impl Into<String>) -> Self {
        self.horizontals.push((y, label.into()));
        self
    }

    /// One unit is as long along x as along y: for paths and sketches.
    #[must_use]
    pub fn equal_aspect(mut self) -> Self {
        self.equal_aspect = true;
        self
    }
}

/// What an axis shows and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    pub(crate) quantity: String,
    pub(crate) unit: String,
    pub(crate) range: Option<[f64; 2]>,
    pub(crate) categories: Vec<String>,
    pub(crate) is_log: bool,
}

impl Axis {
    /// A linear axis as long as the data. The unit is empty for a pure number.
    pub fn new(quantity: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            quantity: quantity.into(),
            unit: unit.into(),
            range: None,
            categories: Vec::new(),
            is_log: false,
        }
    }

    /// An axis of named places: the first is at zero, the next at one, and so on; left to right, and top to bottom.
    pub fn categories<T: Into<String>>(
        quantity: impl Into<String>,
        names: impl IntoIterator<Item = T>,
    ) -> Self {
        let mut axis = Self::new(quantity, "");
        axis.categories = names.into_iter().map(Into::into).collect();
        axis
    }

    /// Shows this range and nothing beyond.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some([low, high]);
        self
    }

    /// Shows powers of ten at equal distances; values that are not positive are left out.
    #[must_use]
    pub fn log(mut self) -> Self {
        self.is_log = true;
        self
    }

    pub(crate) fn label(&self) -> String {
        if self.unit.is_empty() {
            return self.quantity.clone();
        }
        format!("{}, {}", self.quantity, self.unit)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Line,
    Dashed,
    Points,
    Bars,
}

/// Values drawn with one mark and one colour. Long ones are thinned to what can be seen; extremes stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub(crate) name: String,
    pub(crate) shape: Shape,
    pub(crate) points: Vec<[f64; 2]>,
    /// For each point, by how much the error bar goes below and above it.
    pub(crate) errors: Vec<[f64; 2]>,
}

impl Series {
    /// Points joined in their order. Without a name it is not in the legend.
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::new(name, Shape::Line, points)
    }

    /// The same with a broken line, for smooth curves.
    pub fn dashed(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::new(name, Shape::Dashed, points)
    }

    /// A dot for each point.
    pub fn points(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self::new(name, Shape::Points, points)
    }

    /// A bar from zero for each category, in their order. They lie flat where the categories are those of y.
    pub fn bars(name: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let points = values.into_iter().enumerate();
        Self::new(
            name,
            Shape::Bars,
            points.map(|(place, value)| [place as f64, value]),
        )
    }

    /// Error bars on points or bars, as much below as above.
    #[must_use]
    pub fn with_errors(self, errors: impl IntoIterator<Item = f64>) -> Self {
        self.with_intervals(errors.into_iter().map(|error| [error, error]))
    }

    /// Error bars on points or bars: how far below and above each reaches.
    #[must_use]
    pub fn with_intervals(mut self, intervals: impl IntoIterator<Item = [f64; 2]>) -> Self {
        self.errors = intervals.into_iter().collect();
        self
    }

    fn new(
        name: impl Into<String>,
        shape: Shape,
        points: impl IntoIterator<Item = [f64; 2]>,
    ) -> Self {
        Self {
            name: name.into(),
            shape,
            points: points.into_iter().collect(),
            errors: Vec::new(),
        }
    }
}

/// Coloured cells. Over categories the edges are `-0.5, 0.5, 1.5, …`.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    pub(crate) quantity: String,
    pub(crate) unit: String,
    pub(crate) x_edges: Vec<f64>,
    pub(crate) y_edges: Vec<f64>,
    pub(crate) values: Vec<Vec<f64>>,
    pub(crate) labels: Vec<Vec<String>>,
    scale: Option<[f64; 2]>,
}

impl HeatMap {
    /// Cells between rising edges: `values[row][column]`, the first row at the first edges of y. A cell that is not finite, or
    /// not given, stays white.
    pub fn new(
        quantity: impl Into<String>,
        unit: impl Into<String>,
        x_edges: impl IntoIterator<Item = f64>,
        y_edges: impl IntoIterator<Item = f64>,
        values: Vec<Vec<f64>>,
    ) -> Self {
        Self {
            quantity: quantity.into(),
            unit: unit.into(),
            x_edges: x_edges.into_iter().collect(),
            y_edges: y_edges.into_iter().collect(),
            values,
            labels: Vec::new(),
            scale: None,
        }
    }

    /// Writes into each cell, `labels[row][column]`.
    #[must_use]
    pub fn with_labels(mut self, labels: Vec<Vec<String>>) -> Self {
        self.labels = labels;
        self
    }

    /// Colours from this value to that one instead of from its own smallest to its own largest, so that maps beside each other can be
    /// compared; maps of one quantity on one scale have one legend.
    #[must_use]
    pub fn on_scale(mut self, from: f64, to: f64) -> Self {
        self.scale = Some([from, to]);
        self
    }

    /// Values of the first and the last colour.
    pub(crate) fn range(&self) -> [f64; 2] {
        if let Some(scale) = self.scale {
            return scale;
        }
        let all = self.values.iter().flatten().filter(|v| v.is_finite());
        let [low, high] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(*v), high.max(*v)]
        });
        if low <= high { [low, high] } else { [0.0, 0.0] }
    }
}
