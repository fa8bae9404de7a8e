//! Who may ask: whoever names this computer, is no foreign web page, and shows the token if one is needed.
//!
//! A web page that a person looks at can send requests to this computer. It cannot forge `Origin`, and when it has its
//! own name lead here (DNS rebinding), `Host` still has that name.

use super::TheApi;
use super::problem::Problem;
use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};
use std::net::IpAddr;

/// The address at which a connection arrived.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrived(pub(super) IpAddr);

/// What a client has to show, as its digest.
pub(super) struct Token([u8; 32]);

impl Token {
    pub(super) fn new(token: &str) -> Token {
        Token(Sha256::digest(token).into())
    }

    /// Compares in a time that says nothing about the token: every byte of the digests is looked at.
    fn is(&self, shown: &[u8]) -> bool {
        let shown: [u8; 32] = Sha256::digest(shown).into();
        self.0.iter().zip(shown).fold(0, |differing, (mine, shown)| differing | (mine ^ shown)) == 0
    }
}

/// Lets those requests through that may be answered.
pub(super) async fn guard(State(api): TheApi, request: Request, next: Next) -> Response {
    let mut response = match check(api.token.as_ref(), &request) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

fn check(token: Option<&Token>, request: &Request) -> Result<(), Problem> {
    let arrived = request.extensions().get::<Arrived>().map(|arrived| arrived.0.to_canonical());
    let host = check_host(request.uri(), request.headers(), arrived)?;
    check_origin(request.headers(), &host)?;
    match token {
        Some(token) => check_token(request.headers(), token),
        None => Ok(()),
    }
}

/// The host that is asked, if it is this one.
fn check_host(uri: &Uri, headers: &HeaderMap, arrived: Option<IpAddr>) -> Result<Authority, Problem> {
    let mut named = headers.get_all(header::HOST).iter();
    let host = match (named.next(), named.next()) {
        (Some(host), None) => Authority::try_from(host.as_bytes()).ok(),
        _ => None,
    };
    let is_here = |host: &Authority| is_here(host.host(), arrived);
    host.filter(is_here).filter(|_| uri.authority().is_none_or(is_here)).ok_or_else(|| {
        let message = "the Host header names another computer; ask by the address that the API listens on, or by localhost";
        Problem::new(StatusCode::FORBIDDEN, message)
    })
}

/// Whether a host is this computer: a loopback name or address, or the address at which the connection arrived.
fn is_here(host: &str, arrived: Option<IpAddr>) -> bool {
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let address: Option<IpAddr> = host.parse().ok();
    host.eq_ignore_ascii_case("localhost")
        || address.is_some_and(|address| address.is_loopback() || Some(address) == arrived)
}

/// A web page may ask only if it comes from here.
fn check_origin(headers: &HeaderMap, host: &Authority) -> Result<(), Problem> {
    let from_here = |origin: &HeaderValue| {
        let origin = origin.as_bytes().strip_prefix(b"http://");
        origin.is_some_and(|origin| origin.eq_ignore_ascii_case(host.as_str().as_bytes()))
    };
    if headers.get_all(header::ORIGIN).iter().all(from_here) {
        return Ok(());
    }
    Err(Problem::new(
        StatusCode::FORBIDDEN,
        "this comes from a web page of another origin; it may not control the rig",
    ))
}

fn check_token(headers: &HeaderMap, token: &Token) -> Result<(), Problem> {
    let shown = headers.get(header::AUTHORIZATION).map(HeaderValue::as_bytes);
    let Some((scheme, shown)) = shown.and_then(|shown| shown.split_at_checked("Bearer ".len())) else {
        return Err(unauthorised(
            "a token is needed; send the header Authorization: Bearer TOKEN, with the api_token of the rig file",
        ));
    };
    if scheme.eq_ignore_ascii_case(b"Bearer ") && token.is(shown) {
        return Ok(());
    }
    Err(unauthorised("this is not the token; it is the api_token of the rig file"))
}

fn unauthorised(message: &str) -> Problem {
    Problem::new(StatusCode::UNAUTHORIZED, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_computer_are_here() {
        let arrived = "192.0.2.7".parse().ok();
        for host in ["localhost", "LocalHost", "127.0.0.1", "127.9.9.9", "[::1]", "192.0.2.7"] {
            assert!(is_here(host, arrived), "{host}");
        }
        for host in ["", "localhost.evil.example", "127.0.0.1.evil.example", "192.0.2.8", "0.0.0.0", "[::2]"]
        {
            assert!(!is_here(host, arrived), "{host}");
        }
    }

    #[test]
    fn a_token_is_itself_and_nothing_else() {
        let token = Token::new("sixteen-letters!");
        assert!(token.is(b"sixteen-letters!"));
        for other in [&b""[..], b"sixteen-letters", b"sixteen-letters!!", b"Sixteen-letters!"] {
            assert!(!token.is(other));
        }
    }
}
