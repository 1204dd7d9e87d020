//! Parses a DBC into its statements, as they are written.

use std::ops::RangeInclusive;

use super::lexer::{Lexer, SyntaxError};

/// Name of the pseudo message by which tools keep signals that belong to no message.
const NO_MESSAGE: &str = "VECTOR__INDEPENDENT_SIG_MSG";
/// Name by which a DBC says "no node".
pub(crate) const NO_NODE: &str = "Vector__XXX";

/// Every word that begins a statement, in the order of the format's description.
const KEYWORDS: [&str; 34] = [
    "VERSION",
    "NS_",
    "NS_DESC_",
    "BS_",
    "BU_",
    "VAL_TABLE_",
    "BO_",
    "SG_",
    "BO_TX_BU_",
    "EV_",
    "ENVVAR_DATA_",
    "EV_DATA_",
    "SGTYPE_",
    "SGTYPE_VAL_",
    "BA_DEF_SGTYPE_",
    "BA_SGTYPE_",
    "SIG_TYPE_REF_",
    "SIG_GROUP_",
    "CM_",
    "CAT_DEF_",
    "CAT_",
    "FILTER",
    "BA_DEF_",
    "BA_DEF_REL_",
    "BA_DEF_DEF_",
    "BA_DEF_DEF_REL_",
    "BA_",
    "BA_REL_",
    "VAL_",
    "SIG_VALTYPE_",
    "SIGTYPE_VALTYPE_",
    "SG_MUL_VAL_",
    "BU_SG_REL_",
    "BU_BO_REL_",
];

/// Statements of a file that concern frames, each kind in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Statements {
    pub nodes: Vec<String>,
    /// Messages, without the pseudo message of unassigned signals.
    pub messages: Vec<MessageStatement>,
    /// Further nodes that send a message.
    pub senders: Vec<(u64, Vec<String>)>,
    /// The texts of raw numbers.
    pub values: Vec<OfSignal<Vec<(i128, String)>>>,
    /// The kind of number that a signal is: 1 a floating-point number of 32 bits, 2 one of 64.
    pub types: Vec<OfSignal<u64>>,
    /// The switch of a signal, and its values that select.
    pub switches: Vec<OfSignal<(String, Vec<RangeInclusive<u64>>)>>,
    /// Comments on signals, without their text.
    pub comments: Vec<OfSignal<()>>,
    /// Words of enumerated message attributes, by attribute.
    pub attribute_words: Vec<(String, Vec<String>)>,
    pub attribute_defaults: Vec<(String, AttributeValue)>,
    pub attributes: Vec<Attribute>,
}

/// A message, `BO_`, with its signals, `SG_`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MessageStatement {
    /// Line in the file, from 1 on.
    pub line: usize,
    /// Identifier with bit 31 set if it has 29 bits.
    pub id: u64,
    pub name: String,
    pub bytes: u64,
    /// Node that sends the message; `None` for `Vector__XXX`.
    pub sender: Option<String>,
    pub signals: Vec<SignalStatement>,
}

/// A signal statement, `SG_`, with the fields as written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SignalStatement {
    /// Line in the file, from 1 on.
    pub line: usize,
    pub name: String,
    /// Whether the signal is marked `M`, as a switch.
    pub is_switch: bool,
    /// Value of the switch that selects the signal, from the mark `m`.
    pub selected_by: Option<u64>,
    pub start_bit: u64,
    pub bits: u64,
    pub is_intel: bool,
    pub is_signed: bool,
    pub factor: f64,
    pub offset: f64,
    pub limits: [f64; 2],
    pub unit: String,
    /// Nodes that receive the signal, without `Vector__XXX`.
    pub receivers: Vec<String>,
}

/// A statement about a signal: its place, the signal, and the stated value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OfSignal<T> {
    /// Line in the file, from 1 on.
    pub line: usize,
    /// Identifier with bit 31 set if it has 29 bits.
    pub message: u64,
    pub signal: String,
    pub value: T,
}

/// `BA_`: an attribute of a message, a signal or a node.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Attribute {
    pub name: String,
    pub of: AttributeOwner,
    pub value: AttributeValue,
}

/// Object that an attribute belongs to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum AttributeOwner {
    Node(String),
    Message(u64),
    Signal(u64, String),
    /// The file, or an environment variable.
    Other,
}

/// Value of an attribute, a number or a text.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum AttributeValue {
    Number(f64),
    Text(String),
}

