//! The nearest known name, and serde's messages in words for people.

/// The one of `known` that differs least from `name`; upper and lower case do not differ.
pub(super) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name = name.to_lowercase();
    known.into_iter().min_by_key(|known| strsim::damerau_levenshtein(&name, &known.to_lowercase()))
}

/// "the nearest known key is `max_kl`", where `what` is "key".
pub(super) fn nearest_label<'a>(what: &str, name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(name, known).map(|nearest| format!("the nearest known {what} is `{nearest}`"))
}

/// "`a`, `b` and `c`".
pub(super) fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
    match names.as_slice() {
        [] => "nothing".into(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// A message of serde or of a bounded number in plain words, and what to show at the caret.
pub(super) fn plain(message: &str) -> (String, Option<String>) {
    let message = message.lines().next().unwrap_or_default();
    if let Some((found, expected)) =
        message.strip_prefix("invalid type: ").and_then(|rest| rest.split_once(", expected "))
    {
        return (
            format!("{} does not belong here", found_in_words(found)),
            Some(format!("expected {}", type_in_words(expected))),
        );
    }
    if let Some((wrong, expected)) = message.split_once(" is out of range; expected ") {
        return (format!("{wrong} is out of range"), Some(format!("expected {expected}")));
    }
    for what in ["variant", "field"] {
        if let Some(rest) = message.strip_prefix("unknown ").and_then(|rest| rest.strip_prefix(what)) {
            // serde writes "`wrong`, expected `a` or `b`": every other piece between backticks is a name.
            let names: Vec<&str> = rest.split('`').skip(1).step_by(2).collect();
            if let Some((wrong, known)) = names.split_first() {
                let (what, title) = if what == "field" { ("key", "key") } else { ("name", "name") };
                let label = nearest_label(what, wrong, known.iter().copied());
                return (format!("unknown {title} `{wrong}`; known are {}", list(known.iter().copied())), label);
            }
        }
    }
    (message.to_owned(), None)
}

/// What was found: "string "abc"" as it is, floating point `2.5` as the number 2.5.
fn found_in_words(found: &str) -> String {
    let numbers = ["floating point `", "integer `", "boolean `"];
    match numbers.iter().find_map(|kind| Some((kind, found.strip_prefix(kind)?.strip_suffix('`')?))) {
        Some((_, number)) => number.to_owned(),
        None if found == "map" => "a table".into(),
        None if found == "sequence" => "a list".into(),
        None => format!("the {found}"),
    }
}

/// A Rust type as a TOML user knows it.
fn type_in_words(expected: &str) -> String {
    match expected {
        "f32" | "f64" => "a number".into(),
        "i64" | "u64" | "usize" => "a whole number".into(),
        "path string" => "a string".into(),
        "a sequence" => "a list".into(),
        other if other.starts_with("struct ") => "a table".into(),
        other => other.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_the_one_with_fewest_changes() {
        assert_eq!(nearest("max_klp", ["max_d", "max_kl", "mmd"]), Some("max_kl"));
        assert_eq!(nearest("PPO", ["mcpo", "ppo"]), Some("ppo"));
        assert_eq!(nearest("ppo", []), None);
    }

    #[test]
    fn messages_of_serde_become_plain() {
        let (message, label) = plain("unknown variant `demos`, expected `demo_states` or `rollout`");
        assert_eq!(message, "unknown name `demos`; known are `demo_states` and `rollout`");
        assert_eq!(label.as_deref(), Some("the nearest known name is `demo_states`"));
        let (message, label) = plain("invalid type: floating point `2.5`, expected i64");
        assert_eq!(message, "2.5 does not belong here");
        assert_eq!(label.as_deref(), Some("expected a whole number"));
        let (message, label) = plain("-1 is out of range; expected a finite number above 0");
        assert_eq!(
            (message.as_str(), label.as_deref()),
            ("-1 is out of range", Some("expected a finite number above 0"))
        );
    }
}
