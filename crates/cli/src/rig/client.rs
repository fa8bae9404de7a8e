//! A client of the control API: HTTP/1.1 and JSON.

use super::sse::Events;
use crate::Failure;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;
use ureq::http::{Request, Response, StatusCode, Uri};
use ureq::{Agent, AsSendBody, Body, BodyReader, Timeout};

/// Where a rig is controlled from when its rig file is as the demo's.
pub(crate) const DEFAULT_API: &str = "http://127.0.0.1:8087";

/// How long it may take until the rig's computer takes a connection.
const CONNECT: Duration = Duration::from_secs(3);

/// The largest answer that is read, bytes: more than the state of any rig has.
const LARGEST_ANSWER: u64 = 256 << 20;

/// Under which these options stand in help texts.
const HEADING: &str = "Which rig";

/// Which rig is meant, and how one is let in.
#[derive(Debug, clap::Args)]
pub(crate) struct At {
    /// Where the rig is controlled from: `api` of its rig file, which `stepdrive up` tells.
    #[arg(long, value_name = "URL", default_value = DEFAULT_API, global = true, help_heading = HEADING)]
    api: String,
    /// The `api_token` of its rig file, if it has one. Others on this computer may see it; a file is safer.
    #[arg(long, value_name = "TOKEN", global = true, help_heading = HEADING)]
    token: Option<String>,
    /// A file with the token in it.
    #[arg(long, value_name = "FILE", conflicts_with = "token", global = true, help_heading = HEADING)]
    token_file: Option<PathBuf>,
}

/// A client of one rig.
pub(super) struct Client {
    agent: Agent,
    /// `http://HOST:PORT`.
    base: String,
    token: Option<String>,
}

/// What a rig answered.
pub(super) struct Answer {
    /// JSON.
    pub(super) text: String,
    base: String,
}

/// An answer that says no, or none.
#[derive(Debug)]
pub(super) struct Refusal {
    /// Whether what was asked for is wrong, and not only in vain.
    pub(super) wrong: bool,
    /// What is told to the person.
    pub(super) message: String,
    /// Line and column in what was sent, from 1.
    pub(super) place: Option<(usize, usize)>,
}

/// The body of an answer that says no.
#[derive(Deserialize)]
struct ErrorBody {
    error: String,
    line: Option<usize>,
    column: Option<usize>,
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Failure {
        let kind = if refusal.wrong { Failure::Usage } else { Failure::Failed };
        kind(refusal.message)
    }
}

impl Client {
    /// A client of the rig that is meant. Nothing is asked yet.
    pub(super) fn new(at: &At) -> Result<Client, Failure> {
        // A proxy that the environment names is for the world outside; a rig is near.
        let config = Agent::config_builder().proxy(None).http_status_as_error(false).max_redirects(0);
        let agent = config.timeout_connect(Some(CONNECT)).build().new_agent();
        Ok(Client { agent, base: base(&at.api)?, token: token(at)? })
    }

    /// Where the rig is.
    pub(super) fn base(&self) -> &str {
        &self.base
    }

    /// Asks for something.
    pub(super) fn get(&self, path: &str) -> Result<Answer, Refusal> {
        self.answer(self.ask("GET", path, ())?)
    }

    /// Asks for something to be set.
    pub(super) fn put(&self, path: &str, body: &serde_json::Value) -> Result<Answer, Refusal> {
        self.answer(self.ask("PUT", path, body.to_string())?)
    }

    /// Asks for something to be done.
    pub(super) fn post(&self, path: &str, body: &serde_json::Value) -> Result<Answer, Refusal> {
        self.answer(self.ask("POST", path, body.to_string())?)
    }

    /// Asks to be told what happens.
    pub(super) fn listen(&self, path: &str) -> Result<Events<BodyReader<'static>>, Refusal> {
        Ok(Events::new(self.ask("GET", path, ())?.into_body().into_reader()))
    }

    /// Asks for something to be done, and to be told meanwhile what happens.
    pub(super) fn post_and_listen(
        &self,
        path: &str,
        body: &serde_json::Value,
    ) -> Result<Events<BodyReader<'static>>, Refusal> {
        Ok(Events::new(self.ask("POST", path, body.to_string())?.into_body().into_reader()))
    }

    fn ask(&self, method: &str, path: &str, body: impl AsSendBody) -> Result<Response<Body>, Refusal> {
        let mut request = Request::builder().method(method).uri(format!("{}{path}", self.base));
        if method != "GET" {
            request = request.header("content-type", "application/json");
        }
        if let Some(token) = &self.token {
            request = request.header("authorization", format!("Bearer {token}"));
        }
        let request = request.body(body).map_err(|error| wrong(error.to_string()))?;
        let response = self.agent.run(request).map_err(|error| self.unreachable(&error))?;
        if response.status().is_success() { Ok(response) } else { Err(self.refused(response)) }
    }

    fn answer(&self, mut response: Response<Body>) -> Result<Answer, Refusal> {
        let text = response.body_mut().with_config().limit(LARGEST_ANSWER).read_to_string();
        let text = text.map_err(|error| self.unreachable(&error))?;
        Ok(Answer { text, base: self.base.clone() })
    }

    /// What an answer that says no has to say.
    fn refused(&self, mut response: Response<Body>) -> Refusal {
        let status = response.status();
        let text = response.body_mut().read_to_string().unwrap_or_default();
        let Ok(body) = serde_json::from_str::<ErrorBody>(&text) else { return no_rig(&self.base, &status) };
        // A conflict passes when the other has ended; an error of the server is none of the person's.
        let wrong = status.is_client_error() && status != StatusCode::CONFLICT;
        let how = if status == StatusCode::UNAUTHORIZED { "; --token-file FILE gives it" } else { "" };
        Refusal { wrong, message: format!("{}{how}", body.error), place: body.line.zip(body.column) }
    }

    /// Why there is no answer.
    fn unreachable(&self, error: &ureq::Error) -> Refusal {
        if let ureq::Error::Protocol(_) = error {
            return no_rig(&self.base, &"it does not speak HTTP/1.1");
        }
        let why = reason(error);
        let message = format!(
            "no rig answers at {} ({why}): start one with `stepdrive up`, or name its API with --api URL",
            self.base
        );
        Refusal { wrong: false, message, place: None }
    }
}

