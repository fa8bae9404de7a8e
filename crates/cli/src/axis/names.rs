//! Names that mean nothing, and what was probably meant.

/// Up to so many names are listed even when it is likely which was meant.
const FEW: usize = 10;
/// The most names that are listed.
const MOST_LISTED: usize = 40;
/// Names that are longer are not compared.
const LONGEST: usize = 60;

/// What there is instead of a name: all when they are few, else the one that was probably meant.
pub(crate) fn instead(name: &str, known: &[&str]) -> String {
    match (nearest(name, known), known) {
        (_, []) => "there are none".to_owned(),
        (_, [only]) => format!("there is only {only}"),
        (Some(likely), _) if known.len() > FEW => format!("did you mean {likely}?"),
        (_, known) => format!("there are {}", list(known)),
    }
}

/// Names in a row, not too many.
fn list(names: &[&str]) -> String {
    match names.split_at_checked(MOST_LISTED) {
        Some((listed, rest)) if !rest.is_empty() => {
            format!("{} and {} more", listed.join(", "), rest.len())
        }
        _ => names.join(", "),
    }
}

/// The name that differs least, when it differs little enough to be a slip of the finger.
fn nearest<'a>(written: &str, known: &[&'a str]) -> Option<&'a str> {
    let most = (written.len() / 3).max(1);
    if written.len() > LONGEST {
        return None;
    }
    let key = |name: &str| name.to_ascii_uppercase().replace(['-', '_', ' '], "");
    let written = key(written);
    let near = known.iter().map(|name| (strsim::osa_distance(&written, &key(name)), *name));
    near.filter(|(distance, _)| *distance <= most).min_by_key(|(distance, _)| *distance).map(|(_, name)| name)
}

/// A text of somebody else for a message: short, and without what a terminal would act on.
pub(crate) fn shown(text: &str) -> String {
    let mut shown: String = text.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_names_are_listed_and_of_many_the_nearest_is_named() {
        assert_eq!(instead("stag", &[]), "there are none");
        assert_eq!(instead("stag", &["stage"]), "there is only stage");
        assert_eq!(instead("stag", &["stage", "uhv"]), "there are stage, uhv");
        let many: Vec<String> = (0..50).map(|number| format!("axis-{number}")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        assert_eq!(instead("axsi_49", &many), "did you mean axis-49?");
        assert!(instead("colour", &many).ends_with(", axis-39 and 10 more"));
    }

    #[test]
    fn what_is_shown_of_a_text_is_short_and_tame() {
        assert_eq!(shown("a\u{1b}[31m"), "a\\u{1b}[31m");
        assert_eq!(shown(&"ä".repeat(61)), "ä".repeat(60) + "…");
    }
}
