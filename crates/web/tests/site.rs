//! A site with a page and two tables of routes, served behind a guard, by an HTTP client that says what it is told to.

use axum::Router;
use axum::http::{Method, StatusCode, header};
use axum::routing::on;
use serde_json::{Value, json};
use std::net::SocketAddr;
use stepdrive_web::{Asked, Guard, Listener, Problem, Reply, Route, Site, route, router};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinSet;

const TOKEN: &str = "correct-horse-battery";

const PAGE: [Route<()>; 2] = [
    route(Method::GET, "/", |method| on(method, async || "the page")),
    route(Method::GET, "/assets/{*path}", |method| {
        on(method, async || ([(header::CACHE_CONTROL, "no-cache")], "a part"))
    }),
];

const THINGS: [Route<()>; 2] = [
    route(Method::GET, "/v1/things", |method| on(method, async || Reply(["one", "two"]))),
    route(Method::PUT, "/v1/things", |method| {
        on(method, async |Asked(thing): Asked<Value>| match thing.get("name") {
            Some(name) => Ok((StatusCode::ACCEPTED, Reply(json!({ "made": name })))),
            None => Err(Problem::impossible("a thing has a name").with("fields", json!({ "name": "text" }))),
        })
    }),
];

/// A served site; it ends when this is dropped.
struct Bench {
    address: SocketAddr,
    _tasks: JoinSet<()>,
}

struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl Bench {
    async fn start(guard: Guard) -> Bench {
        let listener = Listener::bind("127.0.0.1:0".parse().expect("an address")).await.expect("a listener");
        let (address, mut tasks) = (listener.address(), JoinSet::new());
        let page: Router = router(PAGE).with_state(());
        let site = Site::new(router(THINGS).with_state(()), guard, "GET /v1/things").with(page);
        tasks.spawn(async { match listener.serve(site, |error| panic!("{error}")).await {} });
        Bench { address, _tasks: tasks }
    }

    async fn send(&self, first_line: &str, head: &str, body: &str) -> Answer {
        let mut stream = TcpStream::connect(self.address).await.expect("connected");
        let length = body.len();
        let fixed = format!("Connection: close\r\nContent-Length: {length}\r\n");
        let request = format!("{first_line} HTTP/1.1\r\n{fixed}{head}\r\n{body}");
        stream.write_all(request.as_bytes()).await.expect("sent");
        let mut text = String::new();
        stream.read_to_string(&mut text).await.expect("answered");
        let (head, body) = text.split_once("\r\n\r\n").expect("a head");
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok());
        Answer { status: status.expect("a status"), head: head.to_lowercase(), body: body.to_owned() }
    }

    async fn get(&self, path: &str) -> Answer {
        self.send(&format!("GET {path}"), "Host: localhost\r\n", "").await
    }
}

