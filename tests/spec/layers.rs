//! Defaults, extended files, the file, environment variables, `--set` and `--axis`: who wins, and
//! who is blamed.

use std::{env, fs, path::Path, process::Command};

use mcpo_run::spec::{self, Overrides, Place};

use super::{LEAST, overrides, runs};

fn refused(set: &[&str], axis: &[&str]) -> Vec<(String, String)> {
    let text = format!("{LEAST}d = [0.1]\n");
    let errors =
        spec::parse(Path::new("test.toml"), &text, &overrides(set, axis)).expect_err("a mistake");
    let told = |error: &spec::SpecError| {
        let Place::Layer(layer) = &error.place else {
            panic!("blamed on the file: {error}")
        };
        (
            layer.clone(),
            format!(
                "{} / {}",
                error.message,
                error.label.clone().unwrap_or_default()
            ),
        )
    };
    errors.iter().map(told).collect()
}

#[test]
fn mistakes_on_the_command_line_name_the_argument() {
    for (set, fragments) in [
        ("budget.env_steps=-5", ["-5 is out of range", "1 or above"]),
        ("budget.env_steps=many", ["\"many\"", "a whole number"]),
        (
            "budget.env_step=5",
            ["unknown key `env_step`", "`env_steps`"],
        ),
        ("bugdet.env_steps=5", ["unknown key `bugdet`", "`budget`"]),
        (
            "budget.env_steps=100",
            ["smaller than one rollout", "at least one rollout"],
        ),
        (
            "algorithms.mcpo.mmd.samples=demo_state",
            ["unknown name `demo_state`", "`demo_states`"],
        ),
        (
            "environments.Hoper-v2.reward=dense",
            ["unknown environment `Hoper-v2`", "`Hopper-v2`"],
        ),
        ("budget", ["KEY=VALUE", "budget.env_steps"]),
        (
            "algorithms.mcpo.d=0.2",
            ["`d` is an axis of the matrix", "`--axis d=...`"],
        ),
        ("d=0.1", ["unknown key `d`", "[algorithms.NAME]"]),
    ] {
        let told = refused(&[set], &[]);
        assert_eq!(told.len(), 1, "{set}: {told:?}");
        assert_eq!(told[0].0, format!("--set {set}"));
        for fragment in fragments {
            assert!(told[0].1.contains(fragment), "{fragment} not in {told:?}");
        }
    }
    for (axis, fragments) in [
        ("seed=0,-1", ["-1 is out of range", "0 or above"]),
        (
            "seeds=0,1",
            ["no block of the matrix has the axis `seeds`", "`seed`"],
        ),
        (
            "env=Hopper-v2,Antt-v2",
            ["unknown environment `Antt-v2`", "`Ant-v2`"],
        ),
        ("d=0.1,0", ["0 is out of range", "above 0"]),
        ("seed=", ["the list of `seed` is empty", ""]),
        ("seed", ["KEY=VALUE", "seed=0,1"]),
    ] {
        let told = refused(&[], &[axis]);
        assert_eq!(told.len(), 1, "{axis}: {told:?}");
        assert_eq!(told[0].0, format!("--axis {axis}"));
        for fragment in fragments {
            assert!(told[0].1.contains(fragment), "{fragment} not in {told:?}");
        }
    }
}

#[test]
fn a_key_or_an_axis_given_twice_is_told() {
    let told = refused(&[], &["seed=0", "seed=7"]);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].0 == "--axis seed=7" && told[0].1.contains("the axis `seed` is given twice"),
        "{told:?}"
    );
    for (one, other, key) in [
        (
            "budget.env_steps=20480",
            "budget.env_steps=30720",
            "budget.env_steps",
        ),
        (
            "rollout={steps=2048}",
            "rollout.steps=4096",
            "rollout.steps",
        ),
    ] {
        let told = refused(&[one, other], &[]);
        assert_eq!(told.len(), 1, "{told:?}");
        assert_eq!(told[0].0, format!("--set {other}"));
        assert_eq!(
            told[0].1,
            format!("`{key}` is set twice / the first is `--set {one}`")
        );
    }
    assert_eq!(
        runs(
            "",
            &["rollout.steps=2048", "rollout.environments=4"],
            &["seed=0", "env=Ant-v2"]
        )
        .len(),
        2
    );
}

#[test]
fn what_is_no_second_value_is_one_run() {
    assert_eq!(runs("epsilon = [-0.0]\n", &[], &[]).len(), 8);
    assert_eq!(
        runs("epsilon = [-0.0]\n", &[], &[])[0].id,
        runs("epsilon = [0.0]\n", &[], &[])[0].id
    );
    let second = "\n[[matrix]]\nseed = [0, 1]\nenv = [\"Hopper-v2\"]\nalgorithm = [\"mcpo\"]\nepsilon = [0.0]\n";
    assert_eq!(
        runs(&format!("epsilon = [-0.0]\n{second}"), &[], &[]).len(),
        8
    );
    for list in [
        "epsilon = [0.0, -0.0]",
        "epsilon = [0, 0.0]",
        "\"mmd.bandwidth\" = [{ fixed = 1 }, { fixed = 1.0 }]",
    ] {
        let errors = super::parse(&format!("{LEAST}{list}\n"))
            .expect_err(list)
            .to_string();
        assert!(errors.contains("twice"), "{errors}");
    }
}

