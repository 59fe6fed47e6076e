"""The emitted runtime is libc/ with its options decided: the same tokens, the same objects, nothing unused."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import ROOT
from gyrotc.model import Model
from gyrotc.tables import NUMERICS, joint_needs, needs_of, runtime_texts
from models import bank_of, random_model, random_terms

PARTS = ("uncertainty", "rezero", "coverage", "known_answers", "image", "saved_state", "time")
# Without optimisation, the object has everything that the text says, whether it is used or not.
FLAGS = ("-std=c99", "-ffp-contract=off", "-O0", "-ffunction-sections")
WARNINGS = (
    "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wundef", "-Wshadow",
    "-Wmissing-declarations", "-Wunused-macros", "-Werror", "-Dinline=", "-DGTC_ASSERT(claim)=((void)(claim))",
)  # fmt: skip


def _models() -> dict[str, list[Model]]:
    plain = random_model(3)
    return {
        "plain": [plain],
        "the map alone": [plain.model_copy(update={"left_out": PARTS})],
        "without times and images": [plain.model_copy(update={"left_out": ("time", "image")})],
        **{f"terms {seed}": [random_model(seed, terms=random_terms(seed))] for seed in range(1, 7)},
        "a term without uncertainty": [
            random_model(2, terms=random_terms(2)[:1]).model_copy(update={"left_out": ("uncertainty", "rezero")})
        ],
        "a bank with terms": [bank_of(random_model(2, terms=random_terms(2)))],
        "a fleet": [plain, bank_of(random_model(4)), *(random_model(k, terms=random_terms(k)) for k in range(5, 9))],
    }


@pytest.fixture(scope="module", params=_models())
def emitted(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, int]]:
    """A folder with the runtime of some models, and its options."""
    needs = joint_needs(map(needs_of, _models()[request.param]))
    folder = tmp_path_factory.mktemp("runtime")
    for name, text in runtime_texts(needs, NUMERICS).items():
        (folder / name).write_bytes(text)
    return folder, needs


def _tokens(source: Path, include: Path, defined: list[str]) -> list[str]:
    """Tokens of a source and its own headers, without those of the system's headers."""
    command = ["gcc", "-std=c99", "-E", f"-I{include}", *defined, str(source)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    kept, is_own = [], True
    for line in text.splitlines():
        if mark := re.match(r'# \d+ "([^"]*)"', line):
            is_own = Path(mark[1]).name.startswith("gtc")
        elif is_own:
            kept.append(line)
    return re.findall(r"0[xX][0-9a-fA-F.]+(?:p[+-]\d+)?\w*|\w+|\S", "\n".join(kept))


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_emitted_text_has_the_tokens_of_the_library(
    emitted: tuple[Path, dict[str, int]], numeric: str, tmp_path: Path
) -> None:
    """Sizes that the library computes from its options are numbers in what is emitted; the objects show that."""
    folder, needs = emitted
    for name in ("include", "libc"):
        shutil.copytree(ROOT / name, tmp_path / name)
    sizes = re.findall(r"^#define (GTC_(?:MAX|PARTS|BIAS|SAVE)\w*) (\w+)", (folder / "gtc.h").read_text(), re.MULTILINE)
    with (tmp_path / "include" / "gtc_config.h").open("a") as config:
        config.writelines(f"#undef {name}\n#define {name} {value}\n" for name, value in sizes)
    defined = [f"-D{name}={value}" for name, value in needs.items()]
    ours = _tokens(tmp_path / "libc" / f"gtc_{numeric}.c", tmp_path / "include", defined)
    assert ours == _tokens(folder / f"gtc_{numeric}.c", folder, [])


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_objects_are_equal(emitted: tuple[Path, dict[str, int]], numeric: str) -> None:
    folder, needs = emitted
    defined = [f"-D{name}={value}" for name, value in needs.items()]
    code = []
    for source, include, options in (
        (ROOT / "libc" / f"gtc_{numeric}.c", ROOT / "include", defined),
        (folder / f"gtc_{numeric}.c", folder, []),
    ):
        subprocess.run(["gcc", *FLAGS, f"-I{include}", *options, "-c", source, "-o", folder / "a.o"], check=True)
        done = subprocess.run(["objdump", "-dr", "-s", folder / "a.o"], capture_output=True, text=True, check=True)
        code.append(
            re.sub(r"^.*file format.*$|^Contents of section .comment:\n(?: .*\n)*", "", done.stdout, flags=re.M)
        )
    assert code[0] == code[1]


@pytest.mark.parametrize("numeric", NUMERICS)
def test_nothing_of_the_emitted_text_is_unused(emitted: tuple[Path, dict[str, int]], numeric: str) -> None:
    """No function, parameter or constant that the tables do not need: compilers warn of each."""
    folder, _ = emitted
    command = ["gcc", *FLAGS, *WARNINGS, "-c", f"gtc_{numeric}.c", "-o", "b.o"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:3000]


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_emitted_text_is_plain(emitted: tuple[Path, dict[str, int]], numeric: str) -> None:
    """No macro stands for a name or a type, no condition for an option, and no file is named that is not there."""
    folder, _ = emitted
    for name in ("gtc.h", f"gtc_{numeric}.c"):
        text = (folder / name).read_text("ascii")
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        code = re.sub(r"^#define GTC_WITH_\w+ [01]$", "", code, flags=re.MULTILINE)  # what is declared
        assert not re.search(r"##|\b(NUM|WIDE|STATE|TABLE|ELEMENT|MEMBER|PUBLIC|GTC_WITH_\w+)\b", code)
        assert not re.findall(r"\bgtc_\w+\.(?:inl|h)\b", text), name
        assert max(map(len, text.splitlines())) <= 128, max(text.splitlines(), key=len)
        assert set(re.findall(r"^#include (.*)$", code, re.MULTILINE)) <= {
            "<stddef.h>",
            "<stdint.h>",
            '"gtc.h"',
            "<arm_acle.h>",
        }


def test_the_header_begins_with_the_manual(emitted: tuple[Path, dict[str, int]]) -> None:
    assert (emitted[0] / "gtc.h").read_text("ascii").startswith("/* gtc.h - bias of a gyro from its temperature:")
