//! Holm's (1979) correction for testing many hypotheses at once.

/// The p values, such that refuting those that are at most alpha refutes any true hypothesis with
/// probability alpha at most, whatever their dependence.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut least = 0.0_f64;
    for (rank, &index) in order.iter().enumerate() {
        least = least.max((p.len() - rank) as f64 * p[index]).min(1.0);
        adjusted[index] = least;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R's `p.adjust(p, "holm")`, by its definition.
    #[test]
    fn the_smallest_counts_most_and_none_overtakes_another() {
        let close = |p: &[f64], wanted: &[f64]| {
            assert!(
                holm(p)
                    .iter()
                    .zip(wanted)
                    .all(|(a, b)| (a - b).abs() < 1e-12),
                "{:?}",
                holm(p)
            );
        };
        close(&[0.01, 0.04, 0.03, 0.005], &[0.03, 0.06, 0.06, 0.02]);
        close(&[0.2, 0.001, 0.9], &[0.4, 0.003, 0.9]);
        close(&[0.7, 0.6], &[1.0, 1.0]);
        assert!(holm(&[]).is_empty());
    }
}
