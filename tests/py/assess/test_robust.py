"""Rows that are outliers stand in the plain figures; beside them stand figures without these rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gyrotc.cli.results import summary
from gyrotc.jobs.build import build_into
from gyrotc.pages.report import write_report
from gyrotc.recordings.load import load
from gyrotc.train.fitting import FitOptions
from recordings import columns, toml, write_csv


def test_spikes_of_an_exam_are_in_the_plain_figure_and_not_in_the_robust_one(tmp_path: Path) -> None:
    spikes = [100, 333, 501]
    for name, seed in (("a.csv", 1), ("b.csv", 2), ("c.csv", 3)):
        rows = columns(720, seed=seed)
        rate = rows["rate_dph"] - 20.0
        if name == "c.csv":
            rate[spikes] += 500.0 * np.std(np.diff(rate))
        write_csv(tmp_path / "RLG-1" / name, rows | {"rate_dph": rate})
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    runs = ['file = "a.csv"', 'file = "b.csv"', 'file = "c.csv"\nrole = "exam"']
    (tmp_path / "RLG-1" / "dataset.toml").write_text(toml(*runs, head=head))
    (tmp_path / "out").mkdir()
    built = build_into(tmp_path / "out", load(tmp_path / "RLG-1"), FitOptions(), numerics=["f32"], compiled=False)
    clean, exam = built.evaluation.runs[0], built.evaluation.runs[2]
    assert exam.outlier_rows == len(spikes) and clean.outlier_rows == 0 and clean.without_outliers is None
    assert exam.without_outliers is not None and built.evaluation.without_outliers == exam.without_outliers
    plain, robust, other = exam.after.rms_dph, exam.without_outliers.rms_dph, clean.after.rms_dph
    assert plain and robust and other and plain > 5.0 * robust and robust < 2.0 * other
    assert "without 3 rows that are outliers" in summary(built.evaluation)
    assert "(3 rows)" in write_report(tmp_path / "out").read_text("utf-8")