#[test]
fn an_axis_argument_replaces_the_list_in_every_block() {
    let second = "\n[[matrix]]\nseed = [5]\nenv = [\"Walker2d-v2\"]\nalgorithm = [\"mcpo\"]\nd = [0.1, 0.2]\n";
    assert_eq!(runs(second, &[], &[]).len(), 8 + 2);
    let replaced = runs(second, &[], &["seed=7"]);
    assert_eq!(replaced.len(), 4 + 2);
    assert!(replaced.iter().all(|run| run.seed.0 == 7));
    // Where a block does not have the axis, it gets none.
    assert_eq!(runs(second, &[], &["d=0.3"]).len(), 8 + 1);
    let only = runs("", &[], &["algorithm=ppo", "env=Pendulum-v2,Ant-v2"]);
    assert!(only.iter().all(|run| run.algorithm_name() == "ppo"));
    assert_eq!(only[0].id, "InvertedPendulum-v2/ppo/seed-0");
}

#[test]
fn a_stronger_layer_reaches_every_environment() {
    let own = "\n[environments.\"Ant-v2\"]\nbudget.env_steps = 200_000\nrollout.steps = 2048\nreward = \"dense\"\n";
    let ant = |set: &[&str]| {
        runs(own, set, &[])
            .into_iter()
            .find(|run| run.env.name() == "Ant-v2")
            .expect("it runs")
    };
    assert_eq!(ant(&[]).budget.env_steps.get(), 200_000);
    let set = ant(&["budget.env_steps=50000"]);
    assert_eq!(set.budget.env_steps.get(), 50_000);
    assert_eq!(set.rollout.steps.get(), 2048, "what was not set stays");
    assert_eq!(set.reward, mcpo_run::env::Reward::Dense);
    let set = ant(&[
        "environments.Ant-v2.budget.env_steps=60000",
        "algorithms.mcpo.max_kl=0.1",
    ]);
    assert_eq!(set.budget.env_steps.get(), 60_000);
    assert_eq!(set.value("mcpo.max_kl"), Some(toml::Value::Float(0.1)));
}

#[test]
fn a_file_wins_over_what_it_extends() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let base = format!(
        "{LEAST}\n[algorithms.mcpo]\nmax_kl = 0.02\ndamping = 0.5\n[environments.\"Ant-v2\"]\ndemonstrations = \"ant.parquet\"\n"
    );
    fs::create_dir(folder.path().join("base")).expect("a folder");
    fs::write(folder.path().join("base/base.toml"), &base).expect("a file");
    fs::write(
        folder.path().join("middle.toml"),
        "extends = \"base/base.toml\"\nname = \"middle\"\n",
    )
    .expect("a file");
    let path = folder.path().join("top.toml");
    fs::write(
        &path,
        "extends = \"middle.toml\"\nname = \"top\"\n[algorithms.mcpo]\nmax_kl = 0.03\n",
    )
    .expect("a file");
    let spec = spec::load(&path, &Overrides::default()).expect("a valid chain");
    assert_eq!(spec.name, "top");
    let runs = mcpo_run::plan::plan(&spec).expect("a plan");
    assert_eq!(runs[0].value("mcpo.max_kl"), Some(toml::Value::Float(0.03)));
    assert_eq!(runs[0].value("mcpo.damping"), Some(toml::Value::Float(0.5)));
    // A path starts at the folder of the file that names it.
    let ant = runs
        .iter()
        .find(|run| run.env.name() == "Ant-v2")
        .expect("it runs");
    assert_eq!(
        ant.demonstration.as_deref(),
        Some(folder.path().join("base/ant.parquet").as_path())
    );
    let hopper = runs[0].demonstration.as_deref();
    assert_eq!(
        hopper,
        Some(folder.path().join("base/demos/Hopper-v2.parquet").as_path())
    );
}

#[test]
fn a_missing_demonstration_is_told_before_runs_start_and_not_before() {
    let text =
        format!("{LEAST}\n[environments.\"Hopper-v2\"]\ndemonstrations = \"nowhere.parquet\"\n");
    let spec = spec::parse(Path::new("test.toml"), &text, &Overrides::default())
        .expect("a report can be drawn");
    let errors = spec.ready([
        Path::new("demos/Ant-v2.parquet"),
        Path::new("nowhere.parquet"),
    ]);
    let errors = errors.expect_err("the runs cannot start");
    let told: Vec<(Option<usize>, &str)> = errors
        .iter()
        .map(|error| (error.line(), error.message.as_str()))
        .collect();
    assert_eq!(
        told,
        [
            (
                Some(7),
                "the demonstration demos/Ant-v2.parquet of Ant-v2 does not exist"
            ),
            (
                Some(11),
                "the demonstration nowhere.parquet of Hopper-v2 does not exist"
            ),
        ]
    );
    assert_eq!(
        spec.ready([Path::new("nowhere.parquet")])
            .expect_err("one of them")
            .iter()
            .count(),
        1
    );
    spec.ready([]).expect("runs that need none can start");
}

