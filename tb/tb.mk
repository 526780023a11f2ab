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

pytest: $(TB_OUT)/libasi_slaves.so
