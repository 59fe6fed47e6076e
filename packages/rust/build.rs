//! Compiles the C runtime: from `c/` of the published crate, or from gyrotc's sources two folders up.
//!
//! Crates that depend on this one find the folder of `gtc.h` in `DEP_GTC_INCLUDE`, for their emitted table.

use std::env;
use std::path::PathBuf;

fn main() {
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let own = here.join("c");
    let root = if own.is_dir() { own } else { here.join("../..").canonicalize().expect("it exists") };
    let include = root.join("include");
    let mut build = cc::Build::new();
    for name in ["gtc_crc.c", "gtc_f32.c", "gtc_q31.c"] {
        build.file(root.join("libc").join(name));
    }
    build
        .file(here.join("src/sizes.c"))
        .include(&include)
        .std("c99")
        .flag_if_supported("-ffp-contract=off")
        .compile("gtc");
    println!("cargo:include={}", include.display());
    println!("cargo:rerun-if-changed={}", root.join("libc").display());
    println!("cargo:rerun-if-changed={}", include.display());
}
