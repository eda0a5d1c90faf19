//! Tables, seeds and curves as CSV, for programs: every number in full, plain and in a column of
//! its own.

use super::super::{
    axis::Label,
    curve::{Across, CurveData},
    table::TableData,
    verdict::Comparison,
};
use crate::{escape, measured::progress, spec::Key};

/// The cells of a table, one row each: the keys as the file names them, then the numbers.
///
/// # Errors
///
/// None that the csv crate gives for a buffer in memory.
pub fn csv(data: &TableData) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let numbers = [
        "mean",
        "low",
        "high",
        "seeds",
        "planned_seeds",
        "best_seed",
        "best_mean",
        "best_std",
        "best_episodes",
        "paper_mean",
        "paper_std",
        "expected_best",
        "difference_low",
        "difference_high",
        "margin",
        "p",
        "verdict",
        "env_steps",
        "demo",
        "paper_demo",
    ];
    writer.write_record(
        data.row_keys
            .iter()
            .chain(&data.column_keys)
            .map(Key::to_string)
            .chain(numbers.map(str::to_owned)),
    )?;
    for row in &data.rows {
        for (column, cell) in data.columns.iter().zip(&row.cells) {
            // The matrix need not have a run for each pair of a row and a column.
            let Some(cell) = cell else { continue };
            let compared = cell.comparison.as_ref();
            let interval = compared.map(Comparison::interval);
            let whole = |value: Option<u64>| value.map_or(String::new(), |x| x.to_string());
            let mut record: Vec<String> =
                row.values.iter().chain(&column.values).map(value).collect();
            // A single seed has no interval.
            record.extend([
                number(cell.ours.map(|ours| ours.mean)),
                number(cell.ours.filter(|_| cell.seeds > 1).map(|ours| ours.low)),
                number(cell.ours.filter(|_| cell.seeds > 1).map(|ours| ours.high)),
                cell.seeds.to_string(),
                cell.planned.to_string(),
                whole(cell.best.map(|best| best.seed)),
                number(cell.best.map(|best| best.mean)),
                number(cell.best.map(|best| best.std)),
                whole(cell.best.map(|best| best.episodes as u64)),
                number(cell.paper.map(|paper| paper.mean)),
                number(cell.paper.map(|paper| paper.std)),
                number(compared.and_then(|compared| compared.expected_best)),
                number(interval.map(|(low, _)| low)),
                number(interval.map(|(_, high)| high)),
                number(compared.map(|compared| compared.margin)),
                number(compared.map(|compared| compared.p)),
                cell.verdict
                    .as_ref()
                    .map_or(String::new(), |verdict| verdict.text()),
                cell.env_steps.to_string(),
                number(row.demo),
                number(row.paper_demo),
            ]);
            writer.write_record(&record)?;
        }
    }
    writer
        .into_inner()
        .map_err(|error| error.into_error().into())
}

/// The seeds of a table's cells, one row each: the keys, then the seed and its value.
///
/// # Errors
///
/// None that the csv crate gives for a buffer in memory.
pub fn seeds_csv(data: &TableData) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let keys = data
        .row_keys
        .iter()
        .chain(&data.column_keys)
        .map(Key::to_string);
    writer.write_record(keys.chain(["seed", "mean_return"].map(str::to_owned)))?;
    for row in &data.rows {
        for (column, cell) in data.columns.iter().zip(&row.cells) {
            for (seed, mean) in cell.iter().flat_map(|cell| &cell.values) {
                let keys = row.values.iter().chain(&column.values).map(value);
                writer.write_record(keys.chain([seed.to_string(), number(Some(*mean))]))?;
            }
        }
    }
    writer
        .into_inner()
        .map_err(|error| error.into_error().into())
}