impl Answer {
    /// What it says.
    pub(super) fn read<T: DeserializeOwned>(&self) -> Result<T, Refusal> {
        serde_json::from_str(&self.text).map_err(|error| no_rig(&self.base, &error))
    }

    /// The whole of it as a line.
    pub(super) fn line(&self) -> String {
        format!("{}\n", self.text.trim_end())
    }
}

/// A part of a path, such as the name of a drive, with everything in it that means something in a URL made harmless.
pub(super) fn part(name: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte);
    let shown = |byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") };
    name.bytes().map(shown).collect()
}

/// Why there is no answer, in few words.
fn reason(error: &ureq::Error) -> String {
    if let ureq::Error::Io(error) = error {
        return io_reason(error);
    }
    if let ureq::Error::Timeout(Timeout::Connect) = error {
        return format!("nothing came for {} s", CONNECT.as_secs());
    }
    if let ureq::Error::HostNotFound = error {
        return "there is no such host".to_owned();
    }
    error.to_string()
}

/// Without the numbers of the system where they say nothing more.
fn io_reason(error: &io::Error) -> String {
    let kind = error.kind();
    if kind == io::ErrorKind::ConnectionRefused {
        return "connection refused".to_owned();
    }
    if matches!(kind, io::ErrorKind::ConnectionReset | io::ErrorKind::UnexpectedEof) {
        return "the connection was closed without an answer".to_owned();
    }
    error.to_string()
}

fn no_rig(base: &str, why: &dyn std::fmt::Display) -> Refusal {
    let message = format!("what answers at {base} is not a rig ({why}); name the rig's API with --api URL");
    Refusal { wrong: false, message, place: None }
}

fn wrong(message: String) -> Refusal {
    Refusal { wrong: true, message, place: None }
}

/// The start of every URL of the API.
fn base(api: &str) -> Result<String, Failure> {
    let with_scheme = if api.contains("://") { api.to_owned() } else { format!("http://{api}") };
    let base = with_scheme.trim_end_matches('/');
    let bad = |why: &str| Failure::Usage(format!("--api {api}: {why}, as in {DEFAULT_API}"));
    let uri: Uri = base.parse().map_err(|_| bad("it is a URL"))?;
    if uri.scheme_str() != Some("http") {
        return Err(bad("a rig is controlled over http"));
    }
    if uri.host().is_none_or(str::is_empty) || uri.path_and_query().is_some_and(|path| path.as_str() != "/") {
        return Err(bad("it is host and port only"));
    }
    Ok(base.to_owned())
}

/// The token to show, if there is one.
fn token(at: &At) -> Result<Option<String>, Failure> {
    let token = match (&at.token, &at.token_file) {
        (Some(token), _) => token.clone(),
        (None, Some(file)) => read_token(file)?,
        (None, None) => return Ok(None),
    };
    let sendable = !token.is_empty() && token.bytes().all(|byte| byte.is_ascii_graphic());
    let refusal =
        || Failure::Usage("the token is not one: it is printable ASCII characters without spaces".to_owned());
    sendable.then_some(Some(token)).ok_or_else(refusal)
}

fn read_token(file: &Path) -> Result<String, Failure> {
    let text = fs::read_to_string(file);
    let text = text
        .map_err(|error| Failure::Usage(format!("cannot read the token file {}: {error}", file.display())))?;
    Ok(text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_api_may_be_given_with_and_without_its_scheme() {
        for text in ["127.0.0.1:8087", "http://127.0.0.1:8087", "http://127.0.0.1:8087/"] {
            assert_eq!(base(text).expect(text), DEFAULT_API);
        }
        assert_eq!(base("http://[::1]:80").expect("valid"), "http://[::1]:80");
    }

    #[test]
    fn what_is_no_api_is_refused() {
        for text in ["", "https://127.0.0.1:8087", "http://127.0.0.1:8087/v1", "http://", "a b", "ftp://x"] {
            let Err(Failure::Usage(message)) = base(text) else { panic!("`{text}` was taken") };
            assert!(message.starts_with(&format!("--api {text}: ")), "{message}");
        }
    }

    #[test]
    fn a_part_of_a_path_cannot_lead_elsewhere() {
        assert_eq!(part("stage-2_b"), "stage-2_b");
        assert_eq!(part("a/../b?c#d é"), "a%2F..%2Fb%3Fc%23d%20%C3%A9");
    }
}
