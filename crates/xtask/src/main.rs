//! `cargo xtask`: the one test command, the generated documents and the house rules.

mod docs;
mod setup;
mod test;
mod tidy;
mod workspace;

use std::process::ExitCode;
use workspace::Workspace;

const HELP: &str = "\
cargo xtask test           install what the tests need, then run all of them
cargo xtask docs           write the generated documents
cargo xtask docs --check   fail when a generated document has drifted from its source
cargo xtask tidy           check the house rules
cargo xtask help           print this
";

/// What a task gives back: its failure is one message for the person at the terminal.
type Outcome<T = ()> = Result<T, String>;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let workspace = Workspace::here();
    let outcome = match words.as_slice() {
        ["test"] => test::run(&workspace),
        ["docs"] => docs::write(&workspace),
        ["docs", "--check"] => docs::check(&workspace),
        ["tidy"] => tidy::run(&workspace),
        ["help" | "--help" | "-h"] => {
            print!("{HELP}");
            Ok(())
        }
        _ => {
            eprint!("{HELP}");
            return ExitCode::from(2);
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("xtask: {message}");
            ExitCode::FAILURE
        }
    }
}
