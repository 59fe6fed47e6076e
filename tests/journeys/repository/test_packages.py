"""Packages for firmware, each built by its own tool where the machine has it; the installed C library.

All of them carry the version of `include/gtc.h`, and give the bits of the C functions.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import version
from conftest import ROOT

import packages

PACKAGES = ROOT / "packages"
MINIMAL = ROOT / "examples" / "minimal"
RUNTIME = [ROOT / "libc" / f"gtc_{part}.c" for part in ("crc", "f32", "q31")]
FLAGS = (
    "-std=c99",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Werror",
    f"-I{ROOT / 'include'}",
    f"-I{MINIMAL}",
)


#: What packages/rust/example and packages/ada/example do, in C.
RAMP = r"""
#include <inttypes.h>
#include <stdio.h>

#include "gtc_rlg_0042.h"

int main(void)
{
    static gtc_f32_state_t single;
    static gtc_q31_state_t fixed;
    int k;

    if ((gtc_f32_init(&single, &gtc_rlg_0042_f32, 1000000UL) != 0)
        || (gtc_q31_init(&fixed, &gtc_rlg_0042_q31, 1000000UL) != 0)) {
        return 1;
    }
    for (k = 0; k < 600; k++) {
        const float warm = 20.0F + (float) k / 64.0F;
        const int_least32_t word = (20 * 65536) + (k * 1024);
        const int lost = (k % 100 == 99);
        gtc_word_t bits;
        int_least32_t bias;
        int status = gtc_f32_sample(&single, 1000000UL, lost ? NULL : &warm);

        if ((status < 0) || (gtc_q31_sample(&fixed, 1000000UL, lost ? NULL : &word) < 0)) {
            return 2;
        }
        status = gtc_f32_bias(&single, &bits.value);
        if ((status < 0) || (gtc_q31_bias(&fixed, &bias) < 0)) {
            return 3;
        }
        printf("%d %08" PRIxLEAST32 " %08" PRIxLEAST32 " %d\n", k, bits.bits, (uint_least32_t) bias, status);
    }
    return 0;
}
"""


def _run(*command: str | Path, cwd: Path | None = None, **environment: str) -> str:
    done = subprocess.run(
        [str(c) for c in command],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=os.environ | environment,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _need(program: str) -> str:
    """Path of a program of this machine; without it the test is skipped by its name."""
    path = shutil.which(program)
    if path is None:
        pytest.skip(f"{program} is not installed")
    return path


@pytest.fixture(scope="module")
def ramp(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What the C functions give."""
    folder = tmp_path_factory.mktemp("ramp")
    (folder / "ramp.c").write_text(RAMP)
    _run("gcc", *FLAGS, folder / "ramp.c", MINIMAL / "gtc_rlg_0042.c", *RUNTIME, "-o", folder / "ramp")
    return _run(folder / "ramp")


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of everything that `make packages` writes."""
    out = tmp_path_factory.mktemp("archives")
    packages.assemble(out, list(packages.KINDS))
    return out


# --- one source of the version -----------------------------------------------------------------


@pytest.mark.slow
def test_every_file_carries_the_version_of_the_header() -> None:
    assert version.differing(ROOT) == []


@pytest.fixture
def copies(tmp_path: Path) -> Path:
    """A folder with a copy of each file that carries the version."""
    for name in (version.HEADER, *version.PLACES):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("name", version.PLACES)
def test_a_file_with_another_version_is_reported_and_mended(name: str, copies: Path) -> None:
    path = copies / name
    path.write_text(path.read_text().replace(version.header_version(ROOT), "9.8.7"))
    (reported,) = version.differing(copies)
    assert reported.startswith(f"{name}: 9.8.7")
    version.write(copies)
    assert path.read_text() == (ROOT / name).read_text()


@pytest.mark.slow
def test_a_new_version_is_set_in_one_place_and_reaches_all(copies: Path) -> None:
    version.set_header(copies, "1.20.3")
    assert version.header_version(copies) == "1.20.3" and len(version.differing(copies)) == len(version.PLACES)
    version.write(copies)
    assert version.differing(copies) == []


@pytest.mark.slow
def test_no_file_of_a_package_carries_a_version_that_the_list_lacks() -> None:
    current = version.header_version(ROOT)
    listed = set(version.PLACES) | {"packages/README.md"}
    for path in (p for p in PACKAGES.rglob("*") if p.is_file() and p.suffix != ".lock"):
        name = path.relative_to(ROOT).as_posix()
        if name not in listed:
            assert current not in path.read_text("utf-8"), name


# --- each by its tool ----------------------------------------------------------------------------


@pytest.mark.slow
def test_meson_builds_a_user_of_the_wrap(tmp_path: Path, ramp: str) -> None:
    _need("ninja")
    meson = _need("meson")
    (tmp_path / "subprojects").mkdir()
    (tmp_path / "subprojects" / "gyrotc").symlink_to(ROOT)
    shutil.copy(PACKAGES / "meson" / "gyrotc.wrap", tmp_path / "subprojects")
    (tmp_path / "user.c").write_text(RAMP)
    for ending in "ch":
        shutil.copy(MINIMAL / f"gtc_rlg_0042.{ending}", tmp_path)
    (tmp_path / "meson.build").write_text(
        "project('user', 'c', default_options: ['c_std=c99'])\n"
        "executable('user', 'user.c', 'gtc_rlg_0042.c', dependencies: dependency('gyrotc'))\n"
    )
    _run(meson, "setup", "--wrap-mode=nodownload", tmp_path / "build", tmp_path)
    _run(meson, "compile", "-C", tmp_path / "build")
    assert _run(tmp_path / "build" / "user") == ramp


#: Stand-ins for the functions of Zephyr's and Espressif's CMake that the two files call.
STUBS = """
cmake_minimum_required(VERSION 3.18)
project(image C)
set(CMAKE_C_STANDARD 99)
add_executable(image user.c gtc_rlg_0042.c)
function(zephyr_library_named name)
  set(ZEPHYR_CURRENT_LIBRARY ${name} PARENT_SCOPE)
  add_library(${name} STATIC)
  target_link_libraries(image PRIVATE ${name})
