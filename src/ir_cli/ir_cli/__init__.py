"""The `ir` command: demonstration, service calls, cells and reports."""

import os

# Linear algebra computes with one thread, unless the user chose a number: the matrices are small,
# on a busy machine threads spin while they wait for each other (a fit took five times the
# processor time at a load of 16), and how many add up a sum must not depend on the machine.
# NumPy's libraries read this when they are loaded.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
