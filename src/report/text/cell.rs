//! The texts of one cell's numbers; an absent number is an empty text.

use super::{
    super::{amount, cell::Cell, verdict::Comparison},
    digits::{alone, between, plus_minus},
};

/// The most digits after the point of our own numbers.
pub const OUR_DECIMALS: usize = 4;
/// The digits after the point that the paper prints.
const PAPER_DECIMALS: usize = 2;

/// Our mean with half of its interval, where several seeds give one.
pub fn ours(cell: &Cell) -> String {
    match cell.ours {
        None => "–".to_owned(),
        Some(ours) if cell.seeds < 2 => alone(ours.mean),
        Some(ours) => plus_minus(ours.mean, (ours.high - ours.low) / 2.0, OUR_DECIMALS),
    }
}

/// The seeds of a cell, as `4 of 5 seeds`, or `5 seeds` where none is missing.
pub fn seeds(cell: &Cell) -> String {
    if cell.seeds < cell.planned {
        format!("{} of {}", cell.seeds, amount::count(cell.planned, "seed"))
    } else {
        amount::count(cell.seeds, "seed")
    }
}

/// The value of each seed.
pub fn each_seed(cell: &Cell) -> String {
    let values: Vec<String> = cell.values.iter().map(|(_, value)| alone(*value)).collect();
    values.join(", ")
}

/// The best seed's mean and standard deviation.
pub fn best(cell: &Cell) -> String {
    cell.best.map_or(String::new(), |best| {
        plus_minus(best.mean, best.std, OUR_DECIMALS)
    })
}

/// The expected best of as many seeds as the paper has.
pub fn expected_best(cell: &Cell) -> String {
    cell.comparison
        .as_ref()
        .and_then(|comparison| comparison.expected_best)
        .map_or(String::new(), alone)
}

/// The paper's mean and standard deviation.
pub fn paper(cell: &Cell) -> String {
    cell.paper.map_or(String::new(), |paper| {
        plus_minus(paper.mean, paper.std, PAPER_DECIMALS)
    })
}

/// The interval of our difference from the paper.
pub fn difference(cell: &Cell) -> String {
    cell.comparison
        .as_ref()
        .map(Comparison::interval)
        .map_or(String::new(), |(low, high)| between(low, high))
}

/// The verdict on our value beside the paper's.
pub fn verdict(cell: &Cell) -> String {
    cell.verdict
        .as_ref()
        .map_or(String::new(), |verdict| verdict.text())
}
