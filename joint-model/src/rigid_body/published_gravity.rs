//! Gravity torque as PA10-05 prints it, eqs (9)–(13): for comparison only.
//!
//! The terms are kept as printed, `s_i = sin θ_i` and `c_i = cos θ_i`, also where they cannot be right. They are not the
//! gradient of any potential, so an arm held by them would gain energy on a closed path; and no zero position makes
//! them fit an arm: the shoulder's own mass (`c_2`) wants the upper arm level at zero, where the masses beyond the elbow
//! (`c_2·s_2`) then weigh nothing at shoulder and elbow. What the system computes with is [`Chain::gravity_torque`]
//! with the same masses and centres. Units: SI. Sign: as printed, the torque spent against
//! gravity, eq (5).
//!
//! [`Chain::gravity_torque`]: super::Chain::gravity_torque

/// The masses and lengths of PA10-05 Table IV, and eqs (9)–(13) on them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedGravity {
    /// `g`, acceleration of free fall.
    pub g_m_s2: f64,
    /// `m_2`, upper arm.
    pub m2_kg: f64,
    /// `m_4`, forearm.
    pub m4_kg: f64,
    /// `m_6`, hand.
    pub m6_kg: f64,
    /// `l_2`, shoulder to elbow.
    pub l2_m: f64,
    /// `l_4`, elbow to wrist.
    pub l4_m: f64,
    /// `l_c2`, shoulder to the centre of `m_2`.
    pub lc2_m: f64,
    /// `l_c4`, elbow to the centre of `m_4`.
    pub lc4_m: f64,
    /// `l_c6`, wrist to the centre of `m_6`; negative where it lies behind the wrist.
    pub lc6_m: f64,
}

/// Sines and cosines by joint number; index 0 is not used.
struct Angles {
    s: [f64; 7],
    c: [f64; 7],
}

impl Angles {
    fn of(position_rad: &[f64; 7]) -> Self {
        let mut angles = Self {
            s: [0.0; 7],
            c: [0.0; 7],
        };
        for (index, angle_rad) in position_rad[..6].iter().enumerate() {
            (angles.s[index + 1], angles.c[index + 1]) = angle_rad.sin_cos();
        }
        angles
    }
}

impl PublishedGravity {
    /// Torque of the seven joints as printed; the paper has none for joints 1 and 7.
    pub fn torque_nm(&self, position_rad: &[f64; 7]) -> [f64; 7] {
        let at = Angles::of(position_rad);
        [
            0.0,
            self.joint_2_nm(&at),
            self.joint_3_nm(&at),
            self.joint_4_nm(&at),
            self.joint_5_nm(&at),
            self.joint_6_nm(&at),
            0.0,
        ]
    }

    /// Eq (9).
    fn joint_2_nm(&self, Angles { s, c }: &Angles) -> f64 {
        let forearm_m = self.l2_m * (c[2] * s[2])
            + self.lc4_m * (s[2] * s[3] * s[4] + c[2] * c[2] * c[3] * s[4] + c[2] * s[2] * c[4]);
        let hand_m = self.l2_m * (c[2] * s[2])
            + self.l4_m * (s[2] * s[3] * s[4] + c[2] * c[2] * c[3] * s[4])
            + self.lc6_m
                * (s[2] * s[3] * c[4] * c[5] * s[6]
                    + s[2] * c[3] * s[5] * s[6]
                    + s[2] * s[3] * s[4] * c[6]
                    + c[2] * c[2] * c[3] * c[4] * c[5] * s[6]
                    - c[2] * c[2] * s[3] * s[5] * s[6]
                    + c[2] * c[2] * c[3] * s[4] * c[6]
                    + c[2] * s[2] * c[4] * c[6]);
        self.g_m_s2
            * (self.m2_kg * self.lc2_m * c[2] + self.m4_kg * forearm_m + self.m6_kg * hand_m)
    }

