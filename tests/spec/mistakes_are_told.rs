//! Every file of `mistakes/` is refused, with all of its mistakes at their line and column.

use std::{fs, path::Path, process::Command, time::Duration};

use mcpo_run::spec::{self, Overrides, Place, SpecErrors};
use proptest::prelude::*;

use super::{LEAST, parse};

/// Line, column, a piece of the message, and a piece of what stands at the caret.
pub type Told = (usize, usize, &'static str, &'static str);

pub const MISTAKES: &[(&str, &[Told])] = &[
    (
        "algorithm_that_is_a_number",
        &[(
            9,
            14,
            "an algorithm cannot be a whole number",
            "expected its name",
        )],
    ),
    (
        "axis_given_twice",
        &[(11, 1, "the axes `d` and `mcpo.d` are the same", "")],
    ),
    (
        "axis_that_is_no_list",
        &[(10, 5, "the axis `d` cannot be", "expected a list")],
    ),
    (
        "axis_that_no_algorithm_has",
        &[(
            10,
            1,
            "no algorithm of this block has `d`: it runs `ppo`",
            "`checkpoint.every_seconds`, `checkpoint.keep_policy_every`, `clip`, `demonstrations`, `discount`",
        )],
    ),
    (
        "axis_value_of_wrong_type",
        &[(10, 12, "\"small\"", "expected a number")],
    ),
    (
        "axis_value_out_of_range",
        &[(10, 12, "0 is out of range", "above 0")],
    ),
    (
        "axis_without_quotes",
        &[(10, 1, "unknown axis `mcpo`", "`\"mcpo.max_kl\" = [...]`")],
    ),
    (
        "bad_syntax",
        &[
            (4, 13, "a value is missing", "expected a value"),
            (10, 20, "unclosed array", "expected `]`"),
        ],
    ),
    (
        "budget_below_one_rollout",
        &[(
            4,
            13,
            "1000 is smaller than one rollout",
            "at least one rollout",
        )],
    ),
    (
        "choice_that_is_its_name_alone",
        &[(2, 10, "more belongs to `sparse2`", "`distance`")],
    ),
    (
        "claim_of_a_demonstrations_column",
        &[(15, 8, "a demonstration has a return, but no `mmd`", "")],
    ),
    (
        "claim_of_an_unknown_kind",
        &[(
            14,
            8,
            "unknown name `better`; the known ones are `above`",
            "",
        )],
    ),
    (
        "claim_of_likeness_without_a_margin",
        &[(11, 1, "`like` needs a `margin`", "above 0")],
    ),
    ("claim_of_nothing", &[(11, 1, "this claim has no `of`", "")]),
    (
        "claim_of_unknown_runs",
        &[(
            13,
            8,
            "unknown algorithm `mcpoo` in a selection; the nearest known one is `mcpo`",
            "",
        )],
    ),
    (
        "claim_on_an_unknown_column",
        &[(16, 8, "unknown column `retrun`", "`return`")],
    ),
    (
        "claim_on_words",
        &[(16, 8, "`case` holds words; a claim is about numbers", "")],
    ),
    (
        "claim_that_is_kept_than",
        &[
            (
                15,
                10,
                "`than` means nothing for a constraint that is kept",
                "",
            ),
            (
                16,
                10,
                "`share`: 1.5 is out of range",
                "a number from 0 to 1",
            ),
        ],
    ),
    (
        "claim_with_a_margin_that_is_none",
        &[(16, 10, "`margin` is not a finite number", "")],
    ),
    (
        "claim_with_an_unknown_key",
        &[(16, 1, "unknown key `margn` of a claim", "`margin`")],
    ),
    (
        "claim_without_the_other_side",
        &[(11, 1, "this claim has no `than`", "`demonstration`")],
    ),
    (
        "column_that_is_a_list",
        &[(
            15,
            11,
            "`columns`: a list does not belong here",
            "expected a string",
        )],
    ),
    (
        "dates",
        &[
            (1, 15, "`description` cannot be a time", "expected a string"),
            (
                5,
                13,
                "`budget.env_steps`: the date 2024-01-01 does not belong here",
                "expected a whole number",
            ),
            (8, 14, "a seed cannot be a date", "a whole number"),
            (
                11,
                14,
                "`d`: the time 12:30:00 does not belong here",
                "expected a number",
            ),
            (
                14,
                11,
                "`network.hidden`: the date 2024-02-29 does not belong here",
                "expected a whole number",
            ),
            (
                17,
                23,
                "the date and time 2024-01-01T00:00:00Z does not belong here",
                "expected a number",
            ),
        ],
    ),
    ("duplicate_key", &[(5, 1, "duplicate key", "")]),
    ("empty_list", &[(7, 13, "the list of `seed` is empty", "")]),
    (
        "empty_matrix",
        &[(2, 10, "`matrix` is empty", "write a `[[matrix]]` block")],
    ),
    (
        "environment_twice",
        &[(8, 29, "lists InvertedPendulum-v2 twice", "")],
    ),
    (
        "extends_a_folder",
        &[(1, 11, "it is a folder, not a file", "")],
    ),
    (
        "extends_a_missing_file",
        &[(1, 11, "not_there.toml: there is no such file", "")],
    ),
    ("extends_itself", &[(1, 11, "ends up extending itself", "")]),
    (
        "figure_of_an_unknown_column",
        &[(14, 10, "unknown y `retrun`", "`return`")],
    ),
    (
        "figure_of_an_unknown_series",
        &[(15, 11, "unknown axis `epsilom`", "`epsilon`")],
    ),
    (
        "figure_of_unknown_runs",
        &[(
            16,
            8,
            "unknown env `Hoper-v2` in a selection; the nearest known one is `Hopper-v2`",
            "",
        )],
    ),
    (
        "figure_with_an_unknown_key",
        &[(16, 1, "unknown key `logy`", "`log_y`")],
    ),
    ("figure_without_y", &[(11, 1, "this figure has no `y`", "")]),
    (
        "hidden_name",
        &[(
            1,
            8,
            "`.broken` cannot name a file",
            "not starting with `.`",
        )],
    ),
    (
        "key_of_another_algorithm",
        &[(
            12,
            1,
            "unknown key `clip` of `mcpo`",
            "the known ones are `",
        )],
    ),
    (
        "list_for_a_table",
        &[(3, 1, "`budget` cannot be a list", "")],
    ),
    (
        "list_for_the_fields_of_a_choice",
        &[(2, 22, "a list does not belong here", "expected a table")],
    ),
    (
        "many_mistakes",
        &[
            (
                4,
                13,
                "`budget.env_steps`: -5 is out of range",
                "1 or above",
            ),
            (7, 17, "a seed cannot be a string", "a whole number"),
            (9, 22, "unknown algorithm `pp`", "`ppo`"),
            (10, 17, "`epsilon`: -1 is out of range", "0 or above"),
            (13, 1, "unknown key `max_klp` of `mcpo`", "`max_kl`"),
            (
                14,
                11,
                "`damping`: the string \"high\"",
                "expected a number",
            ),
            (
                17,
                16,
                "`rollout.environments`: 0 is out of range",
                "1 or above",
            ),
            (19, 15, "unknown environment `Ant-v3`", "`Ant-v2`"),
        ],
    ),
    (
        "matrix_that_is_a_table",
        &[(
            6,
            1,
            "`matrix` cannot be a table",
            "each headed `[[matrix]]`",
        )],
    ),
    (
        "minibatch_above_the_rollout",
        &[(
            12,
            9,
            "minibatch 128 is larger than the rollout",
            "no larger",
        )],
    ),
    (
        "missing_bracket",
        &[(8, 1, "the list above is not closed", "`]` before this line")],
    ),
    (
        "missing_bracket_after_a_comma",
        &[(8, 1, "the list above is not closed", "`]` before this line")],
    ),
    (
        "missing_budget",
        &[(1, 1, "no budget.env_steps for Hopper-v2", "`[budget]`")],
    ),
    (
        "missing_matrix",
        &[(1, 1, "`matrix` is missing", "`[[matrix]]`")],
    ),
    (
        "missing_name",
        &[(1, 1, "`name` is missing", "`name = \"...\"`")],
    ),
    (
        "missing_seed",
        &[(6, 1, "this block has no `seed`", "`seed = [...]`")],
    ),
    (
        "name_that_leads_outside",
        &[(1, 8, "`../broken` cannot name a file", "expected letters")],
    ),
    (
        "names_of_other_files",
        &[
            (
                12,
                10,
                "`README` is the name of one of the report's own files",
                "",
            ),
            (
                18,
                11,
                "`Claims` is the name of one of the report's own files",
                "another name",
            ),
            (
                24,
                11,
                "`returns-seeds` is the name of one of the report's own files",
                "",
            ),
            (
                30,
                11,
                "`return-curves` is the name of one of the report's own files",
                "",
            ),
            (
                36,
                11,
                "`statistics` is the name of one of the report's own files",
                "",
            ),
        ],
    ),
    (
        "negative_budget",
        &[(
            4,
            13,
            "-100000 is out of range",
            "a whole number, 1 or above",
        )],
    ),
    (
        "negative_seed",
        &[(7, 17, "the seed -1 is out of range", "0 or above")],
    ),
    (
        "nothing",
        &[
            (1, 1, "`name` is missing", "`name = "),
            (1, 1, "`matrix` is missing", "`[[matrix]]`"),
        ],
    ),
    (
        "number_beyond_64_bits",
        &[(
            4,
            13,
            "99999999999999999999 is out of range",
            "a whole number that fits in 64 bits",
        )],
    ),
    (
        "number_beyond_any",
        &[(2, 35, "1e400 is out of range", "not beyond 1.8e308")],
    ),
    (
        "number_that_is_none",
        &[(
            12,
            10,
            "`max_kl`: NaN is out of range",
            "a finite number above 0",
        )],
    ),
    (
        "number_with_a_point",
        &[(4, 13, "100000.0 does not belong here", "such as 100000")],
    ),
    (
        "out_of_range",
        &[(12, 12, "`discount`: 1 is out of range", "from 0 to below 1")],
    ),
    (
        "out_of_range_inside_a_choice",
        &[(12, 35, "-1 is out of range", "above 0")],
    ),
    (
        "reward_of_another_environment",
        &[(12, 10, "`sparse1` is not a reward", "`dense` or `sparse2`")],
    ),
    (
        "reward_of_two_kinds",
        &[(
            12,
            10,
            "this table does not hold exactly one choice",
            "one of `dense`, `sparse1`",
        )],
    ),
    (
        "reward_that_is_a_number",
        &[(
            12,
            10,
            "this is neither a name nor a table",
            "expected one of `dense`",
        )],
    ),
    (
        "robot_called_like_one_that_ships",
        &[(
            12,
            1,
            "`model` cannot be set: Hopper-v2 ships with the program",
            "a name of its own",
        )],
    ),
    (
        "rollout_that_does_not_divide",
        &[(
            12,
            9,
            "4096 cannot be shared among rollout.environments 7",
            "a multiple",
        )],
    ),
    (
        "seed_beyond_64_bits",
        &[(
            7,
            9,
            "the seed 18446744073709551616 is out of range",
            "0 or above",
        )],
    ),
    ("seed_twice", &[(7, 20, "`seed` lists 0 twice", "")]),
    (
        "selection_without_a_value",
        &[(
            16,
            8,
            "`algorithm` is not of the form KEY=VALUE or KEY!=VALUE",
            "",
        )],
    ),
    (
        "string_without_end",
        &[(1, 15, "invalid basic string", "expected `\"`")],
    ),
    (
        "table_name_that_leads_outside",
        &[(12, 11, "`a/b` cannot name a file", "expected letters")],
    ),
    (
        "table_with_an_unknown_reference",
        &[(16, 13, "unknown reference `tabel5`", "`table5`")],
    ),
    (
        "too_many_episodes",
        &[(2, 23, "episodes of one evaluation", "1000000 at most")],
    ),
    (
        "two_claims_of_one_name",
        &[
            (18, 9, "two claims are called `MCPO is better`", ""),
            (22, 9, "`share` is only for a constraint that is `kept`", ""),
        ],
    ),
    (
        "two_figures_of_one_name",
        &[(18, 10, "two figures are called `figure`", "")],
    ),
    (
        "two_slips",
        &[
            (4, 8, "unclosed table", "expected `]`"),
            (14, 10, "a value is missing", "expected a value"),
        ],
    ),
    (
        "unknown_algorithm",
        &[(9, 14, "unknown algorithm `mcp`", "`mcpo`")],
    ),
    (
        "unknown_algorithm_table",
        &[(11, 13, "unknown algorithm `pppo`", "`ppo`")],
    ),
    (
        "unknown_block_key",
        &[(10, 1, "unknown axis `sed`", "`seed`")],
    ),
    (
        "unknown_enum_value",
        &[(
            12,
            11,
            "unknown name `demo_state`; the known ones are `demo_states` and `rollout`",
            "`demo_states`",
        )],
    ),
    (
        "unknown_environment",
        &[(8, 14, "unknown environment `Hoper-v2`", "`Hopper-v2`")],
    ),
    (
        "unknown_environment_key",
        &[(12, 1, "unknown key `rewards` of Hopper-v2", "`reward`")],
    ),
    (
        "unknown_environment_table",
        &[(
            11,
            15,
            "unknown environment `HalfCheeta-v2`",
            "`HalfCheetah-v2`",
        )],
    ),
    (
        "unknown_hyperparameter",
        &[(12, 1, "unknown key `max_klp` of `mcpo`", "`max_kl`")],
    ),
    (
        "unknown_nested_hyperparameter",
        &[(12, 1, "unknown key `sample` in `mmd`", "`samples`")],
    ),
    (
        "unknown_reward",
        &[(12, 12, "unknown name `sparse4`", "`sparse1`")],
    ),
    (
        "unknown_reward_field",
        &[(
            12,
            24,
            "unknown key `distanc`; the known ones are `distance` and `mode`",
            "`distance`",
        )],
    ),
    (
        "unknown_root_key",
        &[(3, 2, "unknown key `bugdet`", "`budget`")],
    ),
    (
        "unknown_section_key",
        &[(4, 1, "unknown key `env_step` in `budget`", "`env_steps`")],
    ),
    (
        "windows_line_ends",
        &[(12, 1, "unknown key `max_klp` of `mcpo`", "`max_kl`")],
    ),
    (
        "wrong_name_inside_a_choice",
        &[(2, 47, "unknown name `beyon`", "`beyond`")],
    ),
    (
        "wrong_type",
        &[(
            4,
            13,
            "`budget.env_steps`: the string \"many\"",
            "a whole number",
        )],
    ),
];

