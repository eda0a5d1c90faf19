//! The nearest known name, and mistakes in words for people.

use crate::fit::Fault;

/// The one of `known` that was probably meant by `name`: at most a third of its letters differ,
/// whatever their case.
pub(super) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LONGEST: usize = 100;
    if name.len() > LONGEST {
        return None;
    }
    let name = name.to_lowercase();
    let distances = known.into_iter().map(|known| {
        (
            strsim::damerau_levenshtein(&name, &known.to_lowercase()),
            known,
        )
    });
    let (distance, nearest) = distances.min_by_key(|(distance, _)| *distance)?;
    (3 * distance <= name.chars().count().max(nearest.chars().count())).then_some(nearest)
}

/// The most names that are listed where none is near.
const MOST_LISTED: usize = 40;

/// "the nearest known key is `max_kl`", where `what` is "key"; the list of known names if none is
/// near.
pub(super) fn nearest_label<'a>(
    what: &str,
    name: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    let mut names: Vec<&str> = Vec::new();
    known.into_iter().for_each(|known| {
        if !names.contains(&known) {
            names.push(known)
        }
    });
    if let Some(nearest) = nearest(name, names.iter().copied()) {
        return Some(format!("the nearest known {what} is `{nearest}`"));
    }
    // `ppo.clip` is `clip` where that is known too.
    let all = names.clone();
    names.retain(|name| {
        name.split_once('.')
            .is_none_or(|(_, shared)| !all.contains(&shared))
    });
    let (most, others) = names.split_at_checked(MOST_LISTED).unwrap_or((&names, &[]));
    let more = if others.is_empty() {
        String::new()
    } else {
        format!(", and {} more", others.len())
    };
    match most {
        [] => None,
        [only] => Some(format!("the only one is `{only}`")),
        _ => Some(format!(
            "the known ones are {}{more}",
            list(most.iter().copied())
        )),
    }
}

