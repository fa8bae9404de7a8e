//! Files that are written for a person.

use crate::Failure;
use std::fs;
use std::path::{Path, PathBuf};

/// Writes a file whole or not at all: what was there stays until the new one is complete.
pub(crate) fn replace(file: &Path, bytes: &[u8]) -> Result<(), Failure> {
    // A link stays a link; what it points at is replaced.
    let target = file.canonicalize().unwrap_or_else(|_| file.to_owned());
    let mut beside = target.clone().into_os_string();
    // Of its own for each program: two that end together each write a whole file.
    beside.push(format!(".{}.new", std::process::id()));
    let beside = PathBuf::from(beside);
    let written = fs::write(&beside, bytes).and_then(|()| {
        if let Ok(there) = fs::metadata(&target) {
            fs::set_permissions(&beside, there.permissions())?;
        }
        fs::rename(&beside, &target)
    });
    written.map_err(|error| {
        // It is of no use to anybody; where it cannot be removed, it is at least not in the way.
        let _ = fs::remove_file(&beside);
        Failure::Failed(format!("cannot write {}: {error}", file.display()))
    })
}
