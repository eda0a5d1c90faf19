//! The dual of the two-constraint problem (appendix, Eq. 5 to 11, with Eq. 11 corrected).

/// Minimise `g.x` subject to `b.x <= slack` and `x.Hx/2 <= radius`, given by its scalars.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DualProblem {
    /// `g.H^-1 g`, 0 or above.
    pub q: f64,
    /// `g.H^-1 b`.
    pub r: f64,
    /// `b.H^-1 b`, 0 or above.
    pub s: f64,
    /// `c`: how much the linear constraint may still grow; negative when it is violated.
    pub slack: f64,
    /// `delta`, above 0.
    pub radius: f64,
}

/// The optimum, by case. TODO(helper): final set of cases and their data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DualSolution {
    /// placeholder
    Infeasible,
}
