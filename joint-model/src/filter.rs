//! Digital filters that run once a cycle.
//!
//! [`Butterworth`]: a low-pass of order 1 to 8 as cascaded second-order sections, from the analogue prototype by the
//! bilinear transform with the cut-off prewarped (Oppenheim, Schafer, Discrete-Time Signal Processing, 3rd ed.,
//! section 7.2.2). PA10-05 and PA10-03 use order five at 200 Hz on the backward difference of position.

use core::f64::consts::PI;

use arrayvec::ArrayVec;

/// The highest order that can be designed.
pub const ORDER_MAX: usize = 8;

/// Why a filter cannot be designed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// The order is not within 1 and [`ORDER_MAX`].
    #[error("filter order {order}: choose 1 to {ORDER_MAX}")]
    Order {
        /// Order asked for.
        order: usize,
    },
    /// The cut-off does not lie between zero and half the sample rate.
    #[error("filter cut-off {cutoff_hz} Hz: choose above 0 and below half of {rate_hz} Hz")]
    Cutoff {
        /// Cut-off asked for.
        cutoff_hz: f64,
        /// Sample rate asked for.
        rate_hz: f64,
    },
}

/// One section, transposed direct form II, for several signals side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Section<const N: usize = 1> {
    b: [f64; 3],
    a: [f64; 2],
    /// Of each signal.
    memory: [[f64; N]; 2],
}

impl Section {
    /// Analogue `1/(s + 1)` with cut-off `tan(π·f_c/f_s) = warped`.
    fn first_order(warped: f64) -> Self {
        let gain = warped / (1.0 + warped);
        Self {
            b: [gain, gain, 0.0],
            a: [(warped - 1.0) / (1.0 + warped), 0.0],
            memory: [[0.0]; 2],
        }
    }

    /// Analogue `1/(s² + damping·s + 1)`.
    fn second_order(warped: f64, damping: f64) -> Self {
        let scale = 1.0 / (1.0 + damping * warped + warped * warped);
        let gain = warped * warped * scale;
        Self {
            b: [gain, 2.0 * gain, gain],
            a: [
                2.0 * (warped * warped - 1.0) * scale,
                (1.0 - damping * warped + warped * warped) * scale,
            ],
            memory: [[0.0]; 2],
        }
    }

    /// The same for several signals.
    fn for_each<const N: usize>(&self) -> Section<N> {
        Section {
            b: self.b,
            a: self.a,
            memory: self.memory.map(|[memory]| [memory; N]),
        }
    }
}

impl<const N: usize> Section<N> {
    /// Replaces each signal's input by its output.
    #[inline]
    fn step(&mut self, row: &mut [f64; N]) {
        let [newer, older] = &mut self.memory;
        for ((value, newer), older) in row.iter_mut().zip(newer).zip(older) {
            let input = *value;
            let output = self.b[0] * input + *newer;
            *newer = self.b[1] * input - self.a[0] * output + *older;
            *older = self.b[2] * input - self.a[1] * output;
            *value = output;
        }
    }

    /// Memory after an endless constant input of each signal; the section's gain at zero frequency is one.
    fn settle(&mut self, values: &[f64; N]) {
        let [newer, older] = &mut self.memory;
        for ((value, newer), older) in values.iter().zip(newer).zip(older) {
            *older = (self.b[2] - self.a[1]) * value;
            *newer = (self.b[1] - self.a[0]) * value + *older;
        }
    }
}

/// A Butterworth low-pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Butterworth {
    sections: ArrayVec<Section, { ORDER_MAX.div_ceil(2) }>,
}

impl Butterworth {
    /// A low-pass of `order` with -3 dB at `cutoff_hz`, stepped at `rate_hz`, at rest.
    ///
    /// # Errors
    /// [`FilterError`] for an order outside 1 to [`ORDER_MAX`] or a cut-off outside zero to half the rate.
    pub fn design(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<Self, FilterError> {
        if !(1..=ORDER_MAX).contains(&order) {
            return Err(FilterError::Order { order });
        }
        if !(cutoff_hz > 0.0 && cutoff_hz < 0.5 * rate_hz && rate_hz.is_finite()) {
            return Err(FilterError::Cutoff { cutoff_hz, rate_hz });
        }
        let warped = (PI * cutoff_hz / rate_hz).tan();
        let mut sections = ArrayVec::new();
        if order % 2 == 1 {
            sections.push(Section::first_order(warped));
        }
        for pair in 0..order / 2 {
            // the prototype's poles lie on the unit circle; a pair at ±angle from the negative axis has damping 2·cos
            let from_imaginary = PI * (2 * pair + 1) as f64 / (2 * order) as f64;
            sections.push(Section::second_order(warped, 2.0 * from_imaginary.sin()));
        }
        Ok(Self { sections })
    }

    /// The next output.
    pub fn step(&mut self, input: f64) -> f64 {
        let mut value = [input];
        for section in &mut self.sections {
            section.step(&mut value);
        }
        value[0]
    }

    /// Replaces each input by its output, first to last, beginning where an endless constant input `from` would have put the
    /// filter. A row holds one sample of each of several signals: they are filtered side by side, since every step of a
    /// filter waits for the one before.
    pub fn run_from<'a, const N: usize>(
        &self,
        from: &[f64; N],
        rows: impl Iterator<Item = &'a mut [f64; N]>,
    ) {
        let sections = self.sections.iter();
        let mut all: ArrayVec<Section<N>, { ORDER_MAX.div_ceil(2) }> =
            sections.map(Section::for_each).collect();
        for section in &mut all {
            section.settle(from);
        }
        if let [first, second] = all.as_mut_slice() {
            // copies stay in registers
            let (mut one, mut other) = (*first, *second);
            for row in rows {
                one.step(row);
                other.step(row);
            }
        } else {
            for row in rows {
                for section in &mut all {
                    section.step(row);
                }
            }
        }
    }

