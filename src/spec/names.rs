//! The nearest known name, and serde's messages in words for people.

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
    (!most.is_empty()).then(|| format!("the known ones are {}{more}", list(most.iter().copied())))
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

/// Packs `message`, and the label for the caret, into the text of one error; see [`told_apart`].
pub(super) fn told(message: &str, label: Option<&str>) -> String {
    format!("{message}\n{}", label.unwrap_or_default())
}

/// Unpacks a text of [`told`]; `None` for any other text.
pub(super) fn told_apart(text: &str) -> Option<(String, Option<String>)> {
    let (message, label) = text.split_once('\n')?;
    Some((
        message.to_owned(),
        Some(label.to_owned()).filter(|label| !label.is_empty()),
    ))
}

/// A message of serde, toml or a bounded number in plain words, and the label for the caret.
pub(super) fn plain(message: &str) -> (String, Option<String>) {
    let message = message.lines().next().unwrap_or_default();
    wrong_choice(message)
        .or_else(|| too_large(message))
        .or_else(|| wrong_type(message))
        .or_else(|| out_of_range(message))
        .or_else(|| unknown_name(message))
        .unwrap_or_else(|| (message.to_owned(), None))
}

/// A message about a choice: a name, or a table with a name and its fields.
fn wrong_choice(message: &str) -> Option<(String, Option<String>)> {
    let wrong = match message {
        "wanted string or table" => "this is neither a name nor a table",
        _ if message.starts_with("wanted exactly 1 element") => {
            "this table does not hold exactly one choice"
        }
        _ => return None,
    };
    Some((
        wrong.into(),
        Some("expected a name, or a table with one name and its fields".into()),
    ))
}

/// A message about a whole number beyond 64 bits.
fn too_large(message: &str) -> Option<(String, Option<String>)> {
    let (number, rest) = message
        .strip_prefix("invalid type: integer `")?
        .split_once('`')?;
    let (_, expected) = rest.strip_prefix(" as ")?.split_once(", expected ")?;
    Some((
        format!("{number} is out of range"),
        Some(format!(
            "expected {} that fits in 64 bits",
            type_in_words(expected)
        )),
    ))
}

fn wrong_type(message: &str) -> Option<(String, Option<String>)> {
    let (found, expected) = message
        .strip_prefix("invalid type: ")?
        .split_once(", expected ")?;
    let (found, expected) = (found_in_words(found), type_in_words(expected));
    let label = match found.strip_suffix(".0") {
        Some(whole) if expected == "a whole number" => {
            format!("expected a whole number, such as {whole}")
        }
        _ => format!("expected {expected}"),
    };
    Some((format!("{found} does not belong here"), Some(label)))
}

fn out_of_range(message: &str) -> Option<(String, Option<String>)> {
    let (wrong, expected) = message.split_once(" is out of range; expected ")?;
    Some((
        format!("{wrong} is out of range"),
        Some(format!("expected {expected}")),
    ))
}

fn unknown_name(message: &str) -> Option<(String, Option<String>)> {
    let (what, wrong, known): (_, _, Vec<&str>) =
        if let Some(names) = message.strip_prefix("unexpected keys in table: ") {
            let (wrong, known) = names.split_once(", available keys: ")?;
            ("key", wrong, known.split(", ").collect())
        } else {
            let (what, names) = match (
                message.strip_prefix("unknown variant "),
                message.strip_prefix("unknown field "),
            ) {
                (Some(names), _) => ("name", names),
                (_, names) => ("key", names?),
            };
            // "`wrong`, expected `a` or `b`": every other piece between backticks is a name.
            let names: Vec<&str> = names.split('`').skip(1).step_by(2).collect();
            let (wrong, known) = names.split_first()?;
            (what, *wrong, known.to_vec())
        };
    // The message itself lists the known names.
    let label = nearest(wrong, known.iter().copied())
        .map(|nearest| format!("the nearest known {what} is `{nearest}`"));
    Some((
        format!(
            "unknown {what} `{wrong}`; the known ones are {}",
            list(known)
        ),
        label,
    ))
}

/// The found value in words: "string "abc"" as it is, floating point `2.5` as the number 2.5.
fn found_in_words(found: &str) -> String {
    let numbers = ["floating point `", "integer `", "boolean `"];
    match numbers
        .iter()
        .find_map(|kind| Some((kind, found.strip_prefix(kind)?.strip_suffix('`')?)))
    {
        Some((_, number)) => number.to_owned(),
        None if found == "map" => "a table".into(),
        None if found == "sequence" => "a list".into(),
        None if found.ends_with(" variant") => "this choice".into(),
        None if found == "unit value" => "nothing".into(),
        None => format!("the {found}"),
    }
}

/// The kind of a date in words; serde calls it a map.
pub(super) fn date_in_words(date: &toml::value::Datetime) -> &'static str {
    match (date.date, date.time) {
        (Some(_), None) => "date",
        (None, Some(_)) => "time",
        _ => "date and time",
    }
}

/// A Rust type as a TOML user knows it.
fn type_in_words(expected: &str) -> String {
    match expected {
        "f32" | "f64" => "a number".into(),
        "i8" | "i16" | "i32" | "i64" | "u8" | "u16" | "u32" | "u64" | "usize" => {
            "a whole number".into()
        }
        "newtype variant" | "struct variant" => "a table with its fields".into(),
        "unit variant" => "its name alone, without fields".into(),
        "a map" | "map" => "a table".into(),
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
    fn messages_of_serde_become_plain() {
        let (_, label) = plain("unknown variant `demos`, expected `demo_states` or `rollout`");
        assert_eq!(label, None);
        let (message, label) =
            plain("unknown variant `demo_state`, expected `demo_states` or `rollout`");
        assert_eq!(
            message,
            "unknown name `demo_state`; the known ones are `demo_states` and `rollout`"
        );
        assert_eq!(
            label.as_deref(),
            Some("the nearest known name is `demo_states`")
        );
        let (message, label) = plain("invalid type: floating point `2.5`, expected i64");
        assert_eq!(message, "2.5 does not belong here");
        assert_eq!(label.as_deref(), Some("expected a whole number"));
        let (_, label) = plain("invalid type: floating point `100000.0`, expected i64");
        assert_eq!(
            label.as_deref(),
            Some("expected a whole number, such as 100000")
        );
        let (message, label) =
            plain("invalid type: integer `99999999999999999999` as i128, expected i64");
        assert_eq!(message, "99999999999999999999 is out of range");
        assert_eq!(
            label.as_deref(),
            Some("expected a whole number that fits in 64 bits")
        );
        let (_, label) = plain("unexpected keys in table: distanc, available keys: distance, mode");
        assert_eq!(
            label.as_deref(),
            Some("the nearest known key is `distance`")
        );
        let (message, label) = plain("-1 is out of range; expected a finite number above 0");
        assert_eq!(
            (message.as_str(), label.as_deref()),
            (
                "-1 is out of range",
                Some("expected a finite number above 0")
            )
        );
    }
}
