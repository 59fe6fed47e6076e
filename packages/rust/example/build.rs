//! Compiles the emitted table of gyro RLG-0042.

fn main() {
    let folder = "../../../examples/minimal";
    cc::Build::new()
        .file(format!("{folder}/gtc_rlg_0042.c"))
        .include(std::env::var_os("DEP_GTC_INCLUDE").expect("gyrotc's build script gives it"))
        .include(folder)
        .std("c99")
        .flag_if_supported("-ffp-contract=off")
        .compile("table");
    println!("cargo:rerun-if-changed={folder}");
}
