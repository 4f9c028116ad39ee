//! The end of the interpreter while other threads render.
//!
//! CPython up to 3.13 ends a thread that wants the GIL then by `pthread_exit`, which unwinds its stack: through frames of
//! Rust that is an abort. And a driver whose threads work while the process tears it down crashes or hangs. So `close`,
//! called by `atexit` before all of that, waits until no other thread is in here, and none comes out or in again: they
//! sleep without the GIL until the process is gone.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

static CLOSING: AtomicBool = AtomicBool::new(false);
/// Threads that are in a call.
static INSIDE: AtomicUsize = AtomicUsize::new(0);
/// Longest wait for them. Submissions end within a second, compiling kernels within ten.
const PATIENCE: Duration = Duration::from_secs(30);

thread_local! {
    /// Calls of this thread, one in another.
    static DEPTH: Cell<usize> = const { Cell::new(0) };
    /// Whether this thread ends the interpreter: it may still render, in what `atexit` calls later.
    static CLOSER: Cell<bool> = const { Cell::new(false) };
}

/// That a thread is in a call, as long as it lives.
pub struct Inside(());

/// Begins a call; at the end of the interpreter it never returns.
pub fn enter(py: Python<'_>) -> Inside {
    if DEPTH.replace(DEPTH.get() + 1) == 0 {
        INSIDE.fetch_add(1, Ordering::SeqCst);
        stay_if_closing(py);
    }
    Inside(())
}

impl Drop for Inside {
    fn drop(&mut self) {
        if DEPTH.replace(DEPTH.get() - 1) == 1 {
            INSIDE.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

/// Whether the work of this thread is no longer wanted.
pub fn is_closing() -> bool {
    CLOSING.load(Ordering::SeqCst) && !CLOSER.get()
}

/// Keeps a thread that is in a call and holds nothing, if the interpreter ends.
pub fn stay_if_closing(py: Python<'_>) {
    if is_closing() {
        INSIDE.fetch_sub(1, Ordering::SeqCst);
        py.detach(|| {
            loop {
                std::thread::park();
            }
        });
    }
}

/// Stops all renders and waits for them; for `atexit`.
#[pyfunction]
pub fn close(py: Python<'_>) {
    CLOSER.set(true);
    CLOSING.store(true, Ordering::SeqCst);
    let started = Instant::now();
    py.detach(|| {
        while INSIDE.load(Ordering::SeqCst) > 0 && started.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(2));
        }
    });
}

/// Forgets the threads that a forked child does not have.
#[pyfunction]
pub fn forked() {
    INSIDE.store(DEPTH.get().min(1), Ordering::SeqCst);
}
