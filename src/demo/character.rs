//! The character of a demonstration beside its return: the numbers that show how tight a tolerance
//! on MMD^2 to it is.
//!
//! Owns how strong its actions are, how far doing nothing is from it, and the points that MMD^2 is
//! measured between. Start at [`Demonstration::mmd_of_doing_nothing`].

use nalgebra::DMatrix;

use super::{Bandwidth, Demonstration, Estimator, Kernel, Standardizer, mmd::Target};

impl Demonstration {
    /// The root mean square of the numbers of its actions, in units of the action.
    pub fn action_rms(&self) -> f64 {
        (self.actions.norm_squared() / self.actions.len() as f64).sqrt()
    }

    /// MMD^2 between the demonstration and the policy that does nothing, whose action is 0 at each
    /// of the demonstration's states.
    /// In `demo_states` this is the D of a policy that has learned nothing, and so the scale of a
    /// tolerance d.
    pub fn mmd_of_doing_nothing(&self, bandwidth: Bandwidth, estimator: Estimator) -> f64 {
        let states = Standardizer::new(&self.observations).standardize(&self.observations);
        let points = stack(&states, &self.actions.map(|action| action as f32));
        let nothing = DMatrix::zeros(self.actions.nrows(), self.len());
        let kernel = Kernel::new(bandwidth, &points);
        Target::new(points, kernel, estimator).mmd_squared_at_states(&nothing)
    }
}

/// States above actions, one column a sample: the points that the kernel compares.
pub fn stack(states: &DMatrix<f32>, actions: &DMatrix<f32>) -> DMatrix<f32> {
    let mut points = DMatrix::zeros(states.nrows() + actions.nrows(), states.ncols());
    points.rows_mut(0, states.nrows()).copy_from(states);
    points
        .rows_mut(states.nrows(), actions.nrows())
        .copy_from(actions);
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::constant;

    /// Four steps, of which the second action is `scale` times as strong as the first.
    fn demonstration(scale: f64) -> Demonstration {
        Demonstration {
            observations: DMatrix::from_row_slice(1, 4, &[-1.0, -1.0, 1.0, 1.0]),
            actions: DMatrix::from_row_slice(
                2,
                4,
                &[1.0, -1.0, 1.0, -1.0, scale, scale, scale, scale],
            ),
            rewards: None,
            episode_starts: vec![0],
            terminated: vec![false; 4],
            truncated: vec![false; 4],
            poses: None,
            provenance: Vec::new(),
        }
    }

    #[test]
    fn the_rms_is_over_all_numbers() {
        assert!((demonstration(2.0).action_rms() - 2.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(demonstration(0.0).action_rms(), 0.5f64.sqrt());
    }

    /// By hand: states are -1 or 1, each with the actions (1, s) and (-1, s). With k = exp(-|x -
    /// y|^2 / 2), e = exp(-2) for a difference of 2 in one number, and the mean over states (1 + e)
    /// / 2: within the demonstration (1 + e) / 2 over actions, within doing nothing 1, between them
    /// exp(-(1 + s^2) / 2).
    #[test]
    fn doing_nothing_is_as_far_as_a_double_sum_says() {
        let e = (-2.0f64).exp();
        for scale in [0.0_f64, 0.5, 2.0] {
            let expected = (1.0 + e) / 2.0
                * ((1.0 + e) / 2.0 + 1.0 - 2.0 * (-(1.0 + scale * scale) / 2.0).exp());
            let got = demonstration(scale)
                .mmd_of_doing_nothing(Bandwidth::Fixed(constant(1.0)), Estimator::V);
            assert!((got - expected).abs() < 1e-6, "{got} {expected}");
        }
    }
}
