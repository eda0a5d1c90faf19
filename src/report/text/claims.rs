//! Claims as text: the verdict on each, and the numbers of every row.

use super::{
    Grid,
    csv::{number, written},
    digits::{alone, between, within},
    markdown_grid, terminal, tex,
};
use crate::{
    escape,
    measured::Measure,
    report::{
        amount,
        claims::{ClaimRow, ClaimVerdict, ClaimsData, Count},
        notes, reference,
    },
    spec::{Part, Relation, Versus},
};

const TITLE: &str = "Claims";

/// The claims as Markdown: a line each, then every environment's numbers.
pub fn markdown(data: &ClaimsData) -> String {
    let notes: String = data
        .notes
        .iter()
        .map(|note| format!("- {}\n", escape::markdown(note)))
        .collect();
    format!(
        "# {TITLE}\n\n{}\n{}\n{notes}",
        markdown_grid(&summary(data)),
        markdown_grid(&details(data))
    )
}

/// Every environment's numbers for LaTeX, as [`latex`](super::latex) writes a table called `name`.
pub fn latex(name: &str, data: &ClaimsData) -> [String; 2] {
    let grid = details(data);
    [
        tex::tabular(&grid),
        tex::float(name, TITLE, &data.notes, &grid),
    ]
}

/// The verdict on each claim, for a terminal of `width` columns.
pub fn shown(data: &ClaimsData, width: Option<usize>) -> String {
    terminal::folded(TITLE, &summary(data), &[], width)
}

/// A grid of one line per claim.
fn summary(data: &ClaimsData) -> Grid {
    let headers = ["claim", "what is compared", "verdict"]
        .map(str::to_owned)
        .to_vec();
    let line = |rows: &[ClaimRow]| vec![rows[0].claim.name.clone(), compared(rows), overall(rows)];
    Grid {
        headers,
        rows: data.by_claim().map(line).collect(),
        names: 1,
        numeric: vec![false; 3],
    }
}

/// The comparison that the claim of `rows` makes, in words: `return of algorithm=mcpo above that of
/// algorithm=ppo`.
pub fn compared(rows: &[ClaimRow]) -> String {
    let claim = &rows[0].claim;
    let has_scale = |row: &ClaimRow| {
        let env = row.env.as_deref();
        env.is_none_or(|env| reference::scale(env).is_some())
    };
    let part = if claim.at == Part::Area {
        " over all of training"
    } else {
        ""
    };
    let margin = match (claim.margin, claim.on) {
        (0.0, _) => String::new(),
        // Where the paper has no returns, the margin is one of the returns themselves.
        (margin, Measure::Return) if rows.iter().any(has_scale) => {
            format!(", margin {} of Expert - Random", alone(margin))
        }
        (margin, _) => format!(", margin {}", number(Some(margin))),
    };
    let (of, on) = (&claim.of, &claim.on);
    let than = match &claim.than {
        Some(Versus::Demonstration) => "the demonstration".to_owned(),
        Some(Versus::Runs(selection)) => selection.to_string(),
        None => String::new(),
    };
    match claim.is {
        Relation::Kept => {
            format!(
                "MMD² of {of} within d in {} % of iterations once met",
                alone(100.0 * claim.share.get())
            )
        }
        Relation::Above => format!("{on} of {of} above that of {than}{part}{margin}"),
        Relation::Below => format!("{on} of {of} below that of {than}{part}{margin}"),
        Relation::Like => format!("{on} of {of} like that of {than}{part}{margin}"),
    }
}

