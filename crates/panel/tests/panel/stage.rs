//! A panel over an SMSD in millimetres and an SMD3 in steps, and those who use it.

use crate::bench::Bench;
use crate::station::Station;
use axum::Router;
use axum::body::{Body, BodyDataStream, Bytes, to_bytes};
use axum::http::{HeaderMap, Request, StatusCode, header};
use futures_util::StreamExt as _;
use hyper::service::Service as _;
use hyper_util::service::TowerToHyperService;
use serde_json::Value;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_host::axis::{DriveAxis, Smd3Motor, SmsdMotor, SoftLimits};
use stepdrive_host::smsd::SmsdOptions;
use stepdrive_host::units::{Decimal, Scale};
use stepdrive_panel::{Controller, Keeper, Panel, PanelAxis};
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, timeout};

pub(crate) use crate::station::{MS, SECOND};

/// A reply.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: StatusCode,
    pub(crate) headers: HeaderMap,
    pub(crate) body: Bytes,
}

impl Answer {
    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body).expect("JSON")
    }

    /// Its status and why.
    pub(crate) fn error(&self) -> (u16, String) {
        (self.status.as_u16(), self.json()["error"].as_str().expect("an error").to_owned())
    }

    #[track_caller]
    pub(crate) fn done(self) -> Value {
        assert!(self.status.is_success(), "{} {:?}", self.status, self.body);
        self.json()
    }
}

/// Two controllers and a panel over them.
pub(crate) struct Stage {
    pub(crate) smsd: Bench,
    pub(crate) smd3: Arc<Station>,
    pub(crate) panel: Panel,
}

impl Stage {
    /// `stage`, an SMSD with a screw of 5 mm, and `uhv`, an SMD3 in full steps.
    pub(crate) fn new() -> Stage {
        Stage::with(SoftLimits::OFF, None)
    }

    pub(crate) fn with(limits: SoftLimits, keeper: Option<Box<dyn Keeper>>) -> Stage {
        let (smsd, smd3) = (Bench::new(), Station::new());
        let screw = Scale::millimetres(Decimal::whole(5), 200).expect("a scale");
        let motor = SmsdMotor::new("stage", smsd.another(SmsdOptions::default()));
        let stage = DriveAxis::new(motor).with_scale(screw).with_limits(limits);
        let uhv = DriveAxis::new(Smd3Motor::new(smd3.client()));
        let mut stage = axis("stage", Controller::Smsd(Arc::new(stage)));
        stage.keeper = keeper;
        let panel = Panel::new(vec![stage, axis("uhv", Controller::Smd3(Arc::new(uhv)))]);
        Stage { smsd, smd3, panel }
    }

    pub(crate) fn router(&self) -> Router {
        self.panel.router()
    }

    pub(crate) async fn get(&self, path: &str) -> Answer {
        ask(self.router(), "GET", path, None).await
    }

    pub(crate) async fn post(&self, path: &str, body: &str) -> Answer {
        ask(self.router(), "POST", path, Some(body)).await
    }

    pub(crate) async fn put(&self, path: &str, body: &str) -> Answer {
        ask(self.router(), "PUT", path, Some(body)).await
    }

    /// A request that goes on by itself.
    pub(crate) fn begin(
        &self,
        method: &'static str,
        path: &str,
        body: &str,
    ) -> tokio::task::JoinHandle<Answer> {
        let (router, path, body) = (self.router(), path.to_owned(), body.to_owned());
        tokio::spawn(async move { ask(router, method, &path, Some(&body)).await })
    }