/// Runs the ignored test `name` of this binary, alone, under one more environment variable.
fn under(variable: (&str, &str), name: &str) {
    let output = Command::new(env::current_exe().expect("this binary"))
        .args(["--exact", &format!("layers::{name}"), "--ignored"])
        .env(variable.0, variable.1)
        .output()
        .expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && text.contains("1 passed"),
        "{text}"
    );
}

#[test]
fn environment_variables_win_over_the_file_and_lose_to_arguments() {
    under(("MCPO_BUDGET__ENV_STEPS", "50000"), "with_a_budget");
    under(("MCPO_BUDGET__ENV_STEPS", "-3"), "with_a_negative_budget");
    under(("MCPO_BUGDET__ENV_STEPS", "3"), "with_an_unknown_key");
    under(
        ("MCPO_ALGORITHMS__MCPO__MMD__SAMPLES", "rollout"),
        "with_a_name",
    );
    under(("MCPO_BUDGET__ENV_STEPS", "50_000"), "with_a_budget");
    under(("MCPO_ALGORITHMS__PPO__CLIP", "1e-1"), "with_an_exponent");
    for no_number in [".001", "02048", "1,000", "[[[[", "1\nname = 'x'"] {
        under(("MCPO_BUDGET__ENV_STEPS", no_number), "with_no_number");
    }
    under(("MCPO_RESULTS", "elsewhere"), "with_the_folder_of_results");
    under(
        ("MCPO_NETWORK__HIDDEN", &"[".repeat(100_000)),
        "with_something_deep",
    );
    under(
        (&format!("MCPO_{}X", "A__".repeat(30_000)), "1"),
        "with_something_deep",
    );
}

const SMOKE: &str = "experiments/smoke.toml";

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_a_budget() {
    let budgets = |set: Vec<String>| {
        let spec = spec::load(Path::new(SMOKE), &Overrides { set, axis: vec![] }).expect("valid");
        mcpo_run::plan::plan(&spec)
            .expect("a plan")
            .into_iter()
            .map(|run| run.budget.env_steps.get())
    };
    assert!(budgets(vec![]).all(|steps| steps == 50_000));
    assert!(budgets(vec!["budget.env_steps=60000".into()]).all(|steps| steps == 60_000));
}

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_an_exponent() {
    let spec = spec::load(Path::new(SMOKE), &Overrides::default()).expect("valid");
    let runs = mcpo_run::plan::plan(&spec).expect("a plan");
    assert!(
        runs.iter()
            .any(|run| run.value("ppo.clip") == Some(toml::Value::Float(0.1)))
    );
}

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_no_number() {
    let variable = env::var("MCPO_BUDGET__ENV_STEPS").expect("it is set");
    let errors = spec::load(Path::new(SMOKE), &Overrides::default()).expect_err("a mistake");
    let set = vec![format!("budget.env_steps={variable}")];
    let text = fs::read_to_string(SMOKE).expect("readable");
    let same = spec::parse(Path::new(SMOKE), &text, &Overrides { set, axis: vec![] })
        .expect_err("a mistake");
    let told = |errors: &spec::SpecErrors| {
        errors
            .iter()
            .map(|error| error.message.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(
        told(&errors),
        told(&same),
        "a variable and an argument are read alike"
    );
    let refused = ["does not belong here", "out of range"];
    assert!(
        told(&errors)
            .iter()
            .all(|message| refused.iter().any(|words| message.contains(words))),
        "{errors}"
    );
}

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_the_folder_of_results() {
    spec::load(Path::new(SMOKE), &Overrides::default()).expect("it is no key of a matrix");
}

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_something_deep() {
    spec::load(Path::new(SMOKE), &Overrides::default())
        .expect_err("refused, and no end of the stack");
}

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_a_negative_budget() {
    let errors = spec::load(Path::new(SMOKE), &Overrides::default())
        .expect_err("a mistake")
        .to_string();
    assert!(
        errors.contains(
            "environment variable MCPO_BUDGET__ENV_STEPS: `budget.env_steps`: -3 is out of"
        ),
        "{errors}"
    );
}

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_an_unknown_key() {
    let errors = spec::load(Path::new(SMOKE), &Overrides::default())
        .expect_err("a mistake")
        .to_string();
    assert!(
        errors.contains("environment variable MCPO_BUGDET__ENV_STEPS: unknown key `bugdet`"),
        "{errors}"
    );
    assert!(
        errors.contains("the nearest known key is `budget`"),
        "{errors}"
    );
}

#[test]
#[ignore = "needs a variable, which another test sets"]
fn with_a_name() {
    let spec = spec::load(Path::new(SMOKE), &Overrides::default()).expect("valid");
    let runs = mcpo_run::plan::plan(&spec).expect("a plan");
    assert_eq!(
        runs[0].value("mmd.samples"),
        Some(toml::Value::String("rollout".into()))
    );
}
