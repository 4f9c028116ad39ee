//! Exit of the interpreter while other threads render.
//!
//! CPython up to 3.13 ends a thread that requests the GIL during finalization by `pthread_exit`, which unwinds its
//! stack: through Rust frames that is an abort. A driver whose threads run while the process destroys it crashes or
//! hangs. `atexit` therefore calls `close` first. It waits until no other thread is in a call; threads that enter or
//! leave a call later sleep without the GIL until the process ends.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

static CLOSING: AtomicBool = AtomicBool::new(false);
/// Number of threads in a call.
static INSIDE: AtomicUsize = AtomicUsize::new(0);
/// Maximum wait for them. Submissions end within a second, compilation of kernels within ten.
const PATIENCE: Duration = Duration::from_secs(30);

thread_local! {
    /// Depth of nested calls of this thread.
    static DEPTH: Cell<usize> = const { Cell::new(0) };
    /// Whether this thread ends the interpreter. It may still render, in later `atexit` handlers.
    static CLOSER: Cell<bool> = const { Cell::new(false) };
}

/// Guard of a thread in a call.
pub struct Inside(());

/// Begins a call; never returns during finalization.
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

/// Whether the work of this thread is to be stopped.
pub fn is_closing() -> bool {
    CLOSING.load(Ordering::SeqCst) && !CLOSER.get()
}

/// Parks a thread that is in a call and holds no locks, if the interpreter exits.
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

/// Stops all renders and waits for them; registered with `atexit`.
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

/// Resets the count of threads in a forked child, which has only its own.
#[pyfunction]
pub fn forked() {
    INSIDE.store(DEPTH.get().min(1), Ordering::SeqCst);
}