/// Mistakes that stand in a file that the fixture extends.
const EXTENDED: &[(&str, &str, Told)] = &[
    (
        "extends_in_a_circle",
        "circle.base",
        (1, 11, "ends up extending itself", ""),
    ),
    (
        "mistake_in_what_it_extends",
        "mistaken.base",
        (3, 1, "unknown key `episode` in `evaluation`", "`episodes`"),
    ),
];

fn refused(name: &str) -> SpecErrors {
    let path = Path::new("tests/spec/mistakes")
        .join(name)
        .with_extension("toml");
    match spec::load(&path, &Overrides::default()) {
        Ok(_) => panic!("{} was accepted", path.display()),
        Err(errors) => errors,
    }
}

fn assert_told(name: &str, errors: &SpecErrors, told: &[Told]) {
    assert_eq!(errors.iter().count(), told.len(), "{name}: {errors}");
    for (error, (line, column, message, label)) in errors.iter().zip(told) {
        assert_eq!(
            (error.line(), error.column()),
            (Some(*line), Some(*column)),
            "{name}: {errors}"
        );
        assert!(
            error.message.contains(message),
            "{name}: not {message:?}: {errors}"
        );
        assert!(
            error.label.as_deref().unwrap_or_default().contains(label),
            "{name}: not {label:?}: {errors}"
        );
    }
}

