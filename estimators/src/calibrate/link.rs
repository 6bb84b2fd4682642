//! Fit of the link: how large its inertia and gravity are beside the robot file's.
//!
//! `T = γ g + M v̇`, least squares for `γ` and `M` with the robot file's values as a prior. The acceleration is a second
//! difference over a window, `(q_+ - 2 q + q_-)/W²`, which is the mean of the acceleration weighted by a triangle; torque and
//! gravity are averaged alike, so none is late or smoother than the other. Limits: other joints that move count as noise.

use super::Bench;

/// Half of the window: 20 ms pass what a swing does; the encoders' steps leave 0.02 rad/s².
const HALF_WINDOW_S: f64 = 0.02;
/// Relative standard deviation of the robot file's inertia: the arm behind the joint may stand otherwise.
const INERTIA_PRIOR: f64 = 0.2;
/// The same of its gravity.
const GRAVITY_PRIOR: f64 = 0.05;
/// Torque that is left over at least, so that no filter takes the model for exact: a good torque sensor's drift.
const LEFT_MIN_NM: f64 = 0.02;

/// What the recording says of the link.
pub(super) struct LinkFit {
    /// About the joint's axis.
    pub inertia_kg_m2: f64,
    /// Over the robot file's.
    pub gravity_share: f64,
    /// Torque that both leave unexplained, root mean square.
    pub left_nm: f64,
}

/// One window: mean gravity, acceleration, and mean reference torque.
struct Window {
    gravity_nm: f64,
    acceleration_rad_s2: f64,
    torque_nm: f64,
}

impl Bench<'_> {
    pub(super) fn link(&self) -> LinkFit {
        let half = (HALF_WINDOW_S / self.period_s()).round().max(1.0) as usize;
        let middles = (half..self.log.rows().saturating_sub(half)).step_by(half);
        let windows: Vec<Window> = middles
            .filter_map(|middle| self.window(middle, half))
            .collect();
        fit(&windows, self.link_inertia_kg_m2)
    }

    /// `None` where a row is missing or has no reference.
    fn window(&self, middle: usize, half: usize) -> Option<Window> {
        let samples = &self.log.samples;
        let (before, after) = (&samples[middle - half], &samples[middle + half]);
        if after.cycle - before.cycle != 2 * half as u64 {
            return None;
        }
        let mut sums = [0.0; 3];
        for row in middle - half + 1..middle + half {
            let weight = (half - row.abs_diff(middle)) as f64;
            sums[0] += weight;
            sums[1] += weight * self.log.gravity_nm[row];
            sums[2] += weight * self.reference_nm[row];
        }
        let [before, now, after] = [before, &samples[middle], after].map(|s| s.link_position_rad);
        let window_s = half as f64 * self.period_s();
        let window = Window {
            gravity_nm: sums[1] / sums[0],
            acceleration_rad_s2: (after - 2.0 * now + before) / (window_s * window_s),
            torque_nm: sums[2] / sums[0],
        };
        let sum = window.gravity_nm + window.acceleration_rad_s2 + window.torque_nm;
        sum.is_finite().then_some(window)
    }
}

/// Normal equations of two unknowns, in units of the priors' means.
fn fit(windows: &[Window], inertia_kg_m2: f64) -> LinkFit {
    let mut left_nm = f64::INFINITY;
    let (mut gravity_share, mut inertia_share) = (1.0, 1.0);
    // the priors weigh as much as the torque left over says, which the first round does not know
    for _ in 0..3 {
        let variance_nm2 = if left_nm.is_finite() {
            left_nm * left_nm
        } else {
            0.0
        };
        let mut normal = [[variance_nm2 / GRAVITY_PRIOR.powi(2), 0.0], [0.0, 0.0]];
        normal[1][1] = variance_nm2 / INERTIA_PRIOR.powi(2);
        let mut right = [normal[0][0], normal[1][1]];
        for window in windows {
            let row = [
                window.gravity_nm,
                inertia_kg_m2 * window.acceleration_rad_s2,
            ];
            for place in 0..2 {
                right[place] += row[place] * window.torque_nm;
                normal[place][0] += row[place] * row[0];
                normal[place][1] += row[place] * row[1];
            }
        }
        let determinant = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
        if determinant > f64::EPSILON * normal[0][0] * normal[1][1] {
            gravity_share = (right[0] * normal[1][1] - right[1] * normal[0][1]) / determinant;
            inertia_share = (normal[0][0] * right[1] - normal[1][0] * right[0]) / determinant;
        }
        let squares: f64 = windows
            .iter()
            .map(|window| {
                let model_nm = gravity_share * window.gravity_nm
                    + inertia_share * inertia_kg_m2 * window.acceleration_rad_s2;
                (window.torque_nm - model_nm).powi(2)
            })
            .sum();
        left_nm = (squares / windows.len().max(1) as f64)
            .sqrt()
            .max(LEFT_MIN_NM);
    }
    LinkFit {
        inertia_kg_m2: inertia_share * inertia_kg_m2,
        gravity_share,
        left_nm,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heavier_link_is_found_and_no_data_leave_the_robot_file() {
        let window = |k: usize| {
            let phase = 0.1 * k as f64;
            let (gravity_nm, acceleration_rad_s2) = (5.0 * phase.sin(), 20.0 * (3.0 * phase).cos());
            Window {
                gravity_nm,
                acceleration_rad_s2,
                torque_nm: 1.03 * gravity_nm + 0.31 * acceleration_rad_s2,
            }
        };
        let windows: Vec<Window> = (0..600).map(window).collect();
        let found = fit(&windows, 0.29);
        assert!((found.gravity_share - 1.03).abs() < 1e-3);
        assert!((found.inertia_kg_m2 - 0.31).abs() < 1e-3);
        let nothing = fit(&[], 0.29);
        assert_eq!((nothing.gravity_share, nothing.inertia_kg_m2), (1.0, 0.29));
    }
}