impl Statements {
    /// Reads a whole text.
    ///
    /// # Errors
    /// The first token that does not belong where it stands.
    pub fn parse(text: &str) -> Result<Statements, SyntaxError> {
        let mut parser = Parser { lexer: Lexer::new(text), found: Statements::default(), lost: None };
        if parser.lexer.is_at_end() {
            return parser.lexer.error("a statement such as BO_: the file is empty");
        }
        while !parser.lexer.is_at_end() {
            parser.statement()?;
        }
        Ok(parser.found)
    }
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    found: Statements,
    /// The pseudo message of unassigned signals while the parser is inside it.
    lost: Option<MessageStatement>,
}

impl<'a> Parser<'a> {
    fn statement(&mut self) -> Result<(), SyntaxError> {
        let start = self.lexer.clone();
        let keyword = self.lexer.word("a statement such as BO_")?;
        match keyword {
            "VERSION" => self.lexer.quoted("the version in quotes").map(drop)?,
            "NS_" => self.new_symbols()?,
            "BS_" => self.bit_timing()?,
            "BU_" => {
                self.lexer.symbol(':', "`:`")?;
                let nodes = self.nodes();
                self.found.nodes.extend(nodes);
            }
            "BO_" => self.message(start.line())?,
            "SG_" => {
                let signal = self.signal(start.line())?;
                // Signals of the pseudo message are collected apart and dropped with it.
                match self.lost.as_mut().or(self.found.messages.last_mut()) {
                    Some(message) => message.signals.push(signal),
                    None => return start.error("a message, BO_, before its signals"),
                }
            }
            "BO_TX_BU_" => self.senders()?,
            "VAL_" => self.values(start.line())?,
            "SIG_VALTYPE_" => self.value_type(start.line())?,
            "SG_MUL_VAL_" => self.switch(start.line())?,
            "CM_" => self.comment(start.line())?,
            "BA_DEF_" => self.attribute_definition()?,
            "BA_DEF_DEF_" => {
                let name = self.attribute_name()?;
                let value = self.attribute_value()?;
                self.found.attribute_defaults.push((name, value));
            }
            "BA_" => self.attribute()?,
            keyword if KEYWORDS.contains(&keyword) => return self.skip_statement(),
            _ => return start.error("a statement such as BO_, SG_ or VAL_"),
        }
        // Some tools forget the semicolon, others put one where none belongs.
        while self.lexer.has(';') {}
        Ok(())
    }

    /// Parses `NS_ :` and its keywords, which begin no statement here: the list ends at the first one that does.
    fn new_symbols(&mut self) -> Result<(), SyntaxError> {
        self.lexer.symbol(':', "`:`")?;
        loop {
            // The list of `NS_` has no end mark, and its keywords are those that begin statements. A keyword
            // followed by another word is a list entry; one followed by `:`, a quote or a number begins a
            // statement.
            let mut ahead = self.lexer.clone();
            let Ok(_) = ahead.word("a keyword") else { return Ok(()) };
            let is_listed =
                ahead.is_at_end() || ahead.next_char().is_some_and(|next| next.is_alphabetic() || next == '_');
            if !is_listed {
                return Ok(());
            }
            self.lexer = ahead;
        }
    }

    /// Parses `BS_: [RATE : REGISTER , REGISTER]`, which no file has used for decades.
    fn bit_timing(&mut self) -> Result<(), SyntaxError> {
        self.lexer.symbol(':', "`:`")?;
        if self.lexer.peek_number().is_some() {
            self.lexer.number("a bit rate")?;
            self.lexer.symbol(':', "`:`")?;
            self.lexer.number("a register of the bit timing")?;
            self.lexer.symbol(',', "`,`")?;
            self.lexer.number("a register of the bit timing")?;
        }
        Ok(())
    }

    /// Parses names up to the next statement, with or without commas between them; `Vector__XXX` is no node.
    fn nodes(&mut self) -> Vec<String> {
        let mut nodes = Vec::new();
        while let Some(node) = self.lexer.peek_word().filter(|word| !KEYWORDS.contains(word)) {
            let _ = self.lexer.word("a node");
            if node != NO_NODE {
                nodes.push(node.to_string());
            }
            self.lexer.has(',');
        }
        nodes
    }

    /// Parses `BO_ 512 Name: 8 Sender`.
    fn message(&mut self, line: usize) -> Result<(), SyntaxError> {
        let id = self.lexer.unsigned("an identifier as a decimal number")?;
        let name = self.lexer.word("the name of the message")?.to_string();
        self.lexer.symbol(':', "`:`")?;
        let bytes = self.lexer.unsigned("a length in bytes")?;
        let sender = self.lexer.peek_word().filter(|word| !KEYWORDS.contains(word));
        if sender.is_some() {
            self.lexer.word("a node")?;
        }
        let sender = sender.filter(|sender| *sender != NO_NODE).map(str::to_string);
        let is_lost = name == NO_MESSAGE;
        let message = MessageStatement { line, id, name, bytes, sender, signals: Vec::new() };
        self.lost = is_lost.then(|| message.clone());
        if !is_lost {
            self.found.messages.push(message);
        }
        Ok(())
    }

