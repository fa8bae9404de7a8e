//! What clients say behind the `?` of a path.

use crate::Problem;
use std::borrow::Cow;

/// The values of a query, each by a name that is known and comes once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Query<'a>(Vec<(Cow<'a, str>, Cow<'a, str>)>);

impl<'a> Query<'a> {
    /// Reads a query that may have these names; `None` when there is none.
    ///
    /// # Errors
    /// It has another name, or one twice.
    pub fn parse(text: Option<&'a str>, names: &[&str]) -> Result<Query<'a>, Problem> {
        let mut values: Vec<(Cow<'a, str>, Cow<'a, str>)> = Vec::new();
        for (name, value) in form_urlencoded::parse(text.unwrap_or_default().as_bytes()) {
            if !names.contains(&&*name) || values.iter().any(|(other, _)| *other == name) {
                return Err(unknown(names));
            }
            values.push((name, value));
        }
        Ok(Query(values))
    }

    /// The value of this name, if there is one.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(other, _)| other == name).map(|(_, value)| &**value)
    }
}

fn unknown(names: &[&str]) -> Problem {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    let each = if names.len() == 1 { "once" } else { "once each" };
    Problem::malformed(format!("the query takes {} {each}, and nothing else", names.join(" and ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_are_known_are_taken_once_and_decoded() {
        let query = Query::parse(Some("every=0.5%20s&focus=a+b"), &["focus", "every"]).expect("taken");
        assert_eq!((query.get("every"), query.get("focus")), (Some("0.5 s"), Some("a b")));
        assert_eq!(query.get("other"), None);
        assert_eq!(Query::parse(None, &["every"]).expect("taken").get("every"), None);
    }

    #[test]
    fn other_names_and_those_that_come_twice_are_refused() {
        for text in ["each=1", "every=1&every=1", "every=1&x", "=1"] {
            let problem = Query::parse(Some(text), &["every"]).expect_err(text);
            assert_eq!(problem.error(), "the query takes `every` once, and nothing else", "{text}");
        }
        let problem = Query::parse(Some("each"), &["drive", "every"]).expect_err("refused");
        assert_eq!(problem.error(), "the query takes `drive` and `every` once each, and nothing else");
    }
}
