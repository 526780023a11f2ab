# SPDX-License-Identifier: Apache-2.0
# Firmware images: product, test (short P_PWR_SETTLE), boot ROM. Included from the top Makefile.
FW       := $(BUILD)/firmware
FW_CC    := $(VPY) -m ziglang cc
# generic_rv32 is RV32I; -fno-builtin keeps memset from calling itself; address 0 is RAM, hence the null-pointer flag
FW_FLAGS := -target riscv32-freestanding-none -mcpu=generic_rv32 -mabi=ilp32 -std=c17 -Os -fno-unroll-loops -mno-relax \
            -g -ffreestanding -fno-builtin -fno-sanitize=all -fno-delete-null-pointer-checks \
            -ffunction-sections -fdata-sections \
            -Wall -Wextra -Wconversion -Wshadow -Werror -Wframe-larger-than=256 -Wvla \
            $(addprefix -Ifirmware/,hal/include core hal app generated)
FW_LINK  := -nostdlib -static -Wl,--gc-sections
FW_SRC   := firmware/hal/startup.S $(wildcard firmware/core/*.c firmware/hal/*.c firmware/app/*.c)
FW_DEPS  := $(FW_SRC) $(wildcard firmware/*/*.h firmware/hal/include/*.h) firmware/hal/firmware.ld \
            firmware/firmware.mk tools/elf2hex.py
FW_RAM   := $(shell echo $$((62 * 1024)))  # 64 KB without the stack

.PHONY: firmware
firmware: $(FW)/asi.hex $(FW)/asi_test.hex $(FW)/boot.hex  ## firmware images in build/firmware, with a size report

$(FW)/asi.elf: FW_DEFS :=
$(FW)/asi_test.elf: FW_DEFS := -DASI_PWR_SETTLE_US=20000
$(FW)/asi.elf $(FW)/asi_test.elf: $(FW_DEPS) | $(VENV)/.ready
	@mkdir -p $(@D)
	@$(FW_CC) $(FW_FLAGS) $(FW_DEFS) $(FW_LINK) -T firmware/hal/firmware.ld $(FW_SRC) -o $@

$(FW)/asi.hex $(FW)/asi_test.hex: %.hex: %.elf tools/elf2hex.py
	@$(VPY) tools/elf2hex.py $< --hex $@ --bin $*.bin --flash $*.flash --ram $(FW_RAM)

$(FW)/boot.elf: $(wildcard firmware/boot/*) $(FW_DEPS) | $(VENV)/.ready
	@mkdir -p $(@D)
	@$(FW_CC) $(FW_FLAGS) $(FW_LINK) -T firmware/boot/boot.ld firmware/boot/boot_start.S firmware/boot/boot.c -o $@

$(FW)/boot.hex: $(FW)/boot.elf tools/elf2hex.py
	@$(VPY) tools/elf2hex.py $< --hex $@ --limit 1024

.PHONY: firmware-coverage
firmware-coverage: $(VENV)/.ready  ## table of line and branch coverage of firmware/core (needs gcov); UNTAKEN=1 names the rest
	@rm -rf $(FW)/native
	@FW_COVERAGE=1 $(VPY) -m pytest firmware/tests -k 'not image'
	@$(VPY) tools/coverage_table.py $(FW)/native --below 95 $(if $(filter 1,$(UNTAKEN)),--untaken)

CYCLES ?= 1000000
SEEDS  ?= 1 2 3 4
.PHONY: soak
soak: $(VENV)/.ready  ## core against its reference: CYCLES=1000000 random cycles, SEEDS='1 2 3 4' in parallel (minutes)
	@$(VPY) firmware/tests/soak.py --cycles $(CYCLES) --seeds $(SEEDS)

FUZZ_CC  ?= clang
FUZZ_TIME ?= 60
FUZZ_SRC := $(filter-out %/asi_store.c,$(wildcard firmware/core/*.c)) firmware/tests/native.c firmware/tests/fuzz.c
.PHONY: fuzz
fuzz:  ## fuzz the core by coverage for FUZZ_TIME=60 s (needs clang with libFuzzer); finds in build/firmware/fuzz
	@command -v $(FUZZ_CC) > /dev/null || { echo "make fuzz needs clang with libFuzzer (Debian: clang); FUZZ_CC=... \
	  names another. The corpus runs without it: make pytest ARGS=firmware/tests/test_fuzz.py"; exit 1; }
	@mkdir -p $(FW)/fuzz/corpus $(FW)/fuzz/found
	@$(FUZZ_CC) -std=c17 -g -O1 -DFUZZ_LIBFUZZER -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all \
	  -Ifirmware/core -Ifirmware/generated $(FUZZ_SRC) -o $(FW)/fuzz/fuzz
	@cd $(FW)/fuzz && ./fuzz -max_total_time=$(FUZZ_TIME) -max_len=600 -len_control=0 -print_final_stats=1 \
	  -artifact_prefix=found/ corpus $(CURDIR)/firmware/tests/corpus
