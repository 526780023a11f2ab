# SPDX-License-Identifier: Apache-2.0
# Native simulation: the simulated slaves alone, and the Verilated chip with them, fast or with waves.
#   build/tb/libasi_slaves.so       no Verilator in it
#   build/tb/libasi_chip.so         whole chip, as fast as it gets
#   build/tb/libasi_chip_trace.so   the same with waves (FST where the headers of lz4 and zlib are found, else VCD)
TB_OUT     := $(BUILD)/tb
TB_CXX     ?= g++
TB_FLAGS   := -std=c++20 -O3 -fPIC -Wall -Wextra -Werror
TB_HEADERS := $(wildcard tb/*.h)
TB_SLAVES  := tb/asi_slaves.cpp tb/asi_monitor.cpp
ASI_CLK_HZ ?= 16000000

$(TB_OUT)/libasi_slaves.so: $(TB_SLAVES) $(TB_HEADERS)
	@mkdir -p $(@D)
	$(TB_CXX) $(TB_FLAGS) -shared $(TB_SLAVES) -o $@

pytest test: $(TB_OUT)/libasi_slaves.so

# ---------------------------------------------------------------- whole chip
# The firmware is not in the model: the image is loaded when a chip is made (+firmware=, FirmwareHex).
TB_RTL     = $(addprefix $(CURDIR)/rtl/,$(shell grep -v '^//' rtl/asi_master.f))
TB_MODEL   = verilator --cc --build -j 2 --top-module asi_master --prefix Vasi_master -Mdir $@ \
             -GClkHz=$(ASI_CLK_HZ) -O3 --x-assign fast --x-initial fast --noassert --timescale 1ns/1ps \
             -CFLAGS "-fPIC" -MAKEFLAGS "OPT_FAST=-O3 OPT_SLOW=-O1 OPT_GLOBAL=-O2 CFG_CXXFLAGS_PCH_I=-include"
TB_LINK    = $(TB_CXX) $(TB_FLAGS) -DASI_CLK_HZ=$(ASI_CLK_HZ) -I$(1) -isystem $(VERILATOR_ROOT)/include -isystem $(VERILATOR_ROOT)/include/vltstd -shared \
             tb/asi_chip.cpp $(TB_SLAVES) $(1)/libVasi_master.a $(1)/libverilated.a -lpthread -o $@

# FST needs the headers of lz4 and zlib
TB_FST     = $(shell printf '\43include <lz4.h>\n\43include <zlib.h>\n' | $(TB_CXX) -E -xc++ - >/dev/null 2>&1 && echo yes)

$(TB_OUT)/model: $(TB_RTL) tools/lint.vlt $(VENV)/.ready
	@mkdir -p $(@D)
	$(TB_MODEL) $(CURDIR)/tools/lint.vlt $(TB_RTL) $(VEXRISCV) >$@.log || { cat $@.log; rm -rf $@; exit 1; }
	@touch $@

$(TB_OUT)/model_trace: $(TB_RTL) tools/lint.vlt $(VENV)/.ready
	@mkdir -p $(@D)
	$(if $(TB_FST),,@echo "waves will be VCD; for the smaller FST install the headers: Debian liblz4-dev zlib1g-dev")
	$(TB_MODEL) $(if $(TB_FST),--trace-fst,--trace-vcd) $(CURDIR)/tools/lint.vlt $(TB_RTL) $(VEXRISCV) >$@.log || \
	    { cat $@.log; rm -rf $@; exit 1; }
	@touch $@

$(TB_OUT)/libasi_chip.so: $(TB_OUT)/model tb/asi_chip.cpp $(TB_SLAVES) $(TB_HEADERS)
	$(call TB_LINK,$<)

$(TB_OUT)/libasi_chip_trace.so: $(TB_OUT)/model_trace tb/asi_chip.cpp $(TB_SLAVES) $(TB_HEADERS)
	$(call TB_LINK,$<) -DVM_TRACE=1 $(if $(TB_FST),-DVM_TRACE_FST=1 -lz -llz4,-DVM_TRACE_VCD=1)
