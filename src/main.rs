//! The `mcpo-run` program: see `mcpo-run --help`.

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator, with larger pieces at the beginning of a cache line: the usual 16 bytes
/// of alignment make nearly every load of a whole vector touch two lines.
struct AtCacheLines;

#[global_allocator]
static ALLOCATOR: AtCacheLines = AtCacheLines;

/// Bytes of a cache line, and of the widest vector.
const LINE: usize = 64;
/// Pieces smaller than this hold no matrix, and keep the usual alignment.
const LARGE: usize = 4096;

fn aligned(layout: Layout) -> Layout {
    if layout.size() < LARGE {
        layout
    } else {
        layout.align_to(LINE).unwrap_or(layout)
    }
}

#[expect(
    unsafe_code,
    reason = "an allocator is unsafe to implement; this one hands everything to the system's"
)]
// SAFETY: every call reaches the system's allocator, with a layout that depends on the caller's
// alone, so that a piece is freed with the layout that it was made with.
unsafe impl GlobalAlloc for AtCacheLines {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        unsafe { System.alloc(aligned(layout)) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        unsafe { System.alloc_zeroed(aligned(layout)) }
    }

    unsafe fn dealloc(&self, piece: *mut u8, layout: Layout) {
        unsafe { System.dealloc(piece, aligned(layout)) }
    }
}

fn main() -> std::process::ExitCode {
    mcpo_run::cli::main()
}
