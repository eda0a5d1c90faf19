//! The check of claims.

use std::ops::Range;

use toml::de::DeTable;

use super::{Checker, Value};
use crate::{
    measured::Measure,
    spec::{catalog::Catalog, claim::Versus},
};

/// The keys of a comparison, which mean nothing for a constraint that is kept.
const OF_COMPARISONS: [&str; 4] = ["than", "on", "at", "margin"];

impl Checker<'_> {
    /// Checks `[[claims]]`.
    pub(super) fn claims(&mut self, value: &Value<'_>) {
        let section = &Catalog::get().claim;
        self.shown_tables(value, "claims", "claim", section, Self::of_claim);
        self.tables(value, "claims", Self::together);
    }

    /// Checks one value of a claim, which has the right type already.
    fn of_claim(&mut self, key: &str, value: &Value<'_>) {
        if key == "margin" && number(value).is_some_and(|margin| !margin.is_finite()) {
            self.wrong(value.span(), "`margin` is not a finite number", None);
        }
    }

    /// Checks that the keys of one claim go together.
    fn together(&mut self, claim: &DeTable<'_>, span: Range<usize>) {
        let text = |key: &str| claim.get(key).and_then(|value| value.get_ref().as_str());
        let place = |key: &str| claim.get(key).map_or(span.clone(), |value| value.span());
        match text("is") {
            Some("kept") => {
                for key in OF_COMPARISONS
                    .into_iter()
                    .filter(|key| claim.contains_key(*key))
                {
                    self.note(
                        place(key),
                        format!("`{key}` means nothing for a constraint that is kept"),
                        None,
                    );
                }
            }
            Some("above" | "below" | "like") => {
                if claim.contains_key("share") {
                    self.note(
                        place("share"),
                        "`share` is only for a constraint that is `kept`",
                        None,
                    );
                }
                if !claim.contains_key("than") {
                    let label =
                        "expected runs such as `algorithm=ppo`, or `demonstration`".to_owned();
                    self.note(span.clone(), "this claim has no `than`", Some(label));
                }
            }
            // Another word is no relation, which is reported by itself.
            _ => {}
        }
        // A margin that is no number is reported by itself too.
        let margin = claim.get("margin").map_or(Some(0.0), number);
        if text("is") == Some("like") && margin.is_some_and(|margin| margin <= 0.0) {
            let label =
                "expected a number above 0: nothing is the same to the last digit".to_owned();
            self.note(place("margin"), "`like` needs a `margin`", Some(label));
        }
        let on = text("on").unwrap_or(Measure::RETURN);
        if text("than") == Some(Versus::DEMONSTRATION) && on != Measure::RETURN {
            self.note(
                place("than"),
                format!("a demonstration has a return, but no `{on}`"),
                None,
            );
        }
    }
}

/// `value` as a number; `None` if it is none.
fn number(value: &Value<'_>) -> Option<f64> {
    super::plain_value(value).and_then(|value| {
        value
            .as_float()
            .or_else(|| Some(value.as_integer()? as f64))
    })
}
