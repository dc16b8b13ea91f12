#!/bin/sh
# Builds the compiled core with AddressSanitizer and UndefinedBehaviorSanitizer and runs the kernels' tests on it;
# then with ThreadSanitizer, and runs those tests that call it from several threads.
# Usage: sanitize.sh [pytest arguments]; PYTHON names the interpreter (default: python), OUT the folder to build in.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
python=${PYTHON:-python}
out=${OUT:-$root/out/sanitize}

# build SANITIZER VARIANTS
build() {
    mkdir -p "$out/$1/lib"
    (cd "$here" && IR_KERNELS_SANITIZE=$1 IR_KERNELS_VARIANTS=$2 "$python" setup.py -q build_ext -b "$out/$1/lib" -t "$out/$1/temp")
    cp -r "$here"/ir_kernels/*.py "$here"/ir_kernels/reference "$out/$1/lib/ir_kernels/"
}

runtime() { ${CXX:-g++} -print-file-name="lib$1.so"; }

build address native,baseline
# Python itself leaves memory to the system at exit: no search for leaks.
for variant in native baseline; do
    LD_PRELOAD=$(runtime asan):$(runtime ubsan) ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1:halt_on_error=1 \
        IR_KERNELS=$variant PYTHONPATH="$out/address/lib" "$python" -m pytest -q -n0 -p no:cacheprovider "$root/tests/kernels" "$@"
done
build thread native
LD_PRELOAD=$(runtime tsan) TSAN_OPTIONS=exitcode=66 \
    IR_KERNELS=native PYTHONPATH="$out/thread/lib" "$python" -m pytest -q -n0 -p no:cacheprovider "$root/tests/kernels" -k thread "$@"
