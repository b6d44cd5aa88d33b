//! Threads that make one cut together.
//!
//! The caller is one of them. The others sleep between cuts and end when the crew is dropped. What always holds: a warm turn
//! allocates nothing; when [`Crew::work`] returns, nobody works any more. Where there are no threads, or the system gives none,
//! the caller works alone.

use super::walk::{Cut, Worker};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;

#[derive(Debug, Default)]
struct Turn {
    number: u64,
    /// Threads that have not finished this turn.
    busy: usize,
    panicked: bool,
    closed: bool,
}

#[derive(Debug)]
struct Shared {
    /// The cut of this turn.
    cut: RwLock<Option<Cut>>,
    workers: Vec<Mutex<Worker>>,
    turn: Mutex<Turn>,
    begun: Condvar,
    ended: Condvar,
}

/// Workers, each with a thread but the first, which is the caller's.
#[derive(Debug)]
pub(super) struct Crew {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Crew {
    /// At least one worker; fewer than `threads` where the system does not give them.
    pub(super) fn new(threads: usize) -> Self {
        let threads = if cfg!(target_arch = "wasm32") { 1 } else { threads.max(1) };
        let shared = Arc::new(Shared {
            cut: RwLock::new(None),
            workers: (0..threads).map(|_| Mutex::new(Worker::new())).collect(),
            turn: Mutex::default(),
            begun: Condvar::new(),
            ended: Condvar::new(),
        });
        let mut crew = Self { shared, threads: Vec::new() };
        for number in 1..threads {
            let shared = crew.shared.clone();
            let name = format!("selector {number}");
            match std::thread::Builder::new().name(name).spawn(move || shared.serve(number)) {
                Ok(thread) => crew.threads.push(thread),
                Err(_) => break,
            }
        }
        crew
    }

    /// Number of workers.
    pub(super) fn len(&self) -> usize {
        self.threads.len() + 1
    }

    /// A worker; between turns.
    pub(super) fn worker(&self, number: usize) -> MutexGuard<'_, Worker> {
        lock(&self.shared.workers[number])
    }

    /// Makes a cut, with all workers or the first one alone; returns it, used up.
    pub(super) fn work(&self, cut: Cut, together: bool) -> Cut {
        for number in 0..self.len() {
            let mut worker = self.worker(number);
            worker.begin();
            worker.reserve(&cut);
        }
        *self.shared.cut.write().unwrap_or_else(PoisonError::into_inner) = Some(cut);
        if together && !self.threads.is_empty() {
            let mut turn = lock(&self.shared.turn);
            turn.number += 1;
            turn.busy = self.threads.len();
            drop(turn);
            self.shared.begun.notify_all();
        }
        self.shared.take_part(0);
        let mut turn = lock(&self.shared.turn);
        while turn.busy > 0 {
            turn = self.shared.ended.wait(turn).unwrap_or_else(PoisonError::into_inner);
        }
        assert!(!turn.panicked, "a selecting thread panicked");
        drop(turn);
        let mut cut = self.shared.cut.write().unwrap_or_else(PoisonError::into_inner);
        cut.take().expect("only this function takes it")
    }
}

impl Shared {
    fn take_part(&self, number: usize) {
        let cut = self.cut.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(cut) = &*cut {
            lock(&self.workers[number]).run(cut);
        }
    }

    /// What a thread does all its life.
    fn serve(&self, number: usize) {
        /// Says that the turn is over, however it ended.
        struct Over<'a>(&'a Shared);
        impl Drop for Over<'_> {
            fn drop(&mut self) {
                let mut turn = lock(&self.0.turn);
                turn.busy -= 1;
                turn.panicked |= std::thread::panicking();
                drop(turn);
                self.0.ended.notify_one();
            }
        }
        let mut seen = 0;
        loop {
            let mut turn = lock(&self.turn);
            while turn.number == seen && !turn.closed {
                turn = self.begun.wait(turn).unwrap_or_else(PoisonError::into_inner);
            }
            if turn.closed {
                return;
            }
            seen = turn.number;
            drop(turn);
            let _over = Over(self);
            self.take_part(number);
        }
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        lock(&self.shared.turn).closed = true;
        self.shared.begun.notify_all();
        for thread in self.threads.drain(..) {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}
