#!/usr/bin/env bash
# Tests, times and trains on a machine with one GPU and no network. Nothing is built there.
#   tests/bench/gpu.sh OUT BUNDLE PART ...
# PARTS: step paper fast memcheck racecheck tests. OUT receives table.md, a line for each part, log.txt and the parts' own
# pages. BUNDLE is what gpu_bundle.sh made; with - the package is installed already. A part that fails or takes too long is a line of
# the table, and the next one begins.
#   PYTHON=python3        has torch
#   GPU_WORK=DIR          environment, data and runs, kept for a later command (default: in /tmp)
#   PART_SECONDS=140      of a part
#   SPLITNERF_DATA=DIR    a data set to train on (default: the demo scene, 200 x 200)
#   GPU_DRY=1             the same on the CPU with small sizes: tries the script, measures nothing
set -u
[ $# -ge 3 ] || { sed -n '2,12p' "$0"; exit 2; }
root=$(cd "$(dirname "$0")/../.." && pwd)
mkdir -p "$1" && out=$(cd "$1" && pwd) || exit 2
bundle=
[ "$2" = - ] || bundle=$(cd "$2" && pwd) || exit 2
shift 2
python=$(command -v "${PYTHON:-python3}") dry=${GPU_DRY:-} work=${GPU_WORK:-${TMPDIR:-/tmp}/splitnerf-gpu${GPU_DRY:+-dry}}
mkdir -p "$work" && work=$(cd "$work" && pwd) || exit 2
export PATH="$work/venv/bin:$PATH:/usr/local/cuda/bin" PYTHONPYCACHEPREFIX="$work/pycache" PYTHONUNBUFFERED=1
run_python=$work/venv/bin/python seconds=${PART_SECONDS:-140}
device=cuda picture="size=200" small=() limit=(--max-minutes "$(awk "BEGIN { print ($seconds - 25) / 60 }")")
if [ -n "$dry" ]; then
  device=cpu picture="size=24, n_train=6, n_test=2, spp=4" seconds=600 limit=(--steps 40)
  small=(--set max_rays=64 --set log2_table_size=10 --set grid_resolution=16 --set mesh_resolution=24 --set light_resolution=16
    --set target_samples=256 --set initial_rays=64 --set light_samples=64 --set light_queries=64)
fi

# Runs a command under the time limit, keeps its log, and adds the last line of that to the table.
part() { # name, command
  local name=$1 log=$work/$1.log begin=$SECONDS code result
  shift
  echo "== $name" >&2
  (export -f setup data tests; timeout --kill-after=10 "$seconds" "$@") >"$log" 2>&1 </dev/null
  code=$? result=done
  [ "$code" = 0 ] || result="failed ($code)"
  { echo "==== $name: $result, $((SECONDS - begin)) s"; tr '\r' '\n' <"$log" | tail -c 300000; } >>"$out/log.txt"
  echo "| $name | $result | $((SECONDS - begin)) | $(tr '\r' '\n' <"$log" | grep -v '^ *$' | tail -n 1 | cut -c 1-400 | tr '|' '/') |" | tee -a "$out/table.md"
  [ "$code" = 0 ] || tail -n 12 "$log"
  return "$code"
}

setup() { # an environment in which that of $python stays visible; the wheel is of these sources, and its operators are right here
  set -e
  [ -x "$run_python" ] || "$python" -m venv --without-pip "$work/venv"
  site=$("$run_python" -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')
  "$python" -c 'import sys
for path in sys.path:
    if path.endswith(("site-packages", "dist-packages")): print(f"import site; site.addsitedir({path!r})")' >"$site/shared.pth"
  if [ -n "$bundle" ]; then
    [ "$(cat "$bundle/built/sources")" = "$(sh tests/bench/gpu_bundle.sh sources)" ] || { echo "the wheel is of other sources"; exit 1; }
    "$run_python" "$(echo "$bundle"/wheels/pip-*.whl)/pip" --disable-pip-version-check install --quiet --no-index --no-deps --no-compile \
      --force-reinstall "$bundle"/wheels/*.whl "$bundle"/built/*.whl
  fi
  "$run_python" -m splitnerf doctor
  "$run_python" -c 'import sys
from splitnerf.devices import devices
print("operators for", ", ".join(devices()))
sys.exit(sys.argv[1] not in devices())' $device
}

data() { # prints the folder of a data set, last
  for found in "${SPLITNERF_DATA:-}" "$work/demo"; do
    if [ -f "$found/transforms_test.json" ]; then echo "$found"; return; fi
  done
  "$run_python" -c "
from pathlib import Path
from splitnerf_tools.demo.scene import write_demo_dataset
write_demo_dataset(Path('$work/writing'), $picture)" && mv "$work/writing" "$work/demo" && echo "$work/demo"
}

tests() { # of some files, each in a process of its own, as a kernel may take the device down; before it a tool, if any
  local failed=0
  for file in $(grep -lE 'DEVICES|devices\(|"cuda"' tests/python/test_*.py); do
    CUDA_LAUNCH_BLOCKING=1 "$@" "$run_python" -m pytest "$file" -q -k "$device" -p no:cacheprovider -o faulthandler_timeout=60 -r fE || [ $? = 5 ] || failed=$((failed + 1))
  done
  echo "$failed files failed"
  return $((failed > 0))
}
export python run_python work bundle picture device SPLITNERF_DATA="${SPLITNERF_DATA:-}"

train() { # preset: as long as the part has time for; steps a second and memory stand in metrics.jsonl
  part "$1" "$run_python" -m splitnerf train "$scene" --out "$work/runs/$1" --overwrite --device $device --preset "$1" "${limit[@]}" "${small[@]}"
  [ ! -f "$work/runs/$1/metrics.jsonl" ] || cp "$work/runs/$1/metrics.jsonl" "$out/$1.jsonl"
}

cd "$root" || exit 2
commit=$(git describe --always --exclude '*' --dirty=+ 2>/dev/null || cat "$bundle/built/commit" 2>/dev/null) || commit=unknown
card=$(nvidia-smi --query-gpu=name,driver_version --format=csv,noheader 2>/dev/null | head -n 1)
{
  printf '%s\n\n' "${card:-no card}; commit $commit; $(date -u +%F); $("$python" -c 'import platform, torch; print(f"python {platform.python_version()}, torch {torch.__version__}")')${dry:+; a rehearsal on the CPU}"
  printf '| part | | seconds | |\n|---|---|---|---|\n'
} | tee "$out/table.md"
: >"$out/log.txt"
part setup bash -c setup && part data bash -c data || exit 1
scene=$(tail -n 1 "$work/data.log") failures=0
for name in "$@"; do
  case $name in
    step) part step "$run_python" -m pytest tests/python/test_gpu_step.py -q -k $device -p no:cacheprovider ;;
    paper | fast) train "$name" ;;
    memcheck | racecheck) part "$name" bash -c "tests compute-sanitizer --tool $name --error-exitcode 9" ;;
    tests) part tests bash -c tests ;;
    *) echo "no part is called $name" >&2; false ;;
  esac || failures=$((failures + 1))
done
exit $((failures > 0))
