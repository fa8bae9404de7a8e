//! `stepdrive program`: the user programs of the SMSD as text, and in a controller's memory.

mod controller;
mod files;
mod follow;
mod run;
mod signals;
mod timeline;

use crate::terminal::{no_color, print, print_json, tell};
use crate::{Failure, disk};
use clap::Subcommand;
use files::Program;
use std::io::{self, IsTerminal};
use std::path::PathBuf;
use stepdrive_asm::{Diagnostic, Origin, Severity, SourceFile, Style, disassemble, report};
use stepdrive_spec::smsd::instructions::PROGRAM_AREAS;
use stepdrive_spec::smsd::models::Model;

/// What can be done with a program.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Look for mistakes, and for what is allowed but hardly meant.
    Check(CheckArgs),
    /// Turn a program into the words that a controller stores.
    Build(BuildArgs),
    /// Turn words back into a program.
    Dump(DumpArgs),
    /// Lay a program out properly, in place.
    Fmt(FmtArgs),
    /// Run a program on a virtual drive on virtual time, and print what happens.
    Run(run::RunArgs),
    /// Check a program, store it in a controller's memory, and read it back.
    Store(controller::StoreArgs),
    /// Read the programs in a controller's memory as text.
    Fetch(controller::FetchArgs),
    /// Start a program in a controller's memory.
    Start(controller::StartArgs),
    /// Stop the program that a controller runs. The motor goes on as it was.
    Stop(controller::StopArgs),
    /// Print the line that a controller runs, live, until the program ends.
    Follow(follow::FollowArgs),
}

