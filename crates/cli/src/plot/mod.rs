//! `stepdrive plot`.

mod drawing;
mod font;
mod picture;
mod raster;
mod thin;
mod ticks;

use crate::Failure;
use crate::table::{Series, Table};
use crate::terminal::{print_json, tell};
use picture::{Style, picture};
use serde_json::json;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// What to draw.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive plot run.csv                                 run.png: a panel for each unit, over time
  stepdrive plot run.parquet -o run.svg
  stepdrive plot run.csv --columns position,speed        these quantities, of every axis
  stepdrive plot run.csv --columns stage.position --title 'Stage, empty'")]
pub(crate) struct PlotArgs {
    /// The recording, as `stepdrive record` wrote it: .csv or .parquet.
    file: PathBuf,
    /// The drawing: .png or .svg; by default beside the recording, as PNG.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// What to draw, parted by commas: names with or without the axis, as in stage.position or position. All by default.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    columns: Vec<String>,
    /// What stands above it; the name of the recording by default.
    #[arg(long)]
    title: Option<String>,
    /// How wide and how high it is, in pixels of SVG; a PNG has twice as many each way.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Replace a drawing that is there.
    #[arg(long)]
    force: bool,
    /// Print JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// How wide a drawing is where nothing else is said.
const WIDTH: u32 = 1200;

/// How wide and how high a drawing can be.
const SIZES: std::ops::RangeInclusive<u32> = 300..=8000;

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let parts =
        text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let fits = |size: &(u32, u32)| SIZES.contains(&size.0) && SIZES.contains(&size.1);
    parts.filter(fits).ok_or_else(|| "it is a width and a height from 300 to 8000, as in 1200x800".to_owned())
}

/// What a drawing is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Image {
    Png,
    Svg,
}

/// Draws a recording.
pub(crate) fn plot(args: &PlotArgs) -> Result<(), Failure> {
    let output = args.output.clone().unwrap_or_else(|| args.file.with_extension("png"));
    let image = image_of(&output)?;
    let mut table = Table::read(&args.file)?;
    choose(&mut table.series, &args.columns, &args.file)?;
    let name = args.file.file_stem().unwrap_or(args.file.as_os_str()).to_string_lossy().into_owned();
    let style = Style {
        title: args.title.clone().unwrap_or(name),
        width: args.size.map_or(WIDTH, |(width, _)| width),
        height: args.size.map(|(_, height)| height),
    };
    let drawing =
        picture(&table, &style).map_err(|why| Failure::Usage(format!("{}: {why}", args.file.display())))?;
    let bytes = match image {
        Image::Svg => drawing.svg().into_bytes(),
        Image::Png => raster::png(&drawing).map_err(|why| cannot_write(&output, &why))?,
    };
    write(&output, &bytes, args.force)?;
    let columns: Vec<String> = table.series.iter().map(|series| series.column.to_string()).collect();
    if args.json {
        return print_json(&json!({ "file": output, "columns": columns, "rows": table.times.len() }));
    }
    tell(&format!(
        "{}: {} of {} rows",
        output.display(),
        counted(columns.len(), "quantity", "quantities"),
        table.times.len()
    ));
    Ok(())
}

fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

fn image_of(path: &Path) -> Result<Image, Failure> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "png" => Ok(Image::Png),
        "svg" => Ok(Image::Svg),
        _ => Err(Failure::Usage(format!(
            "{}: a drawing's name ends in .png or .svg, which says what it is written as",
            path.display()
        ))),
    }
}

/// Keeps what is asked for, in that order.
fn choose(series: &mut Vec<Series>, words: &[String], file: &Path) -> Result<(), Failure> {
    if series.is_empty() {
        return Err(Failure::Usage(format!("{}: there are no quantities in it", file.display())));
    }
    if words.is_empty() {
        return Ok(());
    }
    let mut chosen: Vec<Series> = Vec::new();
    for word in words {
        let called = series.iter().filter(|series| series.column.is_called(word));
        let before = chosen.len();
        for series in called {
            if !chosen.contains(series) {
                chosen.push(series.clone());
            }
        }
        let none = chosen.len() == before && !chosen.iter().any(|series| series.column.is_called(word));
        if none {
            let names: Vec<&str> = series.iter().map(|series| series.column.name.as_str()).collect();
            let message = format!(
                "{}: there is no `{}` in it; there are {}",
                file.display(),
                word.escape_debug(),
                names.join(", ")
            );
            return Err(Failure::Usage(message));
        }
    }
    *series = chosen;
    Ok(())
}

fn write(path: &Path, bytes: &[u8], force: bool) -> Result<(), Failure> {
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    if !force {
        options.create_new(true);
    }
    let mut file = options.open(path).map_err(|error| {
        if error.kind() == io::ErrorKind::AlreadyExists {
            return Failure::Usage(format!("{} exists; --force replaces it", path.display()));
        }
        cannot_write(path, &error.to_string())
    })?;
    file.write_all(bytes).map_err(|error| cannot_write(path, &error.to_string()))
}

fn cannot_write(path: &Path, why: &str) -> Failure {
    Failure::Failed(format!("cannot write {}: {why}", path.display()))
}