    /// Eq (10).
    fn joint_3_nm(&self, Angles { s, c }: &Angles) -> f64 {
        let forearm_m = self.lc4_m * s[2] * c[3] * (c[4] + s[3] * s[4]);
        let hand_m = self.l4_m * s[2] * (c[3] * c[4] + s[3] * c[3] * s[4])
            + self.lc6_m
                * s[2]
                * (c[3] * c[4] * c[6] - c[3] * s[4] * c[5] * s[6]
                    + s[3] * c[3] * c[4] * c[5] * s[6]
                    - s[5] * s[6]
                    + c[3] * c[3] * s[5] * s[6]
                    + s[3] * c[3] * s[4] * c[6]);
        self.g_m_s2 * (self.m4_kg * forearm_m + self.m6_kg * hand_m)
    }

    /// Eq (11).
    fn joint_4_nm(&self, Angles { s, c }: &Angles) -> f64 {
        let forearm_m = self.lc4_m * s[4] * (s[2] * c[3] * s[4] - c[2] * c[4]);
        let hand_m = self.l4_m * (s[2] * c[3] * c[4] * c[4] + c[2] * c[4] * s[4])
            + self.lc6_m
                * (s[2] * c[3] * c[4] * s[5] * s[6] + c[2] * s[4] * s[5] * s[6]
                    - s[2] * c[3] * s[4] * c[4] * c[5] * s[6]
                    + c[2] * c[4] * c[4] * c[5] * s[6]
                    - s[2] * c[3] * c[6]
                    + s[2] * c[3] * c[4] * c[4] * c[6]
                    + c[2] * c[4] * s[4] * c[6]);
        self.g_m_s2 * (self.m4_kg * forearm_m + self.m6_kg * hand_m)
    }

    /// Eq (12).
    fn joint_5_nm(&self, Angles { s, c }: &Angles) -> f64 {
        let hand_m = self.lc6_m
            * s[6]
            * (s[2] * c[3] * c[4] * s[5] + c[2] * s[4] * s[5] + s[2] * s[3] * c[5]);
        self.g_m_s2 * self.m6_kg * hand_m
    }

    /// Eq (13).
    fn joint_6_nm(&self, Angles { s, c }: &Angles) -> f64 {
        let hand_m = self.lc6_m
            * s[6]
            * (s[2] * c[3] * c[4] * c[5] * s[6] + c[2] * s[4] * c[5] * s[6]
                - s[2] * s[3] * s[5] * s[6]
                + s[2] * c[3] * s[4] * c[6]
                - c[2] * c[4] * c[6]);
        self.g_m_s2 * self.m6_kg * hand_m
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};

    use super::super::{Chain, JointKind, Link};
    use super::*;

    /// PA10-05 Table IV.
    const PA10: PublishedGravity = PublishedGravity {
        g_m_s2: 9.81,
        m2_kg: 9.86,
        m4_kg: 2.18,
        m6_kg: 4.34,
        l2_m: 0.45,
        l4_m: 0.50,
        lc2_m: 0.32,
        lc4_m: 0.17,
        lc6_m: -0.09,
    };

    /// An ordinary pose.
    const POSE_RAD: [f64; 7] = [0.0, 0.6, 0.4, 0.9, 0.3, -0.5, 0.0];

    /// The same masses on the arm's kinematics: joint axes z, y, z, y, z, y, z, upright at zero.
    fn rigid_arm() -> Chain {
        let link = |height_m: f64, turns: bool, mass_kg: f64, centre_m: f64| Link {
            parent: None,
            kind: JointKind::Revolute,
            origin: Isometry3::from_parts(
                Translation3::new(0.0, 0.0, height_m),
                UnitQuaternion::identity(),
            ),
            axis: if turns {
                Vector3::z_axis()
            } else {
                Vector3::y_axis()
            },
            mass_kg,
            centre_of_mass_m: Vector3::new(0.0, 0.0, centre_m),
            inertia_kg_m2: Matrix3::zeros(),
        };
        let mut links = [
            link(0.0, true, 0.0, 0.0),
            link(0.0, false, PA10.m2_kg, PA10.lc2_m),
            link(PA10.l2_m, true, 0.0, 0.0),
            link(0.0, false, PA10.m4_kg, PA10.lc4_m),
            link(PA10.l4_m, true, 0.0, 0.0),
            link(0.0, false, PA10.m6_kg, PA10.lc6_m),
            link(0.0, true, 0.0, 0.0),
        ];
        for (index, link) in links.iter_mut().enumerate() {
            link.parent = Link::serial(index);
        }
        let gravity_m_s2 = Vector3::new(0.0, 0.0, -PA10.g_m_s2);
        Chain::new(&links, gravity_m_s2, Isometry3::identity()).unwrap()
    }

