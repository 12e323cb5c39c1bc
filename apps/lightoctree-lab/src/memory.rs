//! Settings of the memory allocator.

/// mimalloc's `mi_option_purge_delay`, which the bindings do not define.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;

/// Keeps freed memory in the process instead of returning it to the system after 10 ms.
///
/// The next step needs as much again. Page faults would take half the time of a training step, and 5 % of that of a
/// generated room.
#[expect(unsafe_code)]
pub fn retain_freed_memory() {
    // SAFETY: allocator options may be set at any time; a negative delay disables purging.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, -1) };
}
