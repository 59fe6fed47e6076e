"""What a user reads where an extra of gyrotc is not installed: the exact command."""

from __future__ import annotations

import re
import sys

import gyrotc
import pytest
from conftest import ROOT
from gyrotc.common.errors import InputError, install_command
from gyrotc.fleet.run import Cluster, _connected
from gyrotc.tables.record import _serialization


def _without(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [n for n in sys.modules if n.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)


def test_the_estimator_without_scikit_learn_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    _without("sklearn", monkeypatch)
    monkeypatch.delitem(sys.modules, "gyrotc.train.estimator", raising=False)
    with pytest.raises(ModuleNotFoundError, match=re.escape('pip install "gyrotc[sklearn]"')):
        _ = gyrotc.RBFNetworkRegressor


def test_a_signature_without_its_package_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    _without("cryptography", monkeypatch)
    with pytest.raises(InputError, match=re.escape('pip install "gyrotc[sign]"')):
        _serialization()


def test_a_scheduler_without_its_package_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    _without("distributed", monkeypatch)
    cluster = Cluster("tcp://127.0.0.1:1", 1.0, print)
    with pytest.raises(InputError, match=re.escape('pip install "gyrotc[dask]"')), _connected(cluster):
        pass


@pytest.mark.parametrize("extra", ["sklearn", "sign", "dask", "hdf5", "tdms", "ulog", "dataflash", "ros", "mdf"])
def test_an_extra_that_is_named_exists(extra: str) -> None:
    assert install_command(extra) == f'pip install "gyrotc[{extra}]"'
    assert re.search(rf"(?m)^{extra} = \[", (ROOT / "gen" / "pyproject.toml").read_text("utf-8"))
