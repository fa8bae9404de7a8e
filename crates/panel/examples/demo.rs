//! The panel of a virtual rig, with the files of the page read from the source tree at every request: for work on the page.
//!
//! `cargo run -p stepdrive-panel --example demo [RIG.toml | COUNT | demo] [ADDRESS]`: a rig file, so many SMSDs, or the demo rig,
//! with its API beside the panel on `127.0.0.1:5081` or another address. `stepdrive up` does the same with the page embedded.

use axum::Router;
use axum::extract::Path;
use axum::http::header;
use axum::response::IntoResponse;
use axum::routing::get;
use std::error::Error;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use stepdrive_host::axis::{DriveAxis, Smd3Motor, SmsdMotor, SoftLimits};
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::{SmsdClient, SmsdOptions};
use stepdrive_host::units::{Decimal, Scale};
use stepdrive_host::{Timeouts, from_fn};
use stepdrive_panel::{Controller, Panel, PanelAxis};
use stepdrive_rig::file::{ApiSection, DEMO, DriveSection, RigFile};
use stepdrive_server::{Connector, Options, ServedDrive, Server};

const HERE: &str = "127.0.0.1:5081";

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let address: SocketAddr = arguments.get(1).map_or(HERE, String::as_str).parse()?;
    let text = rig_text(arguments.first().map(String::as_str))?;
    let mut rig = RigFile::parse(&text).map_err(|mistake| mistake.render("the rig"))?;
    rig.api = Some(ApiSection { address, token: None });
    let state = tempfile::TempDir::new()?;
    let notify = Arc::new(|notice| eprintln!("{notice}"));
    let options = Options { state: state.path().to_owned(), recording: None, notify };
    let mut panel = None;
    let server = Server::start_with(&rig, options, |connector, drives| {
        let sections = drives.iter().zip(&rig.drives).enumerate();
        let axes = sections.filter_map(|(number, (drive, section))| axis(connector, number, drive, section));
        let api = panel.insert(Panel::new(axes.collect())).api();
        Router::new().route("/", get(index)).route("/assets/{*path}", get(file)).merge(api)
    });
    let server = server.await?;
    eprintln!("http://{}/", server.api().ok_or("no API")?);
    tokio::signal::ctrl_c().await?;
    if let Some(panel) = panel {
        panel.close().await;
    }
    server.stop().await;
    Ok(())
}

/// The rig: a file, so many drives, or the demo rig on free ports.
fn rig_text(which: Option<&str>) -> Result<String, Box<dyn Error>> {
    let Some(which) = which.filter(|which| *which != "demo") else {
        return Ok(DEMO.replace("127.0.0.1:5020", "127.0.0.1:0"));
    };
    match which.parse() {
        Ok(count) => Ok((0_u32..count).map(drive).collect()),
        Err(_) => Ok(std::fs::read_to_string(which)?),
    }
}

fn drive(number: u32) -> String {
    format!("[[drive]]\nname = \"a{number}\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n")
}

fn axis(
    connector: &Connector,
    number: usize,
    drive: &ServedDrive,
    section: &DriveSection,
) -> Option<PanelAxis> {
    let connector = connector.clone();
    let line = from_fn(&drive.name, move || std::future::ready(connector.connect(number)));
    let controller = if section.smsd().is_some() {
        let client = SmsdClient::new(line, SmsdOptions { unit: 255, ..SmsdOptions::default() });
        let scale = Scale::millimetres(Decimal::whole(5), section.steps_per_rev).ok()?;
        let limits = SoftLimits::new(Decimal::whole(-40), Decimal::whole(45)).ok()?;
        let axis = DriveAxis::new(SmsdMotor::new(&drive.name, client)).with_scale(scale).with_limits(limits);
        Controller::Smsd(Arc::new(axis))
    } else {
        let client = Smd3Client::new(line, Timeouts::default());
        Controller::Smd3(Arc::new(DriveAxis::new(Smd3Motor::new(client))))
    };
    Some(PanelAxis {
        name: drive.name.clone(),
        is_virtual: true,
        target: format!("the {} of this rig", drive.model),
        controller,
        keeper: None,
        simulated_as: Some(section.clone()),
    })
}

async fn index() -> impl IntoResponse {
    file(Path("index.html".to_owned())).await
}

async fn file(Path(path): Path<String>) -> impl IntoResponse {
    let kind = match path.rsplit_once('.').map(|(_, kind)| kind) {
        Some("html") => "text/html; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some(_) | None => "text/plain; charset=utf-8",
    };
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets").join(path);
    ([(header::CONTENT_TYPE, kind)], std::fs::read(file).unwrap_or_default())
}
