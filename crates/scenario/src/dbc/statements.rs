//! The lines of messages and signals in the text of a DBC, and what has to be taken out before it is parsed.
//!
//! The parser takes every identifier without bit 31 modulo 2¹⁶, and an identifier beyond 32 bits as an error of the
//! whole file. So messages with an impossible identifier are found here, and blanked out with all that refers to them.

use std::collections::BTreeSet;

/// The name of the message that holds signals of no message.
const NO_MESSAGE: &str = "VECTOR__INDEPENDENT_SIG_MSG";

/// The largest 29-bit identifier, and the bit that marks one.
const EXTENDED_MAX: u64 = 0x1FFF_FFFF;
const EXTENDED: u64 = 1 << 31;

/// Where a message stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MessageLine {
    pub(super) name: String,
    /// The number as it is written.
    pub(super) id: u64,
    /// From 1 on.
    pub(super) line: usize,
    /// The names and lines of its signals.
    pub(super) signals: Vec<(String, usize)>,
}

/// What of a text is to be parsed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Scan {
    /// The text, in which a line that is left out is empty.
    pub(super) text: String,
    /// The messages of the text.
    pub(super) messages: Vec<MessageLine>,
    /// Those left out because of their identifier.
    pub(super) impossible: Vec<MessageLine>,
}

/// Finds the messages, and blanks out those that can't be parsed.
pub(super) fn scan(text: &str) -> Scan {
    let starts = line_starts(text);
    let (messages, left_out): (Vec<_>, Vec<_>) = messages(&starts).into_iter().partition(|message| {
        let possible = message.id <= 0x7FF || (EXTENDED..=EXTENDED | EXTENDED_MAX).contains(&message.id);
        possible && message.name != NO_MESSAGE
    });
    let ids: BTreeSet<u64> = left_out.iter().map(|message| message.id).collect();
    let mut scan = Scan { messages, ..Scan::default() };
    let mut blank = Blank::No;
    for (line, is_start) in starts {
        blank = if is_start { blank.at(line, &ids) } else { blank };
        scan.text.push_str(if blank == Blank::No { line } else { "" });
        scan.text.push('\n');
        blank = if blank == Blank::Statement && line.trim_end().ends_with(';') { Blank::No } else { blank };
    }
    scan.impossible = left_out.into_iter().filter(|message| message.name != NO_MESSAGE).collect();
    scan
}

/// What is being blanked out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Blank {
    No,
    /// A message with its signals.
    Message,
    /// A statement up to its semicolon.
    Statement,
}

impl Blank {
    /// What is blanked out from this line on, which is not inside of a quoted text.
    fn at(self, line: &str, ids: &BTreeSet<u64>) -> Blank {
        let mut words = line.split_ascii_whitespace();
        let Some(keyword) = words.next() else {
            return self;
        };
        match keyword {
            "BO_" if message_line(line).is_some_and(|(id, _)| ids.contains(&id)) => Blank::Message,
            "SG_" if self == Blank::Message => self,
            _ if refers_to(keyword, line).is_some_and(|id| ids.contains(&id)) => Blank::Statement,
            // Its further lines begin with no keyword.
            _ if self == Blank::Statement && !keyword.ends_with('_') => self,
            _ => Blank::No,
        }
    }
}

/// The identifier that a statement about a message or its signal refers to.
fn refers_to(keyword: &str, line: &str) -> Option<u64> {
    let behind = match keyword {
        "VAL_" | "SIG_VALTYPE_" | "SG_MUL_VAL_" | "BO_TX_BU_" | "SIG_GROUP_" => {
            line.trim_start().get(keyword.len()..)?
        }
        "CM_" | "BA_" => {
            // The name of the attribute is quoted.
            let object = if keyword == "BA_" { line.splitn(3, '"').nth(2)? } else { line.trim_start().get(3..)? };
            let object = object.trim_start();
            object.strip_prefix("BO_").or_else(|| object.strip_prefix("SG_"))?
        }
        _ => return None,
    };
    behind.split(|c: char| c.is_ascii_whitespace() || c == ':').find(|word| !word.is_empty())?.parse().ok()
}

