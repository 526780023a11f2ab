# SPDX-License-Identifier: Apache-2.0
# Native simulation: the simulated slaves alone, and the Verilated chip with them, fast or with waves.
#   build/tb/libasi_slaves.so       no Verilator in it
#   build/tb/libasi_chip.so         whole chip, as fast as it gets
#   build/tb/libasi_chip_trace.so   the same with waves (FST where the headers of lz4 and zlib are found, else VCD)
#   build/tb/libasi_line_rx.so      the receivers alone, behind comparator levels, for the analog line model (sim/line)
TB_OUT     := $(BUILD)/tb
TB_CXX     ?= $(CXX)
TB_FLAGS   := -std=c++20 -O3 -fPIC -Wall -Wextra -Werror -Ifirmware/generated
TB_HEADERS := $(wildcard tb/*.h) firmware/generated/asi_ctt_table.h tb/tb.mk
TB_SLAVES  := tb/asi_slaves.cpp tb/asi_ctt_slave.cpp tb/asi_monitor.cpp tb/asi_flash.cpp
ASI_CLK_HZ ?= 16000000

$(TB_OUT)/libasi_slaves.so: $(TB_SLAVES) $(TB_HEADERS)
	@mkdir -p $(@D)
	@echo "building $@"
	@$(TB_CXX) $(TB_FLAGS) -shared $(TB_SLAVES) -o $@

pytest test: $(addprefix $(TB_OUT)/,libasi_slaves.so libasi_chip.so libasi_chip_trace.so libasi_line_rx.so)

# ---------------------------------------------------------------- whole chip
# The firmware is not in the model: the image is loaded when a chip is made (+firmware=, FirmwareHex).
# Absolute paths, because the waivers in tools/lint.vlt name folders above the file.
TB_RTL    = $(addprefix $(CURDIR)/rtl/,$(shell grep -v '^//' rtl/asi_master.f))
TB_VFLAGS = --cc --top-module asi_master --prefix Vasi_master -GClkHz=$(ASI_CLK_HZ) -O3 --x-assign fast \
            --x-initial fast --noassert --timescale 1ns/1ps $(CURDIR)/tools/lint.vlt $(TB_RTL) $(VEXRISCV)
TB_ISYS   = -isystem $(VERILATOR_ROOT)/include -isystem $(VERILATOR_ROOT)/include/vltstd
# one compilation unit with the model in it, as a system header: its warnings are not ours
TB_CHIP   = $(TB_CXX) $(TB_FLAGS) -fno-semantic-interposition -Wl,-Bsymbolic -DASI_CLK_HZ=$(ASI_CLK_HZ) \
            -isystem $(<D) $(TB_ISYS) -Itb -shared $< $(TB_SLAVES) $(filter %.o,$^) -o $@ -pthread
TB_VRT    = $(addprefix $(TB_OUT)/verilated/,verilated.o verilated_threads.o verilated_dpi.o)
TB_UNIT   = { ls $(@D) | grep '^Vasi_master.*\.cpp$$' | grep -v vm_classes | sed 's/.*/\#include <&>/'; \
              echo '\#include "asi_chip.cpp"'; } > $@

# FST needs the headers of lz4 and zlib
TB_FST   := $(shell printf "\043include <lz4.h>\n\043include <zlib.h>\n" | \
                    $(TB_CXX) -E -xc++ - >/dev/null 2>&1 && echo 1)
TB_WAVE  := $(if $(TB_FST),fst,vcd)

$(TB_OUT)/verilated/%.o: $(VENV)/.ready
	@mkdir -p $(@D)
	@$(TB_CXX) -std=c++20 -O2 -fPIC $(TB_ISYS) -c $(VERILATOR_ROOT)/include/$*.cpp -o $@

$(TB_OUT)/model/unit.cpp: $(TB_RTL) tools/lint.vlt tb/tb.mk $(VENV)/.ready
	@rm -rf $(@D) && mkdir -p $(@D)
	@verilator --quiet-stats $(TB_VFLAGS) --flatten -Mdir $(@D)
	@$(TB_UNIT)

# not flattened: the waves keep the hierarchy
$(TB_OUT)/model_$(TB_WAVE)/unit.cpp: $(TB_RTL) tools/lint.vlt tb/tb.mk $(VENV)/.ready
	@rm -rf $(@D) && mkdir -p $(@D)
	$(if $(TB_FST),,@echo "waves will be VCD, several MB per ms; for FST (25 times smaller) install the headers:" \
	  "Debian liblz4-dev zlib1g-dev")
	@verilator --quiet-stats $(TB_VFLAGS) --trace-$(TB_WAVE) -Mdir $(@D)
	@$(TB_UNIT)

$(TB_OUT)/libasi_chip.so: $(TB_OUT)/model/unit.cpp $(TB_VRT) tb/asi_chip.cpp $(TB_SLAVES) $(TB_HEADERS)
	@echo "building $@"
	@$(TB_CHIP)

$(TB_OUT)/libasi_chip_trace.so: $(TB_OUT)/model_$(TB_WAVE)/unit.cpp $(TB_VRT) \
                                $(TB_OUT)/verilated/verilated_$(TB_WAVE)_c.o tb/asi_chip.cpp $(TB_SLAVES) $(TB_HEADERS)
	@echo "building $@"
	@$(TB_CHIP) -DVM_TRACE=1 $(if $(TB_FST),-DVM_TRACE_FST=1 -lz -llz4,-DVM_TRACE_VCD=1)

# ---------------------------------------------------------------- receivers behind comparator levels
TB_RX_SV := $(addprefix $(CURDIR)/,rtl/generated/asi_map_pkg.sv rtl/phy/asi_timing_pkg.sv rtl/phy/asi_sync.sv \
              rtl/phy/asi_pulse_filter.sv rtl/phy/asi_rx.sv tb/asi_line_rx.sv)

# PINMISSING: outputs of asi_rx that the line model has no use for
$(TB_OUT)/model_rx/unit.cpp: $(TB_RX_SV) tools/lint.vlt tb/tb.mk $(VENV)/.ready
	@rm -rf $(@D) && mkdir -p $(@D)
	@verilator --quiet-stats --cc --top-module asi_line_rx --prefix Vasi_line_rx -O3 --x-assign fast --x-initial fast \
	  --noassert --timescale 1ns/1ps --flatten -Wno-PINMISSING $(CURDIR)/tools/lint.vlt $(TB_RX_SV) -Mdir $(@D)
	@{ ls $(@D) | grep '^Vasi_line_rx.*\.cpp$$' | sed 's/.*/#include <&>/'; echo '#include "asi_line_rx.cpp"'; } > $@

$(TB_OUT)/libasi_line_rx.so: $(TB_OUT)/model_rx/unit.cpp $(TB_VRT) tb/asi_line_rx.cpp tb/asi_line_rx.h
	@echo "building $@"
	@$(TB_CXX) $(TB_FLAGS) -isystem $(<D) $(TB_ISYS) -Itb -shared $< $(filter %.o,$^) -o $@ -pthread
