//! Fewer points, the same picture.

use std::collections::HashSet;

/// Of successive points in one pixel column the first, the lowest, the highest and the last, in their order: a line
/// through them covers the same pixels. `column` numbers the columns.
pub fn line(points: &[[f64; 2]], column: impl Fn(f64) -> i64) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a[0]) == column(b[0])) {
        let by_y = |a: &&[f64; 2], b: &&[f64; 2]| a[1].total_cmp(&b[1]);
        let lowest = run.iter().min_by(by_y);
        let highest = run.iter().max_by(by_y);
        let matters = |place: usize, point: &[f64; 2]| {
            place == 0 || place + 1 == run.len() || Some(point) == lowest || Some(point) == highest
        };
        let mut last = None;
        for (place, point) in run.iter().enumerate() {
            if matters(place, point) && last != Some(point) {
                kept.push(*point);
                last = Some(point);
            }
        }
    }
    kept
}

/// The first point in each cell; `cell` numbers the cells.
pub fn scatter(points: &[[f64; 2]], cell: impl Fn(&[f64; 2]) -> (i64, i64)) -> Vec<[f64; 2]> {
    let mut taken = HashSet::new();
    let is_first = |point: &&[f64; 2]| taken.insert(cell(point));
    points.iter().filter(is_first).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_stay_and_few_points_are_left() {
        let wave = |i: usize| [i as f64, (i as f64 * 0.7).sin()];
        let mut points: Vec<[f64; 2]> = (0..100_000).map(wave).collect();
        points[31_415][1] = 50.0;
        points[27_182][1] = -40.0;
        let kept = line(&points, |x| (x / 100.0) as i64);
        assert!(kept.len() <= 4 * 1000, "{}", kept.len());
        for extreme in [points[31_415], points[27_182], points[0], points[99_999]] {
            assert!(kept.contains(&extreme), "{extreme:?}");
        }
        assert!(
            kept.windows(2).all(|pair| pair[0][0] < pair[1][0]),
            "in order"
        );
    }

    #[test]
    fn a_line_that_comes_back_is_kept_both_ways() {
        let there = (0..50).map(|i| [f64::from(i), 0.0]);
        let back = (0..50).rev().map(|i| [f64::from(i), 1.0]);
        let points: Vec<[f64; 2]> = there.chain(back).collect();
        let kept = line(&points, |x| x as i64);
        assert_eq!(kept.first(), Some(&[0.0, 0.0]));
        assert_eq!(kept.last(), Some(&[0.0, 1.0]));
    }

    #[test]
    fn equal_points_are_drawn_once() {
        let points = vec![[1.0, 2.0]; 1000];
        assert_eq!(scatter(&points, |p| (p[0] as i64, p[1] as i64)).len(), 1);
        assert_eq!(line(&points, |x| x as i64).len(), 1);
        assert!(line(&[], |x| x as i64).is_empty());
    }
}
