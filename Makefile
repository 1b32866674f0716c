# Every step that a person or CI runs. `make help` lists them.
SHELL := /bin/bash
.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT := out
# The lock file holds for Python 3.11 and later; older ones resolve the ranges of pyproject.toml.
CONSTRAINT := $(shell $(PYTHON) -c 'import sys; print("-c requirements.lock" if sys.version_info >= (3, 11) else "")')
SUDO := $(shell [ "$$(id -u)" = 0 ] || command -v sudo)
APT := $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends

.PHONY: help demo quick test check docs rig rig-apt rig-foreign rig-proof gst-apt vm vm-apt firmware firmware-test firmware-proof proof bench lock clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' Makefile | sed 's/:.*## /\t/' | expand -t 18

$(VENV)/.installed: pyproject.toml requirements.lock
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q --disable-pip-version-check $(CONSTRAINT) -e '.[dev]'
	touch $@

demo: $(VENV)/.installed ## fly 60 s of simulated wing; write log, figures and report to out/
	@mkdir -p $(OUT)
	$(BIN)/avionics sim --duration 60 --seed 0 --force -o $(OUT)/demo.mcap
	$(BIN)/avionics evaluate $(OUT)/demo.mcap
	$(BIN)/avionics report $(OUT)/demo.mcap --force -o $(OUT)/demo.html
	@echo
	@echo "log:    $(OUT)/demo.mcap   (open it in Foxglove, or: $(BIN)/avionics info $(OUT)/demo.mcap)"
	@echo "report: $(OUT)/demo.html   (open it in a browser)"

# One thread a worker: matrices of twenty rows gain nothing from more, and the threads wait by spinning.
WORKERS ?= 2
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

quick: $(VENV)/.installed ## the inner loop, under a minute: no flights, no compilers
	$(ONE_THREAD) $(BIN)/python -m pytest -q -n $(WORKERS) --dist worksteal -m "not slow and not alone"

test: $(VENV)/.installed ## everything that needs no kernel rig
	$(ONE_THREAD) $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -m "not alone"
	$(BIN)/python -m pytest -m alone

check: $(VENV)/.installed ## lint, format, import contracts and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy

docs: $(VENV)/.installed ## build the documentation as a site in out/site; warnings are errors
	$(BIN)/python -c 'import latex2mathml, material' 2>/dev/null || \
	  $(BIN)/pip install -q --disable-pip-version-check $(CONSTRAINT) -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "site: $(OUT)/site/index.html"

rig-apt: ## install what the uml tier needs
	command -v linux.uml >/dev/null && command -v candump >/dev/null && command -v i2cdetect >/dev/null && command -v ip >/dev/null && command -v insmod >/dev/null || \
	  { $(SUDO) apt-get update -q && $(APT) user-mode-linux kmod iproute2 can-utils i2c-tools; }

gst-apt: ## install what the gst tier needs
	command -v gst-launch-1.0 >/dev/null && gst-inspect-1.0 python >/dev/null 2>&1 && gst-inspect-1.0 gdppay >/dev/null 2>&1 || \
	  { $(SUDO) apt-get update -q && $(APT) gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-bad \
	    gstreamer1.0-python3-plugin-loader python3-gi python3-gst-1.0 gir1.2-gst-plugins-base-1.0; }

rig-foreign: $(VENV)/.installed ## the BNO055 drivers of others that the rig lets read our chip
	$(BIN)/python -c 'import adafruit_bno055, Adafruit_BNO055' 2>/dev/null || \
	  $(BIN)/pip install -q --disable-pip-version-check -e '.[foreign]' || echo "no third-party drivers: their tests, over UART and I2C, will be skipped and prove nothing"

WITH_TOOLS := tests/kernel/test_foreign_sensors.py tests/kernel/test_ci_page.py tests/firmware/test_chain.py

rig: $(VENV)/.installed rig-apt gst-apt rig-foreign ## real SocketCAN, I2C, ttys and GStreamer in a kernel of our own
	@mkdir -p $(OUT)
	$(BIN)/avionics sim --duration 1 --force -o $(OUT)/rig.mcap  # compiled once here, not in every guest
	@# In no tier, but skipped by `make test` before these tools are there; the chain wants firmware-test's too.
	$(BIN)/python -m pytest -m "qemu_arm or not uml" $(WITH_TOOLS)
	$(BIN)/python -m pytest -m "uml or gst" --require=uml,gst

rig-proof: $(VENV)/.installed rig-apt gst-apt ## the rig's long proofs: a minute of 800 frames/s, of two I2C sensors
	RIG_LIMIT_S=1800 $(BIN)/python -m pytest -m "(uml or gst) and proof" --require=uml,gst

vm-apt: $(VENV)/.installed ## install what the vm tier needs, and fetch its kernel
	command -v qemu-system-x86_64 >/dev/null && command -v busybox >/dev/null && command -v cpio >/dev/null && command -v v4l2-ctl >/dev/null && \
	  command -v modprobe >/dev/null && command -v ip >/dev/null || \
	  { $(SUDO) apt-get update -q && $(APT) qemu-system-x86 busybox-static cpio kmod iproute2 v4l-utils; }
	$(BIN)/python -c 'import sys; from sim_bus.guests import vm; sys.exit(vm.missing() is not None)' || $(BIN)/avionics rig fetch-kernel

vm: $(VENV)/.installed vm-apt ## a real V4L2 camera and real CAN controllers in a virtual machine
	$(BIN)/python -m pytest -m vm --require=vm

firmware: ## build the pod's firmware, with a size report
	$(MAKE) -C firmware firmware

firmware-test: $(VENV)/.installed ## build, check and test the firmware: host, Unicorn, QEMU
	$(MAKE) -C firmware apt
	$(MAKE) -C firmware test

firmware-proof: $(VENV)/.installed ## the firmware's long proofs: a minute of samples from QEMU into our logger
	$(MAKE) -C firmware apt
	$(BIN)/python -m pytest tests/firmware -m "(unicorn or qemu_arm) and proof" --require=unicorn,qemu_arm

proof: $(VENV)/.installed ## the long proofs
	$(BIN)/python -m pytest -m "proof and not (uml or gst or unicorn or qemu_arm or vm)"

bench: $(VENV)/.installed ## the figures of benchmarks/
	cd benchmarks && for script in *.py; do ../$(BIN)/python $$script; done

lock: $(VENV)/.installed ## write requirements.lock from what is installed
	$(BIN)/pip freeze --exclude-editable > requirements.lock

clean: ## remove what was made
	rm -rf $(VENV) $(OUT) build dist *.egg-info
	-$(MAKE) -C firmware clean