#[test]
fn every_mistake_is_told_at_its_line_and_column() {
    for (name, told) in MISTAKES {
        assert_told(name, &refused(name), told);
    }
    for (name, file, told) in EXTENDED {
        let errors = refused(name);
        assert_told(name, &errors, &[*told]);
        let blamed = errors
            .iter()
            .all(|error| matches!(&error.place, Place::File { path, .. } if path.ends_with(file)));
        assert!(blamed, "{errors}");
    }
}

#[test]
fn the_program_refuses_every_mistake_with_code_2_and_writes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let results = folder.path().join("results");
    for (name, told) in MISTAKES {
        let path = format!("tests/spec/mistakes/{name}.toml");
        let mut program = Command::new(env!("CARGO_BIN_EXE_mcpo-run"));
        let output = program
            .arg(&path)
            .arg("--results")
            .arg(&results)
            .output()
            .expect("it starts");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{name}: {stderr}");
        for (line, column, ..) in *told {
            assert!(
                stderr.contains(&format!("{path}:{line}:{column}]")),
                "{name}: {stderr}"
            );
        }
        assert!(!results.exists(), "{name}: something was written");
    }
}

#[test]
fn a_file_that_is_no_text_is_told_by_its_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("binary.toml");
    fs::write(&path, b"name = 'x'\ny = '\xc3\xa9\xff'\n").expect("written");
    let errors = spec::load(&path, &Overrides::default())
        .expect_err("no text")
        .to_string();
    assert!(
        errors.contains("not UTF-8 text: line 2, column 7"),
        "{errors}"
    );
}

