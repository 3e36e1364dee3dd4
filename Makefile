# `make demo` and `make test` need Python >= 3.11 and make; everything else is set up in .venv.
PYTHON ?= python3
BIN := .venv/bin

# The other OpenCV that people have; constraints.txt pins the newest.
OPENCV4 := 4.14.0.94
BIN4 := .venv-opencv4/bin

.PHONY: demo bench test test-all test-opencv4 lint types wheel pictures clean

demo: .venv/ready
	$(BIN)/modeshape demo

# Ceres takes part where its package can be installed.
bench: .venv/ready
	-PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,bench]'
	$(BIN)/modeshape bench --plot recordings/bench.png --overwrite --readme README.md

# Two at a time, file by file, each on one core: threads of linear algebra would only wait for each other. In the order of
# their names, in which slow files are not left to the end, when one of the two has nothing more to do.
PYTEST := -m pytest -n 2 --dist loadfile --no-loadscope-reorder
test test-all test-opencv4: export OPENBLAS_NUM_THREADS := 1

test: .venv/ready
	$(BIN)/python $(PYTEST)

# With what is slow and rarely fails: before a release, and after changes of what is reconstructed.
test-all: .venv/ready
	$(BIN)/python $(PYTEST) -m ''

test-opencv4: .venv-opencv4/ready
	$(BIN4)/python -c 'import cv2; assert cv2.__version__.startswith("4."), cv2.__version__'
	$(BIN4)/python $(PYTEST) tests/tracking tests/app/pipeline/test_live.py

lint: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/ready
	$(BIN)/mypy

# What people install, tried in an empty environment and an empty folder.
wheel: .venv/ready
	rm -rf dist .venv-wheel
	PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	$(PYTHON) -m venv .venv-wheel
	PIP_CONSTRAINT=constraints.txt .venv-wheel/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	mkdir .venv-wheel/empty && cd .venv-wheel/empty && ../bin/modeshape demo --json > summary.json
	$(PYTHON) -c 'import json; assert json.load(open(".venv-wheel/empty/summary.json"))["e3d"] < 0.01'
	rm -rf .venv-wheel

# Those of the README, in docs/.
pictures: demo
	$(BIN)/python -m docs.pictures
	$(BIN)/python -m docs.moving

# By the environment, since pip then pins what builds the package, too. What is editable it does not compile.
.venv/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	$(BIN)/python -m compileall -q app modeshape reconstruction tracking
	touch $@

# Everything but OpenCV is that of .venv.
.venv-opencv4/ready: .venv/ready
	$(PYTHON) -m venv .venv-opencv4
	$(BIN4)/python -m pip install --quiet --disable-pip-version-check --no-deps opencv-contrib-python-headless==$(OPENCV4)
	$(BIN)/python -c 'import sysconfig; print("import site; site.addsitedir(", repr(sysconfig.get_path("purelib")), ")", sep="")' \
	    > "$$($(BIN4)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/venv.pth"
	touch $@

clean:
	rm -rf .venv .venv-opencv4 .venv-wheel dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
