"""Builds the compiled core twice: for this machine, and for any x86-64; or not at all, and says so.

IR_KERNELS_VARIANTS names the variants to build, with commas: native,baseline (both where it isn't
set), one of them, or none (empty: what lies here already is installed).
"""

import copy
import os
import platform
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from glob import glob
from pathlib import Path

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext

PACKAGE = "ir_kernels"
PROCESSOR = "cpp/processor.cpp"  # a module of its own: which processor is this?
X86 = platform.machine().lower() in ("x86_64", "amd64")
# GCC 12 takes the deliberately undefined values of its own AVX-512 header for a mistake.
WARNINGS = ["-Wall", "-Wextra", "-Wno-psabi", "-Wno-uninitialized", "-Wno-maybe-uninitialized"]
# No -ffast-math: NaN checks and the order of additions are part of what is promised.
OPTIMISE = [
    "-O3",
    "-std=c++17",
    "-fvisibility=hidden",
    "-g0",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",  # the same sums and products in every build, whether it has FMA or not
]
# by what IR_KERNELS_SANITIZE says
SANITIZE = {
    "address": ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"],
    "thread": ["-fsanitize=thread"],
}
# What GCC may use on its own under -march=native, as preprocessor name -> name of
# __builtin_cpu_supports.
FEATURES = {
    "__POPCNT__": "popcnt", "__SSE3__": "sse3", "__SSSE3__": "ssse3", "__SSE4_1__": "sse4.1",
    "__SSE4_2__": "sse4.2", "__SSE4A__": "sse4a", "__AVX__": "avx", "__FMA__": "fma", "__FMA4__": "fma4",  # noqa: E501
    "__XOP__": "xop", "__BMI__": "bmi", "__BMI2__": "bmi2", "__AVX2__": "avx2", "__AVX512F__": "avx512f",  # noqa: E501
    "__AVX512DQ__": "avx512dq", "__AVX512CD__": "avx512cd", "__AVX512BW__": "avx512bw",
    "__AVX512VL__": "avx512vl", "__AVX512IFMA__": "avx512ifma", "__AVX512VBMI__": "avx512vbmi",
    "__AVX512VBMI2__": "avx512vbmi2", "__AVX512VNNI__": "avx512vnni", "__AVX512BITALG__": "avx512bitalg",  # noqa: E501
    "__AVX512VPOPCNTDQ__": "avx512vpopcntdq",
}  # fmt: skip


def extensions() -> list[Extension]:
    try:
        import pybind11

        include = [pybind11.get_include()]
    except ImportError:
        include = []  # the distribution's pybind11-dev, found by the compiler on its own
    variants = [
        name for name in os.environ.get("IR_KERNELS_VARIANTS", "native,baseline").split(",") if name
    ]
    if unknown := set(variants) - {"native", "baseline"}:
        raise SystemExit(
            f"IR_KERNELS_VARIANTS names {', '.join(sorted(unknown))}: known are native, baseline"
        )
    core = sorted(set(glob("cpp/*.cpp")) - {PROCESSOR})
    sources = {f"_{name}": core for name in variants} | (
        {"_processor": [PROCESSOR]} if "native" in variants else {}
    )
    return [
        Extension(
            f"{PACKAGE}.{name}",
            files,
            include_dirs=[*include, "cpp"],
            depends=[*glob("cpp/*.[ch]pp"), "setup.py"],
            define_macros=[("IR_MODULE", name)],
            language="c++",
            optional=True,
        )
        for name, files in sources.items()
    ]


def native_features(compiler: str) -> list[str]:
    """What `-march=native` switches on here: the loader compares it with the processor it finds
    itself on.
    """
    command = [compiler, "-march=native", "-dM", "-E", "-x", "c++", os.devnull]
    macros = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    defined = {line.split()[1] for line in macros.splitlines()}
    return [feature for macro, feature in FEATURES.items() if macro in defined]


