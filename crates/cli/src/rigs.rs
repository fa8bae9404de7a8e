//! Which rig is meant, and where its non-volatile memory lives.

use crate::{Failure, UpArgs};
use etcetera::BaseStrategy;
use std::path::{Path, PathBuf};
use stepdrive_rig::file::{DEMO, RigFile};

/// A rig that was asked for.
#[derive(Debug)]
pub(crate) struct Rig {
    /// What it is called when one speaks of it.
    pub(crate) name: String,
    /// What its file says.
    pub(crate) file: RigFile,
    /// Its file as it is written.
    pub(crate) text: String,
    /// The folder of its non-volatile memory.
    pub(crate) state: PathBuf,
}

/// Finds and reads the rig.
pub(crate) fn load(args: &UpArgs) -> Result<Rig, Failure> {
    let (name, text) = read_text(args.rig.as_deref())?;
    let file = parse(&name, &text)?;
    let state = match (&args.state, &args.rig) {
        (Some(state), _) => state.clone(),
        (None, Some(path)) => state_folder()?.join(folder_name(path)),
        (None, None) => state_folder()?.join("demo"),
    };
    Ok(Rig { name, file, text, state })
}

/// Reads a rig file, or the demo rig when there is none, and says what it is called.
pub(crate) fn read(path: Option<&Path>) -> Result<(String, RigFile), Failure> {
    let (name, text) = read_text(path)?;
    let file = parse(&name, &text)?;
    Ok((name, file))
}

/// What a rig is called, and its file as it is written.
pub(crate) fn read_text(path: Option<&Path>) -> Result<(String, String), Failure> {
    let Some(path) = path else { return Ok(("the built-in demo rig".to_owned(), DEMO.to_owned())) };
    let shown = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::Usage(format!("cannot read the rig file {shown}: {error}")))?;
    Ok((shown.to_string(), text))
}

/// What a rig file says.
pub(crate) fn parse(name: &str, text: &str) -> Result<RigFile, Failure> {
    RigFile::parse(text).map_err(|mistake| Failure::Usage(mistake.render(name)))
}

/// The platform's folder for what a program remembers.
pub(crate) fn state_folder() -> Result<PathBuf, Failure> {
    let platform = etcetera::choose_base_strategy().map_err(|error| {
        Failure::Failed(format!("there is no state folder ({error}); give one with --state DIR"))
    })?;
    let state = platform.state_dir().unwrap_or_else(|| platform.data_dir());
    Ok(state.join("stepdrive"))
}

/// A folder name for a rig file: its stem, and a number made of its whole path, so that rigs of the same name in
/// different places do not share their memory.
fn folder_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    format!("{stem}-{:08x}", fnv1a(whole.as_os_str().as_encoded_bytes()))
}

/// The FNV-1a hash of 32 bits: short, and the same on every machine and in every version.
pub(crate) fn fnv1a(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811C_9DC5, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_fnv1a() {
        assert_eq!(fnv1a(b""), 0x811C_9DC5);
        assert_eq!(fnv1a(b"foobar"), 0xBF9C_F968);
    }

    #[test]
    fn rigs_of_the_same_name_in_different_places_have_folders_of_their_own() {
        let (left, right) = (folder_name(Path::new("a/rig.toml")), folder_name(Path::new("b/rig.toml")));
        assert!(left.starts_with("rig-") && right.starts_with("rig-"));
        assert_ne!(left, right);
    }
}
