# make demo   installs what is missing, builds, and reconstructs an embedded scene
# make test   installs, builds, checks form, budgets and the age of tables, and runs gtest and pytest
# make lint   checks the form of all sources; make format brings them into it
# make budget   prints how large each part is beside its budget, and fails where one is exceeded
# make sanitize   builds gtest with AddressSanitizer and UndefinedBehaviorSanitizer, and the GPU's kernels with ThreadSanitizer
# make faults   plants faults in the GPU's kernels and says what finds each
# make stability   asks each operator STABILITY_CASES times and writes docs/benchmarks/stability.md; more in STABILITY_OPTIONS
# make tables   says which tables under docs/ are stale, and fails where one is too old
# make mutants   changes MUTANTS, files or folders of the package, place by place and says which changes no fast test sees
# make docs   builds the documentation into build/docs (HTML, to be read without a network)
# make figures   draws the figures of docs/method.md with the operators
# make results   trains on whole scenes for hours, and writes their pages of docs/benchmarks; PAGE names some
# make test-extras   installs the optional packages and the pages' tools, and runs the tests that need them
# make viewer   builds the page of splitnerf view and the script of report.html from their sources (needs Node and npm)
# make wheels   builds a wheel for each Python from 3.10 to 3.13 that is found, into build/wheels
# make lock   renews third_party/requirements.lock, the versions and hashes of what `make install` brings
# make fuzz   feeds each reader damaged files for FUZZ_SECONDS, in four parts: tracing takes memory with every run
VENV ?= .venv
PYTHON ?= python3
BIN := $(VENV)/bin
BUILD ?= build/tests
JOBS ?= $(shell nproc 2>/dev/null || echo 2)

FUZZ_SECONDS ?= 600
STABILITY_CASES ?= 10000000
STABILITY_OPTIONS ?=
# With a compiler cache, what the package has compiled is not compiled again for the tests: by the same name of the compiler.
CACHED = CXX=$${CXX:-c++} CMAKE_CXX_COMPILER_LAUNCHER=$$(command -v ccache || true) CMAKE_CUDA_COMPILER_LAUNCHER=$$(command -v ccache || true)
CMAKE_TESTS = $(CACHED) $(BIN)/cmake -S . -G Ninja -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN))/ninja -DSPLITNERF_BUILD_PYTHON=OFF -DSPLITNERF_BUILD_TESTS=ON
PAGE ?=
EXTRAS := docs batch_on_ray export relight progress photos view_page report_page training_page three_page
READERS := json colmap neus png exr hdr glb checkpoint

.PHONY: demo test lint format budget test-slow install system gtest sanitize faults fuzz stability tables pytest mutants viewer docs figures results lock test-extras wheels clean

demo: install
	$(BIN)/splitnerf demo

# A clone that is built for its tests has the GPU's kernels wherever there is nvcc; one that is built for use, where there is a GPU, too.
test: CUDA := $(if $(shell command -v nvcc),-C cmake.define.SPLITNERF_CUDA=ON)
test: install lint budget tables gtest pytest

CPP := $(shell find cpp tests -name '*.cpp' -o -name '*.h' -o -name '*.cu' -o -name '*.cuh')
lint: install
	$(BIN)/ruff check --quiet python tests examples
	$(BIN)/ruff format --quiet --check python tests examples
	$(BIN)/clang-format --dry-run --Werror $(CPP)

format: install
	$(BIN)/ruff check --quiet --fix python tests examples
	$(BIN)/ruff format --quiet python tests examples
	$(BIN)/clang-format -i $(CPP)

budget: install
	@$(BIN)/python tests/budget.py

gtest: install
	$(CMAKE_TESTS) -B $(BUILD)
	$(BIN)/cmake --build $(BUILD) -j $(JOBS)
	$(BUILD)/tests/splitnerf_tests --gtest_brief=1
	$(BUILD)/tests/splitnerf_cuda_tests --gtest_brief=1

sanitize: install
	$(CMAKE_TESTS) -B build/sanitize -DCMAKE_BUILD_TYPE=RelWithDebInfo -DSPLITNERF_SANITIZE=address,undefined
	$(BIN)/cmake --build build/sanitize -j $(JOBS)
	UBSAN_OPTIONS=print_stacktrace=1 build/sanitize/tests/splitnerf_tests --gtest_brief=1
	UBSAN_OPTIONS=print_stacktrace=1 build/sanitize/tests/splitnerf_cuda_tests --gtest_brief=1
	$(CMAKE_TESTS) -B build/races -DCMAKE_BUILD_TYPE=RelWithDebInfo -DSPLITNERF_SANITIZE=thread
	$(BIN)/cmake --build build/races -j $(JOBS) --target splitnerf_cuda_tests
	build/races/tests/splitnerf_cuda_tests --gtest_brief=1 --gtest_repeat=1

faults: install
	PATH=$(abspath $(BIN)):$$PATH $(BIN)/python tests/cuda/faults.py

fuzz: install
	$(BIN)/python -m pip install --quiet -e '.[fuzz]' --no-build-isolation
	set -e; for reader in $(READERS); do for part in 1 2 3 4; do \
	  $(BIN)/python tests/fuzz/fuzz_readers.py $$reader -max_total_time=$$(($(FUZZ_SECONDS) / 4)); done; done

stability: install
	PYTHONPATH=tests $(BIN)/python -m stability --jobs $(JOBS) --cases $(STABILITY_CASES) $(STABILITY_OPTIONS)

tables: install
	@$(BIN)/python tests/bench/tables.py

pytest: install
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -n $(JOBS)

mutants: install
	$(BIN)/python -m pip install --quiet -e '.[mutants]' --no-build-isolation
	$(BIN)/python tests/mutants.py $(MUTANTS)

viewer:
	cd python/splitnerf_tools/pages && npm ci --no-audit --no-fund && npm run build

docs: install
	$(BIN)/python -m pip install --quiet -e '.[docs]' --no-build-isolation
	$(BIN)/python -m sphinx -W --keep-going -q -a -E -b html -d build/doctrees docs build/docs
	@echo build/docs/index.html

figures: install
	$(BIN)/python tests/bench/method_figures.py

results: install
	$(BIN)/python tests/bench/results.py $(PAGE)

test-slow: install
	$(BIN)/python -m pytest -q -m slow

test-extras: install viewer
	$(BIN)/python -m pip install --quiet -e '.[batch,usd,video,tensorboard,heic,raw,docs]' --no-build-isolation
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -n $(JOBS) -rs $(EXTRAS:%=tests/python/test_%.py)

system:
	@sh third_party/install_system_packages.sh

install: $(VENV)/.installed

# Built again when a source of the compiled half or the project's own requirements change.
SOURCES := $(shell find cpp third_party -type f) CMakeLists.txt pyproject.toml
$(VENV)/.installed: $(SOURCES) | system
	@echo 'installing the packages of Python into $(VENV): torch alone is 200 MB'
	@began=$$(date +%s); sh third_party/install_python_packages.sh $(PYTHON) $(VENV) && echo "  took $$(($$(date +%s) - began)) s"
	@echo 'compiling: 1 to 5 minutes on 2 cores'
	@began=$$(date +%s); $(CACHED) $(BIN)/python -m pip install --quiet --no-build-isolation --no-deps -e . $(CUDA) && \
	  echo "  took $$(($$(date +%s) - began)) s"
	@touch $@

lock: install
	$(BIN)/python -m pip install --quiet uv
	sh third_party/lock.sh $(BIN)/python

wheels: install
	TORCH_PYTHON=$(BIN)/python sh third_party/build_wheels.sh build/wheels

clean:
	rm -rf build $(VENV)
