#!/bin/sh
# Prints the interpreter that set-up uses: that of .venv where there is one that runs, else the first that is complete,
# 3.11 before 3.12 before 3.13 (PyBullet has a wheel for 3.11 only). $PYTHON, when set, is the only candidate.
# A name on the path proves nothing: version managers leave shims that fail, and distributions ship Python
# without venv or without headers. Every candidate is run, and what it lacks is printed.

complete='
import importlib.util, os, platform, sys, sysconfig
version = "%d.%d" % sys.version_info[:2]
lacks = []
if not (3, 11) <= sys.version_info[:2] <= (3, 13): lacks.append("is Python %s, needed is 3.11, 3.12 or 3.13" % version)
elif platform.python_implementation() != "CPython": lacks.append("is not CPython")
else:
    if not all(map(importlib.util.find_spec, ("venv", "ensurepip"))): lacks.append("has no venv module (apt install python%s-venv)" % version)
    if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")): lacks.append("has no headers (apt install python%s-dev)" % version)
sys.exit(" and ".join(lacks) or None)
'

if [ -z "$PYTHON" ] && .venv/bin/python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
  echo .venv/bin/python
  exit 0
fi

seen=""
for name in ${PYTHON:-python3.11 python3.12 python3.13 python3}; do
  candidates=$(IFS=:; for folder in $PATH; do [ -x "$folder/$name" ] && echo "$folder/$name"; done)
  case $name in */*) candidates=$name ;; esac
  for candidate in $candidates; do
    if reason=$("$candidate" -c "$complete" 2>&1); then
      echo "$candidate"
      exit 0
    fi
    seen="$seen
  $candidate: $(printf '%s\n' "$reason" | head -n 1)"
  done
done

cat >&2 <<END
Set-up needs CPython 3.11 (first choice), 3.12 or 3.13 with its venv module and its headers.
On Debian 12: apt install python3.11 python3.11-venv python3.11-dev. On Ubuntu 24.04: apt install python3.12 python3.12-venv
python3.12-dev. Elsewhere: pyenv install 3.11. An interpreter that is not on the path: make setup PYTHON=/path/to/python3.11
Looked at:${seen:- nothing of that name on the path}
END
exit 1
