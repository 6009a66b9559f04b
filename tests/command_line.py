"""Runs of the command line within the process of the tests, which saves the time of importing."""

import contextlib
import io
import sys
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from manytouch.cli import main


@dataclass(frozen=True)
class Done:
    """Exit status and output of a run."""

    returncode: int
    stdout: str
    stderr: str


def run_command(*words: object, folder: Path | None = None) -> Done:
    """Run `manytouch` with some words, in a folder."""
    arguments = [str(word) for word in words]
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(folder or Path.cwd()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.object(sys, "argv", ["manytouch", *arguments]),
    ):
        status = main(arguments)
    return Done(returncode=status, stdout=out.getvalue(), stderr=err.getvalue())