    /// Parses `SG_ Name m0M : 0|8@1+ (1,0) [0|0] "unit" Node,Node`.
    fn signal(&mut self, line: usize) -> Result<SignalStatement, SyntaxError> {
        let lexer = &mut self.lexer;
        let name = lexer.word("the name of the signal")?.to_string();
        let at_mark = lexer.clone();
        let mark = if lexer.next_char() == Some(':') { "" } else { lexer.word("`:`")? };
        let Some((is_switch, selected_by)) = multiplexing(mark) else {
            return at_mark.error("`:`, or a mark of multiplexing such as M, m0 or m0M");
        };
        lexer.symbol(':', "`:`")?;
        let start_bit = lexer.unsigned("the start bit")?;
        lexer.symbol('|', "`|`")?;
        let bits = lexer.unsigned("the number of bits")?;
        lexer.symbol('@', "`@`")?;
        let is_intel = lexer.has('1');
        if !is_intel {
            lexer.symbol('0', "the byte order: 1, Intel, or 0, Motorola")?;
        }
        let is_signed = lexer.has('-');
        if !is_signed {
            lexer.symbol('+', "the sign: + or -")?;
        }
        lexer.symbol('(', "`(`")?;
        let factor = lexer.number("the factor")?;
        lexer.symbol(',', "`,`")?;
        let offset = lexer.number("the offset")?;
        lexer.symbol(')', "`)`")?;
        lexer.symbol('[', "`[`")?;
        let least = lexer.number("the least value")?;
        lexer.symbol('|', "`|`")?;
        let most = lexer.number("the largest value")?;
        lexer.symbol(']', "`]`")?;
        let unit = lexer.quoted("the unit in quotes")?;
        let receivers = self.nodes();
        Ok(SignalStatement {
            line,
            name,
            is_switch,
            selected_by,
            start_bit,
            bits,
            is_intel,
            is_signed,
            factor,
            offset,
            limits: [least, most],
            unit,
            receivers,
        })
    }

    /// Parses `BO_TX_BU_ 512 : Node,Node;`.
    fn senders(&mut self) -> Result<(), SyntaxError> {
        let id = self.lexer.unsigned("an identifier as a decimal number")?;
        self.lexer.symbol(':', "`:`")?;
        let nodes = self.nodes();
        self.found.senders.push((id, nodes));
        Ok(())
    }

    /// Parses `VAL_ 512 Signal 0 "off" 1 "on" ;`, or `VAL_ Variable …` of an environment variable.
    fn values(&mut self, line: usize) -> Result<(), SyntaxError> {
        let is_of_signal = self.lexer.next_char().is_some_and(|next| next.is_ascii_digit());
        if !is_of_signal {
            return self.skip_statement();
        }
        let (message, signal) = self.signal_reference()?;
        let mut value = Vec::new();
        while self.lexer.peek_number().is_some() {
            let number = self.lexer.integer("an integer")?;
            value.push((number, self.lexer.quoted("a text in quotes")?));
        }
        self.end("a number with its text, or `;`")?;
        self.found.values.push(OfSignal { line, message, signal, value });
        Ok(())
    }

    /// Parses `SIG_VALTYPE_ 512 Signal : 1;`.
    fn value_type(&mut self, line: usize) -> Result<(), SyntaxError> {
        let (message, signal) = self.signal_reference()?;
        self.lexer.has(':');
        let value = self.lexer.unsigned("the kind of number: 0, 1 or 2")?;
        self.end("`;`")?;
        self.found.types.push(OfSignal { line, message, signal, value });
        Ok(())
    }

    /// Parses `SG_MUL_VAL_ 512 Signal Switch 0-3, 5-5;`.
    fn switch(&mut self, line: usize) -> Result<(), SyntaxError> {
        let (message, signal) = self.signal_reference()?;
        let switch = self.lexer.word("the name of the switch")?.to_string();
        let mut ranges = Vec::new();
        while self.lexer.next_char() != Some(';') {
            let least = self.lexer.unsigned("the first value of a range")?;
            self.lexer.symbol('-', "`-`")?;
            ranges.push(least..=self.lexer.unsigned("the last value of the range")?);
            if !self.lexer.has(',') {
                break;
            }
        }
        self.end("`,` or `;`")?;
        self.found.switches.push(OfSignal { line, message, signal, value: (switch, ranges) });
        Ok(())
    }

