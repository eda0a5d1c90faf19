//! The test of a claim.
//!
//! Seeds are the samples. A difference of means is Welch's, with equal weights of several
//! environments by Satterthwaite's approximation; what is compared with a level has Student's. Two
//! p values belong to a claim: that of its opposite, which is small where the claim **holds**, and
//! its own, small where it is **contradicted**. For `above` and `below` both are twice the
//! one-sided one, since both sides are looked at; `like` holds by two one-sided tests (Schuirmann,
//! 1987). Holm's correction is over the rows of the claim, of either p value. A run that failed
//! counts a second time at the random policy's return; the greater p counts.

use crate::{
    report::reference::Scale,
    spec::{Claim, Environments, Relation},
    stats::{Contrast, Interval, holm},
};

/// The error that a verdict allows itself.
pub const ALPHA: f64 = 0.05;

/// The numbers of one environment.
#[derive(Debug, Clone)]
pub struct Part {
    /// One number per seed, for the claim's subject.
    pub of: Vec<f64>,
    /// The numbers that they are compared with; `None` for a level.
    pub than: Option<Vec<f64>>,
    /// The level that they are compared with where `than` is `None`.
    pub level: f64,
    /// The number of failed runs of either side.
    pub failed: (usize, usize),
    /// The scale of returns; `None` where the numbers are not returns.
    pub scale: Option<Scale>,
}

/// The test of one row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// The difference, with its 95 % interval over both ways to count failed runs.
    pub interval: Interval,
    /// The limit that the difference is compared with.
    pub limit: f64,
    /// The p value of the claim's opposite.
    pub opposite: f64,
    /// The p value of the claim.
    pub itself: f64,
}

/// Judges `claim` by `parts`, one per environment; `None` where one has too few numbers.
pub fn judge(claim: &Claim, parts: &[Part]) -> Option<Judged> {
    // Over several environments, returns are averaged in units of each one's scale. In a single one
    // they keep their unit, and the margin is converted instead.
    let in_units = |part: &Part| match (claim.environments, part.scale) {
        (Environments::Each, Some(scale)) => (1.0, scale.distance),
        (Environments::Overall, Some(scale)) => (1.0 / scale.distance, 1.0),
        (_, None) => (1.0, 1.0),
    };
    let margin = claim.margin * in_units(parts.first()?).1;
    let limit = match claim.is {
        Relation::Kept => claim.share.get(),
        Relation::Below => -margin,
        Relation::Above | Relation::Like => margin,
    };
    let failures = with_failures(parts);
    let ways = [parts].into_iter().chain(failures.as_deref());
    let contrasts = ways.map(|parts| {
        // A level is exact: it moves the numbers and adds no variance.
        let shifted: Vec<Vec<f64>> = parts
            .iter()
            .map(|part| part.of.iter().map(|value| value - part.level).collect())
            .collect();
        let weight = |part: &Part| in_units(part).0 / parts.len() as f64;
        let of = parts
            .iter()
            .zip(&shifted)
            .map(|(part, of)| (weight(part), of.as_slice()));
        let than = parts
            .iter()
            .filter_map(|part| Some((-weight(part), part.than.as_deref()?)));
        Contrast::of(&of.chain(than).collect::<Vec<_>>())
    });
    let contrasts: Vec<Contrast> = contrasts.collect::<Option<_>>()?;
    // The less favourable way to count failed runs decides.
    let greatest = |p: fn(Relation, &Contrast, f64) -> f64| {
        contrasts
            .iter()
            .map(|contrast| p(claim.is, contrast, limit))
            .fold(0.0, f64::max)
            // Twice a one-sided p value may be above 1.
            .min(1.0)
    };
    let intervals: Vec<Interval> = contrasts
        .iter()
        .map(|contrast| contrast.interval(1.0 - ALPHA))
        .collect();
    let interval = intervals
        .iter()
        .skip(1)
        .fold(intervals[0], |all, one| Interval {
            // The mean stays that of the runs that finished; the other way only widens the
            // interval.
            mean: all.mean,
            low: all.low.min(one.low),
            high: all.high.max(one.high),
        });
    Some(Judged {
        interval,
        limit,
        opposite: greatest(opposite),
        itself: greatest(itself),
    })
}

/// The p value of the claim's opposite.
fn opposite(is: Relation, contrast: &Contrast, limit: f64) -> f64 {
    let below = |limit| contrast.confidence_below(limit);
    match is {
        Relation::Above | Relation::Kept => 2.0 * below(limit),
        Relation::Below => 2.0 * (1.0 - below(limit)),
        Relation::Like => below(-limit).max(1.0 - below(limit)),
    }
}

/// The p value of the claim.
fn itself(is: Relation, contrast: &Contrast, limit: f64) -> f64 {
    let below = |limit| contrast.confidence_below(limit);
    match is {
        Relation::Above | Relation::Kept => 2.0 * (1.0 - below(limit)),
        Relation::Below => 2.0 * below(limit),
        Relation::Like => 2.0 * (1.0 - below(-limit)).min(below(limit)),
    }
}

/// The numbers with the random policy's return added for each run that failed; `None` where no run
/// failed, or the numbers are not returns.
fn with_failures(parts: &[Part]) -> Option<Vec<Part>> {
    let with = |part: &Part| {
        let mut part = part.clone();
        if let Some(scale) = part.scale {
            part.of.extend(vec![scale.random; part.failed.0]);
            part.than
                .iter_mut()
                .for_each(|than| than.extend(vec![scale.random; part.failed.1]));
        }
        part
    };
    let any = parts
        .iter()
        .any(|part| part.scale.is_some() && part.failed != (0, 0));
    any.then(|| parts.iter().map(with).collect())
}

/// Both p values of each row that has them, corrected over the rows.
pub fn corrected(rows: &[Option<Judged>]) -> Vec<Option<(f64, f64)>> {
    let all: Vec<&Judged> = rows.iter().flatten().collect();
    let of = |p: fn(&Judged) -> f64| holm(&all.iter().map(|row| p(row)).collect::<Vec<_>>());
    let mut pairs = of(|row| row.opposite).into_iter().zip(of(|row| row.itself));
    rows.iter()
        .map(|row| row.as_ref().and_then(|_| pairs.next()))
        .collect()
}
