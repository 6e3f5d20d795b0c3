//! Counts the memory of the process.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering::Relaxed};

/// The maximum of all allocations together, in bytes: an allocation beyond it fails as if memory were exhausted.
pub const MOST_BYTES: usize = 2 << 30;

static TAKEN: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

/// The system's allocator, with a count and a limit.
struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller keeps what the trait asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        TAKEN.fetch_sub(layout.size() as isize, Relaxed);
        // SAFETY: the pointer came from an allocation above, and so from the system's allocator.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Counts an allocation, if it is within the limit.
fn take(bytes: usize) -> bool {
    let taken = TAKEN.fetch_add(bytes as isize, Relaxed).saturating_add_unsigned(bytes);
    if taken < 0 || taken.unsigned_abs() > MOST_BYTES {
        TAKEN.fetch_sub(bytes as isize, Relaxed);
        crate::survival::report_memory(bytes);
        return false;
    }
    PEAK.fetch_max(taken, Relaxed);
    true
}

/// Peak number of allocated bytes.
pub fn peak() -> usize {
    PEAK.load(Relaxed).unsigned_abs()
}
