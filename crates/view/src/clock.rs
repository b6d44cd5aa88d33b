//! How much of the processor this thread has used.

/// Milliseconds of processor time of the calling thread; of the wall clock where the system does not tell.
pub(crate) fn thread_cpu_ms() -> f64 {
    #[cfg(unix)]
    if let Ok(time) = nix::time::clock_gettime(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID) {
        return time.tv_sec() as f64 * 1e3 + time.tv_nsec() as f64 * 1e-6;
    }
    use std::sync::OnceLock;
    use std::time::Instant;
    static BEGUN: OnceLock<Instant> = OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed().as_secs_f64() * 1e3
}
