//! Benchmarks of the whole stack, and what they share. `docs/performance.md` says how to run them and what they gave.
//!
//! * [`requests`]: requests as bytes; [`programs`]: user programs.
//! * [`servers`]: servers in processes of their own, so that what they use can be told from what the load uses.
//! * [`clients`]: the same for clients.
//! * [`load`]: requests to servers, in rounds that alternate between them.
//! * [`terminal`], a pseudo-terminal.
//! * [`process`]: what a process has used, as Linux tells, and what it may.

pub mod clients;
pub mod load;
pub mod process;
pub mod programs;
pub mod requests;
pub mod servers;
pub mod terminal;

/// The one in the middle of `figures`; 0 when there are none.
pub fn median(figures: impl IntoIterator<Item = f64>) -> f64 {
    let mut figures: Vec<f64> = figures.into_iter().collect();
    figures.sort_by(f64::total_cmp);
    figures.get(figures.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_one_in_the_middle() {
        assert_eq!(median([3.0, 1.0, 9.0]).to_bits(), 3.0_f64.to_bits());
        assert_eq!(median([]).to_bits(), 0.0_f64.to_bits());
    }
}
