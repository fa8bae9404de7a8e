//! Step one of the tests: the foreign clients they talk to, put there where they are missing.

use crate::Outcome;
use crate::workspace::{Workspace, finish};
use std::process::{Command, Stdio};

/// What the client tests want installed.
const REQUIREMENTS: &str = "tests/clients/requirements.txt";
/// The Python environment they run in; it belongs to the build and goes with it.
const VENV: &str = "target/venv";
/// A copy of the requirements that the environment was last made from.
const STAMP: &str = "target/venv/requirements.stamp";

/// A Debian package, and a command that succeeds when what we need of it is there.
struct Need {
    package: &'static str,
    probe: &'static [&'static str],
}

const NEEDS: [Need; 5] = [
    Need { package: "python3", probe: &["python3", "--version"] },
    Need { package: "python3-venv", probe: &["python3", "-c", "import ensurepip, venv"] },
    Need { package: "mbpoll", probe: &["mbpoll", "-V"] },
    Need { package: "libmodbus5", probe: &["python3", "-c", "import ctypes; ctypes.CDLL('libmodbus.so.5')"] },
    Need { package: "chromium", probe: &["chromium", "--version"] },
];

/// Installs the Debian packages and the Python packages that are not there yet.
pub(crate) fn run(workspace: &Workspace) -> Outcome {
    let missing: Vec<&str> =
        NEEDS.iter().filter(|need| !succeeds(need.probe)).map(|need| need.package).collect();
    if !missing.is_empty() {
        install(workspace, &missing)?;
    }
    make_venv(workspace)
}

/// The Python of the environment, as a path relative to the root.
pub(crate) fn python() -> String {
    format!("{VENV}/bin/python")
}

fn install(workspace: &Workspace, packages: &[&str]) -> Outcome {
    let wanted = packages.join(" ");
    if !succeeds(&["apt-get", "--version"]) {
        return Err(format!("missing: {wanted}; there is no apt-get here, install them and run this again"));
    }
    let mut apt = root_prefix().ok_or_else(|| {
        format!("missing: {wanted}; run `apt-get install {wanted}` as root, then run this again")
    })?;
    apt.extend(["env", "DEBIAN_FRONTEND=noninteractive", "apt-get"]);
    eprintln!("    installing {wanted}");
    let with = |arguments: &[&'static str]| [apt.as_slice(), arguments].concat();
    run_words(workspace, &with(&["update", "-qq"]))?;
    let install = [with(&["install", "-qq", "-y", "--no-install-recommends"]).as_slice(), packages].concat();
    run_words(workspace, &install)
}

/// What to put before a command that needs root: nothing, `sudo`, or there is no way.
fn root_prefix() -> Option<Vec<&'static str>> {
    let id = Command::new("id").arg("-u").output().ok()?;
    if id.stdout.trim_ascii() == b"0" {
        Some(Vec::new())
    } else {
        succeeds(&["sudo", "--version"]).then(|| vec!["sudo"])
    }
}

fn make_venv(workspace: &Workspace) -> Outcome {
    let wanted = workspace.read(REQUIREMENTS)?;
    if workspace.read(STAMP).is_ok_and(|made_from| made_from == wanted) && still_works(workspace) {
        return Ok(());
    }
    eprintln!("    making {VENV}");
    workspace.run("python3", &["-m", "venv", "--clear", VENV])?;
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r", REQUIREMENTS];
    workspace.run(&python(), &pip)?;
    workspace.write(STAMP, &wanted)
}

/// `true` when the environment's Python still runs; it does not when the system's was replaced.
fn still_works(workspace: &Workspace) -> bool {
    quiet(&mut workspace.command(&python(), &["-c", "import pymodbus, pytest"]))
}

fn succeeds(words: &[&str]) -> bool {
    words.split_first().is_some_and(|(program, arguments)| quiet(Command::new(program).args(arguments)))
}

fn quiet(command: &mut Command) -> bool {
    let silent = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    silent.status().is_ok_and(|status| status.success())
}

fn run_words(workspace: &Workspace, words: &[&str]) -> Outcome {
    let (program, arguments) = words.split_first().ok_or("an empty command")?;
    finish(&mut workspace.command(program, arguments))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_probe_tells_what_is_there_from_what_is_not() {
        assert!(succeeds(&["true"]));
        assert!(!succeeds(&["false"]));
        assert!(!succeeds(&["no-such-program-as-this"]));
        assert!(!succeeds(&[]));
    }

    #[test]
    fn every_python_package_is_pinned() {
        let requirements = Workspace::here().read(REQUIREMENTS).expect("the requirements are there");
        for line in requirements.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
            assert!(line.contains("=="), "{line}");
        }
    }
}
