//! What stands inside a panel's frame.

use plotters::element::{Circle, DashedPathElement, PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use crate::colours;
use crate::decimate;
use crate::draw::{Area, Drawn, FINE, letters};
use crate::figure::{HeatMap, Panel, Series, Shape};
use crate::scale::Scale;

const LINE_PX: u32 = 2;
const ERROR_BAR_PX: u32 = 1;
/// Half the length of the stroke that ends an error bar.
const CAP_PX: f64 = 3.0;
const DOT_RADIUS_PX: f64 = 2.8;
const LONE_DOT_RADIUS_PX: f64 = 3.5;
/// More points than this are a cloud, of smaller dots.
const FEW_POINTS: usize = 60;
const CLOUD_RADIUS_PX: f64 = 1.5;
/// Points of a cloud within one square of this size are drawn once.
const CLOUD_CELL_PX: f64 = 2.0;
const DASH_PX: u32 = 7;
const GAP_PX: u32 = 4;
/// Share of a category that its bars take.
const BARS_WIDTH: f64 = 0.8;
const MARK_LETTERS: u32 = 14;
const MARK_LETTER_PX: f64 = 7.0;

/// The plot's area and its scales.
pub struct Frame<'a> {
    area: Area<'a>,
    x: Scale,
    y: Scale,
    width: f64,
    height: f64,
}

impl<'a> Frame<'a> {
    pub fn new(area: Area<'a>, x: Scale, y: Scale) -> Self {
        let (width, height) = area.dim_in_pixel();
        Self {
            area,
            x,
            y,
            width: f64::from(width),
            height: f64::from(height),
        }
    }

    /// Place of a point, clamped to the frame.
    fn place(&self, [x, y]: [f64; 2]) -> (i32, i32) {
        let across = self.x.share(x).clamp(0.0, 1.0) * self.width;
        let down = (1.0 - self.y.share(y).clamp(0.0, 1.0)) * self.height;
        (across.round() as i32, down.round() as i32)
    }

    fn shows(&self, [x, y]: [f64; 2]) -> bool {
        self.x.shows(x) && self.y.shows(y)
    }

    /// Pixels of the page from the left and the bottom.
    fn pixels(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let fine = f64::from(FINE);
        [
            self.x.share(x) * self.width / fine,
            self.y.share(y) * self.height / fine,
        ]
    }

    fn stroke(&self, points: Vec<(i32, i32)>, colour: RGBColor, width_px: u32) -> Drawn {
        let style = colour.stroke_width(width_px * FINE);
        Ok(self.area.draw(&PathElement::new(points, style))?)
    }
}

/// Values along x and y that the scales have to show.
pub fn extents(panel: &Panel) -> (Vec<f64>, Vec<f64>) {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    if let Some(map) = &panel.heat_map {
        x.extend(&map.x_edges);
        y.extend(&map.y_edges);
    }
    for series in &panel.series {
        let is_bars = series.shape == Shape::Bars;
        for (index, [along, value]) in series.points.iter().enumerate() {
            let [below, above] = series.errors.get(index).copied().unwrap_or_default();
            let values = [value - below, *value, value + above];
            let zero = is_bars.then_some(0.0);
            if is_bars && lies_flat(panel) {
                x.extend(values.into_iter().chain(zero));
            } else {
                x.push(*along);
                y.extend(values.into_iter().chain(zero));
            }
        }
    }
    (x, y)
}

fn lies_flat(panel: &Panel) -> bool {
    !panel.y.categories.is_empty()
}

