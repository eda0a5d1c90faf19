//! The catalogue of columns is what documents, figures and claims know.

use std::{fs, path::Path};

use mcpo_run::{
    measured::{Measure, progress},
    record::rows,
    spec::{self, Overrides, SpecErrors},
};

#[test]
fn the_documented_columns_are_the_catalogues() {
    const DOCUMENT: &str = "experiments/columns.md";
    let expected = rows::documentation();
    let found = fs::read_to_string(DOCUMENT).unwrap_or_default();
    if found != expected {
        let made = std::env::temp_dir().join("columns.md");
        fs::write(&made, expected).expect("written");
        panic!(
            "{DOCUMENT} is not what the catalogue says: cp {} {DOCUMENT}",
            made.display()
        );
    }
}

/// A file of one figure of `y` and one claim on `on`.
fn parsed(y: &str, on: &str) -> Result<(), SpecErrors> {
    let text = format!(
        "name = 'x'\nbudget.env_steps = 4096\n[[matrix]]\nseed = [0]\nenv = ['Hopper-v2']\nalgorithm = ['ppo']\n\
         [[figures]]\nname = 'f'\ntitle = ''\nseries = []\ny = '{y}'\n\
         [[claims]]\nname = 'c'\nof = 'algorithm=mcpo'\nis = 'above'\nthan = 'algorithm=ppo'\non = '{on}'"
    );
    spec::parse(Path::new("x.toml"), &text, &Overrides::default()).map(drop)
}

#[test]
fn every_column_of_numbers_can_be_drawn_and_claimed_by_each_of_its_names() {
    for column in progress::COLUMNS
        .iter()
        .filter(|column| column.holds_numbers())
    {
        for name in [column.name, column.called()] {
            parsed(name, name).unwrap_or_else(|errors| panic!("{name}: {errors}"));
        }
    }
    parsed(Measure::RETURN, Measure::RETURN).expect("returns of evaluations");
}

#[test]
fn words_are_refused_at_their_line_before_anything_is_trained() {
    for (y, on, line, told) in [
        (
            "case",
            "mmd",
            11,
            "`case` holds words; a figure draws numbers",
        ),
        (
            "mmd",
            "case",
            17,
            "`case` holds words; a claim is about numbers",
        ),
        ("mdd", "mmd", 11, "unknown y `mdd`"),
        ("mmd", "step", 17, "unknown column `step`"),
    ] {
        let errors = parsed(y, on).expect_err("no number");
        let found: Vec<_> = errors
            .iter()
            .map(|error| (error.line(), error.message.as_str()))
            .collect();
        assert_eq!(found, [(Some(line), told)]);
    }
}
