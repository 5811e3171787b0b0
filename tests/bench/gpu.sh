#!/usr/bin/env bash
# Builds with CUDA, tests, times and trains on a machine with one GPU and no network, in nine minutes; prints a table.
#   tests/bench/gpu.sh OUT [BUNDLE]
# OUT receives table.md, log.txt, ops.csv, ops.md, profile.md and runs.tar.gz. BUNDLE is what gpu_bundle.sh made; without it
# everything is expected to be installed. A part that fails or takes too long is a line of the table, and the next one begins.
#   PYTHON=python3          has torch
#   GPU_WORK=DIR            keeps environment, build, data and runs, and goes on from them (default: removed at the end)
#   GPU_SECONDS=530         of the whole; parts that find no time left are left out
#   GPU_PARTS="fast paper"  of tests, operators, fast, profile, eager, paper and relight only these (default: all)
#   SPLITNERF_DATA=DIR      a data set to train on, or a folder of some (default: the demo scene, 200 x 200)
#   GPU_DRY=1               the same on the CPU with small sizes: tries the script, measures nothing
set -u
[ $# -ge 1 ] || { sed -n '2,12p' "$0"; exit 2; }
root=$(cd "$(dirname "$0")/../.." && pwd)
mkdir -p "$1" && out=$(cd "$1" && pwd) || exit 2
bundle=${2:+$(cd "$2" && pwd)} || exit 2
python=$(command -v "${PYTHON:-python3}") dry=${GPU_DRY:-}
if [ -n "${GPU_WORK:-}" ]; then
  mkdir -p "$GPU_WORK" && work=$(cd "$GPU_WORK" && pwd) || exit 2
else
  work=$(mktemp -d) && trap 'rm -rf "$work"' EXIT
fi
export PATH="$work/venv/bin:$PATH:/usr/local/cuda/bin" PYTHONPYCACHEPREFIX="$work/pycache" PYTHONUNBUFFERED=1
export LD_LIBRARY_PATH="$work/embree/usr/lib/$(uname -m)-linux-gnu${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
run_python=$work/venv/bin/python

device=cuda cuda=ON fast_minutes=2.2 paper_minutes=1.2 profile_steps=600 eager_steps=2000 paper_steps=2000 slower=1
picture="size=200" ops="--seconds .1 --minutes 1.6" small=() paper=(--set export_resolution=256 --set preview_every=1.0)
if [ -n "$dry" ]; then
  device=cpu cuda=OFF profile_steps=60 eager_steps=60 paper_steps=20 slower=10
  picture="size=24, n_train=6, n_test=2, spp=4" ops="--tiny --seconds .002 --minutes 9"
  small=(--set target_samples=256 --set max_rays=64 --set log2_table_size=10 --set grid_resolution=16 --set mesh_resolution=24
    --set export_resolution=32 --set export_texture_size=64 --set export_faces=500 --set light_resolution=16)
  paper=("${small[@]}" --set preview_every=1.0 --set initial_rays=64 --set light_samples=64 --set light_queries=64 --set environment_height=16 --set occlusion_rays=4)
fi
deadline=$((${GPU_SECONDS:-530} * slower)) # SECONDS counts from the start of this shell
rows=() failures=0
: >"$out/log.txt"

table() {
  echo "# One GPU: $(nvidia-smi --query-gpu=name,driver_version --format=csv,noheader 2>/dev/null | head -n 1 | grep . || echo none)${dry:+; a rehearsal on the CPU}"
  printf '\n| part | | seconds | |\n|---|---|---|---|\n'
  printf '%s\n' "${rows[@]}"
}

row() { # part, result, seconds, what it says
  rows+=("| $1 | $2 | $3 | $(printf '%s' "$4" | tr '|' '/') |")
  [ "$2" = done ] || failures=$((failures + 1))
  table >"$out/table.md"
}

said() { # log, exit code: its last line, but of a compiler that failed the first error
  if [ "$2" != 0 ] && [ "$1" = "$work/build.log" ] && grep -m 1 -E 'CMake Error|error:' "$1"; then return; fi
  tr '\r' '\n' <"$1" | grep -v '^ *$' | tail -n 1
}

# Runs a command under a time limit, keeps its log, and adds the last line of that to the table.
part() { # name, seconds, command
  local name=$1 limit=$(($2 * slower)) left=$((deadline - SECONDS)) log=$work/$1.log begin=$SECONDS result=done code
  case " setup build doctor data ${GPU_PARTS:-$1} " in *" $1 "*) ;; *) return 1 ;; esac
  shift 2
  if [ "$left" -lt 5 ]; then row "$name" "left out" 0 "no time left"; return 1; fi
  [ "$limit" -le "$left" ] || limit=$left
  echo "== $name" >&2
  (export -f setup data relight gpu_tests; timeout --kill-after=10 "$limit" "$@") >"$log" 2>&1 </dev/null
  code=$?
  [ "$code" = 0 ] || result="failed ($code)"
  [ "$code" = 0 ] || [ $((SECONDS - begin)) -lt "$limit" ] || result="stopped at $limit s"
  { echo "==== $name: $result, $((SECONDS - begin)) s"; tr '\r' '\n' <"$log" | tail -c 300000; } >>"$out/log.txt"
  row "$name" "$result" "$((SECONDS - begin))" "$(said "$log" "$code" | cut -c 1-240)"
  [ "$code" = 0 ]
}