/// Joins names as in "`a`, `b` and `c`".
pub(super) fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
    match names.as_slice() {
        [] => "nothing".into(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// A mistake in plain words, and the label for the caret.
pub(super) fn words(fault: &Fault) -> (String, Option<String>) {
    let expected = |expected: &str| Some(format!("expected {expected}"));
    match fault {
        Fault::Type { found, expected: e } => {
            (format!("{found} does not belong here"), expected(e))
        }
        Fault::Range { found, expected: e } => (format!("{found} is out of range"), expected(e)),
        Fault::Length { found, expected: e } => {
            (format!("a list of {found} does not fit"), expected(e))
        }
        Fault::UnknownKey { key, known } => unknown("key", key, known),
        Fault::UnknownName { name, known } => unknown("name", name, known),
        Fault::MissingKey(key) => (
            format!("`{key}` is missing"),
            Some(format!("write `{key} = ...`")),
        ),
        Fault::NoChoice { known } => (
            "this is neither a name nor a table".to_owned(),
            expected(&one_of(known)),
        ),
        Fault::NotOneChoice { known } => (
            "this table does not hold exactly one choice".to_owned(),
            expected(&one_of(known)),
        ),
        Fault::NameAlone { name, keys: [] } => (
            format!("more belongs to `{name}`"),
            Some(format!("write `{{ {name} = ... }}`")),
        ),
        Fault::NameAlone { name, keys } => (
            format!("more belongs to `{name}`"),
            Some(format!(
                "write `{{ {name} = {{ ... }} }}` with {}",
                list(keys.iter().copied())
            )),
        ),
        Fault::NoFields { name } => (
            format!("nothing belongs to `{name}`"),
            Some(format!("write `\"{name}\"` alone")),
        ),
        Fault::Objection { message, label } => (message.clone(), label.clone()),
        Fault::Other(message) => (message.clone(), None),
    }
}

/// The message about an unknown key or name, which lists the known ones.
fn unknown(what: &str, wrong: &str, known: &[&str]) -> (String, Option<String>) {
    let label = nearest(wrong, known.iter().copied())
        .map(|nearest| format!("the nearest known {what} is `{nearest}`"));
    let known = match known {
        [only] => format!("the only one is `{only}`"),
        _ => format!("the known ones are {}", list(known.iter().copied())),
    };
    (format!("unknown {what} `{wrong}`; {known}"), label)
}

/// Choices, as in "one of `dense` and `sparse1`".
fn one_of(known: &[&str]) -> String {
    match known {
        [only] => format!("`{only}`"),
        _ => format!("one of {}", list(known.iter().copied())),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::{
        fit::{self, Step},
        quantity::Positive,
    };

    #[test]
    fn the_nearest_name_is_the_one_with_fewest_changes() {
        assert_eq!(
            nearest("max_klp", ["max_d", "max_kl", "mmd"]),
            Some("max_kl")
        );
        assert_eq!(nearest("PPO", ["mcpo", "ppo"]), Some("ppo"));
        assert_eq!(nearest("ppo", []), None);
        // What resembles nothing is shown what there is.
        assert_eq!(
            nearest_label("key", "clip", ["d", "damping"]).as_deref(),
            Some("the known ones are `d` and `damping`")
        );
        for (name, known) in [
            ("sac", "bc"),
            ("lr", "d"),
            ("zip", "clip"),
            ("Humanoid-v4", "Ant-v2"),
            ("", "d"),
        ] {
            assert_eq!(nearest(name, [known]), None, "{name}");
        }
        for (name, known) in [
            ("pp", "ppo"),
            ("sed", "seed"),
            ("bugdet", "budget"),
            ("rewards", "reward"),
        ] {
            assert_eq!(nearest(name, [known]), Some(known), "{name}");
        }
        let twice = nearest_label("axis", "zzz", ["seed", "env", "seed", "env"]);
        assert_eq!(
            twice.as_deref(),
            Some("the known ones are `seed` and `env`")
        );
    }

    #[test]
    fn mistakes_are_told_in_a_users_words() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(rename_all = "snake_case", deny_unknown_fields)]
        #[expect(dead_code, reason = "it is read, and never used")]
        enum Choice {
            DemoStates,
            Rollout,
            Sparse { distance: f64, mode: i64 },
        }
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        #[expect(dead_code, reason = "it is read, and never used")]
        struct Table {
            #[serde(default)]
            choice: Option<Choice>,
            #[serde(default)]
            number: Option<Positive>,
            #[serde(default)]
            whole: Option<i64>,
            #[serde(default)]
            count: Option<usize>,
            #[serde(default)]
            pair: Option<[f64; 2]>,
        }
        let told = |text: &str| {
            let table: toml::Table = toml::from_str(text).expect("TOML");
            let mistake = fit::read::<Table>(table.into()).expect_err(text);
            let (message, label) = words(&mistake.fault);
            (message, label.unwrap_or_default())
        };
        for (text, message, label) in [
            (
                "choice = 'demos'",
                "unknown name `demos`; the known ones are `demo_states`, `rollout` and `sparse`",
                "",
            ),
            (
                "choice = 'demo_state'",
                "unknown name `demo_state`; the known ones are `demo_states`, `rollout` and \
                 `sparse`",
                "the nearest known name is `demo_states`",
            ),
            (
                "choice.sparse = { distanc = 1.0, mode = 1 }",
                "unknown key `distanc`; the known ones are `distance` and `mode`",
                "the nearest known key is `distance`",
            ),
            (
                "choice.sparse = { mode = 1 }",
                "`distance` is missing",
                "write `distance = ...`",
            ),
            (
                "choice = 3",
                "this is neither a name nor a table",
                "expected one of `demo_states`, `rollout` and `sparse`",
            ),
            (
                "choice = {}",
                "this table does not hold exactly one choice",
                "expected one of `demo_states`, `rollout` and `sparse`",
            ),
            (
                "choice = 'sparse'",
                "more belongs to `sparse`",
                "write `{ sparse = { ... } }` with `distance` and `mode`",
            ),
            (
                "choice.rollout = { a = 1 }",
                "nothing belongs to `rollout`",
                "write `\"rollout\"` alone",
            ),
            (
                "choice.sparse = [1.0, 2]",
                "a list does not belong here",
                "expected a table",
            ),
            (
                "whole = 2.5",
                "2.5 does not belong here",
                "expected a whole number",
            ),
            (
                "whole = 1e5",
                "100000.0 does not belong here",
                "expected a whole number, such as 100000",
            ),
            (
                "whole = 2024-01-01",
                "the date 2024-01-01 does not belong here",
                "expected a whole number",
            ),
            (
                "whole = 'a'",
                "the string \"a\" does not belong here",
                "expected a whole number",
            ),
            (
                "count = -1",
                "-1 is out of range",
                "expected a whole number, 0 or above",
            ),
            (
                "number = -1",
                "-1 is out of range",
                "expected a finite number above 0",
            ),
            (
                "number = nan",
                "NaN is out of range",
                "expected a finite number above 0",
            ),
            (
                "number = [1]",
                "a list does not belong here",
                "expected a number",
            ),
            (
                "pair = [1]",
                "a list of 1 does not fit",
                "expected 2 elements",
            ),
            (
                "pair = [1, 2, 3]",
                "a list of 3 does not fit",
                "expected 2 elements",
            ),
        ] {
            assert_eq!(told(text), (message.to_owned(), label.to_owned()), "{text}");
        }
    }

    #[test]
    fn a_mistake_is_found_however_deep_it_is() {
        let table: toml::Table = toml::from_str("a = [{ b = 1 }, { b = 'x' }]").expect("TOML");
        let mistake = fit::read::<BTreeMap<String, Vec<BTreeMap<String, i64>>>>(table.into())
            .expect_err("a string");
        let key = |key: &str| Step::Key(key.to_owned());
        assert_eq!(mistake.way, [key("a"), Step::Index(1), key("b")]);
    }
}
