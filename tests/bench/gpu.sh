#!/usr/bin/env bash
# Tests, times and trains on a machine with one GPU and no network, in two commands of ten minutes at most. Nothing is built there.
#   tests/bench/gpu.sh first OUT [BUNDLE]    operators and one step against the CPU, the steady state, preset paper, a run of fast
#   tests/bench/gpu.sh second OUT [BUNDLE]   other schedules of fast, the costliest kernels against the card's limits, sanitizers, tests
# OUT receives eight files at most: table.md, log.txt, the parts' own pages, and what gpu_table.py writes into docs/cuda.md. BUNDLE is
# what gpu_bundle.sh made; without it the package is expected to be installed. A part that fails or takes too long is a line of the
# table, and the next one begins.
#   PYTHON=python3           has torch
#   GPU_WORK=DIR             environment, data and runs, kept for the second command (default: in /tmp)
#   GPU_SECONDS=570          of a command; parts that find no time left are left out
#   GPU_PARTS="step fast"    only these parts, beside setup, wheel and data (default: all)
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
run_python=$work/venv/bin/python

# Parts with their seconds; the last one gets all that is left.
first="setup 25 wheel 30 data 25 smoke 50 step 65 steady 60 operators 100 paper 75 fast 140"
second="setup 25 wheel 30 data 25 fast_10000_32k 70 fast_10000_16k 60 fast_5000_131k 80 limits 75 memcheck 60 racecheck 60 tests 85"
device=cuda slower=1 picture="size=200" ops="--seconds .1 --minutes 1.5" steps_before=12 all_tests=yes jobs=8 small=()
steps=(20000 10000 5000) until=1500 until_paper=300 profiled=10
if [ -n "$dry" ]; then
  device=cpu slower=4 picture="size=24, n_train=6, n_test=2, spp=4" ops="--tiny --seconds .002 --minutes 5" steps_before=6 all_tests= jobs=1
  steps=(60 40 20) until=60 until_paper=12 profiled=2
  small=(--set max_rays=64 --set log2_table_size=10 --set grid_resolution=16 --set mesh_resolution=24 --set light_resolution=16
    --set target_samples=256 --set initial_rays=64 --set light_samples=64 --set light_queries=64 --set occlusion.environment_height=16
    --set occlusion_rays=4 --set surface.levels_open_by=0)
fi
deadline=$((${GPU_SECONDS:-570} * slower)) # SECONDS counts from the start of this shell
failures=0 rows=$out/$command.tsv
: >"$out/log.txt"

table() { "$python" "$root/tests/bench/gpu_table.py" "$out"; }

row() { # part, result, seconds, what it says
  printf 'part\t%s\t%s\t%s\t%s\n' "$1" "$2" "$3" "$(printf '%s' "$4" | tr '\t' ' ')" >>"$rows"
  case "$2" in done | "left out") ;; *) failures=$((failures + 1)) ;; esac
  table >"$out/table.md"
}

wanted() { case " setup wheel data ${GPU_PARTS:-$1} " in *" $1 "*) ;; *) return 1 ;; esac }

left() { echo $((deadline - SECONDS)); }

limit_of() { # part: its seconds, or what is left
  local seconds
  seconds=$(echo " ${!command} " | sed -n "s/.* $1 \([0-9]*\) .*/\1/p")
  case " ${!command}" in *" $1 $seconds") seconds= ;; esac
  seconds=$((${seconds:-100000} * slower))
  echo $((seconds < $(left) ? seconds : $(left)))
}

# Runs a command under its part's time limit, keeps its log, and adds the last line of that to the table.
part() { # name, command
  local name=$1 limit log=$work/$1.log begin=$SECONDS result=done code
  wanted "$name" || return 1
  shift
  limit=$(limit_of "$name")
  if [ "$limit" -lt 5 ]; then row "$name" "left out" 0 "no time left"; return 1; fi
  echo "== $name" >&2
  (export -f setup wheel data gpu_tests; timeout --kill-after=10 "$limit" "$@") >"$log" 2>&1 </dev/null
  code=$?
  [ "$code" = 0 ] || result="failed ($code)"
  [ "$code" = 0 ] || [ $((SECONDS - begin)) -lt "$limit" ] || result="stopped at $limit s"
  { echo "==== $name: $result, $((SECONDS - begin)) s"; tr '\r' '\n' <"$log" | tail -c 300000; } >>"$out/log.txt"
  row "$name" "$result" "$((SECONDS - begin))" "$(tr '\r' '\n' <"$log" | grep -v '^ *$' | tail -n 1 | cut -c 1-400)"
  [ "$code" = 0 ]
}

