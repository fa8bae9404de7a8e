//! Who may ask: whoever names this computer, is no foreign web page, and shows the token if one is needed.
//!
//! A web page that a person looks at can send requests to this computer. It cannot forge `Origin`, and when it has its
//! own name lead here (DNS rebinding), `Host` still has that name.

use crate::Problem;
use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};
use std::fmt;
use std::net::IpAddr;
use std::sync::Arc;

/// Where everything lies that a page in a browser is made of. It says nothing about what is controlled, and a browser
/// cannot show a token before the page has asked for it.
const ASSETS: &str = "/assets/";

/// Where a browser says whether what asks is of the same site.
const FETCH_SITE: &str = "sec-fetch-site";

/// The address at which a connection arrived.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrived(pub(crate) IpAddr);

/// Lets those requests through that may be answered. That they name this computer and come from no foreign web page is
/// always asked, but that a foreign page may lead to `GET /`, the page; a token is not for `GET /` and `GET /assets/…`, the page and its parts.
#[derive(Debug)]
pub struct Guard {
    /// What a client has to show; `None` when nothing.
    token: Option<Token>,
}

impl Guard {
    /// Asks for no token.
    pub fn open() -> Guard {
        Guard { token: None }
    }

    /// Asks for a token. `whence` tells people which one, as in `the api_token of the rig file`.
    pub fn with_token(token: &str, whence: &'static str) -> Guard {
        Guard { token: Some(Token { digest: Sha256::digest(token).into(), whence }) }
    }

    fn check(&self, request: &Request) -> Result<(), Problem> {
        let arrived = request.extensions().get::<Arrived>().map(|arrived| arrived.0.to_canonical());
        let host = check_host(request.uri(), request.headers(), arrived)?;
        check_origin(request.headers(), &host)?;
        check_site(request)?;
        match &self.token {
            Some(token) if !is_page(request.method(), request.uri().path()) => token.check(request.headers()),
            Some(_) | None => Ok(()),
        }
    }
}

/// What a client has to show, as its digest.
struct Token {
    digest: [u8; 32],
    whence: &'static str,
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Token").finish_non_exhaustive()
    }
}

impl Token {
    fn check(&self, headers: &HeaderMap) -> Result<(), Problem> {
        let whence = self.whence;
        let shown = headers.get(header::AUTHORIZATION).map(HeaderValue::as_bytes);
        let Some((scheme, shown)) = shown.and_then(|shown| shown.split_at_checked("Bearer ".len())) else {
            return Err(unauthorised(format!(
                "a token is needed; send the header Authorization: Bearer TOKEN, with {whence}"
            )));
        };
        if scheme.eq_ignore_ascii_case(b"Bearer ") && self.is(shown) {
            return Ok(());
        }
        Err(unauthorised(format!("this is not the token; it is {whence}")))
    }

    /// Compares in a time that says nothing about the token: every byte of the digests is looked at.
    fn is(&self, shown: &[u8]) -> bool {
        let shown: [u8; 32] = Sha256::digest(shown).into();
        self.digest.iter().zip(shown).fold(0, |differing, (mine, shown)| differing | (mine ^ shown)) == 0
    }
}

