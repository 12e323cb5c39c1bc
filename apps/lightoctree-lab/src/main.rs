//! The `lightoctree-lab` program; see the library of the same package.

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    lightoctree_lab::main()
}
