//! A chain of joints as people draw an arm: links as strokes, joints as discs whose colour says something.

use maud::{Markup, html};

use crate::colours;
use crate::number;

const WIDTH_PX: f64 = 640.0;
const HEIGHT_PX: f64 = 360.0;
const MARGIN_PX: f64 = 45.0;
/// Least distance between two labels, so that both can be read.
const LABEL_PX: f64 = 20.0;
/// From a joint to its label.
const LABEL_AWAY_PX: f64 = 60.0;
const DISC_PX: f64 = 9.0;
/// The smallest extent that is drawn to scale: joints in one place stay in one place.
const EXTENT_MIN: f64 = 1e-6;

/// One joint of the drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Beside the disc.
    pub label: String,
    /// Across and up, in any unit.
    pub place: [f64; 2],
    /// What the colour says; none leaves the disc white.
    pub value: Option<f64>,
}

/// A chain of joints in the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    caption: String,
    quantity: String,
    nodes: Vec<Node>,
    end: [f64; 2],
}

impl Chain {
    /// Joints from base to tip and the place where the last link ends. Colours go from zero to the largest value.
    pub fn new(
        caption: impl Into<String>,
        quantity: impl Into<String>,
        nodes: impl IntoIterator<Item = Node>,
        end: [f64; 2],
    ) -> Self {
        Self {
            caption: caption.into(),
            quantity: quantity.into(),
            nodes: nodes.into_iter().collect(),
            end,
        }
    }

    pub(crate) fn html(&self) -> Markup {
        let places = self.places();
        let labels = self.label_heights(&places);
        let most = self.most();
        let view = format!("0 0 {WIDTH_PX} {HEIGHT_PX}");
        let path: Vec<String> = places
            .iter()
            .map(|[x, y]| format!("{x:.1},{y:.1}"))
            .collect();
        let path = path.join(" ");
        let label_x = places.iter().map(|place| place[0]).fold(0.0, f64::max) + LABEL_AWAY_PX;
        let nodes = self.nodes.iter().zip(&places).zip(&labels);
        html! {
            figure {
                ul.legend {
                    li {
                        (self.quantity) ": 0"
                        span.scale style={ "background:" (colours::heat_gradient()) } {}
                        (number(most, 3))
                    }
                }
                svg viewBox=(view) role="img" aria-label=(self.caption) {
                    polyline points=(path) fill="none" stroke="#b4b4b4" stroke-width="7" stroke-linejoin="round" stroke-linecap="round" {}
                    @for ((node, [x, y]), label_y) in nodes {
                        @let colour = colour(node.value, most);
                        line x1=(px(*x)) y1=(px(*y)) x2=(px(label_x - 6.0)) y2=(px(label_y - 4.0)) stroke="#d5d5d5" {}
                        circle cx=(px(*x)) cy=(px(*y)) r=(px(DISC_PX)) fill=(colour) stroke="#5a5a5a" stroke-width="1.5" {}
                        text x=(px(label_x)) y=(px(*label_y)) font-size="14" font-family="sans-serif" fill="#1a1a1a" { (node.label) }
                    }
                }
                figcaption { (self.caption) }
            }
        }
    }

    fn most(&self) -> f64 {
        let values = self.nodes.iter().filter_map(|node| node.value);
        values.filter(|value| value.is_finite()).fold(0.0, f64::max)
    }

    /// Joints and end in pixels, equal scale both ways, left of the labels.
    fn places(&self) -> Vec<[f64; 2]> {
        let all = || {
            let nodes = self.nodes.iter().map(|node| node.place);
            nodes.chain([self.end])
        };
        let range = |axis: usize| {
            all().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place[axis]), high.max(place[axis])]
            })
        };
        let ([left, right], [low, high]) = (range(0), range(1));
        let across_px = 0.5 * WIDTH_PX - 2.0 * MARGIN_PX;
        let scale = (across_px / (right - left).max(EXTENT_MIN))
            .min((HEIGHT_PX - 2.0 * MARGIN_PX) / (high - low).max(EXTENT_MIN));
        let scale = scale.min(1e9);
        let place = |[x, y]: [f64; 2]| {
            let finite = |px: f64, instead: f64| if px.is_finite() { px } else { instead };
            let across = 0.25 * WIDTH_PX + (x - 0.5 * (left + right)) * scale;
            let down = 0.5 * HEIGHT_PX - (y - 0.5 * (low + high)) * scale;
            [
                finite(across, 0.25 * WIDTH_PX),
                finite(down, 0.5 * HEIGHT_PX),
            ]
        };
        all().map(place).collect()
    }

    /// As high as their joints, but never on top of each other.
    fn label_heights(&self, places: &[[f64; 2]]) -> Vec<f64> {
        let mut order: Vec<usize> = (0..self.nodes.len()).collect();
        order.sort_by(|a, b| places[*a][1].total_cmp(&places[*b][1]).then(b.cmp(a)));
        let mut heights = vec![0.0; self.nodes.len()];
        let mut free_from = LABEL_PX;
        for index in order {
            heights[index] = f64::max(places[index][1], free_from);
            free_from = heights[index] + LABEL_PX;
        }
        let over = free_from - LABEL_PX - (HEIGHT_PX - 5.0);
        if over > 0.0 {
            heights.iter_mut().for_each(|height| *height -= over);
        }
        heights
    }
}

fn px(value: f64) -> String {
    format!("{value:.1}")
}

fn colour(value: Option<f64>, most: f64) -> String {
    match value {
        Some(value) if value.is_finite() && most > 0.0 => colours::css(colours::heat(value / most)),
        Some(value) if value.is_finite() => colours::css(colours::heat(0.0)),
        _ => "#ffffff".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(places: &[[f64; 2]]) -> Chain {
        let nodes = places.iter().enumerate().map(|(index, place)| Node {
            label: format!("joint <{index}>"),
            place: *place,
            value: (index > 0).then_some(index as f64),
        });
        Chain::new("an arm", "gap over noise", nodes, [0.0, 2.0])
    }

    #[test]
    fn joints_stand_where_they_are_and_labels_never_meet() {
        let chain = chain(&[[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]);
        let places = chain.places();
        assert_eq!(places[0], places[1]);
        assert!(places[2][1] < places[0][1], "up is up");
        let mut heights = chain.label_heights(&places);
        heights.sort_by(f64::total_cmp);
        assert!(
            heights
                .windows(2)
                .all(|pair| pair[1] - pair[0] >= LABEL_PX - 1e-9)
        );
    }

    #[test]
    fn text_is_escaped_and_no_value_is_white() {
        let html = chain(&[[0.0, 0.0], [0.0, 1.0]]).html().into_string();
        assert!(html.contains("joint &lt;0&gt;") && html.contains("#ffffff"));
    }

    #[test]
    fn numbers_that_are_none_leave_no_trace_of_it() {
        let html = chain(&[[f64::NAN, 0.0], [0.0, 1.0]]).html().into_string();
        assert!(!html.contains("NaN"), "{html}");
    }
}
