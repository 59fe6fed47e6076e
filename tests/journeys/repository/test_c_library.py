"""The C library as a project takes it in: CMake, pkg-config, Zephyr; one version in every file that carries it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import version
from conftest import ROOT

MINIMAL = ROOT / "examples" / "minimal"
RUNTIME = [ROOT / "libc" / f"gtc_{part}.c" for part in ("f32", "q31")]
FLAGS = (
    "-std=c99",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Werror",
    f"-I{ROOT / 'include'}",
    f"-I{MINIMAL}",
)


#: A program that prints every bias of a ramp, bit for bit.
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
        int status = gtc_f32_sample(&single, &gtc_rlg_0042_f32, 1000000UL, lost ? NULL : &warm);

        if ((status < 0)
            || (gtc_q31_sample(&fixed, &gtc_rlg_0042_q31, 1000000UL, lost ? NULL : &word) < 0)) {
            return 2;
        }
        status = gtc_f32_bias(&single, &gtc_rlg_0042_f32, &bits.value);
        if ((status < 0) || (gtc_q31_bias(&fixed, &gtc_rlg_0042_q31, &bias) < 0)) {
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


@pytest.fixture(scope="module")
def ramp(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What the C functions give."""
    folder = tmp_path_factory.mktemp("ramp")
    (folder / "ramp.c").write_text(RAMP)
    _run("gcc", *FLAGS, folder / "ramp.c", MINIMAL / "gtc_rlg_0042.c", *RUNTIME, "-o", folder / "ramp")
    return _run(folder / "ramp")


# --- one source of the version -----------------------------------------------------------------


def test_every_file_carries_the_version_of_the_header() -> None:
    assert version.differing(ROOT) == []


@pytest.fixture
def copies(tmp_path: Path) -> Path:
    """A folder with a copy of each file that carries the version."""
    for name in (version.HEADER, *version.PLACES):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


@pytest.mark.parametrize("name", version.PLACES)
def test_a_file_with_another_version_is_reported_and_mended(name: str, copies: Path) -> None:
    path = copies / name
    path.write_text(path.read_text().replace(version.header_version(ROOT), "9.8.7"))
    (reported,) = version.differing(copies)
    assert reported.startswith(f"{name}: 9.8.7")
    version.write(copies)
    assert path.read_text() == (ROOT / name).read_text()


def test_a_new_version_is_set_in_one_place_and_reaches_all(copies: Path) -> None:
    version.set_header(copies, "1.20.3")
    assert version.header_version(copies) == "1.20.3" and len(version.differing(copies)) == len(version.PLACES)
    version.write(copies)
    assert version.differing(copies) == []


#: Stand-ins for the functions of Zephyr's CMake that its file calls.
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


def test_defaults_of_kconfig_are_those_of_the_runtime() -> None:
    text = (ROOT / "include" / "gtc_config.h").read_text()
    defaults = dict(re.findall(r"#ifndef GTC_(\w+)\n#define GTC_\w+ (\w+)", text))
    options = _kconfig(ROOT / "zephyr" / "Kconfig")
    words = {
        "0": "n",
        "1": "y",
        "GTC_WITH_UNCERTAINTY": "y",
        "GTC_WITH_TERMS": "y",
    }  # parts of what is there by default
    for name in defaults.keys() - {"HALF_MULTIPLY", "ASSERT"}:  # those follow the compiler
        assert options.get(f"CONFIG_GYROTC_{name}") == words.get(defaults[name], defaults[name]), name


def test_no_documented_build_fuses_a_product_with_a_sum(tmp_path: Path) -> None:
    """With the flags of the manual, of which -ffp-contract=off says it: without it the same compiler fuses."""
    for compiler, flags in (
        ("arm-none-eabi-gcc", ("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")),
        ("aarch64-linux-gnu-gcc", ()),
        ("clang", ("-march=haswell",)),
    ):
        if shutil.which(compiler) is None:
            continue
        fused = {}
        for name, dialect in (("documented", ("-std=c99", "-ffp-contract=off")), ("careless", ("-std=gnu11",))):
            careless = ("-ffp-contract=fast",) if name == "careless" and compiler == "clang" else ()
            command = (compiler, *dialect, *careless, "-O2", *flags, f"-I{ROOT / 'include'}", "-S", "-o", "-")
            text = _run(*command, ROOT / "libc" / "gtc_f32.c", cwd=tmp_path)
            fused[name] = len(re.findall(r"\b(?:vfn?m[as]|fn?m(?:add|sub)|vfn?m(?:add|sub)\w+)\b", text))
        assert fused["documented"] == 0 and fused["careless"] > 0, compiler


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
    int k;

    if ((gtc_f32_check(&gtc_sn_rlg_0042_f32) != 0) || (gtc_q31_check(&gtc_sn_rlg_0042_q31) != 0)) {
        return 1;
    }
    if (gtc_q31_init(&state, &gtc_sn_rlg_0042_q31, 1000000UL) != 0) {
        return 2;
    }
    for (k = 0; k < 3; k++) { /* as many readings must agree before the first correction */
        if (gtc_q31_sample(&state, &gtc_sn_rlg_0042_q31, 1000000UL, &temp) < 0) {
            return 2;
        }
    }
    return ((gtc_q31_bias(&state, &gtc_sn_rlg_0042_q31, &bias) >= 0) && (bias != 0)) ? 0 : 3;
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


def test_cmake_finds_it(prefix: Path, user: Path) -> None:
    _printed("cmake", "-S", user, "-B", user / "build", f"-DCMAKE_PREFIX_PATH={prefix}")
    _printed("cmake", "--build", user / "build")
    _printed(user / "build" / "user")


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


def test_pkg_config_finds_it(prefix: Path, user: Path) -> None:
    (folder,) = prefix.glob("lib*/**/pkgconfig")
    found = ["env", f"PKG_CONFIG_PATH={folder}", "pkg-config"]
    assert _printed(*found, "--modversion", "gyrotc").strip() == ".".join(VERSION)
    flags = _printed(*found, "--cflags", "--libs", "gyrotc").split()
    _printed("gcc", "-std=c99", "-ffp-contract=off", "user.c", "gtc_rlg_0042.c", *flags, "-o", "user", cwd=user)
    _printed(user / "user")


def test_every_option_of_the_configuration_is_one_of_the_package() -> None:
    config = (ROOT / "include" / "gtc_config.h").read_text(encoding="ascii")
    options = set(re.findall(r"^#ifn?def (GTC_\w+)$", config, re.MULTILINE)) - {
        "GTC_CONFIG_H_INCLUDED",
        "GTC_CONFIG_HEADER",
    }
    listed = re.search(r"set\(GTC_OPTIONS ([^)]*)\)", (ROOT / "CMakeLists.txt").read_text())
    assert listed is not None and set(listed[1].split()) == options