/// The verdicts of a claim's rows, in words: `holds in 5 of 7; contradicted in 1 of 7 (Hopper-v2);
/// inconclusive in 1 of 7`, or the verdict of the only row.
pub fn overall(rows: &[ClaimRow]) -> String {
    if let [only] = rows {
        return only.verdict.text();
    }
    let told = |verdict: &str, is: fn(&ClaimVerdict) -> bool, is_named: bool| {
        let places: Vec<String> = rows
            .iter()
            .filter(|row| is(&row.verdict))
            .map(place)
            .collect();
        let names = if is_named {
            format!(" ({})", notes::listed(&places))
        } else {
            String::new()
        };
        (!places.is_empty())
            .then(|| format!("{verdict} in {} of {}{names}", places.len(), rows.len()))
    };
    let parts = [
        told("holds", |verdict| *verdict == ClaimVerdict::Holds, false),
        told(
            "contradicted",
            |verdict| *verdict == ClaimVerdict::Contradicted,
            true,
        ),
        told(
            "inconclusive",
            |verdict| matches!(verdict, ClaimVerdict::Inconclusive(_)),
            false,
        ),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}

/// The environment and setting in which a row is judged.
pub fn place(row: &ClaimRow) -> String {
    let env = row
        .env
        .clone()
        .unwrap_or_else(|| amount::count(row.environments, "environment"));
    if row.setting.is_empty() {
        env
    } else {
        format!("{env}, {}", row.setting)
    }
}

/// A grid of one line per row.
fn details(data: &ClaimsData) -> Grid {
    grid_of(&data.rows)
}

/// A grid of the numbers of `rows`, one line each.
pub fn grid_of(rows: &[ClaimRow]) -> Grid {
    let headers = [
        "claim",
        "where",
        "difference or share",
        "95 % interval",
        "above",
        "seeds",
        "p",
        "verdict",
    ];
    let line = |row: &ClaimRow| {
        let smaller = row.p.map(|(opposite, itself)| opposite.min(itself));
        vec![
            row.claim.name.clone(),
            place(row),
            row.difference
                .map_or(String::new(), |it| within(it.mean, it.low, it.high)),
            row.difference.map_or(String::new(), |difference| {
                between(difference.low, difference.high)
            }),
            row.improvement
                .map_or(String::new(), |share| format!("{:.0} %", 100.0 * share)),
            seeds(row),
            smaller.map_or(String::new(), p),
            row.verdict.text(),
        ]
    };
    let numeric = headers
        .iter()
        .map(|header| !["claim", "where", "verdict"].contains(header))
        .collect();
    let headers = headers.map(str::to_owned).to_vec();
    Grid {
        headers,
        rows: rows.iter().map(line).collect(),
        names: 2,
        numeric,
    }
}

/// The finished and planned seeds of both sides, as `5 and 4 of 5`.
fn seeds(row: &ClaimRow) -> String {
    let one = |count: Count| match count.found == count.planned {
        true => count.found.to_string(),
        false => format!("{} of {}", count.found, count.planned),
    };
    [Some(row.seeds), row.than]
        .into_iter()
        .flatten()
        .map(one)
        .collect::<Vec<_>>()
        .join(" and ")
}

fn p(p: f64) -> String {
    if p < 0.001 {
        "<0.001".to_owned()
    } else {
        format!("{p:.3}")
    }
}

/// The rows, with every number in full.
///
/// # Errors
///
/// None that the csv crate gives for a buffer in memory.
pub fn csv(data: &ClaimsData) -> Result<Vec<u8>, csv::Error> {
    let headers = [
        "claim",
        "of",
        "is",
        "than",
        "on",
        "env",
        "setting",
        "difference",
        "low",
        "high",
        "limit",
        "improvement",
        "seeds",
        "planned_seeds",
        "than_seeds",
        "than_planned_seeds",
        "p_opposite",
        "p_claim",
        "verdict",
    ];
    let row = |row: &ClaimRow| {
        let claim = &row.claim;
        let is = match claim.is {
            Relation::Above => "above",
            Relation::Below => "below",
            Relation::Like => "like",
            Relation::Kept => "kept",
        };
        let whole = |count: Option<usize>| count.map_or(String::new(), |count| count.to_string());
        vec![
            // A spreadsheet would take a name that begins with `=` for a formula.
            escape::csv(&claim.name),
            escape::csv(&claim.of.to_string()),
            is.to_owned(),
            escape::csv(
                &claim
                    .than
                    .as_ref()
                    .map(Versus::to_string)
                    .unwrap_or_default(),
            ),
            claim.on.name().to_owned(),
            row.env.clone().unwrap_or_default(),
            escape::csv(&row.setting),
            number(row.difference.map(|difference| difference.mean)),
            number(row.difference.map(|difference| difference.low)),
            number(row.difference.map(|difference| difference.high)),
            // Without a difference, the limit is 0, which nobody asked for.
            number(row.difference.map(|_| row.limit)),
            number(row.improvement),
            whole(Some(row.seeds.found)),
            whole(Some(row.seeds.planned)),
            whole(row.than.map(|count| count.found)),
            whole(row.than.map(|count| count.planned)),
            number(row.p.map(|(opposite, _)| opposite)),
            number(row.p.map(|(_, itself)| itself)),
            row.verdict.text(),
        ]
    };
    written(&headers, data.rows.iter().map(row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        report::{fixture, recorded::Run},
        spec::Claim,
    };

    fn judged() -> ClaimsData {
        let claim = |text: &str| -> Claim { toml::from_str(text).expect("a claim") };
        let claims = [
            claim(
                "name = 'MCPO | beats PPO'\nof = 'algorithm=mcpo'\nis = 'above'\nthan = 'algorithm=ppo'\nmargin = 0.1",
            ),
            claim("name = '=cmd()'\nof = 'algorithm=mcpo'\nis = 'kept'"),
        ];
        let (ours, theirs) = ([500.0, 510.0, 490.0], [100.0, 110.0, 90.0]);
        let of = |env: &str, [mcpo, ppo]: [[f64; 3]; 2]| -> Vec<Run> {
            let run = |(seed, value): (u64, f64)| {
                fixture::mcpo(env, 1e-4, 1e-3, seed).finished(&[(100, &[value])])
            };
            let other =
                |(seed, value): (u64, f64)| fixture::ppo(env, seed).finished(&[(100, &[value])]);
            (0..)
                .zip(mcpo)
                .map(run)
                .chain((0..).zip(ppo).map(other))
                .collect()
        };
        let runs = [
            of("Hopper-v2", [ours, theirs]),
            of("Ant-v2", [theirs, ours]),
        ]
        .concat();
        ClaimsData::new(&claims, &runs)
    }

    #[test]
    fn markdown_has_a_line_a_claim_and_a_line_a_row() {
        let text = markdown(&judged());
        for line in [
            "| MCPO \\| beats PPO | return of algorithm=mcpo above that of algorithm=ppo, margin 0.1 of Expert - Random | \
             holds in 1 of 2; contradicted in 1 of 2 (Ant-v2) |",
            "| =cmd() | MMD² of algorithm=mcpo within d in 95 % of iterations once met | inconclusive in 2 of 2 |",
            "| MCPO \\| beats PPO | Hopper-v2 | 400.0 | 377.3 to 422.7 | 100 % | 3 and 3 | 0.003 | holds |",
            "| =cmd() | Ant-v2 | | | | 0 of 3 | | inconclusive: 0 seeds in Ant-v2; 3 are needed |",
        ] {
            let squeezed = text
                .lines()
                .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
            assert!(
                squeezed.into_iter().any(|found| found == line),
                "{line}\n{text}"
            );
        }
        assert!(
            shown(&judged(), Some(60)).contains("holds in 1 of 2"),
            "{}",
            shown(&judged(), Some(60))
        );
        let [bare, _] = latex("claims", &judged());
        assert!(
            bare.contains("MCPO $|$ beats PPO & Hopper-v2 & 400.0 &"),
            "{bare}"
        );
    }

    #[test]
    fn csv_has_every_number_in_full_and_no_formula() {
        let text = String::from_utf8(csv(&judged()).expect("written")).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 5, "{text}");
        assert!(lines[1].starts_with(
            "MCPO | beats PPO,algorithm=mcpo,above,algorithm=ppo,return,Hopper-v2,,400,377."
        ));
        assert!(
            lines[1].contains(",334.671") && lines[1].contains(",1,3,3,3,3,"),
            "{text}"
        );
        assert!(
            lines[3].starts_with("'=cmd(),algorithm=mcpo,kept,,return,Hopper-v2,,,,,,,0,3,,,,,"),
            "{text}"
        );
    }
}