    /// Holds a key down: jogs the SMSD in the positive direction at 5 mm/s.
    pub(crate) async fn jog(&self, id: &str) -> Answer {
        self.post("/v1/axes/stage/jog", &format!(r#"{{"direction":"+","speed":5,"id":"{id}"}}"#)).await
    }

    pub(crate) async fn watch(&self, query: &str) -> Viewer {
        let answer = respond(self.router(), "GET", &format!("/v1/axes/events{query}"), None).await;
        assert_eq!(answer.status(), StatusCode::OK);
        Viewer { body: answer.into_body().into_data_stream(), text: String::new() }
    }

    // ---- the SMSD

    /// Puts current on it, as another program does.
    pub(crate) async fn energise(&self) {
        let other = self.smsd.another(SmsdOptions::default());
        other.trigger(Reg::SoftStop).await.expect("it can be reached");
        self.smsd.acts();
    }

    /// How fast it turns, in full steps a second.
    pub(crate) fn speed(&self) -> f64 {
        self.smsd.machine(|machine, now| {
            machine.advance(now);
            machine.drive().speed(now)
        })
    }

    /// Where it is, in mm.
    pub(crate) fn place(&self) -> f64 {
        self.smsd.machine(|machine, now| {
            machine.advance(now);
            machine.carriage(now)
        }) / 40.0
    }
}

pub(crate) fn axis(name: &str, controller: Controller) -> PanelAxis {
    PanelAxis {
        name: name.to_owned(),
        is_virtual: true,
        target: format!("test:{name}"),
        controller,
        keeper: None,
        simulated_as: None,
    }
}

pub(crate) async fn ask(router: Router, method: &str, path: &str, body: Option<&str>) -> Answer {
    let response = respond(router, method, path, body).await;
    let (parts, body) = response.into_parts();
    let body = to_bytes(body, usize::MAX).await.expect("a body");
    Answer { status: parts.status, headers: parts.headers, body }
}

async fn respond(router: Router, method: &str, path: &str, body: Option<&str>) -> axum::response::Response {
    let request =
        Request::builder().method(method).uri(path).header(header::CONTENT_TYPE, "application/json");
    let request = request.body(Body::from(body.unwrap_or_default().to_owned())).expect("a request");
    TowerToHyperService::new(router).call(request).await.expect("infallible")
}

/// Somebody who watches.
pub(crate) struct Viewer {
    body: BodyDataStream,
    text: String,
}

impl Viewer {
    /// The next event: its name and its data. A comment has the name `""`.
    pub(crate) async fn next(&mut self) -> (String, Value) {
        loop {
            if let Some((event, rest)) = self.text.split_once("\n\n") {
                let (event, rest) = (parsed(event), rest.to_owned());
                self.text = rest;
                return event;
            }
            let part = self.body.next().await.expect("the stream goes on").expect("infallible");
            self.text.push_str(std::str::from_utf8(&part).expect("text"));
        }
    }

    /// The next event of a name.
    pub(crate) async fn event(&mut self, name: &str) -> Value {
        loop {
            let (found, data) = self.next().await;
            if found == name {
                return data;
            }
        }
    }

    /// All that comes within a time.
    pub(crate) async fn during(&mut self, time: Duration) -> Vec<(String, Value)> {
        let latest = Instant::now() + time;
        let mut events = Vec::new();
        while let Ok(event) = timeout(latest - Instant::now(), self.next()).await {
            events.push(event);
        }
        events
    }

    /// The state of an axis once it is as wanted.
    pub(crate) async fn state(&mut self, place: u64, wanted: impl Fn(&Value) -> bool) -> Value {
        loop {
            let states = self.event("states").await;
            let states = states["s"].as_array().expect("states").iter();
            if let Some(state) = states.filter(|state| state["i"] == place).find(|state| wanted(state)) {
                return state.clone();
            }
        }
    }
}

fn parsed(event: &str) -> (String, Value) {
    let line = |name: &str| event.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default().trim();
    let data = line("data:");
    let data = if data.is_empty() { Value::Null } else { serde_json::from_str(data).expect("JSON") };
    (line("event:").to_owned(), data)
}

/// Whether a bit is set in a state.
pub(crate) fn has(state: &Value, bit: u64) -> bool {
    state["b"].as_u64().expect("bits") & bit != 0
}