    fn signal_reference(&mut self) -> Result<(u64, String), SyntaxError> {
        let message = self.lexer.unsigned("an identifier as a decimal number")?;
        Ok((message, self.lexer.word("the name of the signal")?.to_string()))
    }

    /// Parses `CM_ "text";`, `CM_ BU_ Node "text";`, `CM_ BO_ 512 "text";`, `CM_ SG_ 512 Signal "text";`.
    fn comment(&mut self, line: usize) -> Result<(), SyntaxError> {
        if self.lexer.peek_word() == Some("SG_") {
            self.lexer.word("SG_")?;
            let message = self.lexer.unsigned("an identifier as a decimal number")?;
            // Some tools leave out the signal, and mean the message.
            if self.lexer.next_char() != Some('"') {
                let signal = self.lexer.word("the name of the signal")?.to_string();
                self.found.comments.push(OfSignal { line, message, signal, value: () });
            }
        }
        while self.lexer.peek_word().is_some() {
            self.lexer.word("a name")?;
        }
        self.lexer.quoted("a comment in quotes")?;
        self.end("`;`")
    }

    /// Parses `BA_DEF_ BO_ "Name" ENUM "Word","Word";`.
    fn attribute_definition(&mut self) -> Result<(), SyntaxError> {
        let of = self.lexer.peek_word();
        if of.is_some() {
            self.lexer.word("what has the attribute")?;
        }
        let name = self.attribute_name()?;
        let kind = self.lexer.word("the kind of the attribute, such as INT or ENUM")?;
        let mut words = Vec::new();
        while !self.is_at_end_of_statement() {
            if self.lexer.next_char() == Some('"') {
                words.push(self.lexer.quoted("a word in quotes")?);
            } else if self.lexer.peek_number().is_some() {
                self.lexer.number("a limit of the attribute")?;
            } else {
                // canmatrix has written words without quotes.
                words.push(self.lexer.word("a limit of the attribute, or a word in quotes")?.to_string());
            }
            self.lexer.has(',');
        }
        if of == Some("BO_") && kind == "ENUM" {
            self.found.attribute_words.push((name, words));
        }
        Ok(())
    }

    /// Parses `BA_ "Name" BO_ 512 100;`.
    fn attribute(&mut self) -> Result<(), SyntaxError> {
        let name = self.attribute_name()?;
        let of = match self.lexer.peek_word().filter(|word| KEYWORDS.contains(word)) {
            None => AttributeOwner::Other,
            Some(owner) => {
                self.lexer.word("what has the attribute")?;
                match owner {
                    "BU_" => AttributeOwner::Node(self.lexer.word("the name of the node")?.to_string()),
                    "BO_" => AttributeOwner::Message(self.lexer.unsigned("an identifier as a decimal number")?),
                    "SG_" => {
                        let (message, signal) = self.signal_reference()?;
                        AttributeOwner::Signal(message, signal)
                    }
                    _ => {
                        self.lexer.word("the name of the environment variable")?;
                        AttributeOwner::Other
                    }
                }
            }
        };
        let value = self.attribute_value()?;
        self.end("`;`")?;
        self.found.attributes.push(Attribute { name, of, value });
        Ok(())
    }

    fn attribute_name(&mut self) -> Result<String, SyntaxError> {
        self.lexer.quoted("the name of the attribute in quotes")
    }

    fn attribute_value(&mut self) -> Result<AttributeValue, SyntaxError> {
        const EXPECTED: &str = "the value of the attribute: a number, or a text in quotes";
        if self.lexer.next_char() == Some('"') {
            self.lexer.quoted(EXPECTED).map(AttributeValue::Text)
        } else if self.lexer.peek_number().is_some() {
            self.lexer.number(EXPECTED).map(AttributeValue::Number)
        } else {
            self.lexer.word(EXPECTED).map(|word| AttributeValue::Text(word.to_string()))
        }
    }

    /// Returns whether the next token ends a statement: a semicolon, the end of the text, or a keyword where
    /// the semicolon was forgotten.
    fn is_at_end_of_statement(&self) -> bool {
        self.lexer.is_at_end()
            || self.lexer.next_char() == Some(';')
            || self.lexer.peek_word().is_some_and(|word| KEYWORDS.contains(&word))
    }

    fn end(&self, expected: &'static str) -> Result<(), SyntaxError> {
        if self.is_at_end_of_statement() { Ok(()) } else { self.lexer.error(expected) }
    }