def with_bindings_joined(sources: list[str], folder: str) -> list[str]:
    """The sources, with one file in place of those that use pybind11: to compile its headers takes
    several times as long as what they bind.
    """
    bindings = [file for file in sources if "pybind11" in Path(file).read_text(encoding="utf-8")]
    if not bindings:
        return sources
    joined = Path(folder, "bindings.cpp")
    joined.parent.mkdir(parents=True, exist_ok=True)
    lines = [f'#include "{os.path.abspath(file)}"\n' for file in bindings]
    joined.write_text("".join(lines), encoding="utf-8")
    return [str(joined), *(file for file in sources if file not in bindings)]


class BuildVariants(build_ext):
    """The variants are built side by side; a compiler that is missing or fails leaves the NumPy
    reference.
    """

    def finalize_options(self):
        super().finalize_options()
        self.parallel = self.parallel or 2

    def run(self):
        super().run()
        if self.extensions and not any(
            os.path.exists(self.get_ext_fullpath(e.name)) for e in self.extensions
        ):
            print(
                f"{PACKAGE}: no C++ compiler with pybind11 was found: nothing compiled, the "
                "(slow) NumPy "
                "reference will be used. Install g++ and pybind11 and install again.",
                file=sys.stderr,
            )

    def copy_file(self, infile, outfile, *args, **options):
        """Beside its place and renamed: who has the old file mapped keeps it, nobody finds half a
        file.
        """
        beside = f"{outfile}.new"
        copied = super().copy_file(infile, beside, *args, **options)
        if not self.dry_run:
            os.replace(beside, outfile)
        return outfile, copied[1]

    def build_extensions(self):
        with ThreadPoolExecutor(os.cpu_count() or 2) as self.pool:
            super().build_extensions()

    def compile_files_side_by_side(self, sources, **options):
        """CCompiler.compile, on the processors that both variants share."""
        jobs = [self.pool.submit(self.compiler.compile, [source], **options) for source in sources]
        return [name for job in jobs for name in job.result()]

    def build_extension(self, ext):
        compiler = self.compiler.compiler_so[0]
        native = ext.name.endswith("_native")
        features = native_features(compiler) if X86 and shutil.which(compiler) else []
        ext.extra_compile_args = [*OPTIMISE, *WARNINGS]
        if native:
            ext.extra_compile_args += ["-march=native"]
        elif X86:
            ext.extra_compile_args += ["-march=x86-64", "-mtune=generic"]
        sanitizer = os.environ.get("IR_KERNELS_SANITIZE", "")
        if sanitizer:
            options = ["-O1", "-g1", "-fno-omit-frame-pointer", *SANITIZE[sanitizer]]
            ext.extra_compile_args += options
            ext.extra_link_args += options
        elif sys.platform == "linux":
            ext.extra_link_args += ["-Wl,--strip-all"]
        ext.define_macros = [*ext.define_macros, ("IR_NATIVE_FEATURES", f'"{",".join(features)}"')]
        own = copy.copy(self)  # its own folder for objects: both variants compile the same files
        own.build_temp = os.path.join(self.build_temp, ext.name)
        ext.sources = with_bindings_joined(ext.sources, own.build_temp)
        own.compiler = copy.copy(self.compiler)
        own.compiler.compile = self.compile_files_side_by_side
        super(BuildVariants, own).build_extension(ext)


if __name__ == "__main__":  # pip and colcon run it under that name too
    setup(
        name=PACKAGE,
        version="0.1.0",
        packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
        package_data={PACKAGE: ["py.typed"]},
        data_files=[
            ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
            (f"share/{PACKAGE}", ["package.xml"]),
        ],
        ext_modules=extensions(),
        cmdclass={"build_ext": BuildVariants},
        install_requires=["numpy"],
        python_requires=">=3.10",
        zip_safe=False,
        description="Kinematics, exact distances, certified motion, dynamics, inverse "
        "kinematics, compiled.",
        license="Apache-2.0",
    )
