//! Reports as one HTML file: it loads nothing, and follows the light or dark mode of its reader.

use crate::failure::Failure;
use crate::junit::escaped;
use resonarm_figures::plot::Figure;

/// Figures keep a light ground in dark mode, for which their colours are chosen.
const STYLE: &str = "\
:root{color-scheme:light dark;--text:#1c2024;--faint:#5b6570;--ground:#fff;--line:#d5dae0;--good:#00704f;--bad:#b8390b;--open:#8a6100}
@media(prefers-color-scheme:dark){:root{--text:#e6e9ed;--faint:#9aa4b0;--ground:#14171a;--line:#343b43;--good:#3ecf9b;--bad:#ff8a5c;--open:#e8b949}}
body{margin:2rem auto;max-width:64rem;padding:0 1rem;font:16px/1.5 system-ui,sans-serif;color:var(--text);background:var(--ground)}
h1{margin-bottom:.2rem}h2{margin-top:2rem}p{margin:.3rem 0}.faint{color:var(--faint)}
table{border-collapse:collapse;width:100%}th,td{text-align:left;vertical-align:top;padding:.35rem .6rem;border-bottom:1px solid var(--line)}
.good{color:var(--good)}.bad{color:var(--bad)}.open{color:var(--open)}.good,.bad,.open{font-weight:600;white-space:nowrap}
.figure{background:#fff;border-radius:6px;padding:.5rem;margin:1rem 0;overflow-x:auto}.figure svg{display:block;max-width:100%;height:auto;margin:auto}
";

/// Colour of a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tone {
    Good,
    Bad,
    Open,
}

impl Tone {
    const fn class(self) -> &'static str {
        match self {
            Tone::Good => "good",
            Tone::Bad => "bad",
            Tone::Open => "open",
        }
    }
}

/// A page that is being written.
#[derive(Debug)]
pub(crate) struct Page {
    title: String,
    body: String,
}

impl Page {
    pub fn new(title: &str) -> Page {
        Page { title: escaped(title), body: format!("<h1>{}</h1>\n", escaped(title)) }
    }

    pub fn heading(&mut self, text: &str) {
        self.body += &format!("<h2>{}</h2>\n", escaped(text));
    }

    /// Adds a verdict in a word, in its colour.
    pub fn verdict(&mut self, tone: Tone, word: &str) {
        self.body += &format!("<p class=\"{}\">{}</p>\n", tone.class(), escaped(word));
    }

    /// Adds a paragraph that explains.
    pub fn faint(&mut self, text: &str) {
        self.body += &format!("<p class=\"faint\">{}</p>\n", escaped(text));
    }

    /// Adds a table. The second column holds a verdict in its colour.
    pub fn table<const N: usize>(&mut self, heading: [&str; N], rows: &[(Tone, [String; N])]) {
        let cells = |cells: [String; N]| cells.concat();
        let head = cells(heading.map(|name| format!("<th>{}</th>", escaped(name))));
        self.body += &format!("<table>\n<tr>{head}</tr>\n");
        for (tone, row) in rows {
            let cell = |(place, text): (usize, &String)| {
                // The verdict stands in the second column, after the name of what was judged.
                let class = if place == 1 { format!(" class=\"{}\"", tone.class()) } else { String::new() };
                format!("<td{class}>{}</td>", escaped(text))
            };
            let row: String = row.iter().enumerate().map(cell).collect();
            self.body += &format!("<tr>{row}</tr>\n");
        }
        self.body += "</table>\n";
    }

    /// Adds the list of the sources that a specification names, if there are any.
    pub fn sources(&mut self, sources: &[String]) {
        if !sources.is_empty() {
            self.heading("Sources of the specification");
            sources.iter().for_each(|source| self.faint(source));
        }
    }

    pub fn figure(&mut self, figure: &Figure) -> Result<(), Failure> {
        self.body += &format!("<div class=\"figure\">\n{}</div>\n", figure.to_svg()?);
        Ok(())
    }

    /// Returns the whole document.
    pub fn document(&self) -> String {
        let Page { title, body } = self;
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
             <style>\n{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
        )
    }
}