tool_part() { # tool, name, command
  wanted "$2" || return 1
  if command -v "$1" >/dev/null; then part "${@:2}"; else row "$2" "left out" 0 "no $1 on this machine"; fi
}

facts() { # of the machine, before all parts
  local gpu nvcc commit
  gpu=$(nvidia-smi --query-gpu=name,driver_version --format=csv,noheader 2>/dev/null | head -n 1)
  nvcc=$(nvcc --version 2>/dev/null | sed -n 's/.*release \([0-9.]*\).*/\1/p')
  commit=$(git -C "$root" describe --always --exclude '*' --dirty=+ 2>/dev/null || cat "$bundle/built/commit" 2>/dev/null) || commit=unknown
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
  [ -z "$bundle" ] || "$run_python" "$(echo "$bundle"/wheels/pip-*.whl)/pip" --disable-pip-version-check install --quiet --no-index --no-deps --no-compile --ignore-installed "$bundle"/wheels/*.whl
  "$run_python" -c 'import importlib.util, platform, torch
needed = "numpy scipy PIL OpenImageIO trimesh xatlas fast_simplification tqdm jinja2 tomli_w pytest".split()
missing = [name for name in needed if importlib.util.find_spec(name) is None]
versions = f"python {platform.python_version()}, torch {torch.__version__}, CUDA {torch.version.cuda}, {torch.cuda.device_count()} GPU"
print(versions + "; missing: " * bool(missing) + ", ".join(missing))'
}

wheel() { # of these sources, and its operators are right on this machine
  set -e
  if [ -n "$bundle" ]; then
    [ "$(cat "$bundle/built/sources")" = "$(tests/bench/gpu_sources.sh)" ] || { echo "the wheel is of other sources"; exit 1; }
    "$run_python" -m pip --disable-pip-version-check install --quiet --no-index --no-deps --force-reinstall "$bundle"/built/*.whl
  fi
  "$run_python" -m splitnerf doctor
  "$run_python" -c 'import sys
from splitnerf.devices import devices
print("operators for", ", ".join(devices()))
sys.exit(sys.argv[1] not in devices())' $device
}

data() { # prints the folder of a data set, last
  for found in "${SPLITNERF_DATA:-}" "${SPLITNERF_DATA:-}"/*/chair "${SPLITNERF_DATA:-}"/scenes/* "$work/demo"; do
    if [ -f "$found/transforms_train.json" ] && [ -f "$found/transforms_test.json" ]; then echo "$found"; return; fi
  done
  "$run_python" -c "
from pathlib import Path
from splitnerf_tools.demo.scene import write_demo_dataset
write_demo_dataset(Path('$work/writing'), $picture)" && mv "$work/writing" "$work/demo" && echo "$work/demo"
}

gpu_tests() { # each file in a process of its own: a kernel that takes the device down fails one file alone
  rm -rf "$work/tests" && mkdir "$work/tests"
  grep -lE 'DEVICES|devices\(|"cuda"' tests/python/test_*.py | if [ -n "$all_tests" ]; then cat; else head -n 2; fi |
    xargs -P $jobs -I{} bash -c 'CUDA_LAUNCH_BLOCKING=1 "$run_python" -m pytest {} -q -k cuda -p no:cacheprovider -o faulthandler_timeout=60 -r fE >"$work/tests/$(basename {}).log" 2>&1 || [ $? = 5 ]'
  code=$?
  grep -hE '^(FAILED|ERROR|E  )' "$work"/tests/*.log
  for log in "$work"/tests/*.log; do echo "$(basename "$log" .py.log): $(tail -n 1 "$log")"; done | tee "$work/summary"
  sed -n 's/.*: //p' "$work/summary" | awk '{ for (i = 2; i <= NF; i++) n[$i] += $(i - 1) } END { printf "%d passed, %d failed, %d errors\n", n["passed"] + n["passed,"], n["failed"] + n["failed,"], n["error"] + n["errors"] + n["error,"] + n["errors,"] }'
  return "$code"
}
export python run_python work bundle picture device all_tests jobs SPLITNERF_DATA="${SPLITNERF_DATA:-}"

train() { # name, preset, options
  part "$1" "$run_python" tests/bench/gpu_train.py "$scene" --out "$work/runs/$1" --device $device --preset "$2" "${small[@]}" "${@:3}"
}

steady() { # also says which kernels the second command looks at
  train steady fast --steps 20000 --until $until --page "$out/steady.md" --set surface.levels_open_by=0 --set mesh.every=0.02 &&
    cp "$out/steady.md" "$work"
}

to_the_end() { # name, steps, options: a schedule that gives way to the time, less some for the start and the scores
  train "$1" fast --steps "$2" --set run.max_minutes="$(awk "BEGIN { print ($(limit_of "$1") - 25 * $slower) / 60 }")" "${@:3}"
}

samples() { [ -n "$dry" ] || echo "--set sampling.target_samples=$1 --set sampling.initial_rays=$(($1 / 8)) --set sampling.max_rays=$(($1 / 2))"; }

sanitize() { # memcheck or racecheck, on the families that have kernels with shared memory: families to leave out
  tool_part compute-sanitizer "$1" "$run_python" tests/bench/gpu_smoke.py --device $device --seconds $(($(limit_of "$1") - 5)) --jobs $jobs \
    "${@:2}" --under compute-sanitizer --tool "$1" --error-exitcode 9
}

run_first() {
  part smoke "$run_python" tests/bench/gpu_smoke.py --device $device --seconds $((45 * slower)) --jobs $jobs
  part step "$run_python" tests/bench/gpu_step.py "$scene" --device $device --steps $steps_before --out "$out" "${small[@]}"
  steady
  # shellcheck disable=SC2086  # words
  part operators "$run_python" tests/bench/gpu_ops.py --out "$out" --device $device $ops
  train paper paper --steps 20000 --until $until_paper --profiled $profiled --page "$out/paper.md" --set mesh.every=1.0
  to_the_end fast "${steps[0]}"
}

# shellcheck disable=SC2046  # words
run_second() {
  to_the_end fast_10000_32k "${steps[1]}"
  to_the_end fast_10000_16k "${steps[1]}" $(samples 16384)
  to_the_end fast_5000_131k "${steps[2]}" $(samples 131072)
  [ -e "$work/steady.md" ] || steady
  tool_part ncu limits "$run_python" tests/bench/gpu_limits.py "$work/steady.md" --out "$out" -- "$run_python" tests/bench/gpu_train.py \
    "$scene" --out "$work/runs/limits" --device $device --preset fast --steps 100 --set run.cuda_graphs=false "${small[@]}"
  sanitize memcheck --only fields --only gradients --only rays
  sanitize racecheck --only light --only shading
  part tests bash -c gpu_tests
}

cd "$root" || exit 2
facts
if part setup bash -c setup && part wheel bash -c wheel && part data bash -c data; then
  scene=$(tail -n 1 "$work/data.log")
  "run_$command"
  [ ! -d "$work/runs" ] || (cd "$work" && find runs \( -name '*.json*' -o -name '*.png' \) -print0 | tar czf "$out/runs.tar.gz" --null -T -)
fi
awk -F '\t' '$1 == "part" && $3 != "done" && $3 != "left out" { print $2 }' "$rows" | while read -r name; do
  echo "---- $name" # the end of what failed, also where the reader sees no file
  tr '\r' '\n' <"$work/$name.log" | tail -n 12 | cut -c 1-240
done
echo
table | tee "$out/table.md"
exit $((failures > 0))
