//! Reads the tokens of a DBC.
//!
//! A DBC is a stream of tokens: a line break is a blank like any other, and `//` begins a comment that ends with its
//! line. What a token is depends on where it stands: `2nd` is a name where a name belongs, and the number 2 where a
//! number belongs. So the parser asks for the kind of token that it expects.

/// A token that does not belong where it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SyntaxError {
    /// Line of the token, from 1 on.
    pub line: usize,
    /// First character of the token in its line, from 1 on.
    pub column: usize,
    /// Token that the parser expected.
    pub expected: &'static str,
    /// The text from there to the end of the line, at most [`SHOWN_CHARS`] characters.
    pub got: String,
}

/// Largest number of characters of the source that an error shows.
const SHOWN_CHARS: usize = 60;

/// Position in the text, between two tokens.
#[derive(Clone, Debug)]
pub(super) struct Lexer<'a> {
    text: &'a str,
    /// Bytes before the next token.
    at: usize,
    /// The line of the next token, from 1 on.
    line: usize,
}

impl<'a> Lexer<'a> {
    pub fn new(text: &'a str) -> Lexer<'a> {
        let mut lexer = Lexer { text, at: 0, line: 1 };
        lexer.skip_blanks();
        lexer
    }

    /// Returns the line of the next token, from 1 on.
    pub const fn line(&self) -> usize {
        self.line
    }

    pub fn is_at_end(&self) -> bool {
        self.rest().is_empty()
    }

    /// Returns the first character of the next token.
    pub fn next_char(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// Consumes a token of `bytes` bytes and the blanks behind it.
    fn take(&mut self, bytes: usize) -> &'a str {
        let token = &self.rest()[..bytes];
        self.pass(bytes);
        self.skip_blanks();
        token
    }

    fn pass(&mut self, bytes: usize) {
        self.line += self.rest()[..bytes].bytes().filter(|byte| *byte == b'\n').count();
        self.at += bytes;
    }

    fn skip_blanks(&mut self) {
        loop {
            let rest = self.rest();
            let blanks = rest.len() - rest.trim_start().len();
            let comment =
                rest[blanks..].starts_with("//").then(|| rest[blanks..].find('\n').unwrap_or(rest.len() - blanks));
            match blanks + comment.unwrap_or(0) {
                0 => return,
                bytes => self.pass(bytes),
            }
        }
    }

    /// Returns the error that the next token is not the expected one.
    pub fn error<T>(&self, expected: &'static str) -> Result<T, SyntaxError> {
        let before = &self.text[..self.at];
        let column = 1 + before[before.rfind('\n').map_or(0, |end| end + 1)..].chars().count();
        let got = self.rest().lines().next().unwrap_or("").trim_end().chars().take(SHOWN_CHARS).collect();
        Err(SyntaxError { line: self.line, column, expected, got })
    }

    /// Returns the next token if it is a word: letters, digits and underscores.
    pub fn peek_word(&self) -> Option<&'a str> {
        let rest = self.rest();
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        (end > 0).then(|| &rest[..end])
    }

    /// Consumes a word and returns it.
    pub fn word(&mut self, expected: &'static str) -> Result<&'a str, SyntaxError> {
        match self.peek_word() {
            Some(word) => Ok(self.take(word.len())),
            None => self.error(expected),
        }
    }

    /// Consumes a character if it comes next, and returns whether it did.
    pub fn has(&mut self, symbol: char) -> bool {
        let is_next = self.next_char() == Some(symbol);
        if is_next {
            self.take(symbol.len_utf8());
        }
        is_next
    }

    /// Consumes a character that must be there; `expected` is that character, for the error.
    pub fn symbol(&mut self, symbol: char, expected: &'static str) -> Result<(), SyntaxError> {
        if self.has(symbol) { Ok(()) } else { self.error(expected) }
    }

    /// Parses an integer from 0 on. A number beyond 64 bits counts as the largest.
    pub fn unsigned(&mut self, expected: &'static str) -> Result<u64, SyntaxError> {
        match self.digits(self.rest()) {
            0 => self.error(expected),
            digits => Ok(self.take(digits).parse().unwrap_or(u64::MAX)),
        }
    }

    fn digits(&self, text: &str) -> usize {
        text.bytes().take_while(u8::is_ascii_digit).count()
    }

    /// Returns the next token if it is a number: with a sign, a point or an exponent, as `5`, `-5.`, `.5` and
    /// `+5E-003`.
    pub fn peek_number(&self) -> Option<&'a str> {
        let rest = self.rest();
        let sign = usize::from(rest.starts_with(['+', '-']));
        let whole = self.digits(&rest[sign..]);
        let point = sign + whole;
        let fraction = rest[point..].strip_prefix('.').map(|fraction| self.digits(fraction));
        // A point or a sign without any digit is no number.
        if whole + fraction.unwrap_or(0) == 0 {
            return None;
        }
        let end = point + fraction.map_or(0, |digits| 1 + digits);
        // Without digits an `e` is no exponent.
        let exponent = rest[end..].strip_prefix(['e', 'E']).and_then(|exponent| {
            let sign = usize::from(exponent.starts_with(['+', '-']));
            let digits = self.digits(&exponent[sign..]);
            (digits > 0).then_some(1 + sign + digits)
        });
        Some(&rest[..end + exponent.unwrap_or(0)])
    }