/// The layer that puts a guard before routes.
pub(crate) async fn guard(State(guard): State<Arc<Guard>>, request: Request, next: Next) -> Response {
    let mut response = match guard.check(&request) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    let headers = response.headers_mut();
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

/// Whether a page or a part of it is asked for.
fn is_page(method: &Method, path: &str) -> bool {
    matches!(*method, Method::GET | Method::HEAD) && (path == "/" || path.starts_with(ASSETS))
}

/// The host that is asked, if it is this one.
fn check_host(uri: &Uri, headers: &HeaderMap, arrived: Option<IpAddr>) -> Result<Authority, Problem> {
    let mut named = headers.get_all(header::HOST).iter();
    let host = match (named.next(), named.next()) {
        (Some(host), None) => Authority::try_from(host.as_bytes()).ok(),
        _ => None,
    };
    // A host has no user; one that has is there to be mistaken for another.
    let host = host.filter(|host| !host.as_str().contains('@'));
    let is_here = |host: &Authority| is_here(host.host(), arrived);
    host.filter(is_here).filter(|_| uri.authority().is_none_or(is_here)).ok_or_else(|| {
        let message =
            "the Host header names another computer; ask by the address that is listened on, or by localhost";
        Problem::new(StatusCode::FORBIDDEN, message)
    })
}

/// Whether a host is this computer: a loopback name or address, or the address at which the connection arrived.
fn is_here(host: &str, arrived: Option<IpAddr>) -> bool {
    let address = address(host).map(|address| address.to_canonical());
    host.eq_ignore_ascii_case("localhost")
        || address.is_some_and(|address| address.is_loopback() || Some(address) == arrived)
}

/// The address that a host is, if it is one: one of IPv6 stands in brackets.
fn address(host: &str) -> Option<IpAddr> {
    match host.strip_prefix('[').and_then(|host| host.strip_suffix(']')) {
        Some(host) => host.parse().ok().map(IpAddr::V6),
        None => host.parse().ok().map(IpAddr::V4),
    }
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
    Err(foreign())
}

/// Browsers send no `Origin` with what a foreign page embeds, as an image, but say that it is from another site. Only a
/// link may lead here from elsewhere, to the page.
fn check_site(request: &Request) -> Result<(), Problem> {
    let is_foreign = |site: &HeaderValue| site.as_bytes().eq_ignore_ascii_case(b"cross-site");
    let is_foreign = request.headers().get_all(FETCH_SITE).iter().any(is_foreign);
    let is_link = matches!(*request.method(), Method::GET | Method::HEAD) && request.uri().path() == "/";
    if is_foreign && !is_link { Err(foreign()) } else { Ok(()) }
}

fn foreign() -> Problem {
    let message = "this comes from a web page of another origin; it may not control anything here";
    Problem::new(StatusCode::FORBIDDEN, message)
}

fn unauthorised(message: String) -> Problem {
    Problem::new(StatusCode::UNAUTHORIZED, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_computer_are_here() {
        let arrived = "192.0.2.7".parse().ok();
        for host in [
            "localhost",
            "LocalHost",
            "127.0.0.1",
            "127.9.9.9",
            "[::1]",
            "192.0.2.7",
            "[::ffff:127.0.0.1]",
            "[::ffff:192.0.2.7]",
        ] {
            assert!(is_here(host, arrived), "{host}");
        }
        for host in ["[127.0.0.1]", "[localhost]", "::1", "[::1", "[[::1]]", "[::ffff:192.0.2.8]"] {
            assert!(!is_here(host, arrived), "{host}");
        }
        for host in ["", "localhost.evil.example", "127.0.0.1.evil.example", "192.0.2.8", "0.0.0.0", "[::2]"]
        {
            assert!(!is_here(host, arrived), "{host}");
        }
    }

    #[test]
    fn a_token_is_itself_and_nothing_else() {
        let digest = Sha256::digest("sixteen-letters!").into();
        let token = Token { digest, whence: "the one" };
        assert!(token.is(b"sixteen-letters!"));
        for other in [&b""[..], b"sixteen-letters", b"sixteen-letters!!", b"Sixteen-letters!"] {
            assert!(!token.is(other));
        }
    }

    #[test]
    fn only_the_page_and_its_parts_are_shown_without_a_token() {
        for path in ["/", "/assets/app.css", "/assets/js/main.js"] {
            assert!(is_page(&Method::GET, path) && is_page(&Method::HEAD, path), "{path}");
            assert!(!is_page(&Method::POST, path) && !is_page(&Method::PUT, path), "{path}");
        }
        for path in ["", "//", "/v1/rig", "/openapi.json", "/assets", "/v1/assets/", "/ASSETS/x"] {
            assert!(!is_page(&Method::GET, path), "{path}");
        }
    }
}