    /// Skips a statement that is not about frames, up to its semicolon.
    fn skip_statement(&mut self) -> Result<(), SyntaxError> {
        while !self.lexer.has(';') {
            match self.lexer.next_char() {
                None => return self.lexer.error("`;` at the end of the statement"),
                Some('"') => self.lexer.quoted("a text in quotes").map(drop)?,
                Some(symbol) => match self.lexer.peek_word() {
                    Some(_) => self.lexer.word("a word").map(drop)?,
                    None => drop(self.lexer.has(symbol)),
                },
            }
        }
        Ok(())
    }
}

/// Parses a multiplexing mark: whether the signal is a switch, and the value of the switch that selects it.
fn multiplexing(mark: &str) -> Option<(bool, Option<u64>)> {
    let (selected_by, is_switch) = match mark.strip_suffix('M') {
        Some(selected_by) => (selected_by, true),
        None => (mark, false),
    };
    match selected_by {
        // opendbc has a signal marked `m` without a value: nothing says when it is absent.
        "" | "m" => Some((is_switch, None)),
        selected_by => {
            let digits = selected_by.strip_prefix('m')?;
            let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
            is_number.then(|| (is_switch, Some(digits.parse().unwrap_or(u64::MAX))))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Statements {
        Statements::parse(text).unwrap()
    }

    /// A line break is a blank like any other, and a statement ends where the next begins.
    #[test]
    fn line_breaks_are_blanks() {
        let text = "VERSION \"\" NS_ : CM_ BA_DEF_\nVAL_ BS_: BU_: A B BO_ 256 M : 8 A SG_ S : 0 | 8 @ 1 + \
            (5.,-.5) [0|1E2] \"N\" B , A VAL_ 256 S 0 \"zero\" 1 \"one\" ; CM_ SG_ 256 S \"text\" ;";
        let broken: String = text.replace(' ', "\n");
        let [one, many] = [text, &broken].map(|text| {
            let mut found = parse(text);
            found.messages[0].line = 0;
            found.messages[0].signals[0].line = 0;
            found.values[0].line = 0;
            found.comments[0].line = 0;
            found
        });
        assert_eq!(one, many);
        assert_eq!(one.nodes, ["A", "B"]);
        let signal = &one.messages[0].signals[0];
        assert_eq!((signal.factor, signal.offset, signal.limits), (5.0, -0.5, [0.0, 100.0]));
        assert_eq!(signal.receivers, ["B", "A"]);
        assert_eq!(one.values[0].value, [(0, "zero".to_string()), (1, "one".to_string())]);
    }

    /// The statements that say nothing about frames are passed, and so are the signals of no message.
    #[test]
    fn what_says_nothing_about_frames_is_passed() {
        let found = parse(
            "BS_: 500 : 1,2\n\
             BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n SG_ Lost : 0|8@1+ (1,0) [0|0] \"\" Vector__XXX\n\
             EV_ Variable: 0 [0|1] \"a;b\" 0 1 DUMMY_NODE_VECTOR0 A,B;\nENVVAR_DATA_ Variable: 10;\n\
             VAL_TABLE_ Table 1 \"one\" 0 \"zero\" ;\nVAL_ Variable 1 \"one\" ;\nSIG_GROUP_ 1 Group 1 : a b;\n\
             BA_DEF_REL_ BU_SG_REL_ \"Relation\" INT 0 1;\nBA_REL_ \"Relation\" BU_SG_REL_ A SG_ 1 a 5;\n\
             CM_ \"BO_ 9 None: 8 A\";\nCM_ EV_ Variable \"text\"\nCM_ 12 \"of a message\";\n\
             BO_ 1 One: 8 Vector__XXX\n",
        );
        let messages: Vec<_> = found.messages.iter().map(|message| (message.name.as_str(), message.line)).collect();
        assert_eq!(messages, [("One", 14)]);
        assert_eq!((found.messages[0].sender.as_ref(), found.messages[0].signals.len()), (None, 0));
        let empty = Statements { messages: found.messages.clone(), ..Statements::default() };
        assert_eq!(found, empty);
    }

    #[test]
    fn marks_say_what_selects_and_what_is_selected() {
        for (mark, expected) in [
            ("", Some((false, None))),
            ("M", Some((true, None))),
            ("m3", Some((false, Some(3)))),
            ("m12M", Some((true, Some(12)))),
            ("m", Some((false, None))),
            ("mx", None),
            ("x1", None),
            ("M3", None),
        ] {
            assert_eq!(multiplexing(mark), expected, "{mark}");
        }
    }
}