/// The lines of a text, and of each whether it begins outside of a quoted text.
fn line_starts(text: &str) -> Vec<(&str, bool)> {
    let mut is_quoted = false;
    let lines = text.lines().map(|line| {
        let is_start = !is_quoted;
        let mut last = ' ';
        let is_comment = is_start && line.trim_start().starts_with("//");
        for c in line.chars().filter(|_| !is_comment) {
            // `\"` is a quote inside of a quoted text.
            if c == '"' && !(is_quoted && last == '\\') {
                is_quoted = !is_quoted;
            }
            last = c;
        }
        (line, is_start)
    });
    lines.collect()
}

fn messages(starts: &[(&str, bool)]) -> Vec<MessageLine> {
    let mut found: Vec<MessageLine> = Vec::new();
    for (line, (text, _)) in (1..).zip(starts).filter(|(_, (_, is_start))| *is_start) {
        if let Some((id, name)) = message_line(text) {
            found.push(MessageLine { name: name.to_string(), id, line, signals: Vec::new() });
        } else if let (Some(name), Some(message)) = (signal_line(text), found.last_mut()) {
            message.signals.push((name.to_string(), line));
        }
    }
    found
}

/// Identifier and name of `BO_ 512 Name: 8 Sender`. A number beyond 64 bits counts as the largest.
fn message_line(line: &str) -> Option<(u64, &str)> {
    let (id, behind) = line.trim_start().strip_prefix("BO_")?.trim_start().split_once(char::is_whitespace)?;
    let is_number = !id.is_empty() && id.bytes().all(|byte| byte.is_ascii_digit());
    let (name, _) = behind.split_once(':').filter(|_| is_number)?;
    Some((id.parse().unwrap_or(u64::MAX), name.trim()))
}

/// The name of ` SG_ Name m0 : 0|8@1+ …`.
fn signal_line(line: &str) -> Option<&str> {
    let behind = line.trim_start().strip_prefix("SG_")?;
    let name = behind.trim_start().split(|c: char| c.is_whitespace() || c == ':').next()?;
    (behind.starts_with(char::is_whitespace) && !name.is_empty()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
BO_ 273874944 TooLarge: 8 A
 SG_ a : 0|8@1+ (1,0) [0|0] \"\" B

BO_ 0 Zero: 8 A
 SG_ a : 0|8@1+ (1,0) [0|0] \"\" B
// BO_ 1 Comment: 8 A
BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ b : 0|8@1+ (1,0) [0|0] \"\" B
BO_ 99999999999999999999999 Huge: 8 A
CM_ BO_ 0 \"of two lines:
BO_ 5 Quoted: 8 A
a \\\" quote\";
BA_ \"GenMsgCycleTime\" BO_ 273874944 10;
BA_ \"GenMsgCycleTime\" BO_ 0 20;
BA_ \"Version\" 273874944;
VAL_ 273874944 a 0 \"x\"
 1 \"y\";
VAL_ 0 a 0 \"x\";
SIG_VALTYPE_ 273874944 a: 1;";

    #[test]
    fn blanks_out_what_the_parser_would_misread() {
        let scan = scan(TEXT);
        let kept: Vec<&str> = scan.text.lines().map(|line| line.get(..30.min(line.len())).unwrap()).collect();
        insta::assert_debug_snapshot!(kept, @r#"
        [
            "",
            "",
            "",
            "BO_ 0 Zero: 8 A",
            " SG_ a : 0|8@1+ (1,0) [0|0] \"\"",
            "// BO_ 1 Comment: 8 A",
            "",
            "",
            "",
            "CM_ BO_ 0 \"of two lines:",
            "BO_ 5 Quoted: 8 A",
            "a \\\" quote\";",
            "",
            "BA_ \"GenMsgCycleTime\" BO_ 0 20",
            "BA_ \"Version\" 273874944;",
            "",
            "",
            "VAL_ 0 a 0 \"x\";",
            "",
        ]
        "#);
        let lines = |messages: &[MessageLine]| {
            messages
                .iter()
                .map(|message| (message.name.clone(), message.line, message.signals.len()))
                .collect::<Vec<_>>()
        };
        assert_eq!(lines(&scan.messages), [("Zero".to_string(), 4, 1)]);
        assert_eq!(lines(&scan.impossible), [("TooLarge".to_string(), 1, 1), ("Huge".to_string(), 9, 0)]);
    }
}