    /// Parses a number; beyond the range of `f64` it is infinite.
    pub fn number(&mut self, expected: &'static str) -> Result<f64, SyntaxError> {
        let number = self.peek_number().and_then(|token| Some((token.len(), token.parse().ok()?)));
        match number {
            Some((bytes, number)) => {
                self.take(bytes);
                Ok(number)
            }
            None => self.error(expected),
        }
    }

    /// Parses a number without a fraction; `3.0` is one, too.
    pub fn integer(&mut self, expected: &'static str) -> Result<i128, SyntaxError> {
        let Some(token) = self.peek_number() else { return self.error(expected) };
        let exact = token.parse::<i128>().ok();
        let integer = exact.or_else(|| {
            // The exact parse comes first, since f64 skips integers beyond 2^53. The fallback is for integers
            // written as `3.0` or `1E3`.
            let number = token.parse::<f64>().ok()?;
            (number.fract() == 0.0 && number.abs() < 1e18).then_some(number as i128)
        });
        match integer {
            Some(integer) => {
                self.take(token.len());
                Ok(integer)
            }
            None => self.error(expected),
        }
    }

    /// Parses a text in quotes, of any number of lines, in which `\"` is a quote.
    pub fn quoted(&mut self, expected: &'static str) -> Result<String, SyntaxError> {
        let Some(inside) = self.rest().strip_prefix('"') else { return self.error(expected) };
        let mut last = ' ';
        for (at, c) in inside.char_indices() {
            // A backslash escapes a quote, but never another backslash: only the preceding character counts.
            if c == '"' && last != '\\' {
                let text = inside[..at].replace("\\\"", "\"");
                self.take(at + 2);
                return Ok(text);
            }
            last = c;
        }
        self.error("a text that ends with a quote")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_every_form_that_tools_write() {
        let number = |text: &str| Lexer::new(text).number("a number");
        for (text, expected) in [
            ("5", 5.0),
            ("5.", 5.0),
            ("+.5)", 0.5),
            ("-1E-003,", -0.001),
            ("3.4E+038|", 3.4e38),
            ("1e400", f64::INFINITY),
            ("2 // of N\n", 2.0),
            ("7e", 7.0),
        ] {
            assert_eq!(number(text), Ok(expected), "{text}");
        }
        for text in ["", ".", "-", "e5", "\"5\""] {
            assert!(number(text).is_err(), "{text}");
        }
        let integer = |text: &str| Lexer::new(text).integer("an integer");
        assert_eq!(integer("18446744073709551615 "), Ok(u64::MAX.into()));
        assert_eq!((integer("-3"), integer("4.0")), (Ok(-3), Ok(4)));
        assert!(integer("4.5").is_err() && integer("x").is_err());
    }

    #[test]
    fn tokens_are_read_one_after_another() {
        let mut lexer = Lexer::new(" // a comment\n SG_ 2nd\n: \"a \\\"b\\\"\n c\" 8|");
        assert_eq!((lexer.word("a word"), lexer.word("a word"), lexer.line()), (Ok("SG_"), Ok("2nd"), 3));
        assert!(lexer.has(':') && !lexer.has(':'));
        assert_eq!(lexer.quoted("a text"), Ok("a \"b\"\n c".to_string()));
        assert_eq!((lexer.unsigned("a number"), lexer.line()), (Ok(8), 4));
        let expected = SyntaxError { line: 4, column: 6, expected: "`@`", got: "|".to_string() };
        assert_eq!(lexer.symbol('@', "`@`"), Err(expected));
    }
}
