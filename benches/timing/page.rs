//! The page with the plots.

use std::fs;
use std::path::Path;

use report::{Axis, Figure, Page, Panel, Section, Series};

use crate::histograms::Times;

/// Writes one page of figures.
pub fn write(path: &Path, title: &str, figures: Vec<Figure>) {
    let mut section = Section::new("plots", "Plots");
    for figure in figures {
        section = section.figure(figure);
    }
    let page = Page::new(
        title,
        "Measured in turn on one machine; see the command's table.",
    );
    fs::write(path, page.section(section).to_html()).expect("the folder is ours");
    println!("plots: {}", path.display());
}

/// Times over the share of times that are longer.
pub fn percentiles<'a>(
    title: &str,
    cases: impl IntoIterator<Item = (&'a str, &'a Times)>,
) -> Panel {
    let mut panel = Panel::new(
        Axis::new("share that is later", "").log(),
        Axis::new("time", "µs").log(),
    )
    .title(title);
    for (name, times) in cases {
        let point = |quantile: f64| {
            let time_us = times.value_at_quantile(quantile) as f64 * 1e-3;
            [1.0 - quantile, time_us.max(0.1)]
        };
        let least_share = 1.0 / times.len().max(2) as f64;
        let shares = (0..=60).map(|step| least_share.powf(f64::from(step) / 60.0));
        panel = panel.series(Series::line(name, shares.map(|share| point(1.0 - share))));
    }
    panel
}

/// Quantiles over what was varied.
pub fn curve(title: &str, varied: &str, points: &[(f64, [f64; 3])]) -> Panel {
    let mut panel = Panel::new(Axis::new(varied, ""), Axis::new("time", "µs").log()).title(title);
    for (index, name) in ["p50", "p99", "p99.9"].into_iter().enumerate() {
        let line = points.iter().map(|(x, times)| [*x, times[index].max(0.1)]);
        panel = panel.series(Series::line(name, line));
    }
    panel
}

/// A figure of these panels.
pub fn figure(caption: &str, panels: Vec<Panel>) -> Figure {
    let columns = panels.len().min(2);
    let figure = Figure::new(caption).columns(columns);
    panels.into_iter().fold(figure, Figure::panel)
}
