//! How the allocator treats memory that is freed.

/// mimalloc's `mi_option_purge_delay`, which its bindings have no name for.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;

/// Keeps memory that is freed instead of giving it back after 10 ms: what comes next wants as much again, and page faults would be half of
/// a training step's time and a twentieth of a generated room's.
#[expect(unsafe_code)]
pub fn keep_what_is_freed() {
    // SAFETY: the call sets an option of the allocator, which may be done at any time; negative values are for this.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, -1) };
}
