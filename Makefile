# make demo   installs what is missing, builds, and reconstructs an embedded scene
# make test   installs, builds, and runs gtest and pytest
VENV ?= .venv
PYTHON ?= python3
BIN := $(VENV)/bin
BUILD ?= build/tests
JOBS ?= $(shell nproc 2>/dev/null || echo 2)

.PHONY: demo test test-slow install system gtest pytest clean

demo: install
	$(BIN)/splitnerf demo

test: install gtest pytest

gtest: install
	$(BIN)/cmake -S . -B $(BUILD) -G Ninja -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN))/ninja -DSPLITNERF_BUILD_PYTHON=OFF -DSPLITNERF_BUILD_TESTS=ON
	$(BIN)/cmake --build $(BUILD) -j $(JOBS)
	$(BUILD)/splitnerf_tests --gtest_brief=1

pytest: install
	$(BIN)/python -m pytest -q

test-slow: install
	$(BIN)/python -m pytest -q -m slow

system:
	@sh third_party/install_system_packages.sh

install: $(VENV)/.installed

# Built again when a source of the compiled half or the project's own requirements change.
SOURCES := $(shell find cpp third_party -type f) CMakeLists.txt pyproject.toml
$(VENV)/.installed: $(SOURCES) | system
	sh third_party/install_python_packages.sh $(PYTHON) $(VENV)
	$(BIN)/python -m pip install --quiet --no-build-isolation -e '.[test]'
	@touch $@

clean:
	rm -rf build $(VENV)