/// Draws everything, colours by the place of a series' name among `names`.
pub fn draw(frame: &Frame, panel: &Panel, names: &[&str]) -> Drawn {
    if let Some(map) = &panel.heat_map {
        heat_map(frame, map)?;
    }
    reference_lines(frame, panel)?;
    let bars = panel.series.iter().filter(|s| s.shape == Shape::Bars);
    let groups = bars.count();
    let mut group = 0;
    let mut ordered: Vec<&Series> = panel.series.iter().collect();
    ordered.sort_by_key(|series| layer(series));
    for series in ordered {
        let index = names.iter().position(|name| *name == series.name);
        let colour = colours::series(index.unwrap_or_default());
        match series.shape {
            Shape::Line | Shape::Dashed => line(frame, series, colour)?,
            Shape::Points => points(frame, series, colour)?,
            Shape::Bars => {
                let place = Group {
                    group,
                    groups,
                    flat: lies_flat(panel),
                };
                bars_of(frame, series, colour, place)?;
                group += 1;
            }
        }
    }
    Ok(())
}

/// Lines lie above bars and clouds, single points above lines.
fn layer(series: &Series) -> u8 {
    match series.shape {
        Shape::Bars => 0,
        Shape::Points if series.points.len() > FEW_POINTS => 0,
        Shape::Line | Shape::Dashed => 1,
        Shape::Points => 2,
    }
}

fn line(frame: &Frame, series: &Series, colour: RGBColor) -> Drawn {
    let visible = |a: &[f64; 2], b: &[f64; 2]| frame.shows(*a) == frame.shows(*b);
    for run in series.points.chunk_by(visible) {
        if !run.first().is_some_and(|point| frame.shows(*point)) {
            continue;
        }
        let kept = decimate::line(run, |x| {
            (frame.x.share(x) * frame.width / f64::from(FINE)).floor() as i64
        });
        let path: Vec<(i32, i32)> = kept.into_iter().map(|point| frame.place(point)).collect();
        if series.shape == Shape::Dashed {
            let style = colour.stroke_width(LINE_PX * FINE);
            let (dash, gap) = (DASH_PX * FINE, GAP_PX * FINE);
            frame
                .area
                .draw(&DashedPathElement::new(path, dash, gap, style))?;
        } else {
            frame.stroke(path, colour, LINE_PX)?;
        }
    }
    Ok(())
}

fn points(frame: &Frame, series: &Series, colour: RGBColor) -> Drawn {
    for (point, errors) in series.points.iter().zip(&series.errors) {
        if frame.shows(*point) {
            error_bar(frame, *point, *errors, colour, false)?;
        }
    }
    let cell = |point: &[f64; 2]| {
        let [across, up] = frame.pixels(*point).map(|px| (px / CLOUD_CELL_PX).floor());
        (across as i64, up as i64)
    };
    let shown: Vec<[f64; 2]> = series
        .points
        .iter()
        .copied()
        .filter(|p| frame.shows(*p))
        .collect();
    let (kept, radius_px) = match shown.len() {
        0..=1 => (shown, LONE_DOT_RADIUS_PX),
        2..=FEW_POINTS => (shown, DOT_RADIUS_PX),
        _ => (decimate::scatter(&shown, cell), CLOUD_RADIUS_PX),
    };
    let radius = radius_px * f64::from(FINE);
    for point in kept {
        let circle = Circle::new(frame.place(point), radius, colour.filled());
        frame.area.draw(&circle)?;
    }
    Ok(())
}

/// Which of the bars side by side in a category, and how they lie.
#[derive(Clone, Copy)]
struct Group {
    group: usize,
    groups: usize,
    flat: bool,
}

fn bars_of(frame: &Frame, series: &Series, colour: RGBColor, group: Group) -> Drawn {
    let width = BARS_WIDTH / group.groups as f64;
    let offset = (group.group as f64 - 0.5 * (group.groups as f64 - 1.0)) * width;
    let turned = |[along, value]: [f64; 2]| {
        if group.flat {
            [value, along]
        } else {
            [along, value]
        }
    };
    for (index, [place, value]) in series.points.iter().enumerate() {
        if !value.is_finite() {
            continue;
        }
        let along = place + offset;
        // A hair of space between neighbours.
        let half = 0.46 * width;
        let corners = [
            frame.place(turned([along - half, 0.0])),
            frame.place(turned([along + half, *value])),
        ];
        frame.area.draw(&Rectangle::new(corners, colour.filled()))?;
        if let Some(errors) = series.errors.get(index) {
            error_bar(
                frame,
                turned([along, *value]),
                *errors,
                colours::FRAME,
                group.flat,
            )?;
        }
    }
    Ok(())
}