#[test]
fn every_fixture_is_asserted() {
    let asserted: Vec<&str> = MISTAKES
        .iter()
        .map(|(name, _)| *name)
        .chain(EXTENDED.iter().map(|(name, ..)| *name))
        .collect();
    for entry in fs::read_dir("tests/spec/mistakes").expect("the folder is there") {
        let path = entry.expect("its entries can be read").path();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let name = path
                .file_stem()
                .expect("a file has a name")
                .to_string_lossy();
            assert!(asserted.contains(&name.as_ref()), "{name}");
        }
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let errors = spec::load(Path::new("no/such/file.toml"), &Overrides::default())
        .expect_err("it is not there");
    assert_eq!(
        errors.to_string().trim(),
        "x no/such/file.toml: there is no such file"
    );
}

#[test]
fn the_plain_rendering_shows_file_line_text_and_caret() {
    let expected = "  x unknown key `max_klp` of `mcpo`
    ,-[tests/spec/mistakes/unknown_hyperparameter.toml:12:1]
 11 | [algorithms.mcpo]
 12 | max_klp = 5e-3
    : ^^^|^^^
    :    `-- the nearest known key is `max_kl`
    `----
";
    let errors = refused("unknown_hyperparameter");
    assert_eq!(errors.render(false), expected);
    assert!(
        errors.render(true).contains("╰──"),
        "a terminal gets box drawing"
    );
}

