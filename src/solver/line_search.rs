//! Backtracking line search: the first of a shrinking sequence of fractions of a step that is accepted.
