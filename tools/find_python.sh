#!/bin/sh
# Prints the interpreter that set-up uses: that of .venv where there is one that runs, else the first that is complete,
# in the order of requirements/supported.toml. $PYTHON, when set, is the only candidate.
# A name on the path proves nothing: version managers leave shims that fail, and distributions ship Python
# without venv or without headers. Every candidate is run, and what it lacks is printed.

case $0 in */*) here=${0%/*} ;; *) here=. ;; esac
supported=""
while read -r key _ versions; do
  [ "$key" = python ] && supported=${versions%%#*} && break
done <"$here/../requirements/supported.toml"
supported=$(IFS='[]", '; echo $supported) # "3.11   3.12": the shell's own words, no other program is needed

complete='
import importlib.util, os, platform, sys, sysconfig
version = "%d.%d" % sys.version_info[:2]
lacks = []
if version not in sys.argv[1:]: lacks.append("is Python %s, needed is one of %s" % (version, ", ".join(sys.argv[1:])))
elif platform.python_implementation() != "CPython": lacks.append("is not CPython")
else:
    if not all(map(importlib.util.find_spec, ("venv", "ensurepip"))): lacks.append("has no venv module (apt install python%s-venv)" % version)
    if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")): lacks.append("has no headers (apt install python%s-dev)" % version)
sys.exit(" and ".join(lacks) or None)
'

if [ -z "$PYTHON" ] && .venv/bin/python -c 'import sys; sys.exit("%d.%d" % sys.version_info[:2] not in sys.argv)' $supported 2>/dev/null; then
  echo .venv/bin/python
  exit 0
fi

seen=""
for name in ${PYTHON:-$(printf 'python%s ' $supported) python3}; do
  # Where a version manager leaves shims, the interpreters themselves lie beside them.
  candidates=$(IFS=:; for folder in $PATH; do
    for path in "$folder/$name" "${folder%/shims}"/versions/*/bin/"$name"; do [ -x "$path" ] && echo "$path"; done
  done)
  case $name in */*) candidates=$name ;; esac
  for candidate in $candidates; do
    if reason=$("$candidate" -c "$complete" $supported 2>&1); then
      echo "$candidate"
      exit 0
    fi
    seen="$seen
  $candidate: $(printf '%s\n' "$reason" | head -n 1)"
  done
done

set -- $supported
cat >&2 <<END
Set-up needs CPython $1 (first choice)$(shift; printf ' or %s' "$@") with its venv module and its headers.
On Debian 12: apt install python3.11 python3.11-venv python3.11-dev. On Ubuntu 24.04: apt install python3.12 python3.12-venv
python3.12-dev. Elsewhere: pyenv install 3.11. An interpreter that is not on the path: make setup PYTHON=/path/to/python3.11
Looked at:${seen:- nothing of that name on the path}
END
exit 1
