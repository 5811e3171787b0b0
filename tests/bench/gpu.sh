#!/usr/bin/env bash
# Builds with CUDA, tests, times and trains on a machine with one GPU and no network, in two commands of nine minutes each.
#   tests/bench/gpu.sh first OUT [BUNDLE]    operators and one step against the CPU, profiles, sanitizer, tests
#   tests/bench/gpu.sh second OUT [BUNDLE]   whole runs of the presets, the costliest kernels against the card's limits
# OUT receives table.md, log.txt and the parts' own pages; gpu_table.py writes its table into docs/cuda.md. BUNDLE is what
# gpu_bundle.sh made; without it everything is expected to be installed. A part that fails or takes too long is a line of the
# table, and the next one begins.
#   PYTHON=python3           has torch
#   GPU_WORK=DIR             environment, build, data and runs, kept for the second command (default: in /tmp)
#   GPU_SECONDS=540          of a command; parts that find no time left are left out
#   GPU_PARTS="step fast"    only these parts, beside setup, wheel, build and data (default: all)
#   SPLITNERF_DATA=DIR       a data set to train on, or a folder of some (default: the demo scene, 200 x 200)
#   GPU_DRY=1                the same on the CPU with small sizes: tries the script, measures nothing
set -u
case "${1:-}" in first | second) [ $# -ge 2 ] ;; *) false ;; esac || { sed -n '2,14p' "$0"; exit 2; }
command=$1 && shift
root=$(cd "$(dirname "$0")/../.." && pwd)
mkdir -p "$1" && out=$(cd "$1" && pwd) || exit 2
bundle=${2:+$(cd "$2" && pwd)} || exit 2
python=$(command -v "${PYTHON:-python3}") dry=${GPU_DRY:-} work=${GPU_WORK:-${TMPDIR:-/tmp}/splitnerf-gpu${GPU_DRY:+-dry}}
mkdir -p "$work" && work=$(cd "$work" && pwd) || exit 2
export PATH="$work/venv/bin:$PATH:/usr/local/cuda/bin" PYTHONPYCACHEPREFIX="$work/pycache" PYTHONUNBUFFERED=1
export LD_LIBRARY_PATH="$work/embree/usr/lib/$(uname -m)-linux-gnu${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
run_python=$work/venv/bin/python

device=cuda cuda=ON profile_steps=300 short_steps=2000 long_steps=20000 paper_steps=2000 paper_minutes=1.2 slower=1
picture="size=200" ops="--seconds .1 --minutes 1.4" steps_before=30 all_tests=yes small=()
paper=(--set export_resolution=256 --set preview_every=1.0 --set target_samples=32768 --set light_samples=2048
  --set light_queries=2048 --set mesh_resolution=192)
short=(--set export_resolution=128 --set preview_every=1.0)
if [ -n "$dry" ]; then
  device=cpu cuda=OFF profile_steps=60 short_steps=60 long_steps=60 paper_steps=20 slower=10
  picture="size=24, n_train=6, n_test=2, spp=4" ops="--tiny --seconds .002 --minutes 9" steps_before=6 all_tests=
  small=(--set target_samples=256 --set max_rays=64 --set log2_table_size=10 --set grid_resolution=16 --set mesh_resolution=24
    --set export_resolution=32 --set export_texture_size=64 --set export_faces=500 --set light_resolution=16)
  paper=("${small[@]}" --set preview_every=1.0 --set initial_rays=64 --set light_samples=64 --set light_queries=64
    --set environment_height=16 --set occlusion_rays=4)
  short=("${small[@]}")
fi
deadline=$((${GPU_SECONDS:-540} * slower)) # SECONDS counts from the start of this shell
failures=0 rows=$out/$command.tsv
: >"$out/log.txt"

table() { "$python" "$root/tests/bench/gpu_table.py" "$out"; }

row() { # part, result, seconds, what it says
  printf 'part\t%s\t%s\t%s\t%s\n' "$1" "$2" "$3" "$(printf '%s' "$4" | tr '\t' ' ')" >>"$rows"
  case "$2" in done | "left out") ;; *) failures=$((failures + 1)) ;; esac
  table >"$out/table.md"
}

said() { # log, exit code: its last line, but of a compiler that failed the first error
  if [ "$2" != 0 ] && [ "$1" = "$work/build.log" ] && grep -m 1 -E 'CMake Error|error:' "$1"; then return; fi
  tr '\r' '\n' <"$1" | grep -v '^ *$' | tail -n 1
}