fn error_bar(
    frame: &Frame,
    [x, y]: [f64; 2],
    [below, above]: [f64; 2],
    colour: RGBColor,
    flat: bool,
) -> Drawn {
    let (low, high) = if flat {
        (frame.place([x - below, y]), frame.place([x + above, y]))
    } else {
        (frame.place([x, y - below]), frame.place([x, y + above]))
    };
    let cap = (CAP_PX * f64::from(FINE)) as i32;
    frame.stroke(vec![low, high], colour, ERROR_BAR_PX)?;
    for (across, down) in [low, high] {
        let stroke = if flat {
            vec![(across, down - cap), (across, down + cap)]
        } else {
            vec![(across - cap, down), (across + cap, down)]
        };
        frame.stroke(stroke, colour, ERROR_BAR_PX)?;
    }
    Ok(())
}

fn heat_map(frame: &Frame, map: &HeatMap) -> Drawn {
    let [low, high] = map.range();
    let width = if high > low { high - low } else { 1.0 };
    let labels = |row: usize, column: usize| map.labels.get(row)?.get(column);
    for (row, (values, y_edges)) in map.values.iter().zip(map.y_edges.windows(2)).enumerate() {
        for (column, (value, x_edges)) in values.iter().zip(map.x_edges.windows(2)).enumerate() {
            if value.is_finite() {
                let corners = [
                    frame.place([x_edges[0], y_edges[0]]),
                    frame.place([x_edges[1], y_edges[1]]),
                ];
                let share = (value - low) / width;
                let colour = colours::heat(share);
                frame.area.draw(&Rectangle::new(corners, colour.filled()))?;
                if let Some(label) = labels(row, column) {
                    let [(left, bottom), (right, top)] = corners;
                    let centre = ((left + right) / 2, (bottom + top) / 2);
                    let colour = colours::on_heat(share);
                    let style = letters(MARK_LETTERS)
                        .color(&colour)
                        .pos(Pos::new(HPos::Center, VPos::Center));
                    frame.area.draw(&Text::new(label.clone(), centre, style))?;
                }
            }
        }
    }
    Ok(())
}

/// Labels that would run into the one before are left out.
fn reference_lines(frame: &Frame, panel: &Panel) -> Drawn {
    let (right, bottom) = (frame.width as i32, frame.height as i32);
    let fine = FINE as i32;
    let style = letters(MARK_LETTERS).color(&colours::REFERENCE_LETTERS);
    let mut free_from = 0.0;
    for (x, label) in panel.verticals.iter().filter(|(x, _)| frame.x.shows(*x)) {
        let across = (frame.x.share(*x) * frame.width).round() as i32;
        frame.stroke(vec![(across, 0), (across, bottom)], colours::REFERENCE, 1)?;
        let across_px = f64::from(across / fine);
        if across_px >= free_from && !label.is_empty() {
            let at = (across + 3 * fine, 2 * fine);
            frame
                .area
                .draw(&Text::new(label.clone(), at, style.clone()))?;
            free_from = across_px + MARK_LETTER_PX * (label.chars().count() + 1) as f64;
        }
    }
    for (y, label) in panel.horizontals.iter().filter(|(y, _)| frame.y.shows(*y)) {
        let down = ((1.0 - frame.y.share(*y)) * frame.height).round() as i32;
        frame.stroke(vec![(0, down), (right, down)], colours::REFERENCE, 1)?;
        let at = (4 * fine, down - 16 * fine);
        frame
            .area
            .draw(&Text::new(label.clone(), at, style.clone()))?;
    }
    Ok(())
}
