//! Figures as SVG.

use std::error::Error;

use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, IntoDrawingArea, SVGBackend, TRANSPARENT};
use plotters::style::{Color, IntoFont, TextStyle};

use crate::colours;
use crate::figure::{Figure, Panel};
use crate::marks::{self, Frame};
use crate::scale::Scale;

/// Units of the drawing in a pixel of the page: plotters places everything on whole units.
pub const FINE: u32 = 4;
/// Width of a figure in pixels.
const WIDTH: u32 = 960;
/// Sizes of letters in plotters' measure, which is 1.24 times the font size it writes.
const LETTERS: u32 = 16;
const TITLE_LETTERS: u32 = 17;
/// Pixels that a letter of a tick takes, a number well above what it takes on average.
const LETTER_WIDTH: u32 = 8;
/// Pixels for what stands around the plot.
const MARGIN: u32 = 8;
const TITLE_HEIGHT: u32 = 24;
const X_LABELS: u32 = 42;
/// Pixels between two ticks.
const TICK_DISTANCE: [u32; 2] = [80, 42];
/// Room for so many ticks there is along x in the narrowest panel: fewer may leave a single one, which tells no scale.
const TICKS_LEAST: u32 = 4;

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Drawn = Result<(), Box<dyn Error>>;

/// Width of a panel in pixels, where so many stand side by side.
pub fn panel_width(columns: usize) -> u32 {
    WIDTH / columns.max(1) as u32
}

/// The drawing of one panel, for use inside HTML. One that cannot be drawn says why.
pub fn svg(figure: &Figure, panel: &Panel) -> String {
    let size = (
        panel_width(figure.columns) * FINE,
        figure.panel_height * FINE,
    );
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
    let drawn = draw_panel(panel, &figure.names(), &area).and_then(|()| Ok(area.present()?));
    drop(area);
    if let Err(error) = drawn {
        return format!("<p>This panel could not be drawn ({error:?}).</p>");
    }
    // Inside HTML neither the name space nor a size in pixels is wanted.
    let body = text.find('>').map_or("", |end| &text[end + 1..]);
    format!(
        "<svg viewBox=\"0 0 {} {}\" role=\"img\">{body}",
        size.0, size.1
    )
}

fn draw_panel(panel: &Panel, names: &[&str], cell: &Area) -> Drawn {
    let (width, height) = cell.dim_in_pixel();
    let (width, height) = (width / FINE, height / FINE);
    let title_height = if panel.title.is_empty() {
        0
    } else {
        TITLE_HEIGHT
    };
    let ticks = [
        (width / TICK_DISTANCE[0]).max(TICKS_LEAST) as usize,
        (height / TICK_DISTANCE[1]) as usize,
    ];
    let (x_values, y_values) = marks::extents(panel);
    let mut x = Scale::new(&panel.x, x_values.into_iter(), ticks[0]);
    let mut y = Scale::new(&panel.y, y_values.into_iter(), ticks[1]);
    if !panel.y.categories.is_empty() {
        y = y.reversed();
    }
    let y_labels = y.label_length() as u32 * LETTER_WIDTH + 28;
    if panel.equal_aspect {
        let plot_px = (
            width.saturating_sub(y_labels + 2 * MARGIN),
            height.saturating_sub(X_LABELS + title_height + 2 * MARGIN),
        );
        Scale::equalise(&mut x, &mut y, plot_px, ticks);
    }

    let mut builder = ChartBuilder::on(cell);
    builder
        .margin(MARGIN * FINE)
        .margin_right(2 * MARGIN * FINE)
        .x_label_area_size(X_LABELS * FINE)
        .y_label_area_size(y_labels * FINE);
    if !panel.title.is_empty() {
        builder.caption(&panel.title, letters(TITLE_LETTERS));
    }
    let mut chart = builder.build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .x_desc(panel.x.label())
        .y_desc(panel.y.label())
        .x_label_formatter(&|value| x.label(*value))
        .y_label_formatter(&|value| y.label(*value))
        .label_style(letters(LETTERS))
        .axis_desc_style(letters(LETTERS))
        .axis_style(colours::FRAME.stroke_width(FINE))
        .bold_line_style(colours::GRID.stroke_width(FINE))
        .light_line_style(TRANSPARENT)
        .set_all_tick_mark_size(4 * FINE)
        .draw()?;
    let frame = Frame::new(
        chart.plotting_area().strip_coord_spec(),
        x.clone(),
        y.clone(),
    );
    marks::draw(&frame, panel, names)
}

/// Text of this size in the colour of the frame.
pub fn letters(size: u32) -> TextStyle<'static> {
    let font = ("sans-serif", size * FINE).into_font();
    TextStyle::from(font).color(&colours::FRAME)
}
