"""From quantised tables to C: text of tables, runtime, image, known answers, board test, example."""

from .example import example_period_us, example_samples
from .files import (
    Emission,
    board_test_text,
    emit,
    emit_texts,
    emitted_tables,
    expected_answers,
    quantise_all,
    write_texts,
)
from .vectors import answers_text

__all__ = [
    "Emission",
    "answers_text",
    "board_test_text",
    "emit",
    "emit_texts",
    "emitted_tables",
    "example_period_us",
    "example_samples",
    "expected_answers",
    "quantise_all",
    "write_texts",
]
