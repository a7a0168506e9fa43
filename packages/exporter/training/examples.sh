#!/bin/bash
# Trains every example on one NVIDIA GPU in about ten minutes: bash examples.sh DATA GSPLAT.whl OUT [SECONDS]
# DATA holds skull.npz and skull.npy (make_views.py photos), body-cc0/ and scenes/*.ply (to_ply.mjs, sog.py); gsplat 1.5.3's
# wheel is compiled on first use. SECONDS is the most that each long training takes. One that fails does not stop the others.
set -uo pipefail
data=$(realpath "$1") wheel=$(realpath "$2") out=$(realpath -m "$3") seconds=${4:-330}
here=$(realpath "$(dirname "$0")")
work=$(mktemp -d)
mkdir -p "$out"
python3 -m zipfile -e "$wheel" "$work/site"
export PYTHONPATH="$work/site:$here/../src" PYTHONUNBUFFERED=1 MAX_JOBS=16 OMP_NUM_THREADS=2
export TORCH_CUDA_ARCH_LIST=${TORCH_CUDA_ARCH_LIST:-9.0}
cd "$here"

one() { # NAME COMMAND...
  local name=$1
  shift
  timeout $((seconds + 120)) python3 "$@" > "$out/$name.log" 2>&1 || echo "$name failed: $(tail -n 1 "$out/$name.log")"
}

# Alone: a second process that imports gsplat meanwhile would begin again in the same folder.
one compile -c 'from gsplat.cuda._backend import _C; assert _C is not None'
[[ -s $out/compile.log ]] && grep -q Error "$out/compile.log" && exit 1
echo "gsplat compiled after $SECONDS s"
one avatar avatar.py "$data/body-cc0" "$out/avatar" --steps 15000 --seconds "$seconds" &
one scaffold scaffold.py "$data/skull.npz" "$data/skull.npy" "$out/scaffold" --steps 12000 --count 16000 --seconds "$seconds" &
one classic classic.py "$data/skull.npz" "$data/skull.npy" "$out/classic" --steps 12000 --count 80000 --seconds "$seconds" &
(
  one wind-views make_views.py wind "$data/scenes/plant.ply" "$work/wind" --size 512 --count 400
  one hexplane hexplane.py "$work/wind.npz" "$work/wind.npy" "$out/hexplane" --steps 20000 --seconds $((seconds - 20))
) &
one feed-forward feed_forward.py "$out/feed-forward" "$data"/scenes/{skull,plant,playbot,angel,massa}.ply \
  --unseen "$data/scenes/st-peter.ply" --steps 40000 --seconds "$seconds" &
(
  for scene in skull plant playbot; do
    one "large-$scene" make_views.py orbit "$data/scenes/$scene.ply" "$work/large-$scene" --size 512 --count 48
  done
  one oil style.py "$out/oil" "$work"/large-{skull,plant,playbot}.npz --kind oil --steps 8000 --seconds 120
  one denoise style.py "$out/denoise" "$work"/large-{skull,plant,playbot}.npz --kind denoise --halvings 0 --steps 8000 \
    --seconds 120
) &
one vessels diffusion.py train "$out/vessels" --seconds 85 --steps 1000000 --batch 256 &
wait
echo "all done after $SECONDS s"
for record in "$out"/*/record.json; do echo "$record"; python3 -c "import json,sys; print({k: v for k, v in json.load(open(sys.argv[1])).items() if k != 'options'})" "$record"; done