/// The points of a figure, one row each.
///
/// # Errors
///
/// None that the csv crate gives for a buffer in memory.
pub fn curves_csv(data: &CurveData) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let x = if data.across == Across::Steps {
        progress::ENV_STEPS.name
    } else {
        "normalised_return"
    };
    let numbers = [x, "mean", "low", "high", "seeds", "planned_seeds"];
    writer.write_record(
        [data.panel_key.clone()]
            .into_iter()
            .chain(data.keys.iter().map(Key::to_string))
            .chain(numbers.map(str::to_owned)),
    )?;
    for panel in &data.panels {
        for (Label { values, .. }, curve) in data.series.iter().zip(&panel.curves) {
            let Some(curve) = curve else { continue };
            for point in &curve.points {
                let mut record = vec![escape::csv(&panel.title)];
                record.extend(values.iter().map(value));
                record.extend([
                    number(Some(point.env_steps)),
                    number(Some(point.mean)),
                    number(point.band.map(|band| band.0)),
                    number(point.band.map(|band| band.1)),
                    curve.seeds.to_string(),
                    curve.planned.to_string(),
                ]);
                writer.write_record(&record)?;
            }
        }
    }
    writer
        .into_inner()
        .map_err(|error| error.into_error().into())
}

/// The CSV of these rows below their headers.
pub fn written(
    headers: &[&str],
    rows: impl Iterator<Item = Vec<String>>,
) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(headers)?;
    for row in rows {
        writer.write_record(&row)?;
    }
    writer
        .into_inner()
        .map_err(|error| error.into_error().into())
}

/// A number in a form that every program reads; empty where there is none.
pub fn number(value: Option<f64>) -> String {
    value
        .filter(|x| x.is_finite())
        .map_or(String::new(), |x| match x.abs() {
            0.0 | 1e-5..1e16 => x.to_string(),
            _ => format!("{x:e}"),
        })
}

/// The value of a key; empty where the runs do not have it.
pub fn value(value: &Option<toml::Value>) -> String {
    match value {
        None => String::new(),
        Some(toml::Value::Float(x)) => number(Some(*x)),
        Some(toml::Value::String(text)) => escape::csv(text),
        Some(other) => escape::csv(&other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        measured::Measure,
        report::{fixture, identity::Identities, recorded::Run, text::tests::made_up},
        spec::Figure,
    };

    #[test]
    fn numbers_are_numbers_and_keys_are_columns() {
        let run =
            |d, epsilon| fixture::mcpo("Hopper-v2", d, epsilon, 0).finished(&[(100, &[-0.5])]);
        let runs = [run(1e-3, 0.0), run(1e-2, 0.0), run(1e-2, 1e-7)];
        let text = String::from_utf8(
            csv(&made_up(&["d"], "algorithm", "table3", &runs)).expect("written"),
        )
        .expect("text");
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines[0].starts_with("d,algorithm,epsilon,mean,low,"),
            "{text}"
        );
        assert!(lines[1].starts_with("0.001,mcpo,0,-0.5,,"), "{text}");
        assert!(lines[3].starts_with("0.01,mcpo,1e-7,-0.5,,"), "{text}");

        let figure = Figure {
            series: vec!["d".into()],
            ..Figure::returns("f", "F".into())
        };
        let runs: Vec<&Run> = runs.iter().collect();
        let data = CurveData::new(&figure, Measure::Return, &runs, &Identities::default());
        let text = String::from_utf8(curves_csv(&data).expect("written")).expect("text");
        let expected = "env,d,epsilon,env_steps,mean,low,high,seeds,planned_seeds\n\
                        Hopper-v2,0.001,0,100,-0.5,,,1,1\n\
                        Hopper-v2,0.01,0,100,-0.5,,,1,1\nHopper-v2,0.01,1e-7,100,-0.5,,,1,1\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn what_is_no_number_is_harmless_text() {
        assert_eq!(value(&Some("=cmd()".into())), "'=cmd()");
        assert_eq!(
            value(&Some(toml::Value::Array(vec![8.into(), 16.into()]))),
            "[8, 16]"
        );
        assert_eq!(
            [1e-320, -2.5e300, 1e-5, 0.0].map(|x| number(Some(x))),
            ["1e-320", "-2.5e300", "0.00001", "0"]
        );
        assert_eq!(number(Some(f64::NAN)), "");
    }
}
