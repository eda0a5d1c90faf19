//! Adam (Kingma and Ba, 2015). Knows the gradient alone: an L2 penalty is part of the gradient that
//! the caller passes.

use pulp::Arch;
use serde::{Deserialize, Serialize};

/// Decay of the mean of gradients.
const FIRST_DECAY: f64 = 0.9;
/// Decay of the mean of squared gradients.
const SECOND_DECAY: f64 = 0.999;
/// Keeps the step bounded where gradients vanish.
const EPSILON: f32 = 1e-8;

/// The optimiser's moments, for one vector of parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    first: Vec<f32>,
    second: Vec<f32>,
    steps: u64,
}

impl Adam {
    /// Zero moments for `dim` parameters.
    pub fn new(dim: usize) -> Self {
        Self {
            first: vec![0.0; dim],
            second: vec![0.0; dim],
            steps: 0,
        }
    }

    /// Takes one step down `gradient` (`[dim]`) with step size `learning_rate` (0.9, 0.999, epsilon
    /// 1e-8). Panics when a length is not `dim`.
    pub fn step(&mut self, parameters: &mut [f32], gradient: &[f32], learning_rate: f64) {
        self.step_parts([parameters], gradient, learning_rate);
    }

    /// As [`step`](Self::step) for parameters in several places: `parts` are `[dim]` together.
    pub fn step_parts<const N: usize>(
        &mut self,
        parts: [&mut [f32]; N],
        gradient: &[f32],
        learning_rate: f64,
    ) {
        let dim = parts.iter().map(|part| part.len()).sum::<usize>();
        // A zip would leave the rest of a longer slice as it is, and say nothing.
        assert_eq!(
            dim,
            self.first.len(),
            "adam was made for another number of parameters"
        );
        assert_eq!(
            gradient.len(),
            self.first.len(),
            "the gradient has another dimension than the parameters"
        );
        self.steps += 1;
        // Both corrections of the start from zero are made once a step: for each parameter, one
        // square root and one division remain, which the compiler turns into vectors.
        let step_size = (learning_rate / (1.0 - FIRST_DECAY.powf(self.steps as f64))) as f32;
        let scale = (1.0 / (1.0 - SECOND_DECAY.powf(self.steps as f64)).sqrt()) as f32;
        let (keep_first, add_first) = (FIRST_DECAY as f32, (1.0 - FIRST_DECAY) as f32);
        let (keep_second, add_second) = (SECOND_DECAY as f32, (1.0 - SECOND_DECAY) as f32);
        let (first, second) = (&mut self.first, &mut self.second);
        Arch::new().dispatch(
            #[inline(always)]
            || {
                let mut start = 0;
                for part in parts {
                    let range = start..start + part.len();
                    start = range.end;
                    let moments = first[range.clone()]
                        .iter_mut()
                        .zip(&mut second[range.clone()]);
                    for ((parameter, &slope), (first, second)) in
                        part.iter_mut().zip(&gradient[range]).zip(moments)
                    {
                        *first = keep_first * *first + add_first * slope;
                        *second = keep_second * *second + add_second * slope * slope;
                        // As in Kingma and Ba's Algorithm 1, epsilon joins the corrected root.
                        *parameter -= step_size * *first / (second.sqrt() * scale + EPSILON);
                    }
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "another dimension")]
    fn a_gradient_of_another_length_is_our_own_bug() {
        Adam::new(2).step(&mut [0.0; 2], &[0.0; 3], 1e-3);
    }

    /// The numbers are numpy's (float64), printed by
    /// ```text
    /// p = np.array([1.0, -2.0, 0.5]); m = np.zeros(3); v = np.zeros(3)
    /// for t in range(1, 6):
    ///     g = np.array([2 * p[0], np.sin(3.0 * t), 1e-3 * p[2]])
    ///     m = 0.9 * m + 0.1 * g; v = 0.999 * v + 0.001 * g * g
    ///     p = p - 0.05 * (m / (1 - 0.9**t)) / (np.sqrt(v / (1 - 0.999**t)) + 1e-8)
    ///     print(p.tolist())
    /// ```
    const NUMPY: [[f64; 3]; 5] = [
        [0.95000000025, -2.0499999964569167, 0.45000099998000037],
        [0.9000832433105463, -2.0318829642475342, 0.4002081548833706],
        [0.8503116964060569, -2.0488562918273514, 0.35079625239488094],
        [0.8007524481597664, -2.037583549057108, 0.301973745859846],
        [0.7514778912964928, -2.0483436530238563, 0.25398715393190324],
    ];

    fn gradient(parameters: &[f32], t: usize) -> [f32; 3] {
        [
            2.0 * parameters[0],
            (3.0 * (t + 1) as f32).sin(),
            1e-3 * parameters[2],
        ]
    }

    #[test]
    fn steps_are_those_of_numpy() {
        let mut parameters = [1.0, -2.0, 0.5];
        let mut adam = Adam::new(3);
        for (t, wanted) in NUMPY.iter().enumerate() {
            let slope = gradient(&parameters, t);
            adam.step(&mut parameters, &slope, 0.05);
            for (&found, &wanted) in parameters.iter().zip(wanted) {
                // One unit in the last place of 2 is 2.4e-7.
                assert!(
                    (f64::from(found) - wanted).abs() < 5e-7,
                    "step {}: {found} but numpy has {wanted}",
                    t + 1
                );
            }
        }
    }

    #[test]
    fn parts_move_as_the_whole_does() {
        let slope: Vec<f32> = (0..70).map(|i| (i as f32).sin()).collect();
        let (mut whole, mut parts) = (slope.clone(), slope.clone());
        let (mut adam, mut other) = (Adam::new(70), Adam::new(70));
        for _ in 0..3 {
            adam.step(&mut whole, &slope, 0.05);
            let (head, tail) = parts.split_at_mut(41);
            other.step_parts([head, tail], &slope, 0.05);
        }
        assert_eq!((whole, adam), (parts, other));
    }

    #[test]
    fn saved_moments_go_on_where_they_were() {
        let (mut parameters, slope) = ([1.0, -2.0, 0.5], [2.0, 0.1, 5e-4]);
        let mut adam = Adam::new(3);
        adam.step(&mut parameters, &slope, 0.05);
        let saved = postcard::to_stdvec(&adam).expect("moments serialise");
        let mut restored: Adam = postcard::from_bytes(&saved).expect("and come back");
        let mut others = parameters;
        adam.step(&mut parameters, &slope, 0.05);
        restored.step(&mut others, &slope, 0.05);
        assert_eq!((parameters, adam), (others, restored));
    }
}