wanted() { case " setup wheel build data ${GPU_PARTS:-$1} " in *" $1 "*) ;; *) return 1 ;; esac }

left() { echo $((deadline - SECONDS)); }

# Runs a command under a time limit, keeps its log, and adds the last line of that to the table.
part() { # name, seconds, command
  local name=$1 limit=$(($2 * slower)) log=$work/$1.log begin=$SECONDS result=done code
  wanted "$name" || return 1
  shift 2
  if [ "$(left)" -lt 5 ]; then row "$name" "left out" 0 "no time left"; return 1; fi
  [ "$limit" -le "$(left)" ] || limit=$(left)
  echo "== $name" >&2
  (export -f setup wheel data relight gpu_tests; timeout --kill-after=10 "$limit" "$@") >"$log" 2>&1 </dev/null
  code=$?
  [ "$code" = 0 ] || result="failed ($code)"
  [ "$code" = 0 ] || [ $((SECONDS - begin)) -lt "$limit" ] || result="stopped at $limit s"
  { echo "==== $name: $result, $((SECONDS - begin)) s"; tr '\r' '\n' <"$log" | tail -c 300000; } >>"$out/log.txt"
  row "$name" "$result" "$((SECONDS - begin))" "$(said "$log" "$code" | cut -c 1-240)"
  [ "$code" = 0 ]
}

tool_part() { # name, seconds, command whose first word may be missing on the machine
  wanted "$1" || return 1
  if command -v "$TOOL" >/dev/null; then part "$@"; else row "$1" "left out" 0 "no $TOOL on this machine"; fi
}

