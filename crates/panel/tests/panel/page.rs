//! The page and its files.

use crate::stage::{Stage, ask};
use axum::body::Body;
use axum::http::{Request, StatusCode, header};
use hyper::service::Service as _;
use hyper_util::service::TowerToHyperService;

#[tokio::test]
async fn the_page_comes_with_a_policy_that_lets_nothing_in_from_elsewhere() {
    let stage = Stage::new();
    let page = stage.get("/").await;
    assert_eq!(
        (page.status, page.headers[header::CONTENT_TYPE].as_bytes()),
        (StatusCode::OK, &b"text/html; charset=utf-8"[..])
    );
    let policy = page.headers[header::CONTENT_SECURITY_POLICY].to_str().expect("a policy");
    for rule in ["default-src 'none'", "script-src 'self'", "frame-ancestors 'none'", "base-uri 'none'"] {
        assert!(policy.contains(rule), "{policy}");
    }
    assert!(!policy.contains("unsafe"), "{policy}");
    let text = String::from_utf8(page.body.to_vec()).expect("text");
    let named = text.split('"').filter(|part| part.starts_with("/assets/"));
    for path in named {
        assert_eq!(stage.get(path).await.status, StatusCode::OK, "{path}");
    }
}

#[tokio::test]
async fn a_file_that_a_browser_has_is_not_sent_again() {
    let stage = Stage::new();
    let first = stage.get("/assets/app.css").await;
    assert_eq!(first.headers[header::CACHE_CONTROL], "no-cache");
    let tag = first.headers[header::ETAG].clone();
    for (known, status) in [(tag.to_str().expect("a tag"), 304), ("\"another\"", 200)] {
        let request =
            Request::get("/assets/app.css").header(header::IF_NONE_MATCH, known).body(Body::empty());
        let answer = TowerToHyperService::new(stage.router())
            .call(request.expect("a request"))
            .await
            .expect("infallible");
        assert_eq!(answer.status().as_u16(), status, "{known}");
        assert_eq!(answer.headers()[header::ETAG], tag);
    }
}

#[tokio::test]
async fn there_is_nothing_but_the_files_of_the_page() {
    let stage = Stage::new();
    for path in [
        "/assets/../Cargo.toml",
        "/assets/%2e%2e/Cargo.toml",
        "/assets/",
        "/assets/js",
        "/assets//etc/passwd",
    ] {
        let answer = ask(stage.router(), "GET", path, None).await;
        assert_eq!(answer.status, StatusCode::NOT_FOUND, "{path}");
    }
}
