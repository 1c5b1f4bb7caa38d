# make demo   sets everything up, then grasps the USB stick five times with a progress bar and a recording
# make test   sets everything up, then lint, types and tests
# make venv   .venv with mpgrasp and its tools; done again only when pyproject.toml or constraints.txt change
# make gl     headless OpenGL for the camera where it is missing (optional: the camera can ray-cast instead)
# make docs   out/site, the documentation as pages
# make wheel  dist/mpgrasp-*.whl with assets, scenes, benchmarks and weights inside
# make format lets ruff reformat and mend what it can

PYTHON ?= python3
JOBS ?= 2
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test venv gl docs wheel format clean
.DEFAULT_GOAL := demo

venv: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(v < (3, 11) and \
	"mpgrasp needs Python 3.11 or newer, got %d.%d: make venv PYTHON=/path/to/python" % v[:2])'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]' -c constraints.txt
	@touch $@

gl:
	@if PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep -q 'libEGL\.so\.1'; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		echo 'Installing headless OpenGL: libegl1 libgl1-mesa-dri'; \
		{ apt-get update -qq && DEBIAN_FRONTEND=noninteractive \
		apt-get install -y -qq --no-install-recommends libegl1 libgl1-mesa-dri >/dev/null; } || \
		echo 'No headless OpenGL could be installed: the camera will ray-cast (--camera ray).'; \
	else \
		echo 'No libEGL found: the camera will ray-cast. For OpenGL: sudo apt-get install libegl1 libgl1-mesa-dri'; \
	fi

demo: venv gl
	rm -rf out/demo
	$(BIN)/python -m mpgrasp.bench thin --controller mppc --episodes 5 --record 1 --out out/demo
	@echo 'Watch it: $(BIN)/rerun out/demo/recordings/*.rrd, or open the GIF or the MP4 beside it.'
	@echo 'Read it: out/demo/report.html'

test: venv gl
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n $(JOBS) --dist loadgroup

docs: venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]' -c constraints.txt
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo 'Read it: out/site/index.html'

wheel: venv
	$(BIN)/python -m build --wheel

format: venv
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf build dist out .mypy_cache .pytest_cache .ruff_cache
