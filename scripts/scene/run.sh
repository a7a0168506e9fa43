#!/bin/bash
# Everything that needs a GPU, in one go, from the project's root:
#   bash scripts/scene/run.sh VIEWS SPARSE GSPLAT.whl OUT
# VIEWS is what masks.py made, SPARSE the COLMAP text model, GSPLAT.whl gsplat 1.5.3's wheel (built on first use).
set -euo pipefail
views=$1 sparse=$2 wheel=$3 out=$4
here=$(dirname "$0")
work=$(mktemp -d)
python3 -m zipfile -e "$wheel" "$work/site"
export PYTHONPATH="$work/site" PYTHONUNBUFFERED=1 MAX_JOBS=16 TORCH_CUDA_ARCH_LIST=${TORCH_CUDA_ARCH_LIST:-9.0}
time python3 -c 'from gsplat.cuda._backend import _C; assert _C is not None'

one() { # NAME, then train.py's options
  local name=$1
  shift
  python3 "$here/train.py" "$views" "$sparse" "$work/$name" "$@" 2>&1 | sed "s/^/$name: /"
  python3 "$here/trim.py" "$work/$name.ply" "$views/hull.npy" "$sparse" "$work/$name-trimmed.spz" 2>&1 | sed "s/^/$name: /"
  python3 "$here/evaluate.py" "$work/$name-trimmed.spz" "$views" "$sparse" "$work/$name-orbit.png" "$work/$name-close.png" \
    2>&1 | sed "s/^/$name: /"
}

# The scene itself learns from all photographs; its twin leaves every eighth one out, to be measured on them.
# RUNS="NAME:OPTION,OPTION ..." tries something else.
runs=${RUNS:-"skull:--degree=2 held-out:--degree=2,--hold-out"}
for run in $runs; do
  IFS=, read -ra options <<< "${run#*:}"
  one "${run%%:*}" "${options[@]}" &
done
wait
mkdir -p "$out"
cp "$work"/*.ply "$work"/*.spz "$work"/*.png "$out"/