endfunction()
function(zephyr_library_sources)
  target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(zephyr_library_sources_ifdef feature)
  if(${${feature}})
    target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
  endif()
endfunction()
function(zephyr_library_compile_options)
  target_compile_options(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(zephyr_include_directories)
  target_include_directories(image PRIVATE ${ARGN})
  target_include_directories(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(zephyr_compile_definitions)
  target_compile_definitions(image PRIVATE ${ARGN})
  target_compile_definitions(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(idf_component_register)
  cmake_parse_arguments(ARG "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
  set(COMPONENT_LIB gyrotc PARENT_SCOPE)
  add_library(gyrotc STATIC ${ARG_SRCS})
  target_include_directories(gyrotc PUBLIC ${ARG_INCLUDE_DIRS})
  target_link_libraries(image PRIVATE gyrotc)
endfunction()
"""


def _image(component: Path, folder: Path, **options: str) -> Path:
    """The program RAMP with a component that is added by its CMakeLists.txt."""
    folder.mkdir(parents=True)
    (folder / "user.c").write_text(RAMP)
    for ending in "ch":
        shutil.copy(MINIMAL / f"gtc_rlg_0042.{ending}", folder)
    set_ = "".join(f"set({key} {value})\n" for key, value in options.items())
    (folder / "CMakeLists.txt").write_text(f'{STUBS}{set_}add_subdirectory("{component}" gyrotc)\n')
    _run("cmake", "-S", folder, "-B", folder / "build", "-DCMAKE_BUILD_TYPE=Release")
    _run("cmake", "--build", folder / "build")
    return folder / "build" / "image"


def _kconfig(path: Path) -> dict[str, str]:
    """Options of a Kconfig file with their defaults (`n` where there is none), as CMake sees them."""
    found = re.findall(r"^(?:menu)?config (\w+)\n((?:\t.*\n)+)", path.read_text(), re.MULTILINE)
    default = {name: re.search(r"^\tdefault (\w+)$", body, re.MULTILINE) for name, body in found}
    return {f"CONFIG_{name}": match[1] if match else "n" for name, match in default.items()}


def _asked(path: Path) -> set[str]:
    return set(re.findall(r"CONFIG_\w+", path.read_text()))


@pytest.mark.slow
def test_zephyr_finds_the_module_and_its_options(tmp_path: Path, ramp: str) -> None:
    """`zephyr/module.yml` names the folders, each option that CMake asks for is one of Kconfig."""
    named = dict(re.findall(r"^  (cmake|kconfig): (\S+)$", (ROOT / "zephyr" / "module.yml").read_text(), re.M))
    options = _kconfig(ROOT / named["kconfig"])
    assert _asked(ROOT / named["cmake"] / "CMakeLists.txt") == set(options)
    chosen = {key: "1" if value in ("y", "n") else value for key, value in options.items()}
    module, terms = ROOT / named["cmake"], {"CONFIG_GYROTC_MAX_TERMS": "6"}
    assert _run(_image(module, tmp_path / "image", **chosen | terms)) == ramp
    unused = dict.fromkeys(("CONFIG_GYROTC_WITH_IMAGE", "CONFIG_GYROTC_WITH_SAVE", "CONFIG_GYROTC_WITH_TIME"), "0")
    assert _run(_image(module, tmp_path / "least", **chosen | unused)) == ramp
    image, least = (
        (tmp_path / name / "build" / "gyrotc" / "libgyrotc.a").stat().st_size for name in ("image", "least")
    )
    assert least < 0.9 * image


@pytest.mark.slow
def test_esp_idf_takes_the_component(tmp_path: Path, ramp: str, archives: Path) -> None:
    component = archives / "esp-idf" / "gyrotc"
    options = _kconfig(component / "Kconfig")
    assert _asked(component / "CMakeLists.txt") == set(options) - {"CONFIG_GYROTC"}
    chosen = {key: {"n": "0", "y": "1"}.get(value, value) for key, value in options.items()}
    assert _run(_image(component, tmp_path / "image", **chosen)) == ramp


def test_only_the_archive_is_a_component_and_it_is_whole(tmp_path: Path) -> None:
    """Packed by Espressif's tool, the folder of the templates would give an archive without sources."""
    names = {p.name for p in (PACKAGES / "esp-idf").iterdir()}
    assert not names & {"CMakeLists.txt", "idf_component.yml"}
    packages.assemble(tmp_path, ["esp-idf"])
    component = tmp_path / "esp-idf" / "gyrotc"
    sources = re.findall(r"libc/\w+\.c", (component / "CMakeLists.txt").read_text())
    assert len(sources) == 3 and all((component / source).is_file() for source in sources)
    assert (component / "idf_component.yml").is_file() and (component / "include" / "gtc.h").is_file()


@pytest.mark.slow
def test_espressifs_tool_packs_all_sources(tmp_path: Path) -> None:
    compote = _need("compote")
    packages.assemble(tmp_path, ["esp-idf"])
    _run(compote, "component", "pack", "--name", "gyrotc", cwd=tmp_path / "esp-idf" / "gyrotc")
    (archive,) = (tmp_path / "esp-idf" / "gyrotc" / "dist").glob("*.tgz")
    listed = _run("tar", "-tzf", archive)
    for path in (*(ROOT / "libc").iterdir(), *(ROOT / "include").iterdir()):
        assert f"{path.parent.name}/{path.name}\n" in listed, path.name


def test_defaults_of_kconfig_are_those_of_the_runtime() -> None:
    text = (ROOT / "include" / "gtc_config.h").read_text()
    defaults = dict(re.findall(r"#ifndef GTC_(\w+)\n#define GTC_\w+ (\w+)", text))
    options = _kconfig(PACKAGES / "Kconfig")
    words = {"0": "n", "1": "y", "GTC_WITH_UNCERTAINTY": "y"}  # a part of a part that is there by default
    for name in defaults.keys() - {"HALF_MULTIPLY", "UNROLL", "ASSERT"}:  # those follow the compiler
        assert options.get(f"CONFIG_GYROTC_{name}") == words.get(defaults[name], defaults[name]), name


@pytest.mark.slow
def test_platformio_compiles_what_its_manifest_says(tmp_path: Path, ramp: str) -> None:
    manifest = json.loads((ROOT / "library.json").read_text())
    build = manifest["build"]
    files = [re.fullmatch(r"\+<(\w+\.c)>", word)[1] for word in build["srcFilter"]]  # type: ignore[index]
    (tmp_path / "user.c").write_text(RAMP)
    sources = [tmp_path / "user.c", MINIMAL / "gtc_rlg_0042.c", *(ROOT / build["srcDir"] / f for f in files)]
    folders = [f"-I{ROOT / build['includeDir']}", f"-I{MINIMAL}"]
    _run("gcc", "-std=gnu11", *build["flags"], *folders, *sources, "-o", tmp_path / "user")
    assert _run(tmp_path / "user") == ramp
    assert (ROOT / build["includeDir"] / manifest["headers"]).is_file()
    for pattern in manifest["export"]["include"]:
        assert list(ROOT.glob(pattern)), pattern


def test_no_build_fuses_a_product_with_a_sum(tmp_path: Path) -> None:
    """With the flags that a builder has by default, -ffp-contract=off not among them: the sources say it."""
    for compiler, flags in (
        ("arm-none-eabi-gcc", ("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")),
        ("aarch64-linux-gnu-gcc", ()),
        ("clang", ("-march=haswell",)),
    ):
        if shutil.which(compiler) is None:
            continue
        command = (compiler, "-std=gnu11", "-O2", *flags, f"-I{ROOT / 'include'}", "-S", "-o", "-")
        fused = {}
        source = (ROOT / "libc" / "gtc_f32.c").read_text()
        for name, head in (
            ("sources", ""),
            ("control", "float fused(float a, float b, float c) { return a * b + c; }"),
        ):
            (tmp_path / f"{name}.c").write_text(f"{head}\n{source if name == 'sources' else ''}")
            text = _run(*command, f"-I{ROOT / 'libc'}", tmp_path / f"{name}.c")
            fused[name] = len(re.findall(r"\b(?:vfn?m[as]|fn?m(?:add|sub)|vfn?m(?:add|sub)\w+)\b", text))
        assert fused["sources"] == 0, compiler
        if compiler != "clang":  # which fuses across statements only where it is asked to
            assert fused["control"] > 0, compiler


@pytest.mark.slow
def test_rust_gives_the_bits_of_c(ramp: str, archives: Path) -> None:
    """The crate as it is published (C sources inside) holds its own sizes against C's; the example gives C's bits."""
    cargo = _need("cargo")
    target = str(ROOT / "build" / "rust")
    crate = archives / "crate" / "gyrotc"
    fetched = subprocess.run([cargo, "fetch"], cwd=crate, capture_output=True, text=True, check=False)
    if fetched.returncode != 0:
        pytest.skip("crate cc cannot be had (no registry), or cargo is too old")
    assert "1 passed" in _run(cargo, "test", "--offline", "--lib", cwd=crate, CARGO_TARGET_DIR=target)
    assert _run(cargo, "run", "-q", cwd=PACKAGES / "rust" / "example", CARGO_TARGET_DIR=target) == ramp


def test_bindings_reserve_the_words_of_a_state(tmp_path: Path) -> None:
    """Rust and Ada hold a state of C by its size; in Ada and Rust the numbers before the channels are one array."""
    (tmp_path / "size.c").write_text(
        '#include <stddef.h>\n#include <stdio.h>\n#include "gtc.h"\n'
        "int main(void)\n{\n"
        '    printf("%d %d %d", (int)((offsetof(gtc_f32_state_t, window) - sizeof(void *)) / 4),\n'
        "           (int)sizeof(gtc_f32_state_t), (int)sizeof(gtc_q31_state_t));\n    return 0;\n}\n"
    )
    _run("gcc", "-std=c99", f"-I{ROOT / 'include'}", "size.c", "-o", "size", cwd=tmp_path)
    first, *sizes = map(int, _run(str(tmp_path / "size"), cwd=tmp_path).split())
    rust = (PACKAGES / "rust" / "src" / "lib.rs").read_text()
    assert re.findall(r"state words (\d+),", rust) == [str(first + 20 + 2 * 4)] * 2
    ada = (PACKAGES / "ada" / "gtc-binding.ads").read_text()
    assert re.findall(r"\(1 \.\. (\d+) \+ Max_Slope_Blocks \+ 2 \* Max_Terms\)", ada) == [str(first)]
    assert "(1 .. 1 + (Max_Terms + 1) * Input_Words)" in ada
    for numeric, size in zip(("f32", "q31"), sizes, strict=True):
        words = re.search(r"Input_Words => (\d+)", (PACKAGES / "ada" / f"gtc-{numeric}.ads").read_text())
        assert words is not None
        room = 8 + 4 * (first + 20 + 2 * 4 + 1 + (4 + 1) * int(words[1]))
        assert size <= room < size + 16


@pytest.mark.slow
def test_rust_has_every_option_at_its_default_and_every_status() -> None:
    text = (PACKAGES / "rust" / "src" / "lib.rs").read_text()
    header = (ROOT / "include" / "gtc.h").read_text()
    linked = (ROOT / "include" / "gtc_private_state.h").read_text()
    for name in re.findall(r"^#define (gtc_(?:f32|q31)_(?!term)\w+) GTC_LINKED", linked, re.MULTILINE):
        assert f'"{name}_20blocks_4terms"' in text, name
    remarks = dict(re.findall(r"pub const (\w+): Self = Self\((\d+)\);", text))
    assert remarks == dict(re.findall(r"^#define GTC_([A-Z_]+) (\d+) +/\*", header, re.MULTILINE))
    assert len(re.findall(r"^ +-\d => Err\(Error::", text, re.MULTILINE)) == len(
        re.findall(r"^#define GTC_E_\w+ \(-\d\)", header, re.MULTILINE)
    )


@pytest.mark.slow
def test_ada_gives_the_bits_of_c_with_every_contract_checked(ramp: str, tmp_path: Path) -> None:
    gnatmake = _need("gnatmake")
    for source in (*PACKAGES.glob("ada/*.ad?"), *PACKAGES.glob("ada/example/*.adb")):
        shutil.copy(source, tmp_path)
    objects = []
    for source in (*RUNTIME, MINIMAL / "gtc_rlg_0042.c"):
        objects.append(f"{source.stem}.o")
        _run("gcc", *FLAGS, "-c", source, "-o", objects[-1], cwd=tmp_path)
    _run(gnatmake, "-q", "-gnat2012", "-gnata", "-gnatwae", "firmware.adb", "-largs", *objects, cwd=tmp_path)
    assert _run(tmp_path / "firmware") == ramp


#: A project that takes the binding in as its page says.
GPR = """
with "{binding}";
project Firmware is
   for Languages use ("Ada", "C");
   for Source_Dirs use ("{example}", "{minimal}");
   for Source_Files use ("firmware.adb", "gtc_rlg_0042.c");
   for Object_Dir use "objects";
   for Exec_Dir use ".";
   for Create_Missing_Dirs use "True";
   for Main use ("firmware.adb");
   package Compiler is
      for Switches ("Ada") use ("-gnat2012", "-gnata", "-gnatwae");
      for Switches ("C") use ("-I{include}");
   end Compiler;
end Firmware;
"""


@pytest.mark.slow
def test_gprbuild_builds_a_user_of_the_project(ramp: str, tmp_path: Path) -> None:
    _need("gnatmake")
    gprbuild = _need("gprbuild")
    ada = PACKAGES / "ada"
    (tmp_path / "firmware.gpr").write_text(
        GPR.format(binding=ada / "gyrotc.gpr", example=ada / "example", minimal=MINIMAL, include=ROOT / "include")
    )
    _run(gprbuild, "-q", "-P", "firmware.gpr", f"-XGYROTC_OBJECTS={tmp_path / 'gyrotc'}", cwd=tmp_path)
    assert _run(tmp_path / "firmware") == ramp


# --- archives ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_archives_made_twice_are_equal(archives: Path, tmp_path: Path) -> None:
    again = packages.assemble(tmp_path, list(packages.KINDS))
    assert len(again) == len(packages.KINDS)
    for path in again:
        assert path.read_bytes() == (archives / path.name).read_bytes()


USER = r"""
#include "gtc_rlg_0042.h"

#if GTC_MAX_TERMS != 2
#error "the option of the library does not reach its user"
#endif

int main(void)
{
    gtc_q31_state_t state;
    const int_least32_t temp = 20 * 65536;
    int_least32_t bias = 0;

    if ((gtc_f32_check(&gtc_sn_rlg_0042_f32) != 0) || (gtc_q31_check(&gtc_sn_rlg_0042_q31) != 0)) {
        return 1;
    }
    if ((gtc_q31_init(&state, &gtc_sn_rlg_0042_q31, 1000000UL) != 0) || (gtc_q31_sample(&state, 1000000UL, &temp) < 0)
        || (gtc_q31_sample(&state, 1000000UL, &temp) < 0)) { /* one alone is not accepted */
        return 2;
    }
    return ((gtc_q31_bias(&state, &bias) >= 0) && (bias != 0)) ? 0 : 3;
}
"""
_HEADER = (ROOT / "include" / "gtc.h").read_text(encoding="ascii")
VERSION = re.findall(r"#define GTC_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", _HEADER)
FOUND = f"find_package(gyrotc {VERSION[0]}.{VERSION[1]} REQUIRED)"
PROJECT = f"""
cmake_minimum_required(VERSION 3.18)
project(user C)
{FOUND}
add_executable(user user.c gtc_rlg_0042.c)
set_target_properties(user PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
target_link_libraries(user PRIVATE gyrotc::gtc)
"""


def _printed(*command: str | Path, cwd: Path | None = None) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module", params=["lib", "lib/x86_64-linux-gnu"])
def prefix(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """Where the library was installed, moved once since: nothing in it may name the folder of the build."""
    work = tmp_path_factory.mktemp("package")
    _printed(
        "cmake",
        "-S",
        ROOT,
        "-B",
        work / "build",
        "-DGTC_MAX_TERMS=2",
        f"-DCMAKE_INSTALL_LIBDIR={request.param}",
        f"-DCMAKE_INSTALL_PREFIX={work / 'first'}",
    )
    _printed("cmake", "--build", work / "build")
    _printed("cmake", "--install", work / "build")
    return (work / "first").rename(work / "moved")


@pytest.fixture
def user(tmp_path: Path) -> Path:
    """A folder with a program that uses the library and an emitted table."""
    symbol = re.search(r"extern const gtc_f32_table_t (\w+)_f32;", _example("gtc_rlg_0042.h"))
    assert symbol is not None
    (tmp_path / "user.c").write_text(USER.replace("gtc_sn_rlg_0042", symbol[1]))
    (tmp_path / "CMakeLists.txt").write_text(PROJECT)
    for name in ("gtc_rlg_0042.c", "gtc_rlg_0042.h"):
        (tmp_path / name).write_text(_example(name))
    return tmp_path


def _example(name: str) -> str:
    return (ROOT / "examples" / "minimal" / name).read_text(encoding="ascii")


@pytest.mark.slow
def test_cmake_finds_it(prefix: Path, user: Path) -> None:
    _printed("cmake", "-S", user, "-B", user / "build", f"-DCMAKE_PREFIX_PATH={prefix}")
    _printed("cmake", "--build", user / "build")
    _printed(user / "build" / "user")


@pytest.mark.slow
def test_a_project_takes_the_sources_in(user: Path) -> None:
    """FetchContent, with a folder in place of a URL: no installation, the options as in any build."""
    taken = f"""include(FetchContent)
set(GTC_MAX_TERMS 2)
FetchContent_Declare(gyrotc SOURCE_DIR "{ROOT}")
FetchContent_MakeAvailable(gyrotc)"""
    (user / "CMakeLists.txt").write_text(PROJECT.replace(FOUND, taken))
    _printed("cmake", "-S", user, "-B", user / "build", "-DGTC_MAX_TERMS=2")
    _printed("cmake", "--build", user / "build")
    _printed(user / "build" / "user")
    _printed("cmake", "--install", user / "build", "--prefix", user / "installed")
    assert not list((user / "installed").rglob("gtc.h")), "a library taken in installs nothing of its own"


@pytest.mark.slow
def test_pkg_config_finds_it(prefix: Path, user: Path) -> None:
    (folder,) = prefix.glob("lib*/**/pkgconfig")
    found = ["env", f"PKG_CONFIG_PATH={folder}", "pkg-config"]
    assert _printed(*found, "--modversion", "gyrotc").strip() == ".".join(VERSION)
    flags = _printed(*found, "--cflags", "--libs", "gyrotc").split()
    _printed("gcc", "-std=c99", "-ffp-contract=off", "user.c", "gtc_rlg_0042.c", *flags, "-o", "user", cwd=user)
    _printed(user / "user")


@pytest.mark.slow
def test_every_option_of_the_configuration_is_one_of_the_package() -> None:
    config = (ROOT / "include" / "gtc_config.h").read_text(encoding="ascii")
    options = set(re.findall(r"^#ifn?def (GTC_\w+)$", config, re.MULTILINE)) - {
        "GTC_CONFIG_H_INCLUDED",
        "GTC_CONFIG_HEADER",
    }
    listed = re.search(r"set\(GTC_OPTIONS ([^)]*)\)", (ROOT / "CMakeLists.txt").read_text())
    assert listed is not None and set(listed[1].split()) == options


def test_a_comment_stands_before_each_option() -> None:
    config = (ROOT / "include" / "gtc_config.h").read_text(encoding="ascii")
    for match in re.finditer(r"^#ifndef (GTC_\w+)\n", config, re.MULTILINE):
        assert config[: match.start()].endswith("*/\n"), match[1]