/// The time that this thread has had of a processor, whatever else the machine does; on systems
/// that do not tell it, none.
fn processor_time() -> Duration {
    let told = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = told
        .split_whitespace()
        .next()
        .and_then(|first| first.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or(0))
}

#[test]
fn the_number_of_mistakes_or_entries_does_not_slow_the_answer() {
    let many = |line: fn(usize) -> String| (0..10_000).map(line).collect::<String>();
    let texts = [
        format!("{}{LEAST}", many(|n| format!("unknown_{n} = {n}\n"))),
        format!("{LEAST}{}", many(|n| format!("axis_{n} = [{n}]\n"))),
        format!(
            "{LEAST}[algorithms.mcpo]\n{}",
            many(|n| format!("key_{n} = {n}\n"))
        ),
        format!("{LEAST}d = [{}]\n", many(|n| format!("-{n}, "))),
        format!(
            "{LEAST}d = [{}\n{}",
            "0.5, ",
            many(|n| format!("key_{n} = {n}\n"))
        ),
        LEAST.replace(
            "[0, 1]",
            &format!(
                "[{}]",
                (0..100_000)
                    .map(|n| format!("{}, ", n / 2))
                    .collect::<String>()
            ),
        ),
    ];
    for text in texts {
        let began = processor_time();
        let errors = parse(&text).expect_err("many mistakes");
        let shown = errors.render(true);
        // A square took half a minute.
        let took = processor_time() - began;
        assert!(
            took < Duration::from_secs(2),
            "{took:?} for {}",
            &text[..80]
        );
        assert!(shown.len() < 100_000, "{} bytes", shown.len());
        assert!(
            errors.iter().count() <= 50 || shown.contains("errors, of which 50 are shown"),
            "{shown}"
        );
    }
    let began = processor_time();
    let seeds: String = (0..20_000).map(|n| format!("{n}, ")).collect();
    let text = LEAST
        .replace("[0, 1]", &format!("[{seeds}]"))
        .replace("\"mcpo\", ", "")
        .replace(", \"Ant-v2\"", "");
    assert_eq!(parse(&text).expect("nothing is wrong").named_runs(), 20_000);
    let took = processor_time() - began;
    assert!(took < Duration::from_secs(2), "{took:?}");
}