#[derive(Debug, clap::Args)]
pub(crate) struct CheckArgs {
    /// The program: a text, or an image made by `build`. `-` reads a text from stdin.
    file: PathBuf,
    /// Check also for what only one model can do: SMSD-4.2LAN or SMSD-8.0LAN.
    #[arg(long, value_parser = model)]
    model: Option<Model>,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct BuildArgs {
    /// The program's text. `-` reads it from stdin.
    file: PathBuf,
    /// Write the image of all four memories to this file.
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Print every instruction with its line and its word.
    #[arg(long)]
    hex: bool,
    /// Print words, sizes and findings as JSON on stdout.
    #[arg(long, conflicts_with = "hex")]
    json: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct DumpArgs {
    /// An image made by `build`, or bare words: 4 bytes each, little-endian, as the controller stores them.
    file: PathBuf,
    /// The memory, 0 to 3, that bare words are of.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=3))]
    mem: u8,
    /// Print every instruction with its line and its word, instead of a program that can be built again.
    #[arg(long)]
    hex: bool,
    /// Print words and sizes as JSON.
    #[arg(long, conflicts_with = "hex")]
    json: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct FmtArgs {
    /// The program's text. `-` reads it from stdin and writes it to stdout.
    file: PathBuf,
    /// Change nothing; exit with 10 when the file is not laid out properly.
    #[arg(long)]
    check: bool,
}

/// Does what was asked.
pub(crate) fn program(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Check(args) => check(args),
        Command::Build(args) => build(args),
        Command::Dump(args) => dump(args),
        Command::Fmt(args) => fmt(args),
        Command::Run(args) => run::run(args),
        Command::Store(args) => controller::store(args),
        Command::Fetch(args) => controller::fetch(args),
        Command::Start(args) => controller::start(args),
        Command::Stop(args) => controller::stop(args),
        Command::Follow(args) => follow::follow(args),
    }
}

/// The model with this name.
fn model(name: &str) -> Result<Model, String> {
    let names = Model::ALL.map(Model::name).join(" or ");
    Model::from_name(name).ok_or_else(|| format!("it is {names}"))
}

fn check(args: &CheckArgs) -> Result<(), Failure> {
    let program = Program::read(&args.file, args.model)?;
    if args.json {
        print_json(&report(&program.findings, program.source.as_ref()))?;
    } else {
        show(&program);
    }
    let errors = count(&program.findings, Severity::Error);
    if errors > 0 {
        return Err(Failure::Program(errors_in(&program.name, errors)));
    }
    if !args.json {
        let warnings = count(&program.findings, Severity::Warning);
        print(&format!("{}: {}, {}\n", program.name, program.sizes(), plural(warnings, "warning")))?;
    }
    Ok(())
}

fn build(args: &BuildArgs) -> Result<(), Failure> {
    if args.output.is_none() && !args.hex && !args.json {
        return Err(Failure::Usage("say where the result goes: --output OUT, --hex or --json".to_owned()));
    }
    let source = files::read_text(&args.file)?;
    let program = Program::assemble(source, None);
    if args.json {
        print_json(&files::Words::of(&program))?;
    } else {
        show(&program);
    }
    let image = program.image()?;
    if let Some(output) = &args.output {
        disk::replace(output, &image.to_bytes())?;
        tell(&format!("{}: {} to {}", program.name, program.sizes(), output.display()));
    }
    if args.hex {
        print(&image.listing())?;
    }
    Ok(())
}

fn dump(args: &DumpArgs) -> Result<(), Failure> {
    let image = files::read_image(&args.file, args.mem)?;
    if args.json {
        return print_json(&files::Words::of_image(&image));
    }
    print(&if args.hex { image.listing() } else { disassemble(&image) })
}

fn fmt(args: &FmtArgs) -> Result<(), Failure> {
    let source = files::read_text(&args.file)?;
    let formatted = stepdrive_asm::format(&source).map_err(|findings| {
        show_findings(&findings, Origin::Text(&source));
        Failure::Program(format!("{}: left as it is, because lines of it cannot be read", source.name()))
    })?;
    if args.check {
        let same = formatted == source.text();
        let differs =
            || Failure::Differs(format!("{} is not laid out properly; `program fmt` does it", source.name()));
        return same.then_some(()).ok_or_else(differs);
    }
    if files::is_stdin(&args.file) {
        return print(&formatted);
    }
    if formatted == source.text() { Ok(()) } else { disk::replace(&args.file, formatted.as_bytes()) }
}

/// Shows what was found in a program, on stderr.
fn show(program: &Program) {
    match &program.source {
        Some(source) => show_findings(&program.findings, Origin::Text(source)),
        None => show_findings(&program.findings, Origin::Image(&program.name)),
    }
}

fn show_findings(findings: &[Diagnostic], origin: Origin<'_>) {
    // Colour only where a person looks, and has not asked for none.
    let style = if io::stderr().is_terminal() && !no_color() { Style::Colour } else { Style::Plain };
    tell(stepdrive_asm::render(findings, origin, style).trim_end());
}

fn count(findings: &[Diagnostic], severity: Severity) -> usize {
    findings.iter().filter(|finding| finding.severity() == severity).count()
}

fn errors_in(name: &str, errors: usize) -> String {
    format!("{name}: {}; nothing was built", plural(errors, "error"))
}

/// `1 error`, `2 errors`, `no errors`.
fn plural(count: usize, what: &str) -> String {
    match count {
        0 => format!("no {what}s"),
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}

/// How many instructions each memory has that has any.
fn sizes(areas: [usize; PROGRAM_AREAS]) -> String {
    let part = |(memory, size): (usize, usize)| format!("{} in memory {memory}", plural(size, "instruction"));
    let parts: Vec<String> = areas.into_iter().enumerate().filter(|(_, size)| *size > 0).map(part).collect();
    if parts.is_empty() { "no instructions".to_owned() } else { parts.join(", ") }
}

/// The name under which messages show a file.
fn shown(file: &std::path::Path) -> String {
    if files::is_stdin(file) { "stdin".to_owned() } else { file.display().to_string() }
}

/// A text with nothing in it, for what cannot be read as text.
fn empty_source(name: &str) -> SourceFile {
    SourceFile::new(name, "")
}
