use super::*;
use crate::report::fixture;

fn runs(d: f64, values: &[f64]) -> Vec<Run> {
    let run = |(seed, value): (usize, &f64)| {
        fixture::mcpo("HalfCheetah-v2", d, 0.0, seed as u64).finished(&[(100, &[*value])])
    };
    values.iter().enumerate().map(run).collect()
}

#[test]
fn what_was_set_aside_is_not_compared() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = runs(1e-3, &[3000.0]).remove(0);
    fixture::record(&run, folder.path());
    let home = folder.path().join(&run.spec.experiment);
    let kept = home.join("runs").join(&run.spec.id);
    for aside in ["seed-0.old-1", "seed-0.partial"] {
        let aside = kept.with_file_name(aside);
        fs::create_dir(&aside).expect("made");
        fs::copy(RunPaths::manifest(&kept), RunPaths::manifest(&aside)).expect("copied");
    }
    let (found, remarks) = in_folder(&home).expect("readable");
    assert_eq!((found.len(), remarks), (1, Vec::new()));
}

/// The margin of HalfCheetah is 450.936.
fn verdict(first: &[f64], second: &[f64]) -> Verdict {
    CompareData::new(&runs(1e-3, first), &runs(1e-3, second))
        .rows
        .remove(0)
        .verdict
}

#[test]
fn the_margin_decides() {
    let base = [3000.0, 3010.0, 2990.0];
    assert_eq!(
        verdict(&base, &[3100.0, 3110.0, 3090.0]),
        Verdict::Reproduced
    );
    assert_eq!(verdict(&base, &[4000.0, 4010.0, 3990.0]), Verdict::Better);
    assert_eq!(verdict(&base, &[2000.0, 2010.0, 1990.0]), Verdict::Worse);
    assert!(matches!(
        verdict(&base, &[1000.0, 5000.0, 3000.0]),
        Verdict::Inconclusive(_)
    ));
    assert!(matches!(
        verdict(&base, &[3000.0, 3000.0]),
        Verdict::NotComparable(reason) if reason.contains("2 seeds")
    ));
}

#[test]
fn a_run_that_failed_counts_against_a_verdict() {
    let first = runs(1e-3, &[3000.0, 3010.0, 2990.0]);
    let mut second = runs(1e-3, &[3000.0, 3010.0, 2990.0]);
    second.push(fixture::mcpo("HalfCheetah-v2", 1e-3, 0.0, 3).failed("diverged"));
    let row = CompareData::new(&first, &second).rows.remove(0);
    assert!(matches!(row.verdict, Verdict::Inconclusive(_)), "{row:?}");
    assert_eq!(row.seeds, [(3, 3), (3, 4)]);
}

/// `scipy.stats.ttest_ind(b, a, equal_var=False).confidence_interval(0.90)` (SciPy 1.17.1).
#[test]
fn the_interval_is_welchs() {
    let (a, b) = ([3000.0, 3200.0, 2900.0, 3100.0], [3300.0, 3900.0, 3500.0]);
    let row = CompareData::new(&runs(1e-3, &a), &runs(1e-3, &b))
        .rows
        .remove(0);
    let found = row.difference.expect("enough seeds");
    assert!((found.mean - 516.6666666666667).abs() < 1e-9, "{found:?}");
    assert!(
        (found.low - 40.138019566892694).abs() < 1e-4
            && (found.high - 993.1953137664401).abs() < 1e-4,
        "{found:?}"
    );
}

#[test]
fn cells_of_the_same_settings_meet_under_other_names_and_the_rest_is_named() {
    let first = [runs(1e-3, &[1.0]), runs(1.0, &[1.0])].concat();
    let mut second = runs(1e-3, &[2.0]);
    second[0].spec.id = "HalfCheetah-v2/mcpo/seed-0".to_owned();
    let data = CompareData::new(&first, &second);
    assert_eq!(data.rows.len(), 1);
    assert_eq!(data.rows[0].called.as_deref(), Some("HalfCheetah-v2/mcpo"));
    assert!(
        data.notes
            .iter()
            .any(|note| note.contains("Only in A: HalfCheetah-v2/mcpo-d=1")),
        "{:?}",
        data.notes
    );
    // Of one name, whatever was set.
    second[0].spec.id = first[1].spec.id.clone();
    let data = CompareData::new(&first[1..], &second);
    assert_eq!(data.rows[0].changes, ["mcpo.d: 1 -> 0.001"]);
}

#[test]
fn a_folder_is_read_without_its_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let written = runs(1e-3, &[1.0, 2.0]);
    written
        .iter()
        .for_each(|run| fixture::record(run, folder.path()));
    let (read, remarks) = in_folder(&folder.path().join("made-up")).expect("readable");
    assert_eq!(remarks, [""; 0]);
    let ids = |runs: &[Run]| {
        runs.iter()
            .map(|run| run.spec.id.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(ids(&read), ids(&written));
    fs::write(
        RunPaths::manifest(&folder.path().join("made-up/runs").join(&written[0].spec.id)),
        "{",
    )
    .expect("damaged");
    let (read, remarks) = in_folder(&folder.path().join("made-up")).expect("readable");
    assert!(
        read.len() == 1 && remarks[0].contains("seed-0 is left out"),
        "{remarks:?}"
    );
    assert!(in_folder(&folder.path().join("nothing")).is_err());
}
