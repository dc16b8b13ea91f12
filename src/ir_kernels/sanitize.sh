#!/bin/sh
# Builds the compiled core with AddressSanitizer and UndefinedBehaviorSanitizer and runs the kernels' tests on it.
# Usage: sanitize.sh [pytest arguments]; PYTHON names the interpreter (default: python), OUT the folder to build in.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
python=${PYTHON:-python}
out=${OUT:-$root/out/sanitize}
mkdir -p "$out/lib"
(cd "$here" && IR_KERNELS_SANITIZE=1 "$python" setup.py -q build_ext -b "$out/lib" -t "$out/temp")
cp -r "$here"/ir_kernels/*.py "$here"/ir_kernels/reference "$out/lib/ir_kernels/"
runtime=$(${CXX:-g++} -print-file-name=libasan.so):$(${CXX:-g++} -print-file-name=libubsan.so)
# Python itself leaves memory to the system at exit: no search for leaks.
for build in native baseline; do
    LD_PRELOAD=$runtime ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1:halt_on_error=1 \
        IR_KERNELS=$build PYTHONPATH="$out/lib" "$python" -m pytest -q -n0 -p no:cacheprovider \
        "$root/tests/kernels" "$@"
done