#[test]
fn a_mistake_far_out_in_a_line_is_told_without_its_text() {
    let text = LEAST.replace(
        "name = \"least\"",
        &format!("name = \"least\"{}# \u{e9}", " ".repeat(70_000)),
    );
    let text = text.replace(
        "budget.env_steps = 100_000",
        &format!("{}budget.env_steps = -1", " ".repeat(70_000)),
    );
    for terminal in [false, true] {
        let shown = parse(&text)
            .expect_err("a negative budget")
            .render(terminal);
        assert!(
            shown.contains("test.toml:3:70020: `budget.env_steps`: -1 is out of range"),
            "{shown}"
        );
        assert!(shown.contains("1 or above") && shown.len() < 500, "{shown}");
    }
}

#[test]
fn a_matrix_of_too_many_runs_is_refused_at_once() {
    let values = |count: usize| {
        (1..=count)
            .map(|value| value.to_string())
            .collect::<Vec<_>>()
            .join(",")
    };
    let text = format!(
        "{LEAST}d = [{0}]\nepsilon = [{0}]\n\"mcpo.damping\" = [{0}]\n\"mcpo.max_kl\" = [{0}]\n",
        values(300)
    );
    let errors = parse(&text).expect_err("a slip of the pen");
    assert!(
        errors
            .iter()
            .any(|error| error.message.contains("are allowed")),
        "{errors}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever is cut from or pasted into a valid file, there is an answer, and every place lies
    /// in the file.
    #[test]
    fn no_text_makes_the_reader_panic(
        cut in 0_usize..1000,
        length in 0_usize..40,
        paste in "[\\[\\]={}\"'.,#a-z0-9_\\-\n \u{e9}\u{0}]{0,12}",
    ) {
        let text: Vec<char> = format!("{LEAST}d = [1e-3]\n[algorithms.mcpo]\nmmd = {{ samples = \"rollout\" }}\n").chars().collect();
        let start = cut % text.len();
        let end = (start + length).min(text.len());
        let broken: String = text[..start].iter().copied().chain(paste.chars()).chain(text[end..].iter().copied()).collect();
        if let Err(errors) = parse(&broken) {
            prop_assert!(!errors.render(true).is_empty());
            let lines = broken.lines().count() + 1;
            prop_assert!(errors.iter().all(|error| error.line().is_none_or(|line| line <= lines)));
        }
    }
}