facts() { # of the machine, before all parts
  local gpu nvcc commit
  gpu=$(nvidia-smi --query-gpu=name,driver_version --format=csv,noheader 2>/dev/null | head -n 1)
  nvcc=$(nvcc --version 2>/dev/null | sed -n 's/.*release \([0-9.]*\).*/\1/p')
  commit=$(git -C "$root" rev-parse --short HEAD 2>/dev/null) || commit=unknown
  [ -z "$(git -C "$root" status --porcelain --untracked-files=no 2>/dev/null)" ] || commit=$commit+
  printf 'fact\t%s\t%s\n' card "${gpu%%,*}" driver "${gpu##*, }" nvcc "${nvcc:-none}" commit "$commit" date "$(date -u +%F)" \
    rehearsal "${dry:+on the CPU}" >"$rows"
  "$python" -c 'import platform, torch
for name, value in dict(python=platform.python_version(), torch=torch.__version__, CUDA=torch.version.cuda).items():
    print("fact", name, value, sep="\t")' >>"$rows"
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

wheel() { # the bundle's own build, where it is of these sources and its operators are right on this machine
  set -e
  [ "$(cat "$bundle/built/sources")" = "$(tests/bench/gpu_sources.sh)" ] || { echo "the wheel is of other sources"; exit 1; }
  "$run_python" -m pip --disable-pip-version-check install --quiet --no-index --no-deps --force-reinstall "$bundle"/built/*.whl
  splitnerf doctor
  "$run_python" -c 'import sys
from splitnerf.doctor.machine import devices
print("operators for", ", ".join(devices()))
sys.exit(sys.argv[1] not in devices())' $device
}

install() { # the wheel, else a build; kept for the second command while the sources are the same
  local sources
  sources=$("$root/tests/bench/gpu_sources.sh")
  [ "$(cat "$work/installed" 2>/dev/null)" != "$sources" ] || return 0
  rm -f "$work/installed" "$work/tested"
  part setup 90 bash -c setup
  if ! { [ -d "$bundle/built" ] && part wheel 60 bash -c wheel; }; then
    CMAKE_PREFIX_PATH="$work/embree/usr" part build 200 "$run_python" -m pip --disable-pip-version-check install --no-index \
      --no-deps --no-build-isolation --no-cache-dir --force-reinstall "$root" -C build-dir="$work/build" \
      -C cmake.define.SPLITNERF_CUDA=$cuda -v
  fi
  # shellcheck disable=SC2015  # both
  splitnerf info --settings >/dev/null && echo "$sources" >"$work/installed"
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
  grep -lE 'DEVICES|devices\(|"cuda"' tests/python/test_*.py | if [ -n "$all_tests" ]; then cat; else head -n 2; fi |
    xargs -P 5 -I{} bash -c 'CUDA_LAUNCH_BLOCKING=1 "$run_python" -m pytest {} -q -k cuda -p no:cacheprovider -o faulthandler_timeout=60 -r fE >"$work/tests/$(basename {}).log" 2>&1 || [ $? = 5 ]'
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
export python run_python work bundle picture device all_tests SPLITNERF_DATA="${SPLITNERF_DATA:-}"

train() { # name, seconds, preset, options of the training
  local name=$1 seconds=$2 preset=$3
  shift 3
  part "$name" "$seconds" "$run_python" tests/bench/gpu_train.py "$scene" --out "$work/runs/$name" --preset "$preset" --device $device \
    --no-refine "$@"
}

sanitize() { # memcheck or racecheck, on the families that have kernels with shared memory
  TOOL=compute-sanitizer tool_part "$1" 80 "$run_python" tests/bench/gpu_smoke.py --device $device --seconds $((75 * slower)) \
    --only fields --only gradients --only light --only losses --only rays --only shading --under compute-sanitizer --tool "$1" --error-exitcode 9
}

profile_eager() { # also says which kernels the second command looks at
  train profile_eager 45 fast --steps $profile_steps --profile "$out/profile_eager.md" --set cuda_graphs=false "${short[@]}"
}

tests_once() { # in the command that has the time
  [ -e "$work/tested" ] || { part tests 130 bash -c gpu_tests && touch "$work/tested"; }
}

first() {
  part smoke 90 "$run_python" tests/bench/gpu_smoke.py --device $device --seconds $((60 * slower))
  part data 60 bash -c data || return
  scene=$(tail -n 1 "$work/data.log")
  part step 80 "$run_python" tests/bench/gpu_step.py "$scene" --device $device --steps $steps_before --out "$out" "${small[@]}"
  profile_eager
  train profile_graphs 45 fast --steps $profile_steps --profile "$out/profile_graphs.md" "${short[@]}"
  train eager 75 fast --steps $short_steps --set cuda_graphs=false "${short[@]}"
  train graphs 60 fast --steps $short_steps "${short[@]}"
  # shellcheck disable=SC2086  # words
  part operators 100 "$run_python" tests/bench/gpu_ops.py --out "$out" --device $device $ops
  sanitize memcheck
  sanitize racecheck
  tests_once
  wanted short_fast || return
  if [ "$(left)" -ge 80 ]; then # loading, export and scores take about 40 s
    train short_fast "$(left)" fast --steps $long_steps --max-minutes "$(awk "BEGIN { print ($(left) - 45) / 60 / $slower }")" "${small[@]}"
  else row short_fast "left out" 0 "the second command trains longer"; fi
}

second() {
  part data 60 bash -c data || return
  scene=$(tail -n 1 "$work/data.log")
  train fast 330 fast --steps $long_steps "${small[@]}"
  PYTORCH_CUDA_ALLOC_CONF=expandable_segments:True train paper 120 paper --steps $paper_steps --max-minutes $paper_minutes "${paper[@]}"
  [ -z "$(find "$scene" -maxdepth 1 -name 'relight_*.hdr' 2>/dev/null)" ] || part relight 60 bash -c 'relight "$1"' - "$scene"
  [ -e "$out/profile_eager.md" ] || profile_eager
  TOOL=ncu tool_part limits 90 "$run_python" tests/bench/gpu_limits.py "$out/profile_eager.md" --out "$out" -- \
    "$run_python" tests/bench/gpu_train.py "$scene" --out "$work/runs/limits" --preset fast --device $device --no-refine --steps 100 \
    --set cuda_graphs=false "${short[@]}"
  tests_once
}

cd "$root" || exit 2
facts
install
if [ -e "$work/installed" ]; then
  $command
  [ ! -d "$work/runs" ] || (cd "$work" && find runs \( -name '*.json*' -o -name config.toml -o -name report.html \) -print0 |
    tar czf "$out/runs.tar.gz" --null -T -)
fi
awk -F '\t' '$1 == "part" && $3 != "done" && $3 != "left out" { print $2 }' "$rows" | while read -r name; do
  echo "---- $name" # the end of what failed, also where the reader sees no file
  tr '\r' '\n' <"$work/$name.log" | tail -n 12 | cut -c 1-240
done
echo
table | tee "$out/table.md"
exit $((failures > 0))
