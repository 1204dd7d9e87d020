//! Who may view, and who may change something.
//!
//! A browser lets any page open a WebSocket to any address. So a request whose `Origin` header is neither this server's
//! own nor allowed is refused. Anybody can publish a name that resolves to this address, so that their page would have
//! the server's own origin (DNS rebinding): a `Host` that is a name other than `localhost` is refused, too,
//! unless its origin is allowed. Requests that change something need the token, which only the terminal shows.
//!
//! The token is after `#` in the address: a browser sends that in no request and no `Referer`.

use std::net::IpAddr;

use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, HeaderName, StatusCode};

use crate::error::LiveError;

/// Bytes of a token: 128 bits can't be guessed.
const TOKEN_BYTES: usize = 16;

/// Further origins from which a browser may connect.
#[derive(Clone, Debug, Default)]
pub struct Origins(Vec<String>);

/// Reason why a request is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// A required header is missing.
    #[error("the request has no header `{0}`")]
    Missing(&'static str),
    /// A header is repeated.
    #[error("the request has the header `{name}` {got} times")]
    Repeated {
        /// Name of the repeated header.
        name: &'static str,
        /// Number of times that the header is present.
        got: usize,
    },
    /// A header's value is not ASCII.
    #[error("the header `{0}` of the request is not text")]
    NotText(&'static str),
    /// The host is a name, which anybody may have published.
    #[error("the host `{0}` is a name: use the address itself, or allow the name by --live-origin http://{0}")]
    Host(String),
    /// The page is of another origin.
    #[error("the origin `{0}` is not this server's: allow it by --live-origin {0}")]
    Origin(String),
}

impl Origins {
    /// These origins, each as `scheme://host[:port]`.
    ///
    /// # Errors
    /// [`LiveError::Origin`] if one is invalid.
    pub fn new(origins: &[String]) -> Result<Origins, LiveError> {
        let is_origin = |text: &str| {
            text.split_once("://").is_some_and(|(scheme, host)| {
                !scheme.is_empty() && !host.is_empty() && !host.contains(['/', '?', '#', ' '])
            })
        };
        match origins.iter().find(|text| !is_origin(text)) {
            Some(text) => Err(LiveError::Origin { got: text.clone() }),
            None => Ok(Origins(origins.to_vec())),
        }
    }

    /// Admits or refuses a request.
    pub fn admit(&self, headers: &HeaderMap) -> Result<(), Refused> {
        let host = only(headers, HOST, "Host")?.ok_or(Refused::Missing("Host"))?;
        // A name that the user has allowed as an origin is one that the user trusts, so it may be the host as well.
        let is_of_host = |origin: &String| origin.split_once("://").is_some_and(|(_scheme, name)| name == host);
        if !is_address(host) && !self.0.iter().any(is_of_host) {
            return Err(Refused::Host(host.to_owned()));
        }
        match only(headers, ORIGIN, "Origin")? {
            None => Ok(()),
            // The server speaks plain HTTP, so its own origin has no other scheme. A browser states the origin of
            // every WebSocket that a page opens; other programs need not.
            Some(origin) if origin == format!("http://{host}") || self.0.iter().any(|allowed| allowed == origin) => {
                Ok(())
            }
            Some(origin) => Err(Refused::Origin(origin.to_owned())),
        }
    }
}

impl Refused {
    /// The status of the answer: 400 for a request that no browser makes, else 403.
    pub fn status(&self) -> StatusCode {
        match self {
            Refused::Missing(_) | Refused::Repeated { .. } | Refused::NotText(_) => StatusCode::BAD_REQUEST,
            Refused::Host(_) | Refused::Origin(_) => StatusCode::FORBIDDEN,
        }
    }
}

/// The value of a header that must not be repeated: others may choose a different one of two (RFC 9112, section
/// 3.2, demands 400 for `Host`).
fn only<'h>(headers: &'h HeaderMap, key: HeaderName, name: &'static str) -> Result<Option<&'h str>, Refused> {
    let values = headers.get_all(key);
    let mut each = values.iter();
    match (each.next(), each.next()) {
        (None, _) => Ok(None),
        (Some(value), None) => value.to_str().map(Some).map_err(|_not_ascii| Refused::NotText(name)),
        (Some(_), Some(_)) => Err(Refused::Repeated { name, got: values.iter().count() }),
    }
}

/// Whether `host[:port]` is an address or `localhost`, which nobody else can publish.
fn is_address(host: &str) -> bool {
    // In `[::1]` the last colon is within the brackets, and what follows it is not all digits.
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    name == "localhost" || bare.parse::<IpAddr>().is_ok()
}

/// The secret needed to change something.
#[derive(Clone, Debug)]
pub struct Token(String);

impl Token {
    /// A new one, of the system's random numbers.
    ///
    /// # Errors
    /// [`LiveError::Random`] if the system has none.
    pub fn new() -> Result<Token, LiveError> {
        let mut bytes = [0_u8; TOKEN_BYTES];
        let filled = rustix::rand::getrandom(&mut bytes, rustix::rand::GetRandomFlags::empty());
        match filled.map_err(|error| LiveError::Random(error.into()))? {
            // So few bytes come whole (getrandom(2)). A part of them would be a token that is easier to guess.
            TOKEN_BYTES => Ok(Token(bytes.iter().map(|byte| format!("{byte:02x}")).collect())),
            _ => Err(LiveError::Random(std::io::ErrorKind::UnexpectedEof.into())),
        }
    }

    /// Returns the token as hexadecimal text.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Whether `given` is the token; takes the same time for every wrong one of its length.
    pub fn is(&self, given: &str) -> bool {
        let differing = |sum, (a, b): (u8, u8)| sum | (a ^ b);
        // The length is no secret, so it may decide first.
        given.len() == self.0.len() && given.bytes().zip(self.0.bytes()).fold(0, differing) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn admitted(host: &str, origin: Option<&str>) -> Result<(), Refused> {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(ORIGIN, origin.parse().unwrap());
        }
        Origins::new(&[String::from("https://app.foxglove.dev"), String::from("http://bench:80")])
            .unwrap()
            .admit(&headers)
    }

    #[test]
    fn only_own_pages_and_programs_may_view() {
        for host in ["127.0.0.1:8080", "[::1]:8080", "localhost:9", "10.0.0.7", "bench:80"] {
            assert_eq!(admitted(host, None), Ok(()), "{host}");
            assert_eq!(admitted(host, Some(&format!("http://{host}"))), Ok(()), "{host}");
            assert_eq!(admitted(host, Some("https://app.foxglove.dev")), Ok(()));
            let foreign = String::from("http://example.com");
            assert_eq!(admitted(host, Some(&foreign)), Err(Refused::Origin(foreign)));
            assert_eq!(admitted(host, Some("null")), Err(Refused::Origin(String::from("null"))));
        }
        let own = "http://127.0.0.1:8080";
        assert_eq!(admitted("127.0.0.1:8081", Some(own)), Err(Refused::Origin(own.to_owned())));
        // A name that somebody else can publish could be made to lead to this machine (DNS rebinding).
        for host in ["rebound.example.com:8080", "bench", "127.0.0.1.example.com", ""] {
            assert_eq!(admitted(host, Some(&format!("http://{host}"))), Err(Refused::Host(host.to_owned())));
        }
    }

    #[test]
    fn a_header_that_is_missing_repeated_or_not_text_makes_a_bad_request() {
        let judged = |given: &[(HeaderName, &[u8])]| {
            let value = |bytes: &[u8]| axum::http::HeaderValue::from_bytes(bytes).unwrap();
            let headers: HeaderMap = given.iter().map(|(name, bytes)| (name.clone(), value(bytes))).collect();
            Origins::default().admit(&headers).map_err(|refused| (refused.status().as_u16(), refused.to_string()))
        };
        let (host, own): (_, (HeaderName, &[u8])) = ((HOST, &b"10.0.0.7"[..]), (ORIGIN, b"http://10.0.0.7"));
        let bad = |why: &str| Err((400, why.to_owned()));
        assert_eq!(judged(&[host.clone(), own.clone()]), Ok(()));
        assert_eq!(judged(core::slice::from_ref(&own)), bad("the request has no header `Host`"));
        assert_eq!(judged(&[host.clone(), host.clone()]), bad("the request has the header `Host` 2 times"));
        assert_eq!(judged(&[host.clone(), own.clone(), own]), bad("the request has the header `Origin` 2 times"));
        let no_text = bad("the header `Origin` of the request is not text");
        assert_eq!(judged(&[host, (ORIGIN, b"http://\xe9")]), no_text);
    }

    /// Behind a server that terminates TLS, the origin has the host's name but another scheme.
    #[test]
    fn the_host_of_an_allowed_origin_is_allowed() {
        let headers = |host: &str| HeaderMap::from_iter([(HOST, host.parse().unwrap())]);
        let origins = Origins::new(&[String::from("https://bench.example:8443")]).unwrap();
        assert_eq!(origins.admit(&headers("bench.example:8443")), Ok(()));
        let other = String::from("bench.example");
        assert_eq!(origins.admit(&headers(&other)), Err(Refused::Host(other)));
    }

    #[test]
    fn invalid_origins_are_rejected() {
        for text in ["app.foxglove.dev", "https://", "https://a/b", "://x"] {
            assert!(
                matches!(Origins::new(&[text.to_owned()]), Err(LiveError::Origin { got }) if got == text),
                "{text}"
            );
        }
    }

    #[test]
    fn tokens_differ_and_only_the_whole_one_matches() {
        let one = Token::new().unwrap();
        let other = Token::new().unwrap();
        assert_ne!(one.text(), other.text());
        assert_eq!(one.text().len(), 32);
        assert!(one.is(one.text()) && !one.is(other.text()) && !one.is("") && !one.is(&one.text()[1..]));
    }
}
