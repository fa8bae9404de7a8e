//! The page: its files, embedded. Nothing of it comes from elsewhere.

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use stepdrive_web::Problem;

/// What the page may do: load what comes from here, and talk to nobody else.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
    frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// A file of the page.
struct Asset {
    path: &'static str,
    bytes: &'static [u8],
}

macro_rules! assets {
    ($($path:literal)+) => {
        /// All files.
        static ASSETS: [Asset; [$($path),+].len()] = [
            $(Asset { path: $path, bytes: include_bytes!(concat!("../assets/", $path)) },)+
        ];
    };
}

assets! {
    "app.css"
    "icon.svg"
    "index.html"
    "js/axis.js"
    "js/bake.js"
    "js/clock.js"
    "js/dom.js"
    "js/drive.js"
    "js/editor.js"
    "js/jog.js"
    "js/lights.js"
    "js/main.js"
    "js/mechanism.js"
    "js/net.js"
    "js/overview.js"
    "js/plot.js"
    "js/programs.js"
    "js/rig.js"
    "js/settings.js"
    "js/store.js"
    "js/timeline.js"
    "js/traffic.js"
    "vendor/uplot/LICENSE"
    "vendor/uplot/uPlot.iife.min.js"
    "vendor/uplot/uPlot.min.css"
}

impl Asset {
    fn content_type(&self) -> &'static str {
        match self.path.rsplit_once('.').map(|(_, kind)| kind) {
            Some("html") => "text/html; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("js") => "text/javascript; charset=utf-8",
            Some("svg") => "image/svg+xml",
            Some(_) | None => "text/plain; charset=utf-8",
        }
    }

    /// Changes with the contents.
    fn tag(&self) -> String {
        // FNV-1a, 64 bits: it tells versions of a file apart, no more.
        let mix = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        let hash = self.bytes.iter().fold(0xCBF2_9CE4_8422_2325, mix);
        format!("\"{hash:016x}\"")
    }

    /// The reply with it, or without it for a client that has it already.
    fn reply(&self, headers: &HeaderMap) -> Response {
        let tag = self.tag();
        let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|tags| tags.to_str().ok());
        let known = known.flat_map(|tags| tags.split(',')).any(|other| other.trim() == tag);
        let headers: [(HeaderName, String); 5] = [
            (header::CONTENT_TYPE, self.content_type().to_owned()),
            (header::ETAG, tag),
            (header::CACHE_CONTROL, "no-cache".to_owned()),
            (header::CONTENT_SECURITY_POLICY, POLICY.to_owned()),
            (header::REFERRER_POLICY, "no-referrer".to_owned()),
        ];
        if known {
            return (StatusCode::NOT_MODIFIED, headers).into_response();
        }
        (headers, self.bytes).into_response()
    }
}

/// The page.
pub(crate) fn router() -> Router {
    Router::new().route("/", get(index)).route("/assets/{*path}", get(asset))
}

async fn index(headers: HeaderMap) -> Response {
    find("index.html", &headers)
}

async fn asset(Path(path): Path<String>, headers: HeaderMap) -> Response {
    find(&path, &headers)
}

fn find(path: &str, headers: &HeaderMap) -> Response {
    match ASSETS.iter().find(|asset| asset.path == path) {
        Some(asset) => asset.reply(headers),
        None => Problem::new(StatusCode::NOT_FOUND, "the page has no such file").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    /// The most that the page may weigh.
    const MOST: usize = 300 << 10;

    fn files(folder: &Path, under: &str, found: &mut BTreeSet<String>) {
        for entry in fs::read_dir(folder).expect("a folder") {
            let entry = entry.expect("an entry");
            let name = format!("{under}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                files(&entry.path(), &format!("{name}/"), found);
            } else {
                found.insert(name);
            }
        }
    }

    #[test]
    fn every_file_of_the_page_is_served_and_no_other() {
        let mut found = BTreeSet::new();
        files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets"), "", &mut found);
        let served: BTreeSet<String> = ASSETS.iter().map(|asset| asset.path.to_owned()).collect();
        assert_eq!(served, found);
    }

    #[test]
    fn the_page_is_light() {
        let bytes: usize = ASSETS.iter().map(|asset| asset.bytes.len()).sum();
        assert!(bytes < MOST, "{bytes} bytes");
    }

    #[test]
    fn nothing_in_the_page_is_what_its_policy_forbids_or_comes_from_elsewhere() {
        for asset in ASSETS.iter().filter(|asset| asset.content_type().starts_with("text/html")) {
            let text = std::str::from_utf8(asset.bytes).expect("text");
            for forbidden in
                [" style=", " onclick=", " onload=", "<style", "javascript:", "src=\"http", "href=\"http"]
            {
                assert!(!text.contains(forbidden), "{} has {forbidden}", asset.path);
            }
        }
        for asset in ASSETS.iter().filter(|asset| asset.path.starts_with("js/")) {
            let text = std::str::from_utf8(asset.bytes).expect("text");
            for forbidden in
                ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "https://"]
            {
                assert!(!text.contains(forbidden), "{} has {forbidden}", asset.path);
            }
        }
    }
}
