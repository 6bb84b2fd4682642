//! What every page keeps: escaped, self-contained, the same bytes each time, of bounded size.

use report::{Axis, Cell, Column, Figure, HeatMap, Page, Panel, Section, Series, Table};

const HOSTILE: &str = "<script>alert(\"x\")</script> & 'y'";

/// One of everything, every text hostile.
fn page(text: &str) -> String {
    let mut table = Table::new(text, [Column::text(text), Column::number(text)]);
    table.row([text.into(), Cell::published(text)]);
    table.row([Cell::strong(text)]);
    table.note(text);
    let curves = Panel::new(Axis::new(text, text), Axis::new("y", "Nm").log())
        .title(text)
        .series(Series::line(
            text,
            (1..500).map(|i| [f64::from(i), f64::from(i)]),
        ))
        .series(Series::dashed("dashed", [[1.0, 2.0], [9.0, 3.0]]))
        .series(Series::points("points", [[1.0, 2.0], [2.0, 5.0]]).with_errors([0.5, 0.4]))
        .vertical(3.0, text)
        .horizontal(2.0, text);
    let bars = Panel::new(
        Axis::new("probability", ""),
        Axis::categories("effect", [text, "b"]),
    )
    .series(Series::bars("bars", [0.2, 0.7]).with_intervals([[0.1, 0.2], [0.3, 0.1]]));
    let map = HeatMap::new(
        text,
        text,
        [0.0, 1.0, 2.0],
        [0.0, 1.0],
        vec![vec![0.1, f64::NAN]],
    );
    let heat = Panel::new(Axis::new("x", "rad"), Axis::new("y", "Nm")).heat_map(map);
    let path = Panel::new(Axis::new("x", "m"), Axis::new("y", "m"))
        .equal_aspect()
        .series(Series::line("path", [[0.0, 0.0], [1.0, 0.1]]));
    let empty = Panel::new(Axis::new("x", "m"), Axis::new("y", "m"));
    let broken = Panel::new(Axis::new("x", "m").range(2.0, 2.0), Axis::new("y", "m")).series(
        Series::line("broken", [[f64::NAN, 0.0], [1.0, f64::INFINITY]]),
    );
    let panels = [curves, bars, heat, path, empty, broken];
    let figure = panels
        .into_iter()
        .fold(Figure::new(text).columns(2), Figure::panel);
    let section = Section::new("all", text)
        .heading(text)
        .paragraph(text)
        .list([text])
        .definitions([(text, text)])
        .table(table)
        .figure(figure)
        .figure(Figure::new("without panels"));
    Page::new(text, text).section(section).to_html()
}

#[test]
fn text_is_never_markup() {
    let html = page(HOSTILE);
    assert!(!html.contains("<script"), "{html}");
    assert!(html.matches("&lt;script&gt;").count() > 15);
}

#[test]
fn a_page_refers_to_nothing_outside_itself() {
    let html = page("plain");
    for outside in [
        "http:", "https:", "src=", "url(", "@import", "<script", "<link", "<iframe",
    ] {
        assert!(!html.contains(outside), "{outside}");
    }
    let targets = html
        .match_indices("href=")
        .map(|(place, _)| &html[place + 5..place + 7]);
    assert!(targets.into_iter().all(|start| start == "\"#"));
}

#[test]
fn the_same_page_gives_the_same_bytes() {
    assert_eq!(page("a"), page("a"));
}

#[test]
fn every_value_that_is_not_finite_is_left_out() {
    let html = page("plain");
    assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
    assert!(!html.contains("could not be drawn"));
}

#[test]
fn a_million_points_make_a_small_page() {
    let wave = |i: u32| [f64::from(i), (f64::from(i) * 0.37).sin()];
    let figure = |series| {
        let panel = Panel::new(Axis::new("t", "s"), Axis::new("q", "rad")).series(series);
        Figure::new("").panel(panel)
    };
    for series in [
        Series::line("line", (0..1_000_000).map(wave)),
        Series::points("points", (0..1_000_000).map(wave)),
    ] {
        let section = Section::new("s", "s").figure(figure(series));
        let size = Page::new("t", "v").section(section).to_html().len();
        assert!(size < 6_000_000, "{size} bytes");
    }
}

#[test]
fn a_column_without_text_is_not_shown() {
    let columns = || [Column::text("a"), Column::number("b, Nm")];
    let mut table = Table::new("t", columns());
    table.row(["joint1".into(), Cell::published("")]);
    let html = |table| {
        Page::new("t", "v")
            .section(Section::new("s", "s").table(table))
            .to_html()
    };
    assert!(!html(table).contains("b, Nm"));
    assert!(
        html(Table::new("t", columns())).contains("b, Nm"),
        "nothing to judge by"
    );
}

#[test]
fn published_values_are_told_from_ones_own() {
    let mut table = Table::new("t", [Column::text("a"), Column::number("b, Nm")]);
    table.row(["joint1".into(), Cell::published("34.96")]);
    let html = Page::new("t", "v")
        .section(Section::new("s", "s").table(table))
        .to_html();
    assert!(html.contains(
        r#"<td class="number" data-title="b, Nm"><span class="published">34.96</span></td>"#
    ));
    assert!(html.contains(r##"<a href="#s">s</a>"##) && html.contains(r#"<section id="s">"#));
}

#[test]
fn panels_are_drawings_of_their_own_that_go_below_each_other_on_a_narrow_screen() {
    let panel = || Panel::new(Axis::new("x", "m"), Axis::new("y", "m"));
    let html = |columns| {
        let figure = Figure::new("").panel(panel()).panel(panel());
        let section = Section::new("s", "s").figure(figure.columns(columns));
        Page::new("t", "v").section(section).to_html()
    };
    assert_eq!(html(2).matches("<svg viewBox=\"0 0 1920 ").count(), 2);
    assert!(html(2).contains(r#"<div class="panels" style="--narrowest:432px">"#));
    assert!(html(1).contains(r#"<div class="panels wide""#));
}

#[test]
fn labels_stand_in_their_cells() {
    let map = HeatMap::new(
        "share",
        "",
        [0.0, 1.0, 2.0],
        [0.0, 1.0],
        vec![vec![0.1, 0.9]],
    )
    .with_labels(vec![vec!["10 %".to_owned(), HOSTILE.to_owned()]]);
    let panel = Panel::new(Axis::new("x", ""), Axis::new("y", "")).heat_map(map);
    let section = Section::new("s", "s").figure(Figure::new("").panel(panel));
    let html = Page::new("t", "v").section(section).to_html();
    assert!(html.contains("10 %") && !html.contains("<script"));
}

#[test]
fn maps_on_one_scale_are_coloured_alike_and_explained_once() {
    let panel = |value: f64, scaled: bool| {
        let map = HeatMap::new("share", "", [0.0, 1.0], [0.0, 1.0], vec![vec![value]]);
        let map = if scaled { map.on_scale(0.0, 0.8) } else { map };
        Panel::new(Axis::new("x", ""), Axis::new("y", "")).heat_map(map)
    };
    let html = |scaled| {
        let figure = Figure::new("")
            .panel(panel(0.2, scaled))
            .panel(panel(0.8, scaled));
        let section = Section::new("s", "s").figure(figure);
        Page::new("t", "v").section(section).to_html()
    };
    let legends = |html: &str| html.matches("class=\"scale\"").count();
    assert_eq!([legends(&html(true)), legends(&html(false))], [1, 2]);
}
