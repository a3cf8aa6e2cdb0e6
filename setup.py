"""Builds the engine, `cesim.engine`, from csrc/. Everything else is in pyproject.toml.

CESIM_WERROR=1    all warnings, and they are errors
CESIM_SANITIZE=1  with the address and the undefined-behaviour sanitizer, and with assertions
"""

import os
import sys
import tempfile
from pathlib import Path

import numpy
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError, LinkError, PlatformError

ROOT = Path(__file__).resolve().parent

# The same bits on every machine of a kind: no contraction of a b + c, and never -ffast-math.
FLAGS = ["-std=c17", "-O3", "-ffp-contract=off", "-fvisibility=hidden", "-pthread"]

WARNINGS = ["-Wall", "-Wextra", "-Wshadow", "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wvla"]
WARNINGS += ["-Wdouble-promotion", "-Wundef", "-Werror"]
STRICTER_WARNINGS = ["-Wpedantic", "-Wconversion"]  # not for csrc/python: the interpreter's macros break them

SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", "-fno-omit-frame-pointer", "-UNDEBUG"]
SANITIZERS += ["-O1", "-g"]

OPENMP_PROGRAM = "#include <omp.h>\nint main(void) { return omp_get_max_threads() > 0 ? 0 : 1; }\n"
OPENMP_FLAGS = [  # compiling, linking: the usual way, and Apple's clang with a libomp of its own
    (["-fopenmp"], ["-fopenmp"]),
    (["-Xpreprocessor", "-fopenmp"], ["-lomp"]),
]
NO_OPENMP = """\
cesim: this compiler builds no OpenMP program, so the engine is built serially: everything works, on one thread.
cesim: for more threads install OpenMP (libgomp comes with gcc; for clang it is the package libomp) and build again."""


def is_asked_for(name: str) -> bool:
    return os.environ.get(name, "0") not in ("", "0")


def paths(pattern: str) -> list[str]:
    return sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern))


class BuildEngine(build_ext):
    """Finds OpenMP, and gives each part of the sources the warnings it can stand."""

    def builds_openmp(self, compile_flags: list[str], link_flags: list[str]) -> bool:
        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder, "probe.c")
            source.write_text(OPENMP_PROGRAM)
            try:
                objects = self.compiler.compile([str(source)], output_dir=folder, extra_postargs=compile_flags)
                self.compiler.link_executable(objects, "probe", output_dir=folder, extra_postargs=link_flags)
            except (CompileError, LinkError):
                return False
        return True

    def build_extension(self, extension: Extension) -> None:
        if self.compiler.compiler_type != "unix":
            raise PlatformError("cesim needs gcc or clang; on Windows, build it in WSL")
        for compile_flags, link_flags in OPENMP_FLAGS:
            if self.builds_openmp(compile_flags, link_flags):
                extension.extra_compile_args += compile_flags
                extension.extra_link_args += link_flags
                break
        else:
            print(NO_OPENMP, file=sys.stderr)
        self.use_stricter_warnings()
        super().build_extension(extension)

    def use_stricter_warnings(self) -> None:
        if not is_asked_for("CESIM_WERROR"):
            return
        compile_one = self.compiler._compile

        def compile_strictly(target, source, extension, arguments, flags, options):
            more = [] if source.startswith("csrc/python/") else STRICTER_WARNINGS
            compile_one(target, source, extension, arguments, [*flags, *WARNINGS, *more], options)

        self.compiler._compile = compile_strictly


engine = Extension(
    "cesim.engine",
    sources=paths("csrc/**/*.c"),
    depends=[*paths("csrc/**/*.h"), "setup.py"],
    extra_compile_args=[*FLAGS, "-isystem", numpy.get_include()],
    extra_link_args=["-pthread", "-lm"],
)
if is_asked_for("CESIM_SANITIZE"):
    engine.extra_compile_args += SANITIZERS
    engine.extra_link_args += SANITIZERS[:1]

setup(ext_modules=[engine], cmdclass={"build_ext": BuildEngine})
