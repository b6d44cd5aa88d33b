//! Who reads and decodes pages: threads, or the caller's own.

use super::PageKey;
use super::file::{DecodedPage, ModelFile};
use gigalod_format::FormatError;
use std::collections::VecDeque;

/// A page that was asked for, or why it cannot be had.
#[derive(Debug)]
pub struct Loaded {
    /// What was asked for.
    pub key: PageKey,
    /// Decoded.
    pub page: Result<DecodedPage, FormatError>,
}

/// Reads and decodes pages outside the render thread.
pub trait Loader: Send {
    /// Adds a page to the queue; the first in are the first to be loaded.
    fn queue(&mut self, key: PageKey, file: ModelFile);

    /// Empties the queue; returns what was in it. What is being loaded at the moment still arrives.
    fn cancel_queued(&mut self) -> Vec<PageKey>;

    /// What has been loaded since the last call; with `wait`, blocks until there is something. The caller waits only while
    /// something is queued or being loaded.
    fn finished(&mut self, wait: bool) -> Vec<Loaded>;
}

/// Loads in [`Loader::finished`], on the caller's thread, one page a call: for tests, and where there are no threads.
#[derive(Default)]
pub struct InlineLoader {
    queue: VecDeque<(PageKey, ModelFile)>,
}

impl Loader for InlineLoader {
    fn queue(&mut self, key: PageKey, file: ModelFile) {
        self.queue.push_back((key, file));
    }

    fn cancel_queued(&mut self) -> Vec<PageKey> {
        self.queue.drain(..).map(|(key, _)| key).collect()
    }

    fn finished(&mut self, _wait: bool) -> Vec<Loaded> {
        self.queue.pop_front().map(|(key, file)| Loaded { key, page: file.read_page(key.page) }).into_iter().collect()
    }
}

#[cfg(not(target_arch = "wasm32"))]
pub use threaded::ThreadedLoader;

#[cfg(not(target_arch = "wasm32"))]
mod threaded {
    use super::*;
    use std::sync::{Arc, Condvar, Mutex, mpsc};
    use std::thread::JoinHandle;

    #[derive(Default)]
    struct Queue {
        waiting: VecDeque<(PageKey, ModelFile)>,
        closed: bool,
    }

    /// Loads on threads of its own, which end when it is dropped.
    pub struct ThreadedLoader {
        queue: Arc<(Mutex<Queue>, Condvar)>,
        finished: mpsc::Receiver<Loaded>,
        threads: Vec<JoinHandle<()>>,
    }

    impl ThreadedLoader {
        /// Starts `threads` ≥ 1 threads.
        ///
        /// # Errors
        /// What the system says.
        pub fn new(threads: usize) -> std::io::Result<Self> {
            let queue = Arc::new((Mutex::new(Queue::default()), Condvar::new()));
            let (sender, finished) = mpsc::channel();
            let mut loader = Self { queue, finished, threads: Vec::new() };
            for number in 0..threads.max(1) {
                let (queue, sender) = (loader.queue.clone(), sender.clone());
                let thread = std::thread::Builder::new()
                    .name(format!("page loader {number}"))
                    .spawn(move || load_until_closed(&queue, &sender))?;
                loader.threads.push(thread);
            }
            Ok(loader)
        }
    }

    fn load_until_closed(queue: &(Mutex<Queue>, Condvar), sender: &mpsc::Sender<Loaded>) {
        let (queue, changed) = queue;
        loop {
            let mut waiting = queue.lock().expect("nobody panics while holding the queue");
            let (key, file) = loop {
                if waiting.closed {
                    return;
                }
                match waiting.waiting.pop_front() {
                    Some(next) => break next,
                    None => waiting = changed.wait(waiting).expect("nobody panics while holding the queue"),
                }
            };
            drop(waiting);
            if sender.send(Loaded { key, page: file.read_page(key.page) }).is_err() {
                return;
            }
        }
    }

    impl Loader for ThreadedLoader {
        fn queue(&mut self, key: PageKey, file: ModelFile) {
            let (queue, changed) = &*self.queue;
            queue.lock().expect("nobody panics while holding the queue").waiting.push_back((key, file));
            changed.notify_one();
        }

        fn cancel_queued(&mut self) -> Vec<PageKey> {
            let mut queue = self.queue.0.lock().expect("nobody panics while holding the queue");
            queue.waiting.drain(..).map(|(key, _)| key).collect()
        }

        fn finished(&mut self, wait: bool) -> Vec<Loaded> {
            let first = if wait { self.finished.recv().ok() } else { None };
            first.into_iter().chain(self.finished.try_iter()).collect()
        }
    }

    impl Drop for ThreadedLoader {
        fn drop(&mut self) {
            self.queue.0.lock().expect("nobody panics while holding the queue").closed = true;
            self.queue.1.notify_all();
            for thread in self.threads.drain(..) {
                // A loader that panicked has nothing left to say.
                let _ = thread.join();
            }
        }
    }
}
