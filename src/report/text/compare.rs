//! A comparison of two experiments as text.

use super::{
    Grid,
    cell::OUR_DECIMALS,
    digits::{alone, between, plus_minus},
    terminal,
};
use crate::{report::compare::CompareData, stats::Interval};

/// The comparison for a terminal of `width` columns.
pub fn shown(data: &CompareData, width: Option<usize>) -> String {
    let headers = ["cell", "A", "seeds", "B", "seeds", "difference", "verdict"]
        .map(str::to_owned)
        .to_vec();
    let side = |interval: Option<Interval>, seeds: usize| match interval {
        None => "–".to_owned(),
        // One seed has no interval.
        Some(it) if seeds < 2 => alone(it.mean),
        Some(it) => plus_minus(it.mean, (it.high - it.low) / 2.0, OUR_DECIMALS),
    };
    let rows = data.rows.iter().map(|row| {
        let of = |(found, all): (usize, usize)| {
            if found == all {
                all.to_string()
            } else {
                format!("{found} of {all}")
            }
        };
        let cell = row.called.as_ref().map_or_else(
            || row.cell.clone(),
            |other| format!("{} = {other}", row.cell),
        );
        vec![
            cell,
            side(row.sides[0], row.seeds[0].0),
            of(row.seeds[0]),
            side(row.sides[1], row.seeds[1].0),
            of(row.seeds[1]),
            row.difference
                .map_or(String::new(), |it| between(it.low, it.high)),
            row.verdict.text(),
        ]
    });
    let numeric = (0..headers.len())
        .map(|column| (1..6).contains(&column))
        .collect();
    let grid = Grid {
        headers,
        rows: rows.collect(),
        names: 1,
        numeric,
    };
    terminal::folded("B against A", &grid, &data.notes, width)
}
