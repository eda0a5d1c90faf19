//! The page of a report: in a browser, and of a large campaign.

use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
    process::Command,
};

use mcpo_run::{
    plan::plan,
    spec::{self, Overrides},
};

use crate::recorded::write;

/// What the script exits with where no browser is installed.
const SKIPPED: i32 = 77;

/// Markup that would tell on itself, wherever a file or a run can have text.
const HOSTILE: &str = r#"
name = "hostile"
description = "</title></script><script>window.hostile = 1</script><img src=x onerror='window.hostile = 1'>"
budget.env_steps = 8192

[[matrix]]
seed = [0, 1, 2]
env = ["Hopper-v2", "Ant-v2"]
algorithm = ["mcpo", "ppo"]

[[figures]]
name = "returns"
title = "\" onfocus=\"window.hostile = 1\" <b>returns</b>"
y = "return"
series = ["algorithm"]

[[tables]]
name = "table"
title = "<svg onload='window.hostile = 1'>"
rows = ["env"]
columns = "algorithm"

[[claims]]
name = "<b onclick='window.hostile = 1'>MCPO</b> & PPO"
of = "algorithm=mcpo"
is = "above"
than = "algorithm=ppo"
"#;

#[test]
fn a_reader_uses_the_page_in_a_browser_and_hostile_text_stays_text() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("hostile.toml");
    fs::write(&file, HOSTILE).expect("written");
    let runs =
        plan(&spec::load(&file, &Overrides::default()).expect("a valid file")).expect("a plan");
    for (index, run) in runs.iter().enumerate() {
        let returns =
            [1, 2, 3, 4].map(|n| (2048 * n, n == 4, 100.0 * n as f64 + 7.0 * index as f64));
        let rows = match index {
            0 => Err("</pre><script>window.hostile = 1</script>"),
            _ => Ok((&returns[..], &[(2048, 0.5)][..])),
        };
        write(run, &folder.path().join("results"), rows);
    }
    let mut report = Command::new(assert_cmd::cargo::cargo_bin("mcpo-run"));
    let output = report
        .current_dir(folder.path())
        .args(["report", "hostile.toml"])
        .output()
        .expect("it runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/report/browse.py");
    let page = folder.path().join("results/hostile/report/index.html");
    let told = match Command::new("python3").arg(script).arg(page).output() {
        Err(error) => format!("skipped: no python3 ({error})"),
        Ok(output) if output.status.code() == Some(SKIPPED) => {
            String::from_utf8_lossy(&output.stdout).into_owned()
        }
        Ok(output) => {
            let (stdout, stderr) = (
                String::from_utf8_lossy(&output.stdout),
                String::from_utf8_lossy(&output.stderr),
            );
            assert!(output.status.success(), "{stdout}{stderr}");
            return;
        }
    };
    // Not by a macro, whose text a test that passes swallows.
    drop(writeln!(
        io::stderr(),
        "the page was not tried in a browser: {}",
        told.trim()
    ));
}

/// A campaign of 2,000 runs, of 100 evaluations and 240 iterations each.
const CAMPAIGN: &str = r#"
name = "campaign"
description = "2,000 runs"
budget.env_steps = 245_760
evaluation.every = 2_457

[[matrix]]
seed = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]
env = ["Hopper-v2", "HalfCheetah-v2", "Walker2d-v2", "Ant-v2"]
algorithm = ["mcpo"]
d = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5]
epsilon = [0.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9]

[[figures]]
name = "returns"
title = "Returns"
y = "return"
series = ["d", "epsilon"]

[[figures]]
name = "mmd"
title = "The constraint"
y = "mmd"
series = ["d"]
log_y = true
only = "epsilon=0"

[[tables]]
name = "table"
title = "Returns"
rows = ["env", "d"]
columns = "epsilon"

[[claims]]
name = "Annealing helps"
of = "epsilon=1e-3"
is = "above"
than = "epsilon=0"
only = "d=1e-3"
"#;

/// The runs of a campaign that is written once.
fn campaign() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("campaign");
    let file = folder.join("campaign.toml");
    let whole = folder.join("whole");
    if fs::read_to_string(&whole).is_ok_and(|text| text == CAMPAIGN) {
        return folder;
    }
    fs::create_dir_all(&folder).expect("made");
    fs::write(&file, CAMPAIGN).expect("written");
    let spec = spec::load(&file, &Overrides::default()).expect("a valid file");
    let runs = plan(&spec).expect("a plan");
    assert_eq!(runs.len(), 2000);
    for (index, run) in runs.iter().enumerate() {
        let noise = |place: u64| (0.7 * (index as f64) + 1.3 * place as f64).sin();
        let returns = (1..=100).map(|n| (2457 * n, n == 100, 10.0 * n as f64 + 100.0 * noise(n)));
        let mmd = (1..=240).map(|n| (1024 * n, 1e-3 * (1.5 + noise(n))));
        let (returns, mmd): (Vec<_>, Vec<_>) = (returns.collect(), mmd.collect());
        write(run, &folder.join("results"), Ok((&returns, &mmd)));
    }
    fs::write(&whole, CAMPAIGN).expect("written");
    folder
}

#[test]
#[ignore = "writes 2,000 runs, which takes minutes the first time"]
fn a_campaign_of_2000_runs_is_reported_in_10_seconds_on_a_page_of_5_megabytes() {
    let folder = campaign();
    let binary = assert_cmd::cargo::cargo_bin("mcpo-run");
    let mut within_10_seconds_of_cpu = Command::new("sh");
    within_10_seconds_of_cpu
        .args(["-c", "ulimit -t 10; exec \"$0\" report campaign.toml"])
        .arg(binary);
    let output = within_10_seconds_of_cpu
        .current_dir(&folder)
        .output()
        .expect("it runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let page = fs::metadata(folder.join("results/campaign/report/index.html"))
        .expect("there")
        .len();
    assert!(page < 5_000_000, "{page} bytes");
}
