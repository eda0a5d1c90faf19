//! Networks: forward passes, exact derivatives, the Gaussian policy, and the running normaliser of
//! observations.
//!
//! Owns the arithmetic of the learner. Knows nothing of environments, rewards or algorithms. Start
//! at [`Mlp`] and [`GaussianPolicy`].
//!
//! One column is one sample: a batch of `n` observations is a matrix `[observation_dim x n]`.
//! Parameters and activations are f32, sums over samples f64 or fixed chunks in a fixed order, so
//! that a result does not depend on how many samples pass together or on how many threads share
//! them.

mod curvature;
mod fisher;
mod mlp;
mod normalizer;
mod pass;
mod policy;

pub use fisher::Fisher;
pub use mlp::Mlp;
pub use normalizer::Normalizer;
pub use pass::Pass;
pub use policy::GaussianPolicy;
