//! f32 arithmetic at the machine's rate: products and transposes of matrices, and powers of two and
//! tanh of whole slices.
//!
//! Owns the choice of instructions, which is made at run time, so that one binary serves every CPU
//! of its kind. Knows nothing of networks or kernels. Start at [`product`].
//!
//! (The design has no such module: both `nn` and `demo` need these, and neither may use the other.)

mod activation;
mod dots;
mod elementary;
pub mod product;
pub mod threads;
mod transpose;

pub use activation::{tanh_biased, tanh_cotangent, tanh_tangent};
pub use dots::product_of_columns;
pub use elementary::{exp2_nonpositive, tanh};
pub use transpose::transpose;