    /// Puts the filter where an endless constant input would have put it: the next output for that input is the value.
    pub fn reset(&mut self, value: f64) {
        for section in &mut self.sections {
            section.settle(&[value]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude and DC gain by running the filter.
    fn gain_at(filter: &Butterworth, frequency_hz: f64, rate_hz: f64) -> f64 {
        let mut filter = filter.clone();
        let (mut in_phase, mut quadrature) = (0.0, 0.0);
        let samples = 40_000;
        for k in 0..2 * samples {
            let (sin, cos) = (2.0 * PI * frequency_hz * f64::from(k) / rate_hz).sin_cos();
            let output = filter.step(sin);
            if k >= samples {
                in_phase += output * sin;
                quadrature += output * cos;
            }
        }
        2.0 * f64::hypot(in_phase, quadrature) / f64::from(samples)
    }

    #[test]
    fn three_decibels_down_at_the_cutoff_and_falling_with_the_order() {
        for order in 1..=ORDER_MAX {
            let filter = Butterworth::design(order, 150.0, 1500.0).expect("a valid filter");
            assert!(
                (gain_at(&filter, 150.0, 1500.0) - 0.5_f64.sqrt()).abs() < 1e-4,
                "order {order}"
            );
            assert!(
                gain_at(&filter, 450.0, 1500.0) < 0.25_f64.powi(order as i32),
                "order {order}"
            );
        }
    }

    #[test]
    fn passes_a_constant_and_begins_at_one() {
        for order in 1..=ORDER_MAX {
            let mut filter = Butterworth::design(order, 20.0, 1500.0).expect("a valid filter");
            let last = (0..5000)
                .map(|_| filter.step(3.0))
                .last()
                .expect("steps were taken");
            assert!((last - 3.0).abs() < 1e-9);
            let mut rows = [[-7.0, 2.0]; 100];
            filter.run_from(&[-7.0, 2.0], rows.iter_mut());
            let off = |[a, b]: &[f64; 2]| (a + 7.0).abs().max((b - 2.0).abs());
            assert!(rows.iter().all(|row| off(row) < 1e-9));
        }
    }

    #[test]
    fn signals_side_by_side_are_filtered_as_each_alone() {
        for order in [3, 4] {
            let filter = Butterworth::design(order, 60.0, 1500.0).expect("a valid filter");
            let input = |k: usize| [(0.3 * k as f64).sin(), (0.02 * k as f64).cos()];
            let mut both: Vec<[f64; 2]> = (0..200).map(input).collect();
            filter.run_from(&[0.0, 0.0], both.iter_mut());
            let mut alone = filter.clone();
            assert!((0..200).all(|k| both[k][1] == alone.step(input(k)[1])));
        }
    }

    #[test]
    fn impulse_responses_are_those_of_scipy() {
        // scipy.signal.sosfilt(butter(n, fc, fs=1500, output='sos'), [1, 0, 0, 0, 0, 0])
        let fifth_200_hz = [
            0.004282231074195442,
            0.031294431614182834,
            0.10424180942742003,
            0.21076804262971457,
            0.28911772400089353,
            0.2797308321149023,
        ];
        let second_60_hz = [
            0.013359200027856505,
            0.04872714748080904,
            0.08427180519574858,
            0.10468172576731899,
            0.11339311694509632,
            0.11343953765706687,
        ];
        for (order, cutoff_hz, expected) in [(5, 200.0, fifth_200_hz), (2, 60.0, second_60_hz)] {
            let mut filter = Butterworth::design(order, cutoff_hz, 1500.0).expect("a valid filter");
            for (k, value) in expected.into_iter().enumerate() {
                assert!(
                    (filter.step(if k == 0 { 1.0 } else { 0.0 }) - value).abs() < 1e-14,
                    "sample {k}"
                );
            }
        }
    }

    #[test]
    fn refuses_what_cannot_be_built() {
        assert_eq!(
            Butterworth::design(0, 10.0, 1500.0),
            Err(FilterError::Order { order: 0 })
        );
        assert_eq!(
            Butterworth::design(9, 10.0, 1500.0),
            Err(FilterError::Order { order: 9 })
        );
        for cutoff_hz in [0.0, -1.0, 750.0, f64::NAN] {
            assert!(matches!(
                Butterworth::design(2, cutoff_hz, 1500.0),
                Err(FilterError::Cutoff { .. })
            ));
        }
    }
}
