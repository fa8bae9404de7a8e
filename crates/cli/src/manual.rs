//! `stepdrive completions` and `stepdrive man`: the command line described for shells and for `man`.

use crate::Failure;
use crate::terminal::{print, print_json, tell};
use clap::Command;
use clap_complete::Shell;
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};

/// For which shell.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive completions bash > ~/.local/share/bash-completion/completions/stepdrive
  stepdrive completions zsh > ~/.zfunc/_stepdrive            with ~/.zfunc in fpath, before compinit
  stepdrive completions fish > ~/.config/fish/completions/stepdrive.fish")]
pub(crate) struct CompletionsArgs {
    /// The shell.
    shell: Shell,
}

/// Prints what makes a shell complete the words of `stepdrive`.
pub(crate) fn completions(mut command: Command, args: &CompletionsArgs) -> Result<(), Failure> {
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, name, &mut script);
    print(&String::from_utf8_lossy(&script))
}

/// Where to.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  stepdrive man ~/.local/share/man/man1 && man stepdrive-move")]
pub(crate) struct ManArgs {
    /// The folder for the pages; it is made if it is not there. Pages that are there are replaced.
    folder: PathBuf,
    /// Print JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// Writes a manual page for `stepdrive` and each of its commands.
pub(crate) fn man(command: Command, args: &ManArgs) -> Result<(), Failure> {
    let folder = &args.folder;
    fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error.to_string()))?;
    let mut root = command.disable_help_subcommand(true);
    root.build();
    let pages = write_pages(&root, folder)?;
    if args.json {
        return print_json(&json!({ "folder": folder, "pages": pages }));
    }
    tell(&format!("{}: {} pages", folder.display(), pages.len()));
    Ok(())
}

/// Writes the page of a command and those of its subcommands; answers their names.
fn write_pages(command: &Command, folder: &Path) -> Result<Vec<String>, Failure> {
    let page = clap_mangen::Man::new(command.clone());
    let name = page.get_filename();
    let path = folder.join(&name);
    let mut text = Vec::new();
    page.render(&mut text)
        .and_then(|()| fs::write(&path, text))
        .map_err(|error| cannot_write(&path, &error.to_string()))?;
    let mut names = vec![name];
    for subcommand in command.get_subcommands().filter(|subcommand| !subcommand.is_hide_set()) {
        names.extend(write_pages(subcommand, folder)?);
    }
    Ok(names)
}

fn cannot_write(path: &Path, why: &str) -> Failure {
    Failure::Failed(format!("cannot write {}: {why}", path.display()))
}
