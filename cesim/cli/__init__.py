"""The command line. An input that cannot be used ends in one line on stderr and exit code 2, never in a traceback."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from .options import parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code: 0, 1 (simulation failed), 2 (input), 130 (Ctrl-C), 143 (terminated)."""
    options = parser().parse_args(arguments)
    try:
        from .. import engine
    except ImportError as error:
        print(f"cesim: the engine is not built: {error}", file=sys.stderr)
        return 1
    try:
        return int(options.command(options))
    except engine.InputError as error:
        return fail(error, 2)
    except (engine.SimulationError, MemoryError) as error:
        return fail(error, 1)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader of our output has gone, as in `cesim bins run.h5 | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def fail(error: BaseException, code: int) -> int:
    """One line on stderr."""
    print("cesim: " + " ".join((str(error) or "out of memory").split()), file=sys.stderr)
    return code