#[tokio::test]
async fn the_page_comes_without_a_token_and_nothing_else_does() {
    let bench = Bench::start(Guard::with_token(TOKEN, "the one in the drawer")).await;
    for path in ["/", "/assets/js/main.js"] {
        assert_eq!(bench.get(path).await.status, 200, "{path}");
    }
    for path in ["/v1/things", "/nothing", "/assets", "//", "/v1/../assets/x"] {
        let answer = bench.get(path).await;
        assert_eq!(answer.status, 401, "{path}");
        assert!(answer.body.contains("with the one in the drawer"), "{}", answer.body);
    }
    assert_eq!(bench.send("POST /assets/x", "Host: localhost\r\n", "").await.status, 401);
    let shown = format!("Host: localhost\r\nAuthorization: Bearer {TOKEN}\r\n");
    assert_eq!(bench.send("GET /v1/things", &shown, "").await.body, r#"["one","two"]"#);
    let wrong = "Host: localhost\r\nAuthorization: Bearer other\r\n";
    let answer = bench.send("GET /v1/things", wrong, "").await;
    assert_eq!(answer.body, r#"{"error":"this is not the token; it is the one in the drawer"}"#);
}

#[tokio::test]
async fn the_page_too_is_refused_to_foreign_names_and_pages() {
    for guard in [Guard::open(), Guard::with_token(TOKEN, "the one")] {
        let bench = Bench::start(guard).await;
        for head in ["Host: evil.example\r\n", "", "Host: localhost\r\nOrigin: http://evil.example\r\n"] {
            for path in ["/", "/assets/x", "/v1/things"] {
                assert_eq!(bench.send(&format!("GET {path}"), head, "").await.status, 403, "{path} {head}");
            }
        }
    }
}

#[tokio::test]
async fn what_a_page_of_another_site_embeds_is_refused_and_a_link_to_the_page_is_not() {
    let bench = Bench::start(Guard::open()).await;
    let from = |site: &str| format!("Host: localhost\r\nSec-Fetch-Site: {site}\r\n");
    for line in ["GET /v1/things", "GET /assets/x", "PUT /v1/things", "POST /", "GET /nothing"] {
        assert_eq!(bench.send(line, &from("cross-site"), "").await.status, 403, "{line}");
    }
    assert_eq!(bench.send("GET /", &from("cross-site"), "").await.status, 200);
    for site in ["same-origin", "same-site", "none"] {
        assert_eq!(bench.send("GET /v1/things", &from(site), "").await.status, 200, "{site}");
    }
}

#[tokio::test]
async fn a_host_that_only_looks_like_this_one_is_another() {
    let bench = Bench::start(Guard::open()).await;
    for host in ["[127.0.0.1]", "[localhost]", "evil.example@127.0.0.1", "127.0.0.1@evil.example"] {
        let head = format!("Host: {host}\r\n");
        assert_eq!(bench.send("GET /v1/things", &head, "").await.status, 403, "{host}");
    }
    for host in ["127.0.0.1:80", "[::ffff:127.0.0.1]", "[::1]:80"] {
        let head = format!("Host: {host}\r\n");
        assert_eq!(bench.send("GET /v1/things", &head, "").await.status, 200, "{host}");
    }
}

#[tokio::test]
async fn what_is_not_there_is_told_with_where_to_look_whichever_table_is_asked() {
    let bench = Bench::start(Guard::open()).await;
    let answer = bench.get("/nothing").await;
    assert_eq!(answer.status, 404);
    assert_eq!(answer.body, r#"{"error":"there is nothing here; GET /v1/things says what there is"}"#);
    for (line, allowed) in [("DELETE /v1/things", "get,head,put"), ("POST /", "get,head")] {
        let answer = bench.send(line, "Host: localhost\r\n", "").await;
        assert_eq!(answer.status, 405, "{line}");
        assert!(answer.head.contains(&format!("allow: {allowed}")), "{line}: {}", answer.head);
        assert!(answer.body.contains("and GET /v1/things how"), "{line}: {}", answer.body);
    }
}

#[tokio::test]
async fn replies_are_not_kept_unless_they_say_how_long() {
    let bench = Bench::start(Guard::open()).await;
    for (path, kept) in [("/v1/things", "no-store"), ("/assets/x", "no-cache"), ("/nothing", "no-store")] {
        let head = bench.get(path).await.head;
        assert!(head.contains(&format!("cache-control: {kept}")), "{path}: {head}");
        assert!(head.contains("x-content-type-options: nosniff"), "{path}: {head}");
    }
}

#[tokio::test]
async fn a_problem_says_more_than_its_sentence_where_there_is_more() {
    let bench = Bench::start(Guard::open()).await;
    let json = "Host: localhost\r\nContent-Type: application/json\r\n";
    let answer = bench.send("PUT /v1/things", json, "{}").await;
    assert_eq!(answer.status, 422);
    assert_eq!(answer.body, r#"{"error":"a thing has a name","fields":{"name":"text"}}"#);
    let answer = bench.send("PUT /v1/things", json, "{\n}}").await;
    let told: Value = serde_json::from_str(&answer.body).expect("JSON");
    assert_eq!((answer.status, &told["line"], &told["column"]), (400, &json!(2), &json!(2)));
    let answer = bench.send("PUT /v1/things", "Host: localhost\r\n", "{}").await;
    assert_eq!(answer.status, 415);
    let answer = bench.send("PUT /v1/things", json, r#"{"name": 7}"#).await;
    assert_eq!((answer.status, answer.body.as_str()), (202, r#"{"made":7}"#));
}
