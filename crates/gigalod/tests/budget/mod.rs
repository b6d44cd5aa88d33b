//! What builds allocate against what they may.

use crate::counting::peak_of;

const MIB: u64 = 1 << 20;

/// Runs `build` with each budget in MiB and number of threads: all that it allocates is within. Returns the largest share of a
/// budget that was taken. What `build` needs of its own it is given by `prepare`, before the counting.
#[track_caller]
pub(crate) fn fullest<T>(
    what: &str,
    budgets: &[(u64, usize)],
    mut prepare: impl FnMut() -> T,
    mut build: impl FnMut(T, u64, usize),
) -> f64 {
    let mut fullest = 0.0_f64;
    for &(mib, threads) in budgets {
        let prepared = prepare();
        let ((), peak) = peak_of(|| build(prepared, mib * MIB, threads));
        let share = peak as f64 / (mib * MIB) as f64;
        println!("{what}, {mib} MiB, {threads} threads: {:.0} % allocated", share * 100.0);
        assert!(share <= 1.0, "{what}: {peak} bytes allocated of {mib} MiB, {threads} threads");
        fullest = fullest.max(share);
    }
    fullest
}
