"""Keep compiled templates between calls: to compile them takes longer than to fill them in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from importlib import metadata

import jinja2

from ..common.texts import c_environment, html_environment
from . import cache
from .json_text import digest_of


class _KeptTemplates(jinja2.BytecodeCache):
    """The templates that were compiled from the same text by the same program, Python and jinja2."""

    def load_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
        """Fill a bucket with what was kept; it stays empty if that is of another Python."""
        cache.kept(_name_of(bucket), lambda content: _filled(bucket, content))

    def dump_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
        """Keep what a bucket holds."""
        cache.keep(_name_of(bucket), bucket.bytecode_to_string())


def _name_of(bucket: jinja2.bccache.Bucket) -> str:
    # jinja2 evaluates filters of constants when it compiles: the program is part of what a template was made of.
    made_of = [cache.program_of(), metadata.version("jinja2"), bucket.key, bucket.checksum]
    return f"{digest_of(made_of)}.template"


def _filled(bucket: jinja2.bccache.Bucket, content: bytes) -> bool | None:
    bucket.bytecode_from_string(content)
    return True if bucket.code is not None else None


@functools.cache
def c_templates() -> jinja2.Environment:
    """Return the templates of C."""
    return c_environment(_KeptTemplates())


def html_templates(**filters: Callable[..., str]) -> jinja2.Environment:
    """Return the templates of pages, with these filters."""
    return html_environment(_KeptTemplates(), **filters)
