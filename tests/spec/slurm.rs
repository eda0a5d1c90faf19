//! `[slurm]`: checked like the rest of a file, and no part of any run.

use mcpo_run::plan::plan;

use super::{LEAST, parse};

const WHOLE: &str = r#"
    [slurm]
    partition = "short"
    account = "it's $(mine)"
    time = "4:00:00"
    memory = "2G"
    cpus = 4
    pack = 8
    throttle = 50
    grace = 60
    sbatch = ["--constraint=avx512", "--exclusive"]
"#;

#[test]
fn no_run_depends_on_what_a_cluster_is_asked_for() {
    let (without, with) = (
        parse(LEAST).expect("valid"),
        parse(&format!("{LEAST}{WHOLE}")).expect("valid"),
    );
    assert_eq!(
        with.slurm.account.as_ref().map(|account| account.as_str()),
        Some("it's $(mine)")
    );
    assert_ne!(with.slurm, without.slurm);
    assert_eq!(
        plan(&with).expect("a plan"),
        plan(&without).expect("a plan")
    );
}

#[test]
fn mistakes_are_told_where_they_were_made_and_all_at_once() {
    let text = format!(
        "{LEAST}[slurm]\npartiton = \"x\"\ntime = \"2h\"\nmemory = \"2GB\"\ncpus = 0\naccount = \"two\\nlines\"\n\
         sbatch = [\"--exclusive\", \"--array=0-9\", \"-p x\"]\n"
    );
    let errors = parse(&text).expect_err("all of it is wrong");
    let first = LEAST.matches('\n').count() + 2;
    let lines: Vec<Option<usize>> = errors.iter().map(|error| error.line()).collect();
    assert_eq!(
        lines,
        // Both wrong options of sbatch are told.
        (first..first + 6)
            .chain([first + 5])
            .map(Some)
            .collect::<Vec<_>>(),
        "{errors}"
    );
    let all = errors.to_string();
    for told in [
        "unknown key `partiton`",
        "`2h` is not a time",
        "`2GB` is not an amount",
        "slurm.cpus",
        "--array=0-9",
    ] {
        assert!(all.contains(told), "{told}: {all}");
    }
}