    fn rigid_nm(position_rad: &[f64; 7]) -> [f64; 7] {
        let mut torque_nm = [0.0; 7];
        rigid_arm().gravity_torque(position_rad, &mut torque_nm);
        torque_nm
    }

    /// `∂τ_i/∂θ_j` at a pose, by central differences.
    fn slope_nm_rad(
        torque_nm: impl Fn(&[f64; 7]) -> [f64; 7],
        pose_rad: &[f64; 7],
        i: usize,
        j: usize,
    ) -> f64 {
        const STEP_RAD: f64 = 1e-5;
        let at = |step_rad: f64| {
            let mut moved_rad = *pose_rad;
            moved_rad[j] += step_rad;
            torque_nm(&moved_rad)[i]
        };
        (at(STEP_RAD) - at(-STEP_RAD)) / (2.0 * STEP_RAD)
    }

    /// Largest `|∂τ_i/∂θ_j - ∂τ_j/∂θ_i|` of joints 2 to 4: zero for any gradient.
    fn curl_nm_rad(torque_nm: impl Fn(&[f64; 7]) -> [f64; 7], pose_rad: &[f64; 7]) -> f64 {
        let pairs = [(1, 2), (1, 3), (2, 3)];
        let curl = |(i, j)| {
            slope_nm_rad(&torque_nm, pose_rad, i, j) - slope_nm_rad(&torque_nm, pose_rad, j, i)
        };
        pairs
            .map(curl)
            .into_iter()
            .fold(0.0, |most, curl| curl.abs().max(most))
    }

    #[test]
    fn is_not_the_gradient_of_any_potential() {
        let curl = curl_nm_rad(|pose_rad| PA10.torque_nm(pose_rad), &POSE_RAD);
        assert!((curl - 10.28).abs() < 0.01, "{curl} Nm/rad");
        assert!(curl_nm_rad(rigid_nm, &POSE_RAD) < 1e-6);
    }

    #[test]
    fn the_elbow_terms_vanish_at_zero_where_the_arm_weighs() {
        let zero_nm = PA10.torque_nm(&[0.0; 7]);
        // τ_2 says by its first term that the upper arm is level at zero
        assert!((zero_nm[1] - PA10.g_m_s2 * PA10.m2_kg * PA10.lc2_m).abs() < 1e-12);
        assert_eq!(zero_nm[3], 0.0);
        let level_nm = rigid_nm(&[0.0, -FRAC_PI_2, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let elbow_nm =
            PA10.g_m_s2 * (PA10.m4_kg * PA10.lc4_m + PA10.m6_kg * (PA10.l4_m + PA10.lc6_m));
        assert!((level_nm[3] - elbow_nm).abs() < 1e-9 && elbow_nm > 20.0);
        let beyond_elbow_nm = elbow_nm + PA10.g_m_s2 * (PA10.m4_kg + PA10.m6_kg) * PA10.l2_m;
        assert!((level_nm[1] - zero_nm[1] - beyond_elbow_nm).abs() < 1e-9);
    }

    #[test]
    fn nor_does_zero_mean_upright() {
        assert!(rigid_nm(&[0.0; 7]).iter().all(|nm| nm.abs() < 1e-12));
        assert!(PA10.torque_nm(&[0.0; 7])[1] > 30.0);
    }

    #[test]
    fn has_no_torque_about_the_first_and_last_axis_and_does_not_depend_on_them() {
        let mut turned_rad = POSE_RAD;
        (turned_rad[0], turned_rad[6]) = (1.0, -2.0);
        let torque_nm = PA10.torque_nm(&POSE_RAD);
        assert_eq!(torque_nm, PA10.torque_nm(&turned_rad));
        assert_eq!((torque_nm[0], torque_nm[6]), (0.0, 0.0));
    }
}
