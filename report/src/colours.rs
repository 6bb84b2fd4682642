//! Colours that people with any colour vision tell apart, on white and in print.

use plotters::style::RGBColor;

/// Okabe and Ito, Color Universal Design (2008), without yellow, which is too light on white. Series take them in turn.
const SERIES: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(60, 60, 60),
];

/// Cividis (Nuñez, Anderton, Renslow, PLoS ONE 13 (2018) e0199239) at equal steps: lightness rises all the way.
const HEAT: [RGBColor; 9] = [
    RGBColor(0, 34, 78),
    RGBColor(24, 58, 110),
    RGBColor(65, 77, 107),
    RGBColor(96, 98, 110),
    RGBColor(124, 123, 120),
    RGBColor(155, 148, 120),
    RGBColor(188, 175, 111),
    RGBColor(222, 204, 93),
    RGBColor(254, 232, 56),
];

/// Grid, frame and reference lines.
pub const GRID: RGBColor = RGBColor(225, 225, 225);
pub const FRAME: RGBColor = RGBColor(90, 90, 90);
pub const REFERENCE: RGBColor = RGBColor(165, 165, 165);
pub const REFERENCE_LETTERS: RGBColor = RGBColor(110, 110, 110);

/// The colour of the series with this number.
pub fn series(index: usize) -> RGBColor {
    SERIES[index % SERIES.len()]
}

/// The colour of a share of a heat map's range, dark at zero and light at one.
pub fn heat(share: f64) -> RGBColor {
    let place = share.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
    let below = (place as usize).min(HEAT.len() - 2);
    let rest = place - below as f64;
    let mix = |low: u8, high: u8| (f64::from(low) * (1.0 - rest) + f64::from(high) * rest).round();
    let (low, high) = (HEAT[below], HEAT[below + 1]);
    RGBColor(
        mix(low.0, high.0) as u8,
        mix(low.1, high.1) as u8,
        mix(low.2, high.2) as u8,
    )
}

/// Letters on that colour.
pub fn on_heat(share: f64) -> RGBColor {
    if share > 0.5 {
        RGBColor(20, 20, 20)
    } else {
        RGBColor(255, 255, 255)
    }
}

/// The heat map's scale, low to high, for a style sheet.
pub fn heat_gradient() -> String {
    let stops: Vec<String> = HEAT.iter().map(|colour| css(*colour)).collect();
    format!("linear-gradient(to right, {})", stops.join(", "))
}

/// As style sheets write it.
pub fn css(colour: RGBColor) -> String {
    format!("#{:02x}{:02x}{:02x}", colour.0, colour.1, colour.2)
}