setup() { # an environment in which that of $python stays visible, be it a virtual environment itself
  set -e
  [ -x "$run_python" ] || "$python" -m venv --without-pip "$work/venv"
  site=$("$run_python" -c 'import sysconfig; print(sysconfig.get_paths()["purelib"])')
  "$python" -c 'import sys
for path in sys.path:
    if path.endswith(("site-packages", "dist-packages")): print(f"import site; site.addsitedir({path!r})")' >"$site/shared.pth"
  if [ -n "$bundle" ]; then
    "$run_python" "$(echo "$bundle"/wheels/pip-*.whl)/pip" --disable-pip-version-check install --quiet --no-index --no-deps --no-compile --ignore-installed "$bundle"/wheels/*.whl
    [ -d "$work/embree" ] || "$run_python" -m tarfile -e "$bundle/embree.tar.xz" "$work/embree"
  fi
  "$run_python" -c 'import importlib.util, os, platform, shutil, sysconfig, torch
needed = "numpy scipy PIL OpenImageIO trimesh xatlas fast_simplification tqdm jinja2 tomli_w pytest scikit_build_core pybind11".split()
missing = [name for name in needed if importlib.util.find_spec(name) is None]
missing += [name for name in ("c++", "cmake", "ninja", "nvcc") if shutil.which(name) is None]
missing += [] if os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")) else ["Python.h"]
versions = f"python {platform.python_version()}, torch {torch.__version__}, CUDA {torch.version.cuda}, {torch.cuda.device_count()} GPU"
print(versions + "; missing: " * bool(missing) + ", ".join(missing))'
}

data() { # prints the folder of a data set, last
  for found in "${SPLITNERF_DATA:-}" "${SPLITNERF_DATA:-}"/*/chair "${SPLITNERF_DATA:-}"/scenes/* "$work/demo"; do
    if [ -f "$found/transforms_train.json" ] && [ -f "$found/transforms_test.json" ]; then echo "$found"; return; fi
  done
  "$run_python" -c "
from pathlib import Path
from splitnerf.demo.scene import write_demo_dataset
write_demo_dataset(Path('$work/writing'), $picture)" && mv "$work/writing" "$work/demo" && echo "$work/demo"
}

gpu_tests() { # each file in a process of its own: a kernel that takes the device down fails one file alone
  mkdir -p "$work/tests"
  grep -lE 'DEVICES|devices\(|"cuda"' tests/python/test_*.py | xargs -P 5 -I{} bash -c 'CUDA_LAUNCH_BLOCKING=1 "$run_python" -m pytest {} -q -k cuda -p no:cacheprovider -o faulthandler_timeout=60 -r fE >"$work/tests/$(basename {}).log" 2>&1 || [ $? = 5 ]'
  code=$?
  grep -hE '^(FAILED|ERROR|E  )' "$work"/tests/*.log
  for log in "$work"/tests/*.log; do echo "$(basename "$log" .py.log): $(tail -n 1 "$log")"; done | tee "$work/tests/summary"
  sed -n 's/.*: //p' "$work/tests/summary" | awk '{ for (i = 2; i <= NF; i++) n[$i] += $(i - 1) } END { printf "%d passed, %d failed, %d errors\n", n["passed"] + n["passed,"], n["failed"] + n["failed,"], n["error"] + n["errors"] + n["error,"] + n["errors,"] }'
  return "$code"
}

relight() { # of the run, where the data have lights to compare with
  splitnerf evaluate "$work/runs/fast" --data "$1" --views 4 --spp 32 &&
    "$run_python" -c 'import json, sys; print("relit views %.2f dB" % json.load(open(sys.argv[1]))["relight"]["psnr"])' "$work/runs/fast/evaluation.json"
}
export python run_python work bundle picture SPLITNERF_DATA="${SPLITNERF_DATA:-}"

cd "$root" || exit 2
part setup 90 bash -c setup
CMAKE_PREFIX_PATH="$work/embree/usr" part build 200 "$run_python" -m pip --disable-pip-version-check install --no-index --no-deps \
  --no-build-isolation --no-cache-dir --force-reinstall "$root" -C build-dir="$work/build" -C cmake.define.SPLITNERF_CUDA=$cuda -v
part doctor 60 splitnerf doctor
if splitnerf info --settings >/dev/null; then
  part tests 130 bash -c gpu_tests
  if part data 60 bash -c data; then
    scene=$(tail -n 1 "$work/data.log") train=("$run_python" tests/bench/gpu_train.py)
    steps=$(splitnerf info --settings fast 2>/dev/null | sed -n 's/^run\.steps = \([0-9]*\).*/\1/p')
    [ -z "$dry" ] || steps=60
    part profile 60 "${train[@]}" "$scene" --out "$work/runs/profile" --preset fast --device $device --steps $profile_steps \
      --profile "$out/profile.md" "${small[@]}"
    part eager 45 "${train[@]}" "$scene" --out "$work/runs/eager" --preset fast --device $device --steps $eager_steps \
      --set cuda_graphs=false --set export_resolution=128 --set preview_every=1.0 "${small[@]}"
    # shellcheck disable=SC2086  # words
    part operators 125 "$run_python" tests/bench/gpu_ops.py --out "$out" --device $device $ops
    part fast 220 "${train[@]}" "$scene" --out "$work/runs/fast" --preset fast --device $device --steps "${steps:-20000}" \
      --max-minutes $fast_minutes "${small[@]}"
    part paper 120 "${train[@]}" "$scene" --out "$work/runs/paper" --preset paper --device $device --steps $paper_steps \
      --max-minutes $paper_minutes "${paper[@]}"
    [ -z "$(find "$scene" -maxdepth 1 -name 'relight_*.hdr' 2>/dev/null)" ] || part relight 60 bash -c 'relight "$1"' - "$scene"
    (cd "$work" && find runs \( -name '*.json*' -o -name config.toml -o -name report.html \) -print0 | tar czf "$out/runs.tar.gz" --null -T -)
  fi
fi
for log in "$work"/*.log; do # the end of what failed, also where the reader sees no file
  name=$(basename "$log" .log)
  case "$(grep "^| $name |" "$out/table.md")" in *"| done |"* | "") ;; *) echo "---- $name"; tr '\r' '\n' <"$log" | tail -n 12 | cut -c 1-240 ;; esac
done
echo
table | tee "$out/table.md"
exit $((failures > 0))
