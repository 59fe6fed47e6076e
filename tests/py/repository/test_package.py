"""The installed C library: a program finds it by CMake and by pkg-config, with the options that it was built with."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]
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
    if ((gtc_q31_init(&state, &gtc_sn_rlg_0042_q31, 1000000UL) != 0) || (gtc_q31_sample(&state, &temp) < 0)
        || (gtc_q31_sample(&state, &temp) < 0)) { /* one alone is not believed */
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


def _run(*command: str | Path, cwd: Path | None = None) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the library was installed, moved once since: nothing in it may name the folder of the build."""
    work = tmp_path_factory.mktemp("package")
    _run(
        "cmake",
        "-S",
        ROOT,
        "-B",
        work / "build",
        "-DGTC_MAX_TERMS=2",
        f"-DCMAKE_INSTALL_PREFIX={work / 'first'}",
    )
    _run("cmake", "--build", work / "build")
    _run("cmake", "--install", work / "build")
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
    _run("cmake", "-S", user, "-B", user / "build", f"-DCMAKE_PREFIX_PATH={prefix}")
    _run("cmake", "--build", user / "build")
    _run(user / "build" / "user")


def test_a_project_takes_the_sources_in(user: Path) -> None:
    """FetchContent, with a folder in place of a URL: no installation, the options as in any build."""
    taken = f"""include(FetchContent)
set(GTC_MAX_TERMS 2)
FetchContent_Declare(gyrotc SOURCE_DIR "{ROOT}")
FetchContent_MakeAvailable(gyrotc)"""
    (user / "CMakeLists.txt").write_text(PROJECT.replace(FOUND, taken))
    _run("cmake", "-S", user, "-B", user / "build", "-DGTC_MAX_TERMS=2")
    _run("cmake", "--build", user / "build")
    _run(user / "build" / "user")


def test_pkg_config_finds_it(prefix: Path, user: Path) -> None:
    (folder,) = prefix.glob("lib*/**/pkgconfig")
    found = ["env", f"PKG_CONFIG_PATH={folder}", "pkg-config"]
    assert _run(*found, "--modversion", "gyrotc").strip() == ".".join(VERSION)
    flags = _run(*found, "--cflags", "--libs", "gyrotc").split()
    _run("gcc", "-std=c99", "-ffp-contract=off", "user.c", "gtc_rlg_0042.c", *flags, "-o", "user", cwd=user)
    _run(user / "user")


def test_every_option_of_the_configuration_is_one_of_the_package() -> None:
    config = (ROOT / "include" / "gtc_config.h").read_text(encoding="ascii")
    options = set(re.findall(r"^#define (GTC_\w+) \d", config, re.MULTILINE))
    listed = re.search(r"set\(GTC_OPTIONS ([^)]*)\)", (ROOT / "CMakeLists.txt").read_text())
    assert listed is not None and set(listed[1].split()) == options


def test_each_option_has_its_reason() -> None:
    """A comment of some length stands before each `#ifndef` of an option."""
    config = (ROOT / "include" / "gtc_config.h").read_text(encoding="ascii")
    for match in re.finditer(r"^#ifndef (GTC_\w+)\n", config, re.MULTILINE):
        if match[1] != "GTC_CONFIG_H_INCLUDED":
            before = config[: match.start()].rstrip()
            assert before.endswith("*/") and len(before.rsplit("/*", 1)[1].split()) > 15, match[1]
