#!/bin/bash
# Exports what examples.sh trained into the demo: bash publish.sh OUT DEMO/generators
# Needs the exporter on PYTHONPATH or installed, and OpenCV.
set -euo pipefail
out=$1 to=$2
here=$(dirname "$0")
export PYTHONPATH=${PYTHONPATH:-$here/../src}

one() { # NAME TRAINED COMMAND...
  local name=$1 trained=$2
  shift 2
  mkdir -p "$to/$name"
  cp "$out/$trained/record.json" "$to/$name/record.json"
  python3 -c 'import sys; from gaussian_exporter.cli import main; sys.exit(main(sys.argv[1:]))' "$@"
}

one skull scaffold scaffold "$out/scaffold" "$to/skull/model.onnx" --weights compact --name 'Skull, Scaffold-GS' \
  --license CC-BY-4.0 --attribution 'Trained from photographs by alansartlog, CC BY 4.0'
one plant hexplane hexplane "$out/hexplane" "$to/plant/model.onnx" --weights compact --name 'Plant in the wind, 4DGS' \
  --duration 6 --license MIT --attribution 'Plant captured in schwa/MetalSprocketsGaussianSplats, MIT; the wind is ours'
one walker avatar avatar "$out/avatar/avatar.npz" "$to/walker/model.onnx" --weights compact --instances 32 --name 'Walker, avatar' \
  --meters-per-unit 1 --license CC0-1.0 --attribution 'Body and rig of MakeHuman, CC0'
one oil oil image-filter "$out/oil" "$to/oil/model.onnx" --name 'Oil painting' \
  --license CC-BY-4.0 --attribution 'Trained on photographs by alansartlog, CC BY 4.0, and renders of a plant (MIT)'
one statue feed-forward feed-forward "$out/feed-forward" "$to/statue/model.onnx" --weights compact --name 'Two pictures, feed-forward' \
  --license CC-BY-4.0 --attribution 'Trained on views of scenes by alansartlog (CC BY 4.0), Stephane Agullo (CC BY 4.0), PlayCanvas (MIT) and schwa (MIT)'
one denoise denoise image-filter "$out/denoise" "$to/denoise/model.onnx" --name 'Denoiser' \
  --license CC-BY-4.0 --attribution 'Trained on views of scenes by alansartlog (CC BY 4.0), Stephane Agullo (CC BY 4.0) and schwa (MIT)'
mkdir -p "$to/vessels"
cp "$out/vessels/record.json" "$to/vessels/record.json"
python3 "$here/diffusion.py" package "$out/vessels" "$to/vessels/model.onnx"
python3 "$here/example_view.py" "$out/feed-forward/held-out.npz" 17 "$to/statue" --given 2
python3 "$here/example_view.py" "$out/scaffold/held-out.npz" 2 "$to/skull"
python3 "$here/example_view.py" "$out/hexplane/held-out.npz" 1 "$to/plant"
python3 "$here/example_view.py" "$out/avatar/held-out.npz" 3 "$to/walker"
