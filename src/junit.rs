//! Results of cases as JUnit XML, which CI servers read.

use crate::output;

/// Result of a case in the words that JUnit has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    Passed,
    /// It failed, with the reason.
    Failed(String),
    /// It has no result, with the reason: JUnit has no word between success and failure.
    Skipped(String),
}

/// A case with its result.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Case {
    pub name: String,
    /// Duration, s, if it was measured.
    pub took_s: Option<f64>,
    pub outcome: Outcome,
}

impl Case {
    fn xml(&self) -> String {
        let body = match &self.outcome {
            Outcome::Passed => String::new(),
            Outcome::Failed(reason) => format!("<failure message=\"{}\"/>", escaped(reason)),
            Outcome::Skipped(reason) => format!("<skipped message=\"{}\"/>", escaped(reason)),
        };
        let time = self.took_s.map_or(String::new(), |took_s| format!(" time=\"{took_s:.3}\""));
        format!("    <testcase classname=\"resonarm\" name=\"{}\"{time}>{body}</testcase>\n", escaped(&self.name))
    }
}

/// Returns a suite of cases as a whole document.
pub(crate) fn document(suite: &str, cases: &[Case]) -> String {
    let count = |is_counted: fn(&Outcome) -> bool| cases.iter().filter(|case| is_counted(&case.outcome)).count();
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n");
    text += &format!(
        "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" skipped=\"{}\">\n",
        escaped(suite),
        cases.len(),
        count(|outcome| matches!(outcome, Outcome::Failed(_))),
        count(|outcome| matches!(outcome, Outcome::Skipped(_))),
    );
    cases.iter().for_each(|case| text.push_str(&case.xml()));
    text.push_str("  </testsuite>\n</testsuites>\n");
    text
}

/// Escapes text for an attribute or an element of XML or HTML, which can hold no control characters.
pub(crate) fn escaped(text: &str) -> String {
    without_markup(&output::in_line(text))
}

/// Escapes the characters of text that are markup in XML and HTML.
pub(crate) fn without_markup(text: &str) -> String {
    // The ampersand comes first: it would otherwise escape the other escapes again.
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suites_count_their_cases() {
        let case = |name: &str, outcome| Case { name: name.to_owned(), took_s: None, outcome };
        let cases = [
            case("a", Outcome::Passed),
            Case { took_s: Some(1.25), ..case("b", Outcome::Failed(String::from("1 < 2 & \"x\"\n"))) },
            case("c", Outcome::Skipped(String::from("inconclusive: no level"))),
        ];
        assert_eq!(
            document("resonarm <x>", &cases),
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n\
             \x20 <testsuite name=\"resonarm &lt;x&gt;\" tests=\"3\" failures=\"1\" skipped=\"1\">\n\
             \x20   <testcase classname=\"resonarm\" name=\"a\"></testcase>\n\
             \x20   <testcase classname=\"resonarm\" name=\"b\" time=\"1.250\"><failure message=\"1 &lt; 2 &amp; &quot;x&quot;\\n\"/></testcase>\n\
             \x20   <testcase classname=\"resonarm\" name=\"c\"><skipped message=\"inconclusive: no level\"/></testcase>\n\
             \x20 </testsuite>\n</testsuites>\n"
        );
    }
}
