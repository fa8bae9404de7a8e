//! What a process has used, read from `/proc`, and what it may use: these benchmarks run on Linux.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::fs;
use std::io;
use std::time::Duration;

/// The processor time that the threads of a process have used, to the nanosecond. `stat` has the same sum in ticks of
/// 10 ms, too coarse for a round of a second.
///
/// # Errors
/// When there is no such process, or no `/proc`.
pub fn cpu_time(pid: u32) -> io::Result<Duration> {
    let mut nanos = 0;
    for task in fs::read_dir(format!("/proc/{pid}/task"))? {
        // A thread may end between the listing and the reading.
        let Ok(line) = fs::read_to_string(task?.path().join("schedstat")) else { continue };
        nanos += number(line.split_whitespace().next())?;
    }
    Ok(Duration::from_nanos(nanos))
}

/// The memory of a process that is in RAM, in bytes.
///
/// # Errors
/// When there is no such process, or no `/proc`.
pub fn resident(pid: u32) -> io::Result<u64> {
    let status = fs::read_to_string(format!("/proc/{pid}/status"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    Ok(number(line.and_then(|line| line.split_whitespace().next()))? * 1024)
}

/// Lets this process, and those that it starts, have as many open files as the system allows it at most. Gives their
/// number.
///
/// # Errors
/// When the system refuses.
pub fn allow_many_files() -> io::Result<usize> {
    let maximum = getrlimit(Resource::Nofile).maximum;
    setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum })?;
    Ok(maximum.and_then(|maximum| usize::try_from(maximum).ok()).unwrap_or(usize::MAX))
}

fn number(text: Option<&str>) -> io::Result<u64> {
    text.and_then(|text| text.parse().ok()).ok_or_else(|| io::ErrorKind::InvalidData.into())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn this_process_has_used_time_and_memory() {
        let pid = std::process::id();
        assert!(cpu_time(pid).expect("/proc") > Duration::ZERO);
        assert!(resident(pid).expect("/proc") > 0);
    }
}
